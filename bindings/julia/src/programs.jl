# Nonlinear programs with and without complementarity constraints.

"A member of a complementarity pair: `variable(i)` or `constraint(i)`."
struct Member
    kind::Int32
    index::Int
end

"""
    variable(i)

Variable i as a member of a pair; its lower bound becomes zero.
"""
variable(i) = Member(Lib.SWB_MEMBER_VARIABLE, integer(i, "index of a variable"))

"""
    constraint(i)

Row i of the constraints as a member of a pair; its own bounds are not used.
"""
constraint(i) = Member(Lib.SWB_MEMBER_CONSTRAINT, integer(i, "index of a constraint"))

"The function of a Hessian of the Lagrangian and what it needs."
mutable struct LagrangianCallback{D<:Derivative}
    derivative::D
    inputs::Inputs
end

function lagrangian_entry(at::Ptr{Lib.swb_point}, weight::Float64, y::Ptr{Float64}, out::Ptr{Float64}, c::LagrangianCallback)
    try
        Base.sigatomic_end()
        i = c.inputs
        load!(i, at, (length(i.x), 0, length(i.p)))
        i.weight = weight
        isempty(i.y) || unsafe_copyto!(pointer(i.y), y, length(i.y))
        fill_entries!(out, c.derivative, i)
        Base.sigatomic_begin()
        return Int32(0)
    catch e
        return failed(e)
    end
end
lagrangian_pointer(::C) where {C} =
    @cfunction(lagrangian_entry, Int32, (Ptr{Lib.swb_point}, Float64, Ptr{Float64}, Ptr{Float64}, Ref{C}))

"""
    Mpcc(n, objective; constraints, n_constraints, parameters = 0, pairs, boxes, bounds, constraint_bounds, start, params, gradient,
         jac, jac_prototype, hess, hess_prototype, names, constraint_names, pair_names, on_iteration, on_log, options...)

Minimise f(x, p) over n variables subject to bounds on x and c(x, p), 0 <= G ⟂ H >= 0 for pairs of variables or rows of c, and
boxes lower <= x_i <= upper ⟂ c_j.

Functions are those of `ModelFunction`; they may call the variables x or w. `n_constraints` is needed where neither the bounds
nor the constraints tell it. Bounds are (lower, upper), `nothing` is no bound, one number is for all. A member of a pair is
`variable(i)`, or just i, or `constraint(i)`. A box is (i, j), the numbers of a variable and a constraint.

Derivatives of Julia functions: `gradient` of the objective, `jac` of the constraints, with a row for each and a column for
each of x, and `hess(x, weight, y)` of weight times the objective plus y times the constraints, symmetric, in place of those
of the functions. `jac_prototype` and `hess_prototype` make them sparse. What is missing is made by differences.
"""
mutable struct Mpcc <: AnyProgram
    address::Ptr{Lib.swb_mpcc}
    uses::Int
    n::Int
    m::Int
    np::Int
    n_pairs::Int
    hessian::Any # rooted as long as the program has it
    iteration::Monitor
    log::Monitor
end

