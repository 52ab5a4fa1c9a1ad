# Models made of expressions.

mutable struct Built <: AnyBuilt
    address::Ptr{Lib.swb_model}
    uses::Int
end

"""
    Model(; states, controls = 0, parameters = 0, name = "model")

A model made of expressions. Variables are given by names, `states = (:q, :v)`, or by their number. `m.x`, `m.u`, `m.p` are
vectors of expressions, `m.t` is the time, `m[:q]` is a variable by name. `derivatives!` completes the model:

    m = Model(states = (:q, :v))
    q, v = m.x
    derivatives!(m, [v, -q - 0.4sign(v) + cos(0.5m.t)])
"""
mutable struct Model
    name::String
    names::NTuple{3,Vector{String}}
    graph::Graph
    x::Vector{Expression}
    u::Vector{Expression}
    p::Vector{Expression}
    t::Expression
    rhs::Vector{Union{Nothing,Expression}}
    trial::Any
    built::Union{Nothing,Built}
    discrete::Vector{Float64} # values with which the last states begin
    transitions::Vector{Any}
    value_names::Dict{Int,Vector{Symbol}} # of discrete states, by their place among all states
    choices::Vector{Any} # controls from 0, their values, dwell times
end

variable_names(v::Integer, what) = v < 0 ? mistake(:dimension, "$what is negative: $v") : fill("", v)
variable_names(v::Symbol, what) = [String(v)]
variable_names(v::AbstractString, what) = String.(split(replace(v, "," => " ")))
variable_names(v::Union{Tuple,AbstractVector}, what) = String[plain(name, "a name of $what") for name in v]
variable_names(v, what) = mistake(:range, "$what must be names or their number, not $(repr(v))")

function refuse_twice(names)
    given = filter(!isempty, vcat(names...))
    allunique(given) || mistake(:range, "two variables of the model have one name: $(join(given, ", "))")
end

"Warn of variables that `model.name` does not mean, because the name is that of a field: `model.t` is the time."
function warn_hidden(names, m)
    for (block, own) in zip((:x, :u, :p), names), name in own
        field = Symbol(name)
        # a block that holds nothing but the variable of its name hides nothing
        (isempty(name) || !hasfield(typeof(m), field) || (block === field && length(own) == 1)) && continue
        what = get(Dict(:x => "all states", :u => "all controls", :p => "all parameters", :t => "the time"), field, "something else")
        @warn "'$name' is the name of a variable, but model.$name is $what: write model[:$name] for the variable, or call it otherwise"
    end
end

function Model(; states, controls = 0, parameters = 0, name = "model")
    names = (variable_names(states, "states"), variable_names(controls, "controls"), variable_names(parameters, "parameters"))
    refuse_twice(names)
    m = empty_model(Graph(), names, name)
    warn_hidden(names, m)
    return m
end

function empty_model(graph, names, name)
    blocks = (Lib.SWB_INPUT_X, Lib.SWB_INPUT_U, Lib.SWB_INPUT_P)
    x, u, p = (inputs(graph, block, 0, length(n)) for (block, n) in zip(blocks, names))
    t = inputs(graph, Lib.SWB_INPUT_T, 0, 1)[1]
    return Model(plain(name, "name"), names, graph, x, u, p, t, fill(nothing, length(x)), nothing, nothing, Float64[], [], Dict(), [])
end

function inputs(graph::Graph, block, first, n)
    ids = Vector{Int64}(undef, n)
    check(Lib.swb_expr_inputs(graph, block, first, ids, n))
    return [in_graph(graph, id) for id in ids]
end

sizes(m::Model) = (length(m.x), length(m.u), length(m.p))

function Base.getindex(m::Model, name::Union{Symbol,AbstractString})
    for (names, block) in zip(m.names, (m.x, m.u, m.p))
        k = findfirst(==(String(name)), names)
        k === nothing || return block[k]
    end
    known = filter(!isempty, vcat(m.names...))
    mistake(:range, "the model has no variable $name", nearest(name, known), isempty(known) ? ", nothing has a name" : "; the names are $(join(known, ", "))")
