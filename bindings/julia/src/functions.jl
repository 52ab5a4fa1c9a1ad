# Functions of a model: Julia functions with derivatives, called by the library.

# --- what a Julia function takes ----------------------------------------------------------------------

"The inputs of a call, in arrays that are used again: a function that keeps one must copy it."
mutable struct Inputs
    t::Float64
    x::Vector{Float64}
    u::Vector{Float64}
    p::Vector{Float64}
    weights::Vector{Float64}
    weight::Float64
    y::Vector{Float64}
end

Inputs(nx, nu, np, n_weights = 0, n_y = 0) =
    Inputs(0.0, zeros(nx), zeros(nu), zeros(np), zeros(n_weights), 0.0, zeros(n_y))
Inputs(i::Inputs) = Inputs(length(i.x), length(i.u), length(i.p), length(i.weights), length(i.y))

"""
A Julia function with what it takes: the names of its inputs, as a tuple of `Val`s so that its calls are compiled for them,
and whether its first argument is to be filled instead of something being returned.
"""
struct Caller{F,N<:Tuple,P}
    f::F
    names::N
    in_place::Val{P}
end

pick(i::Inputs, ::Val{:t}) = i.t
pick(i::Inputs, ::Val{:x}) = i.x
pick(i::Inputs, ::Val{:u}) = i.u
pick(i::Inputs, ::Val{:p}) = i.p
pick(i::Inputs, ::Val{:weights}) = i.weights
pick(i::Inputs, ::Val{:weight}) = i.weight
pick(i::Inputs, ::Val{:y}) = i.y
@inline arguments(i::Inputs, ::Tuple{}) = ()
@inline arguments(i::Inputs, names::Tuple) = (pick(i, first(names)), arguments(i, Base.tail(names))...)

symbols_of(c::Caller) = Symbol[typeof(v).parameters[1] for v in c.names]

"""
A `Caller` of a Julia function. Its inputs are told by the names of its arguments, or by `inputs`; a first argument whose
name is among `outputs` is filled in place.
"""
function Caller(f, allowed, outputs, inputs, what)
    hint = "$what must take arguments named $(join(allowed, ", ")), those that it needs"
    if inputs !== nothing
        names = inputs isa Symbol ? [inputs] : collect(Symbol, inputs)
    else
        found = methods(f)
        is_callable(f) || mistake(:range, "$what must be a function, not $(typeof(f))")
        length(found) == 1 ||
            mistake(:range, hint, "; $f has $(length(found)) methods: say which inputs it takes, as in inputs = (:x, :u)")
        method = first(found)
        method.isva && mistake(:range, hint, "; it takes any number: say which, as in inputs = (:x, :u)")
        names = Base.method_argnames(method)[2:method.nargs]
    end
    in_place = !isempty(names) && first(names) in outputs
    names = Symbol[n === :w ? :x : n for n in (in_place ? names[2:end] : names)]
    for (k, n) in enumerate(names)
        n in allowed || mistake(:range, hint, "; there is no input '$n'")
        n in names[1:k-1] && mistake(:range, hint, "; '$n' is there twice")
    end
    return Caller(f, Tuple(Val(n) for n in names), Val(in_place))
end

# --- values -------------------------------------------------------------------------------------------

"Write numbers, also nested ones, behind the `k` that are there already; how many there are then."
@inline function put(out::Ptr{Float64}, k::Int, n::Int, v::Real)
    k < n && unsafe_store!(out, Float64(v), k + 1)
    return k + 1
end
@inline function put(out::Ptr{Float64}, k::Int, n::Int, v::Union{Tuple,AbstractArray})
    for e in v
        k = put(out, k, n, e)
    end
    return k
end
put(::Ptr{Float64}, ::Int, ::Int, ::Nothing) = error("a function of the model returned nothing: is a return missing?")
put(::Ptr{Float64}, ::Int, ::Int, v) =
    error("a function of the model must return real numbers, not a value of type $(typeof(v))")

@noinline wrong_count(k, n) =
    mistake(:dimension, "a function of the model returned $k numbers, expected $n: is its number of outputs right?")