function Mpcc(n::Integer, objective; constraints = nothing, n_constraints = nothing, parameters = 0, pairs = (), boxes = (), bounds = nothing,
              constraint_bounds = nothing, start = nothing, params = nothing, gradient = nothing, gradient_prototype = nothing,
              jac = nothing, jac_prototype = nothing, hess = nothing, hess_prototype = nothing, names = nothing,
              constraint_names = nothing, pair_names = nothing, settings = nothing, on_iteration = nothing, on_log = nothing,
              options...)
    nw, np = integer(n, "n"), integer(parameters, "parameters")
    whole = hess !== nothing
    f = program_function(objective, (nw, 0, np), 1, "objective", gradient, gradient_prototype, whole)
    rows = constraints === nothing ? 0 : constraint_count(constraints, n_constraints, constraint_bounds)
    constraints === nothing && (jac !== nothing || jac_prototype !== nothing) && mistake(:range, "jac: there are no constraints")
    c = constraints === nothing ? nothing : program_function(constraints, (nw, 0, np), rows, "constraints", jac, jac_prototype, whole)
    rows = c === nothing ? 0 : c.outputs
    values = chosen_settings(settings, options, Mpcc)
    address = created(AnyProgram, place -> Lib.swb_mpcc_create(nw, np, f, c === nothing ? C_NULL : c, raw(values), place))
    o = watched(Mpcc(address, 0, nw, rows, np, 0, nothing, Monitor(nothing), Monitor(nothing)), on_iteration, on_log)
    whole && set_hessian!(o, hess, hess_prototype)
    !whole && hess_prototype !== nothing && mistake(:range, "hess_prototype without hess")
    for pair in pairs
        pair isa Union{Tuple,Pair,AbstractVector} && length(pair) == 2 || mistake(:dimension, "a pair must have two members, not $(repr(pair))")
        add_pair!(o, pair[1], pair[2])
    end
    for box in boxes
        box isa Union{Tuple,Pair,AbstractVector} && length(box) == 2 || mistake(:dimension, "a box must have a variable and a constraint, not $(repr(box))")
        add_box!(o, box[1], box[2])
    end
    bounds === nothing || set_bounds!(o, bound_pair(bounds, "bounds")...)
    constraint_bounds === nothing || set_constraint_bounds!(o, bound_pair(constraint_bounds, "constraint_bounds")...)
    params === nothing || set_params!(o, params)
    start === nothing || set_start!(o, start)
    for (kind, given) in ((:variable, names), (:constraint, constraint_names), (:pair, pair_names))
        given === nothing || set_names!(o, kind, given)
    end
    return o
end

"""
    Nlp(n, objective; ...)

A nonlinear program: an `Mpcc` without pairs.
"""
function Nlp(n::Integer, objective; keywords...)
    haskey(keywords, :boxes) && mistake(:unsupported, "a nonlinear program has no boxes: use Mpcc")
    haskey(keywords, :pairs) && mistake(:unsupported, "a nonlinear program has no pairs: use Mpcc")
    return Mpcc(n, objective; keywords...)
end

"Objective or constraints. With a Hessian of the Lagrangian no second derivatives of their own are made."
function program_function(f, sizes_, n, name, jac, prototype, linear)
    if is_callable(f)
        return ModelFunction(f, sizes_...; outputs = n, jac = jac, jac_prototype = prototype, linear = linear, name = name)
    end
    jac === nothing && prototype === nothing || mistake(:range, "the derivative of $name: it is no Julia function; give it to ModelFunction")
    return function_of(f, sizes_, n, name)
end

function constraint_count(constraints, n, limits)
    n === nothing || return integer(n, "n_constraints")
    constraints isa ModelFunction && return constraints.outputs
    constraints isa Union{Tuple,AbstractVector} && return length(constraints)
    if limits !== nothing
        lengths = unique([length(b) for b in bound_pair(limits, "constraint_bounds") if b isa Union{Tuple,AbstractVector}])
        length(lengths) == 1 && return lengths[1]
    end
    mistake(:null, "n_constraints: the number of constraints must be given")
end

member(m::Member) = m
member(i::Integer) = variable(i)
member(other) = mistake(:range, "a member of a pair is variable(i) or constraint(i), not $(repr(other))")

"""
    add_pair!(program, g, h)

Add the pair 0 <= G ⟂ H >= 0 of `variable(i)`, or just i, and `constraint(j)`.
"""
function add_pair!(o::Mpcc, g, h)
    a, b = member(g), member(h)
    for m in (a, b)
        m.kind == Lib.SWB_MEMBER_VARIABLE ? index(m.index, o.n, "variable of a pair") : index(m.index, o.m, "constraint of a pair")
    end
    check(Lib.swb_mpcc_add_pair(o, a.kind, a.index - 1, b.kind, b.index - 1))
    o.n_pairs += 1
    return o
end

"""
    add_box!(program, i, j)

Add the box lower <= x_i <= upper ⟂ c_j of variable i and constraint j: the constraint is not negative where the variable is at
its lower bound, not positive at its upper bound, and zero between them. Infinite bounds take no part.
"""
function add_box!(o::Mpcc, i, j)
    index(i, o.n, "variable of a box")
    index(j, o.m, "constraint of a box")
    check(Lib.swb_mpcc_add_box(o, i - 1, j - 1))
    return o
end