end

"The place of a state, given by itself or by its name."
function state_place(m::Union{Model,AnyScene}, state)
    k = state isa Expression ? findfirst(x -> isequal(x, state), m.x) : findfirst(==(plain(state, "a state")), state_names(m)[1])
    k === nothing && mistake(:range, "$state is no state of the model, only $(join((named_text(m, x) for x in m.x), ", "))")
    return k
end
state_names(m::Model) = m.names

"""
    derivatives!(model, rhs)
    derivatives!(model, :q => v, :v => -q)

Set the derivatives of all states, in their order, or of those that are named.
"""
function derivatives!(m::Model, rhs::Union{AbstractVector,Tuple})
    smooth = length(m.x) - length(m.discrete)
    length(rhs) in (length(m.x), smooth) || mistake(:dimension, "$(length(rhs)) derivatives for $smooth states")
    for (k, r) in enumerate(rhs)
        set_derivative(m, k, r)
    end
    return m
end
derivatives!(m::Model, rhs::Real) = derivatives!(m, [rhs])
function derivatives!(m::Model, pairs::Pair...)
    for (state, r) in pairs
        set_derivative(m, state_place(m, state), r)
    end
    return m
end

function set_derivative(m::Model, k, r)
    r isa Real || mistake(:range, "the derivative of $(named_text(m, m.x[k])) must be one expression, not $(typeof(r))")
    e = Expression(r)
    isnumber(e) || e.graph === m.graph || mistake(:range, "the derivative of $(named_text(m, m.x[k])) is made of variables of another model")
    m.rhs[k] = e
    m.built = nothing
end

"""
    try_at!(model, x; u, p, t = 0.0)

A point where everything should be defined; the report says what is not.
"""
function try_at!(m::Model, x; u = zeros(length(m.u)), p = zeros(length(m.p)), t = 0.0)
    m.trial = (number(t, "t"), copy(named_vector(x, m.names[1], "x")), copy(named_vector(u, m.names[2], "u")),
               copy(named_vector(p, m.names[3], "p")))
    m.built = nothing
    return m
end

function built(m::Model)
    m.built === nothing || return m.built
    missing_ = [named_text(m, x) for (x, r) in zip(m.x, m.rhs) if r === nothing]
    isempty(missing_) || mistake(:state, "no derivative is given for $(join(missing_, ", ")): set it to 0 if it is constant")
    rhs = ids_in(m.graph, m.rhs)
    names = join(Iterators.flatten(m.names), "\n")
    make(point) = created(AnyBuilt, place -> Lib.swb_model_create(m.graph, m.name, sizes(m)..., rhs, names, point, place))
    address = m.trial === nothing ? make(C_NULL) : begin
        t, x, u, p = m.trial
        GC.@preserve x u p make(Ref(Lib.swb_point(t, pointer(x), pointer(u), pointer(p))))
    end
    made = owned(Built(address, 0))
    isempty(m.discrete) || check(Lib.swb_model_set_discrete(made, m.discrete, length(m.discrete)))
    for (place, names) in m.value_names
        check(Lib.swb_model_set_value_names(made, place - 1 - (length(m.x) - length(m.discrete)), join(names, "\n")))
    end
    foreach(t -> add_to(made, m.graph, t), m.transitions)
    foreach(((u, values, dwell),) -> check(Lib.swb_model_add_choice(made, u, values, length(values), dwell, C_NULL)), m.choices)
    return m.built = made
end

"""
    System(model)

The system of a model; simulations and optimal control problems make it themselves.
"""
function System(m::Model)
    made = built(m)
    s = owned(System(created(AnySystem, Lib.swb_model_system, made), 0, sizes(m)..., 0, m.graph.serial, map(copy, m.names), copy(m.discrete)))
    s.n_subsystems = counts(m).subsystems
    s.events = String[t.name for t in m.transitions]
    return s
end

system_of(s::System) = s
system_of(m::Model) = System(m)
system_of(other) = mistake(:range, "the first argument must be a System or a Model, not $(typeof(other))")