"Values of one function, or of several one after the other."
struct Several{C<:Tuple}
    parts::C
end

@inline function fill_values!(out::Ptr{Float64}, n::Int, c::Caller{F,N,false}, i::Inputs, ::Vector{Float64}) where {F,N}
    k = put(out, 0, n, c.f(arguments(i, c.names)...))
    k == n || wrong_count(k, n)
    return nothing
end
@inline function fill_values!(out::Ptr{Float64}, n::Int, c::Caller{F,N,true}, i::Inputs, buffer::Vector{Float64}) where {F,N}
    fill!(buffer, 0.0)
    c.f(buffer, arguments(i, c.names)...)
    length(buffer) == n || wrong_count(length(buffer), n) # the function may have resized it
    unsafe_copyto!(out, pointer(buffer), n)
    return nothing
end
@inline function fill_values!(out::Ptr{Float64}, n::Int, s::Several, i::Inputs, ::Vector{Float64})
    each = n ÷ length(s.parts)
    fill_parts!(out, each, i, s.parts...)
    return nothing
end
@inline function fill_parts!(out, each, i, part, others...)
    k = put(out, 0, each, part.f(arguments(i, part.names)...))
    k == each || wrong_count(k, each)
    fill_parts!(out + 8 * each, each, i, others...)
end
@inline fill_parts!(out, each, i) = nothing

# --- derivatives --------------------------------------------------------------------------------------

"The entries of a derivative, sorted by columns, and the matrix that functions in place fill."
struct Pattern{M}
    rows::Vector{Int} # from 1
    columns::Vector{Int}
    pointers::Vector{Int64} # as the library counts
    n_rows::Int
    widths::Vector{Int} # numbers of columns that a matrix may have
    upper::Bool # of a symmetric matrix
    given::Bool # by a prototype: a vector of the entries is understood
    buffer::M
end

function Pattern(prototype, n_rows, n_columns, widths, upper, given, what)
    size(prototype, 1) == n_rows && size(prototype, 2) in widths || mistake(:dimension,
        "prototype of $what has size $(size(prototype)), expected $n_rows rows and $(join(sort(unique(widths)), " or ")) columns")
    sparse_one = prototype isa SparseMatrixCSC ? prototype : sparse(map(!iszero, prototype))
    rows, columns = Int[], Int[]
    for j in axes(sparse_one, 2), k in nzrange(sparse_one, j)
        i = rowvals(sparse_one)[k]
        (upper && i > j) && continue
        push!(rows, i)
        push!(columns, j)
    end
    counts = zeros(Int64, n_columns + 1)
    for j in columns
        counts[j+1] += 1
    end
    buffer = prototype isa SparseMatrixCSC ? SparseMatrixCSC{Float64,Int}(prototype) : zeros(size(prototype))
    return Pattern(rows, columns, cumsum(counts), n_rows, collect(Int, widths), upper, given, buffer)
end

row_indices(p::Pattern) = Int64[i - 1 for i in p.rows]

"Has a matrix one of the sizes of a derivative, with all columns in which there are entries?"
@inline function fits(p::Pattern, m)
    rows, columns = size(m)
    return (p.upper ? rows == columns : rows == p.n_rows) && columns in p.widths &&
           (isempty(p.columns) || p.columns[end] <= columns)
end

@noinline wrong_matrix(p, size_) = mistake(:dimension,
    "a derivative has size $size_, expected $(p.upper ? "as many" : p.n_rows) rows and " *
    "$(join(filter(>=(isempty(p.columns) ? 0 : p.columns[end]), sort(unique(p.widths))), " or ")) columns",
    p.given ? ", or the $(length(p.rows)) entries of its prototype" : "")

@inline function put_entries(out::Ptr{Float64}, p::Pattern, m::AbstractMatrix)
    fits(p, m) || wrong_matrix(p, size(m))
    @inbounds for k in eachindex(p.rows)
        unsafe_store!(out, Float64(m[p.rows[k], p.columns[k]]), k)
    end