"""
    set_hessian!(program, hess, prototype = nothing)

Give second derivatives in one piece, see `Mpcc`; `nothing` takes them away.
"""
function set_hessian!(o::Mpcc, hess, prototype = nothing)
    if hess === nothing
        check(Lib.swb_mpcc_set_hessian(o, C_NULL, 0, C_NULL, 0, C_NULL, C_NULL))
        o.hessian = nothing
        return o
    end
    what = "hessian of the Lagrangian"
    given = prototype === nothing ? ones(o.n, o.n) : prototype
    size(given) == (o.n, o.n) || mistake(:dimension, "prototype of $what has size $(size(given)), expected ($(o.n), $(o.n))")
    pattern = Pattern(given, o.n, o.n, (o.n,), true, prototype !== nothing, what)
    caller = Caller(hess, (:x, :p, :weight, :y), (:H, :out), nothing, what)
    callback = LagrangianCallback(Derivative(caller, pattern), Inputs(o.n, 0, o.np, 0, o.m))
    check(Lib.swb_mpcc_set_hessian(o, pattern.pointers, length(pattern.pointers), row_indices(pattern), length(pattern.rows),
                                   lagrangian_pointer(callback), pointer_from_objref(callback)))
    o.hessian = callback
    return o
end

"""
    set_bounds!(program, lower = nothing, upper = nothing)

Set bounds of the variables.
"""
function set_bounds!(o::Mpcc, lower = nothing, upper = nothing)
    low, high = bounds(lower, upper, o.n, "bounds")
    check(Lib.swb_mpcc_set_bounds(o, low, o.n, high, o.n))
    return o
end

"""
    set_constraint_bounds!(program, lower = nothing, upper = nothing)

Set bounds of the constraints; equal bounds make an equation.
"""
function set_constraint_bounds!(o::Mpcc, lower = nothing, upper = nothing)
    low, high = bounds(lower, upper, o.m, "bounds of the constraints")
    check(Lib.swb_mpcc_set_constraint_bounds(o, low, o.m, high, o.m))
    return o
end

set_params!(o::Mpcc, p) = give(Lib.swb_mpcc_set_params, o, finite(vector(p, o.np, "p"), "p"))

"""
    set_start!(program, x)

Set the point to start from.
"""
set_start!(o::Mpcc, x) = give(Lib.swb_mpcc_set_start, o, finite(vector(x, o.n, "start"), "start"))

"""
    set_warm_start!(program, x, y = nothing, z = nothing)

Start the next solves from a point with multipliers of the constraints and of the bounds, as a result has them; `set_start!`
goes back to a point alone.
"""
function set_warm_start!(o::Mpcc, x, y = nothing, z = nothing)
    w = vector(x, o.n, "x")
    ys, zs = y === nothing ? Float64[] : vector(y, o.m, "y"), z === nothing ? Float64[] : vector(z, o.n, "z")
    check(Lib.swb_mpcc_set_warm_start(o, w, o.n, ys, length(ys), zs, length(zs)))
    return o
end

"""
    set_names!(program, kind, names)

Name all of a kind, `:variable`, `:constraint` or `:pair`; "" for no name. Reports and the log use them.
"""
function set_names!(o::Mpcc, kind, names)
    texts = String[plain(name, "name") for name in names]
    check(Lib.swb_mpcc_set_names(o, enum_number(Lib.NAMES_swb_item, kind, "kind"), texts, length(texts)))
    return o
end

"Name of a variable, a constraint or a pair; it counts from 0 where none was given."
item_name(o::Mpcc, kind, i) = text(Lib.swb_mpcc_get_name, o, kind, i)

# --- solving ------------------------------------------------------------------------------------------

"""
What a solve of a program found.

- `outcome`, `polished` (`:done` where the pairs are exact), `objective`, `x`, `constraints` at x
- multipliers: grad f + J' y - z = 0; `g` and `h` are the members of the pairs, `nu` and `xi` their multipliers
- `residuals`, `scaled_residuals`, `stats`, `linear_stats`
- `certificate` of the point, see `certificate`
- `violations`: what is violated, the worst first; `conflict`: what contradicts what in an infeasible program, with its `gap`
  and `residual`, or nothing. Both have NamedTuples (kind, index, name, value)
- `report` for people, `json` for programs
"""
struct MpccResult
    outcome::Symbol
    polished::Symbol
    objective::Float64
    x::Vector{Float64}
    constraints::Vector{Float64}
    y::Vector{Float64}
    z::Vector{Float64}
    g::Vector{Float64}
    h::Vector{Float64}
    nu::Vector{Float64}
    xi::Vector{Float64}
    residuals::NamedTuple
    scaled_residuals::NamedTuple
    stats::NamedTuple
    linear_stats::NamedTuple
    certificate::NamedTuple
    violations::Vector{NamedTuple}
    conflict::Union{Nothing,NamedTuple}
    report::String
    json::String