"""
    counts(model)

How large a model is: subsystems, switching functions, regions, and algebraic variables and pairs at one point.
"""
function counts(m::Model)
    found = integers(5, Lib.swb_model_counts, built(m))
    return NamedTuple{(:subsystems, :switching_functions, :regions, :algebraic, :pairs)}(Tuple(found))
end

"""
    report(model)

What a model consists of and costs, what was dropped and why, what looks wrong. `report(model; json = true)` is the same
as JSON.
"""
report(m::Model; json = false) =
    (made = built(m); text(Lib.swb_model_report, made, json))

"""
    c_code(model)

C code of all functions of a model with their derivatives.
"""
c_code(m::Model) = (made = built(m); text(Lib.swb_model_write_c, made))

function expression_function(graph, outputs, sizes, n, name)
    es = outputs isa Real ? [outputs] : collect(outputs)
    all(e -> e isa Real, es) || mistake(:dimension, "$name: expressions must be given as a flat list")
    flat = Expression[Expression(e) for e in es]
    length(flat) == n || mistake(:dimension, "$name has $(length(flat)) expressions, expected $n")
    own = graph === nothing ? graph_of(flat) : graph
    ids = ids_in(own, flat)
    address = created(AnyModelFunction,
                      place -> Lib.swb_expr_function(own, plain(name, "name"), sizes..., ids, n, place))
    return taken(address, own.serial, String(name))
end

ModelFunction(m::Model, outputs; name = "f") =
    expression_function(m.graph, outputs, sizes(m), outputs isa Real ? 1 : length(outputs), name)

"""
    between_ends(model, f; name = "ends")

A function of the initial and the final state, for `add_boundary!`: `f(start, stop)` are expressions of these states.
"""
function between_ends(m::Model, f; name = "ends")
    nx = length(m.x)
    outputs = f(inputs(m.graph, Lib.SWB_INPUT_X, 0, nx), inputs(m.graph, Lib.SWB_INPUT_X, nx, nx))
    return expression_function(m.graph, outputs, (2nx, length(m.u), length(m.p)), outputs isa Real ? 1 : length(outputs), name)
end

"""
    external(f, x = []; u = [], p = [], t = 0.0)

Outputs of a `ModelFunction` at expressions; derivatives are those of the function.
"""
function external(f::ModelFunction, x = Expression[]; u = Expression[], p = Expression[], t = 0.0)
    parts = [v isa Real ? [v] : collect(v) for v in (x, u, p, t)]
    args = Expression[Expression(e) for e in Iterators.flatten(parts)]
    length.(parts) == [f.nx, f.nu, f.np, 1] ||
        mistake(:dimension, "$(f.name) takes $(f.nx) states, $(f.nu) controls and $(f.np) parameters, not $(length.(parts[1:3]))")
    graph = graph_of(args)
    out = Vector{Int64}(undef, f.outputs)
    ids = ids_in(graph, args)
    guarded(() -> Lib.swb_expr_call(graph, f, ids, length(ids), out, length(out)))
    graph.serial |= f.serial
    return [in_graph(graph, id) for id in out]
end

function Base.show(io::IO, m::Model)
    nx, nu, np = sizes(m)
    print(io, "Model '", m.name, "' of ", nx, " states, ", nu, " controls, ", np, " parameters")
end
function Base.show(io::IO, ::MIME"text/plain", m::Model)
    show(io, m)
    for (x, r) in zip(m.x, m.rhs)
        print(io, "\n  ", named_text(m, x), "' = ", r === nothing ? "(not given)" : named_text(m, r))
    end
end

"The text of an expression with the names of the variables."
function named_text(m::Union{Model,AnyScene}, e::Expression)
    names = state_names(m)
    blocks = Dict('x' => names[1], 'u' => names[2], 'p' => names[3])
    return replace(string(e), r"\b[xup]\[\d+\]" => v -> begin
        name = blocks[v[1]][parse(Int, v[3:end-1])]
        isempty(name) ? v : name
    end)
end