end
@inline function put_entries(out::Ptr{Float64}, p::Pattern, m::SparseMatrixCSC)
    fits(p, m) || wrong_matrix(p, size(m))
    k, n = 1, length(p.rows)
    for j in axes(m, 2), l in nzrange(m, j)
        i = rowvals(m)[l]
        (p.upper && i > j) && continue
        while k <= n && (p.columns[k], p.rows[k]) < (j, i)
            unsafe_store!(out, 0.0, k)
            k += 1
        end
        if k <= n && p.columns[k] == j && p.rows[k] == i
            unsafe_store!(out, Float64(nonzeros(m)[l]), k)
            k += 1
        elseif !iszero(nonzeros(m)[l])
            mistake(:range, "a derivative has an entry at ($i, $j), where its prototype has none")
        end
    end
    for rest in k:n
        unsafe_store!(out, 0.0, rest)
    end
end
@inline function put_entries(out::Ptr{Float64}, p::Pattern, v::Union{Tuple,AbstractVector,Real})
    n, width = length(p.rows), length(v)
    if p.given && width == n # the entries, sorted by columns
        put(out, 0, n, v)
    elseif p.n_rows == 1 && !p.upper && width in p.widths # a gradient
        for k in 1:n
            unsafe_store!(out, Float64(v[p.columns[k]]), k)
        end
    else
        wrong_matrix(p, (width,))
    end
    return nothing
end
put_entries(::Ptr{Float64}, ::Pattern, v) =
    error("a derivative must be a matrix of real numbers, not a value of type $(typeof(v))")

"A derivative: the function and its entries."
struct Derivative{C<:Caller,P<:Pattern}
    caller::C
    pattern::P
end

@inline function fill_entries!(out, d::Derivative{Caller{F,N,false}}, i::Inputs) where {F,N}
    put_entries(out, d.pattern, d.caller.f(arguments(i, d.caller.names)...))
end
@inline function fill_entries!(out, d::Derivative{Caller{F,N,true}}, i::Inputs) where {F,N}
    buffer = d.pattern.buffer
    clear!(buffer)
    d.caller.f(buffer, arguments(i, d.caller.names)...)
    put_entries(out, d.pattern, buffer)
end
clear!(m::Matrix) = fill!(m, 0.0)
clear!(m::SparseMatrixCSC) = (fill!(nonzeros(m), 0.0); m)

# --- callbacks ----------------------------------------------------------------------------------------

"""
What the library calls: it has the address of this object. The callables are part of its type, so that calls are compiled
for them and allocate nothing.
"""
mutable struct Callbacks{V,J,H}
    released::Int # the first field: `destroy` of the library writes here, possibly inside of a finaliser
    const_sizes::NTuple{4,Int} # nx, nu, np, n_out
    value::V
    jacobian::J
    hessian::H
    inputs::Inputs
    buffer::Vector{Float64}
    busy::Threads.Atomic{Int} # a call within a call has inputs of its own
end

@inline function load!(i::Inputs, at::Ptr{Lib.swb_point}, sizes)
    point = unsafe_load(at)
    i.t = point.t
    (length(i.x), length(i.u), length(i.p)) == sizes[1:3] || error("a function of the model must not resize its inputs: copy them")
    unsafe_copyto!(pointer(i.x), point.x, sizes[1])
    unsafe_copyto!(pointer(i.u), point.u, sizes[2])
    unsafe_copyto!(pointer(i.p), point.p, sizes[3])
    return nothing
end

"""
Run `work(inputs, mine)` at a point: the status that the library wants. `mine` says that the arrays of the callbacks are free;
a call within a call has others.
"""
@inline function entered(work::F, at::Ptr{Lib.swb_point}, c::Callbacks) where {F}
    mine = Threads.atomic_xchg!(c.busy, 1) == 0
    status = Int32(0)
    try
        Base.sigatomic_end() # Ctrl-C may come while code of Julia runs
        inputs = mine ? c.inputs : Inputs(c.inputs)
        load!(inputs, at, c.const_sizes)
        work(inputs, mine)
        Base.sigatomic_begin()
    catch e
        status = failed(e)
    end
    mine && (c.busy[] = 0)
    return status