end

successful(r::MpccResult) = r.outcome === :solved
Base.show(io::IO, r::MpccResult) = print(io, "MpccResult: ", r.outcome, ", objective ", r.objective)
Base.show(io::IO, ::MIME"text/plain", r::MpccResult) = print(io, r.report)
Base.show(io::IO, ::MIME"text/html", r::MpccResult) =
    html_table(io, ("outcome" => r.outcome, "objective" => r.objective, "stationarity" => r.certificate.stationarity,
                    "B-stationary" => r.certificate.b_stationary, "iterations" => r.stats.iterations, "x" => r.x))

function solve!(o::Mpcc; warm = false)
    solve = warm ? Lib.swb_mpcc_resolve : Lib.swb_mpcc_solve
    using_object(() -> solve(o, C_NULL), o)
    return result(o)
end

function items(o::Mpcc, get)
    found = Ref(Int64(0))
    check(get(C_NULL, C_NULL, C_NULL, 0, found))
    n = found[]
    kinds, places, values = zeros(Int32, n), zeros(Int64, n), zeros(n)
    n > 0 && check(get(kinds, places, values, n, C_NULL))
    return NamedTuple[(kind = symbol(Lib.NAMES_swb_item, kinds[k]), index = Int(places[k]) + 1,
                       name = item_name(o, kinds[k], places[k]), value = values[k]) for k in 1:n]
end

function conflict_of(o::Mpcc)
    gap, residual = Ref(0.0), Ref(0.0)
    found = items(o, (kinds, places, values, n, count_) -> Lib.swb_mpcc_get_conflict(o, kinds, places, values, n, count_, gap, residual))
    return isempty(found) ? nothing : (items = found, gap = gap[], residual = residual[])
end

function result(o::Mpcc)
    y, z, (g, h, nu, xi) = zeros(o.m), zeros(o.n), ntuple(_ -> zeros(o.n_pairs), 4)
    check(Lib.swb_mpcc_get_multipliers(o, y, o.m, z, o.n))
    check(Lib.swb_mpcc_get_pairs(o, g, h, nu, xi, o.n_pairs))
    return MpccResult(
        outcome(o), symbol(Lib.NAMES_swb_polished, value(Int32, Lib.swb_mpcc_get_polished, o)),
        value(Float64, Lib.swb_mpcc_get_objective, o),
        numbers(Float64, o.n, Lib.swb_mpcc_get_solution, o),
        numbers(Float64, o.m, Lib.swb_mpcc_get_constraints, o), y, z, g, h, nu, xi, residuals(o),
        named(record(Lib.swb_residuals, Lib.swb_mpcc_get_scaled_residuals, o)), stats(o),
        named(record(Lib.swb_linear_stats, Lib.swb_mpcc_get_linear_stats, o)), certificate(o),
        items(o, (kinds, places, values, n, count_) -> Lib.swb_mpcc_get_worst(o, kinds, places, values, n, count_)), conflict_of(o),
        text(Lib.swb_mpcc_report_text, o),
        text(Lib.swb_mpcc_statistics_json, o),
    )
end

certificate(o::Mpcc) = certificate_of(record(Lib.swb_certificate, Lib.swb_mpcc_get_certificate, o))

"""
    minimize(f, x0; constraints, pairs, bounds, ...) -> MpccResult

Minimise a function once from `x0`; the keywords are those of `Mpcc`.
"""
function minimize(f, x0; keywords...)
    start = vec(reals(x0, "x0"))
    program = Mpcc(length(start), f; start = start, keywords...)
    r = solve!(program)
    close(program)
    return r
end

Base.show(io::IO, o::Mpcc) = print(io, "Mpcc of ", o.n, " variables, ", o.m, " constraints, ", o.n_pairs, " pairs", isopen(o) ? "" : ", closed")