end

@inline value_entry(at::Ptr{Lib.swb_point}, out::Ptr{Float64}, c::Callbacks) =
    entered(at, c) do inputs, mine
        n = c.const_sizes[4]
        fill_values!(out, n, c.value, inputs, mine ? c.buffer : zeros(n))
    end

@inline derivative_entry(d::Derivative, at, weights, out, c::Callbacks) =
    entered(at, c) do inputs, mine
        weights == C_NULL || unsafe_copyto!(pointer(inputs.weights), weights, c.const_sizes[4])
        fill_entries!(out, mine ? d : Derivative(d.caller, copied(d.pattern)), inputs)
    end
copied(p::Pattern) = Pattern(p.rows, p.columns, p.pointers, p.n_rows, p.widths, p.upper, p.given, copy(p.buffer))

jacobian_entry(at::Ptr{Lib.swb_point}, out::Ptr{Float64}, c::Callbacks) =
    derivative_entry(c.jacobian, at, Ptr{Float64}(C_NULL), out, c)
hessian_entry(at::Ptr{Lib.swb_point}, weights::Ptr{Float64}, out::Ptr{Float64}, c::Callbacks) =
    derivative_entry(c.hessian, at, weights, out, c)

value_pointer(::C) where {C} = @cfunction(value_entry, Int32, (Ptr{Lib.swb_point}, Ptr{Float64}, Ref{C}))
jacobian_pointer(::C) where {C} = @cfunction(jacobian_entry, Int32, (Ptr{Lib.swb_point}, Ptr{Float64}, Ref{C}))
hessian_pointer(::C) where {C} =
    @cfunction(hessian_entry, Int32, (Ptr{Lib.swb_point}, Ptr{Float64}, Ptr{Float64}, Ref{C}))

# --- life of callbacks --------------------------------------------------------------------------------

# Callbacks stay alive until the library has no user of them any more. It says so by `destroy`, which may run inside of a
# finaliser and therefore only notes it; the next sweep lets go of them.
const ROOTS = Any[]
const ROOTS_LOCK = ReentrantLock()
const SWEEP_AT = Ref(64)

note_released(data::Ptr{Cvoid}) = (unsafe_store!(Ptr{Int}(data), 1); nothing)
const DESTROY = Ref{Ptr{Cvoid}}(C_NULL) # set when the package is loaded

"Let go of the callbacks that the library does not use any more; how many are left."
function sweep()
    lock(ROOTS_LOCK) do
        filter!(c -> c.released == 0, ROOTS)
        SWEEP_AT[] = max(64, 2 * length(ROOTS))
        return length(ROOTS)
    end
end

function keep_alive(c::Callbacks)
    lock(ROOTS_LOCK) do
        length(ROOTS) >= SWEEP_AT[] && sweep()
        push!(ROOTS, c)
    end
end

# --- the object ---------------------------------------------------------------------------------------

const BLOCKS = (:x, :u, :p, :t)
const FLAGS = Dict(:x => Lib.SWB_INPUT_X, :u => Lib.SWB_INPUT_U, :p => Lib.SWB_INPUT_P, :t => Lib.SWB_INPUT_T)

"""
    ModelFunction(f, nx, nu = 0, np = 0; outputs = 1, jac, jac_prototype, hess, hess_prototype, linear, inputs, name)
    ModelFunction(f, system; ...)
    ModelFunction(model, expressions; name)

A function of `nx` states x, `nu` controls u, `np` parameters p and time t, with derivatives.

The arguments of the Julia function `f` are named after the inputs it needs: `x -> ...`, `(x, u, t) -> ...`; it depends on
nothing else. (For the variables of a program, `w` is another name of x. `inputs = (:x, :t)` says it for functions
whose arguments have other names or that have several methods.) It returns `outputs` numbers: one, a tuple, an array. Or its
first argument is named `out` or `dx`: a vector to be filled. Its inputs are arrays that are used again for the next call:
copy what is to be kept. A `DomainError` means that `f` is not defined at the point, and the solver tries another one; any
other exception ends the call and comes out of it.

Without `jac` and `hess` derivatives are finite differences. `jac` has the same kind of arguments and returns a matrix with
a row for each output and a column for each of x, or of x and u, or of x, u and p, or of x, u, p and t (a vector if there is
one output), up to the last of those that `f` takes; or it fills its first argument, named `J`. `hess` takes `weights` too, and returns the symmetric matrix of second
derivatives of the outputs' sum with these weights, or fills `H`. With `jac_prototype` and `hess_prototype`, a
`SparseMatrixCSC` or a matrix that is zero where the derivative always is, they are sparse; matrices to be filled are
copies of them, and a function may return the vector of the entries in their order. A prototype alone helps the finite
differences. `linear = true` says that all second derivatives are zero.

Evaluate it by `f(x; u, p, t)`, see also `jacobian_at`, `hessian_at`, `check_derivatives`.
"""
mutable struct ModelFunction <: AnyModelFunction
    address::Ptr{Lib.swb_function}
    uses::Int
    serial::Bool # written in Julia: one thread only may call it
    name::String
    nx::Int
    nu::Int
    np::Int
    outputs::Int
end

function ModelFunction(f, nx::Integer, nu::Integer = 0, np::Integer = 0; outputs = 1, jac = nothing, jac_prototype = nothing,
                       hess = nothing, hess_prototype = nothing, linear = false, inputs = nothing, name = default_name(f))
    n = prod(integer.(outputs, "outputs"))
    what = "function '$name'"
    min(nx, nu, np, n) >= 0 || mistake(:dimension, "$what: sizes must not be negative")
    linear && (hess !== nothing || hess_prototype !== nothing) &&
        mistake(:range, "$what: linear and a Hessian contradict each other")
    caller = f isa Several ? f : Caller(f, BLOCKS, (:out, :dx), inputs, what)
    needed = f isa Several ? unique(vcat(map(symbols_of, collect(f.parts))...)) : symbols_of(caller)
    return build(caller, needed, (nx, nu, np, n), jac, jac_prototype, hess, hess_prototype, linear, String(name))
end

default_name(f) = "f"
default_name(f::Function) = (name = string(nameof(f)); startswith(name, "#") ? "f" : name)

"The callbacks of a function, and the function of the library that has them."
function build(caller, needed, sizes, jac, jac_prototype, hess, hess_prototype, linear, name)
    nx, nu, np, n = sizes
    n_in = nx + nu + np + 1
    widths = (nx, nx + nu, nx + nu + np, n_in)
    jacobian = jac_pattern = hessian = hess_pattern = nothing
    if jac !== nothing || jac_prototype !== nothing
        what = "jacobian of '$name'"
        prototype = jac_prototype === nothing ? dense_prototype(needed, (nx, nu, np), n) : jac_prototype
        jac_pattern = Pattern(prototype, n, n_in, widths, false, jac_prototype !== nothing, what)
        jac === nothing || (jacobian = Derivative(Caller(jac, BLOCKS, (:J, :out), nothing, what), jac_pattern))
    end
    if hess !== nothing || hess_prototype !== nothing
        what = "hessian of '$name'"
        row = dense_prototype(needed, (nx, nu, np), 1)
        prototype = hess_prototype === nothing ? row' * row : hess_prototype
        hess_pattern = Pattern(prototype, size(prototype, 1), n_in, widths, true, hess_prototype !== nothing, what)
        size(prototype, 1) == size(prototype, 2) || mistake(:dimension, "prototype of $what must be square")
        hess === nothing || (hessian = Derivative(Caller(hess, (BLOCKS..., :weights), (:H, :out), nothing, what), hess_pattern))
    end
    callbacks = Callbacks(0, (nx, nu, np, n), caller, jacobian, hessian, Inputs(nx, nu, np, n), zeros(n), Threads.Atomic{Int}(0))
    f = create(callbacks, name)
    check(Lib.swb_function_set_flags(f, Lib.SWB_SERIAL)) # threads of the library cannot run code of Julia
    check(Lib.swb_function_set_inputs(f, reduce(+, Int32[FLAGS[s] for s in needed]; init = Int32(0))))
    jac_pattern === nothing || set_pattern(Lib.swb_function_set_jacobian, f, jac_pattern,
                                           jacobian === nothing ? C_NULL : jacobian_pointer(callbacks))
    hess_pattern === nothing || set_pattern(Lib.swb_function_set_hessian, f, hess_pattern,
                                            hessian === nothing ? C_NULL : hessian_pointer(callbacks))
    (linear || (isempty(needed) && hess_pattern === nothing)) && check(Lib.swb_function_set_linear(f))
    return f
end

"A matrix with columns up to the last input that a function depends on, zero for those that it does not."
function dense_prototype(needed, sizes, n)
    ends = cumsum([0, sizes..., 1])
    blocks = [k for (k, s) in enumerate(BLOCKS) if s in needed]
    m = zeros(n, isempty(blocks) ? sizes[1] : ends[maximum(blocks)+1])
    for k in blocks
        m[:, ends[k]+1:ends[k+1]] .= 1
    end
    return m
end

function create(c::Callbacks, name)
    nx, nu, np, n = c.const_sizes
    keep_alive(c)
    data = pointer_from_objref(c)
    address = try
        created(AnyModelFunction, place -> Lib.swb_function_create(plain(name, "name"), nx, nu, np, n, value_pointer(c), data,
                                                                   DESTROY[], place))
    catch
        c.released = 1 # the library did not take it
        rethrow()
    end
    return owned(ModelFunction(address, 0, true, name, nx, nu, np, n))
end

set_pattern(set, f, p::Pattern, pointer) =
    check(set(f, p.pointers, length(p.pointers), row_indices(p), length(p.rows), pointer))

"""
    affine(constant, matrix = nothing; nx, nu = 0, np = 0, name)

The function `constant + matrix * z`, with a column of the matrix for each of z = x, or (x, u), or (x, u, p), or (x, u, p, t).
"""
function affine(constant, matrix = nothing; nx, nu = 0, np = 0, name = "affine")
    b = vec(reals(constant, "constant of '$name'"))
    n, n_in = length(b), nx + nu + np + 1
    a = matrix === nothing ? zeros(n, nx) : matrix isa AbstractVector && n == 1 ? reshape(matrix, 1, :) : matrix
    size(a, 1) == n && size(a, 2) in (nx, nx + nu, nx + nu + np, n_in) ||
        mistake(:dimension, "matrix of '$name' has size $(size(a)), expected $n rows and a column for each of x, or x and u, ...")
    all(isfinite, a) && all(isfinite, b) || mistake(:range, "constant and matrix of '$name' must be finite")
    wide = spzeros(n, n_in)
    wide[:, 1:size(a, 2)] = sparse(Float64.(a))
    length(b) + nnz(wide) <= MOST_EXPRESSIONS && return affine_expressions(b, wide, (nx, nu, np), name)
    names = any(!iszero, wide) ? BLOCKS : ()
    entries = copy(nonzeros(wide))
    value = isempty(names) ? (() -> b) : ((x, u, p, t) -> b + wide * [x; u; p; t])
    caller = Caller(value, BLOCKS, (), names, "function '$name'")
    jac = isempty(entries) ? nothing : (() -> entries)
    return build(caller, collect(Symbol, names), (nx, nu, np, n), jac, isempty(entries) ? nothing : wide, nothing, nothing, true, name)
end

const MOST_EXPRESSIONS = 100_000 # numbers of an affine function above which Julia is faster than expressions

"b + a z as expressions: no Julia runs while they are evaluated, and any thread may do it."
function affine_expressions(b, a, sizes, name)
    graph = Graph()
    blocks = (Lib.SWB_INPUT_X, Lib.SWB_INPUT_U, Lib.SWB_INPUT_P, Lib.SWB_INPUT_T)
    z = reduce(vcat, [inputs(graph, block, 0, k) for (block, k) in zip(blocks, (sizes..., 1))])
    out = Expression[Expression(v) for v in b]
    for j in axes(a, 2), l in nzrange(a, j)
        iszero(nonzeros(a)[l]) || (out[rowvals(a)[l]] += nonzeros(a)[l] * z[j])
    end
    return expression_function(graph, out, sizes, length(out), name)
end

"""
    casadi_function(path, name; inputs = nothing, nx = 0, nu = 0, np = 0)

A function of a shared library that CasADi generated, with its derivatives; see `Switchback.Lib.swb_function_from_casadi_library`.
No code of Julia runs while it is evaluated.
"""
function casadi_function(path, name; inputs = nothing, nx = 0, nu = 0, np = 0)
    said = inputs === nothing ? C_NULL : plain(inputs, "inputs")
    address = created(AnyModelFunction, place -> Lib.swb_function_from_casadi_library(plain(path, "path"), plain(name, "name"),
                                                                                      said, nx, nu, np, place))
    return taken(address, false, String(name))
end

"A function that the library made."
function taken(address, serial, name)
    f = owned(ModelFunction(address, 0, serial, name, 0, 0, 0, 0))
    f.nx, f.nu, f.np, f.outputs = integers(4, (places...) -> Lib.swb_function_sizes(f, places..., C_NULL, C_NULL))
    return f
end

"What models take as a function: one, a Julia function, several of them, expressions, or constants."
function function_of(f, sizes, outputs, name, graph = nothing)
    n = prod(outputs)
    if f isa ModelFunction
        return f
    elseif f === nothing
        mistake(:null, "$name must be a function, not nothing")
    elseif f isa Expression || (f isa Union{Tuple,AbstractArray} && any_expression(f))
        return expression_function(graph, f, sizes, n, name)
    elseif f isa Union{Tuple,AbstractVector} && !isempty(f) && any(is_callable, f)
        return ModelFunction(several(f, n, name), sizes...; outputs = n, name = name)
    elseif is_callable(f)
        return ModelFunction(f, sizes...; outputs = outputs, name = name)
    end
    values = Float64[]
    flatten!(values, f, name)
    length(values) == n || mistake(:dimension, "$name has $(length(values)) numbers, expected $n")
    return affine(values; nx = sizes[1], nu = sizes[2], np = sizes[3], name = name)
end

"Refuse outputs that are constants though a function of the model is meant."
function require_rows(f, what, instead)
    pointers, rows = entries(f, Lib.swb_function_jacobian_pattern, 1)
    still = setdiff(1:f.outputs, rows)
    isempty(still) || mistake(:range, f.outputs > 1 ? "$what[$(first(still))]" : what, " is a constant: ", instead)
    return f
end

"Functions whose signs decide; constants have none that changes."
function switching_of(f, sizes, outputs, name)
    g = function_of(f, sizes, outputs, name)
    f isa ModelFunction && return g
    return require_rows(g, name, "modes change where it passes zero; give a function of the states, as x -> x[1] - 1")
end

is_callable(f) = !(f isa Union{Number,AbstractArray,Tuple,AbstractString,Symbol,Nothing,Handle}) && !isempty(methods(f))
any_expression(v) = any(e -> e isa Expression || (e isa Union{Tuple,AbstractArray} && any_expression(e)), v)
flatten!(out, v::Real, name) = push!(out, number(v, name))
flatten!(out, v::Union{Tuple,AbstractArray}, name) = foreach(e -> flatten!(out, e, name), v)
flatten!(out, v, name) = mistake(:range, "$name must be a function or numbers, not $(typeof(v))")

function several(parts, n, name)
    n % length(parts) == 0 || mistake(:dimension, "$name: $(length(parts)) functions cannot have $n outputs together")
    callers = map(enumerate(parts)) do (k, f)
        is_callable(f) && return Caller(f, BLOCKS, (), nothing, "$name[$k]")
        values = Float64[]
        flatten!(values, f, name)
        return Caller(() -> values, (), (), (), name)
    end
    return Several(Tuple(callers))
end

# --- evaluation ---------------------------------------------------------------------------------------

n_inputs(f::ModelFunction) = f.nx + f.nu + f.np + 1

"Call the library with a point made of arrays."
function with_point(call, f, x, u, p, t)
    xs, us, ps = vector(x, f.nx, "x"), vector(u, f.nu, "u"), vector(p, f.np, "p")
    GC.@preserve xs us ps begin
        call(Ref(Lib.swb_point(number(t, "t"), pointer(xs), pointer(us), pointer(ps))))
    end
end

function (f::ModelFunction)(x = nothing; u = nothing, p = nothing, t = 0.0)
    out = Vector{Float64}(undef, f.outputs)
    with_point(f, x, u, p, t) do at
        guarded(() -> Lib.swb_function_eval(f, at, out, length(out)))
    end
    return out
end

"Rows and columns of the entries, from 1."
function entries(f::ModelFunction, pattern, k)
    counts = [Ref(Int64(0)) for _ in 1:2]
    check(Lib.swb_function_sizes(f, C_NULL, C_NULL, C_NULL, C_NULL, counts...))
    n = counts[k][]
    pointers, rows = Vector{Int64}(undef, n_inputs(f) + 1), Vector{Int64}(undef, n)
    check(pattern(f, pointers, length(pointers), rows, n))
    return pointers .+ 1, rows .+ 1
end

"""
    jacobian_at(f, x; u, p, t)

The Jacobian of a `ModelFunction`, sparse, with a column for each of x, u, p, t.
"""
function jacobian_at(f::ModelFunction, x = nothing; u = nothing, p = nothing, t = 0.0)
    pointers, rows = entries(f, Lib.swb_function_jacobian_pattern, 1)
    values = zeros(length(rows))
    with_point(f, x, u, p, t) do at
        guarded(() -> Lib.swb_function_eval_jacobian(f, at, values, length(values)))
    end
    return SparseMatrixCSC(f.outputs, n_inputs(f), pointers, rows, values)
end

"""
    hessian_at(f, x; u, p, t, weights)

The Hessian of the sum of the outputs with weights (all 1 if they are not given), symmetric and sparse.
"""
function hessian_at(f::ModelFunction, x = nothing; u = nothing, p = nothing, t = 0.0, weights = ones(f.outputs))
    pointers, rows = entries(f, Lib.swb_function_hessian_pattern, 2)
    values, w = zeros(length(rows)), vector(weights, f.outputs, "weights")
    with_point(f, x, u, p, t) do at
        guarded(() -> Lib.swb_function_eval_hessian(f, at, w, length(w), values, length(values)))
    end
    upper = SparseMatrixCSC(n_inputs(f), n_inputs(f), pointers, rows, values)
    return sparse(Symmetric(upper, :U))
end

"""
What a comparison of derivatives with finite differences found: `passed`, `max_error` and a `report` for people.
"""
struct DerivativeCheck
    passed::Bool
    max_error::Float64
    report::String
end
Base.show(io::IO, ::MIME"text/plain", c::DerivativeCheck) = print(io, c.report)

"""
    check_derivatives(f, x; u, p, t) -> DerivativeCheck

Compare the derivatives of a `ModelFunction` at a point with finite differences, inside and outside the patterns.
"""
function check_derivatives(f::ModelFunction, x = nothing; u = nothing, p = nothing, t = 0.0)
    passed, worst, needed = Ref(Int32(0)), Ref(0.0), Ref(Int64(0))
    with_point(f, x, u, p, t) do at
        guarded(() -> Lib.swb_function_check_derivatives(f, at, passed, worst, C_NULL, 0, needed))
        buffer = Vector{UInt8}(undef, needed[] + 4096) # numbers may be a digit longer the next time
        guarded(() -> Lib.swb_function_check_derivatives(f, at, passed, worst, buffer, length(buffer), needed))
        return DerivativeCheck(passed[] != 0, worst[], String(buffer[1:needed[]-1]))
    end
end

Base.show(io::IO, f::ModelFunction) =
    print(io, "ModelFunction '", f.name, "' of ", f.nx, " states, ", f.nu, " controls, ", f.np, " parameters; ", f.outputs, " outputs")
