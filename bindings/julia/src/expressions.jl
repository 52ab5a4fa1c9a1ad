# Expressions: numbers of Julia's type tree that are recorded instead of computed. Generic code, such as the product of a
# matrix of numbers and a vector of expressions, works on them.

abstract type AbstractExpression <: Real end

"Holds expressions; equal expressions are one."
mutable struct Graph <: AnyGraph
    address::Ptr{Lib.swb_expr}
    uses::Int
    serial::Bool # calls functions of Julia, which one thread only may do

    Graph() = owned(new(created(AnyGraph, Lib.swb_expr_create), 0, false))
end

"""
An expression of a model: a variable, a number, or what operators and functions of Base make of them. `sign`, `abs`, `min`,
`max`, `clamp`, `relay`, `dead_zone` and `when` switch: they are for the derivatives of models and become their modes.
"""
struct Expression <: AbstractExpression
    graph::Union{Nothing,Graph} # nothing: a number that belongs to no graph yet
    id::Int64
    number::Float64
end

"A comparison of expressions, or conditions combined by `&`, `|` and `!`; for `when`."
struct Condition
    graph::Graph
    id::Int64
    margin::Union{Nothing,Expression} # of a comparison: what is positive where it holds

    Condition(graph, id, margin = nothing) = new(graph, id, margin)
end

Expression(x::Real) = Expression(nothing, 0, Float64(x))
Expression(x::Expression) = x
in_graph(graph::Graph, id) = Expression(graph, id, NaN)
isnumber(e::Expression) = e.graph === nothing

Base.convert(::Type{Expression}, x::Expression) = x
Base.convert(::Type{Expression}, x::Real) = Expression(x)
Base.promote_rule(::Type{Expression}, ::Type{<:Real}) = Expression
Base.zero(::Type{Expression}) = Expression(0.0)
Base.one(::Type{Expression}) = Expression(1.0)
Base.float(x::Expression) = x
Base.iszero(x::Expression) = isnumber(x) && iszero(x.number)
Base.isone(x::Expression) = isnumber(x) && isone(x.number)
Base.hash(x::Expression, h::UInt) = isnumber(x) ? hash(x.number, h) : hash(x.id, hash(objectid(x.graph), h))
Base.isequal(a::Expression, b::Expression) = # of expressions, not of their values
    a.graph === b.graph && (isnumber(a) ? isequal(a.number, b.number) : a.id == b.id)
function Base.:(==)(a::Expression, b::Expression)
    isnumber(a) && isnumber(b) && return a.number == b.number
    isequal(a, b) || mistake(:unsupported, "$(isnumber(a) ? b : a) == ... is no condition: values are equal at single moments only, where a ",
        "model cannot switch. Compare by < or >: when(a > b, ...) on either side of a value, when(abs(a - b) < width, ...) near it, ",
        "when(w > 0.5, ...) for a discrete state w; what happens as a value is reached is a transition. Whether two expressions ",
        "are the same one is isequal(a, b)")
    return true
end

function Base.Float64(x::Expression)
    isnumber(x) || mistake(:unsupported, "the expression $x has no value before the model runs")
    return x.number
end
Base.AbstractFloat(x::Expression) = x
Base.convert(::Type{Float64}, x::Expression) = Float64(x)
(::Type{T})(x::Expression) where {T<:Integer} = T(Float64(x))
Base.Bool(x::Expression) = mistake(:unsupported, "the expression $x is not known before the model runs")

function common_graph(operands)
    graph = nothing
    for e in operands
        e.graph === nothing && continue
        graph === nothing || graph === e.graph || mistake(:range, "expressions of two models cannot be combined")
        graph = e.graph
    end
    return graph
end

"The number of an expression in a graph, which a number enters as a constant."
function id_in(graph::Graph, e::Expression)
    isnumber(e) || return e.id
    out = Ref{Int64}()
    check(Lib.swb_expr_constants(graph, Ref(e.number), 1, out, 1))
    return out[]
end

function ids_in(graph::Graph, es)
    all(e -> isnumber(e) || e.graph === graph, es) || mistake(:range, "expressions of two models cannot be combined")
    return Int64[id_in(graph, e) for e in es]
end

function apply(graph::Graph, op, a::Int64, b = nothing, c = nothing)
    out = Ref{Int64}()
    place(id) = id === nothing ? C_NULL : Ref(id)
    check(Lib.swb_expr_apply(graph, op, Ref(a), place(b), place(c), out, 1))
    return out[]
end

function applied(op, operands::Expression...)
    graph = common_graph(operands)
    ids = map(e -> id_in(graph, e), operands)
    return in_graph(graph, apply(graph, op, ids...))
end

for (f, op) in (
    (:-, :NEG), (:sqrt, :SQRT), (:exp, :EXP), (:log, :LOG), (:sin, :SIN), (:cos, :COS), (:tan, :TAN), (:asin, :ASIN),
    (:acos, :ACOS), (:atan, :ATAN), (:sinh, :SINH), (:cosh, :COSH), (:tanh, :TANH), (:sign, :SIGN), (:abs, :ABS),
)
    code = Symbol(:SWB_OPERATOR_, op)
    @eval Base.$f(x::Expression) = isnumber(x) ? Expression($f(x.number)) : applied(Lib.$code, x)
end
for (f, op) in ((:+, :ADD), (:-, :SUB), (:*, :MUL), (:/, :DIV), (:^, :POW), (:min, :MIN), (:max, :MAX), (:atan, :ATAN2))
    code = Symbol(:SWB_OPERATOR_, op)
    @eval Base.$f(x::Expression, y::Expression) =
        isnumber(x) && isnumber(y) ? Expression($f(x.number, y.number)) : applied(Lib.$code, x, y)
end
Base.:+(x::Expression) = x
Base.inv(x::Expression) = one(x) / x
Base.:^(x::Expression, n::Integer) = x^Expression(n)
Base.:^(x::Expression, r::Rational) = x^Expression(r)
Base.muladd(x::Expression, y::Expression, z::Expression) = x * y + z
Base.exp2(x::Expression) = exp(log(2.0) * x)
Base.log10(x::Expression) = log(x) / log(10.0)
Base.log2(x::Expression) = log(x) / log(2.0)
Base.exp10(x::Expression) = exp(log(10.0) * x)
Base.expm1(x::Expression) = 2exp(0.5x) * sinh(0.5x)
Base.log1p(x::Expression) = log(1 + x)
Base.sinpi(x::Expression) = sin(pi * x)
Base.cospi(x::Expression) = cos(pi * x)
Base.asinh(x::Expression) = log(x + sqrt(x * x + 1))
Base.acosh(x::Expression) = log(x + sqrt(x * x - 1))
Base.atanh(x::Expression) = 0.5log((1 + x) / (1 - x))
for f in (:ceil, :trunc, :round, :rem, :div) # with any further arguments: the first one decides
    @eval Base.$f(x::Expression, others::Real...; keywords...) =
        mistake(:unsupported, $("$f is not defined for expressions: use step_table, or write its steps by when"))
end
# they jump again and again, so they are for what is evaluated at single times: resets of transitions
Base.floor(x::Expression) = applied(Lib.SWB_OPERATOR_FLOOR, x)
Base.mod(x::Expression, y::Real) = x - y * floor(x / y)
Base.fld(x::Expression, y::Real) = floor(x / y)
Base.cbrt(x::Expression) = mistake(:unsupported, "cbrt is not defined for expressions: use sign(x) * abs(x)^(1/3)")
Base.sincos(x::Expression) = (sin(x), cos(x))
Base.abs2(x::Expression) = x * x
Base.hypot(x::Expression, y::Expression) = sqrt(x * x + y * y)
LinearAlgebra.norm(v::AbstractArray{Expression}) = sqrt(sum(abs2, v)) # those of LinearAlgebra compare
LinearAlgebra.norm(v::AbstractArray{Expression}, p::Real) =
    p == 2 ? norm(v) : p == 1 ? sum(abs, v) : p == Inf ? reduce(max, abs.(v)) : sum(abs.(v) .^ p)^(1 / p)
Base.clamp(x::Expression, low::Real, high::Real) = applied(Lib.SWB_OPERATOR_CLIP, x, Expression(low), Expression(high))

"""
    Switchback.erf(x)

The error function of an expression; it is not exported, because SpecialFunctions has one for numbers.
"""
erf(x::Expression) = applied(Lib.SWB_OPERATOR_ERF, x)

"""
    relay(x, on, off)

`on` where `x > 0`, else `off`. It switches.
"""
relay(x::Expression, on::Real, off::Real) = applied(Lib.SWB_OPERATOR_RELAY, x, Expression(on), Expression(off))

"""
    dead_zone(x, width)

Distance of `x` from the interval from `-width` to `width`, with sign. It switches.
"""
dead_zone(x::Expression, width::Real) = applied(Lib.SWB_OPERATOR_DEAD_ZONE, x, Expression(width))

# --- conditions ---------------------------------------------------------------------------------------

function Base.:<(a::Expression, b::Expression)
    isnumber(a) && isnumber(b) && return a.number < b.number
    d = b - a
    isnumber(d) && return d.number > 0
    return Condition(d.graph, apply(d.graph, Lib.SWB_OPERATOR_POSITIVE, d.id), d)
end
Base.:<=(a::Expression, b::Expression) = a < b # the same: the solution is Filippov's
Base.isless(a::Expression, b::Expression) =
    isnumber(a) && isnumber(b) ? isless(a.number, b.number) :
    mistake(:unsupported, "expressions have no order before the model runs: use when(a < b, x, y), min and max")

function combined(op, a::Condition, b::Condition)
    a.graph === b.graph || mistake(:range, "conditions of two models cannot be combined")
    return Condition(a.graph, apply(a.graph, op, a.id, b.id))
end
Base.:&(a::Condition, b::Condition) = combined(Lib.SWB_OPERATOR_AND, a, b)
Base.:|(a::Condition, b::Condition) = combined(Lib.SWB_OPERATOR_OR, a, b)
Base.:!(a::Condition) = Condition(a.graph, apply(a.graph, Lib.SWB_OPERATOR_NOT, a.id))
Base.:&(a::Condition, b::Bool) = b ? a : b
Base.:&(a::Bool, b::Condition) = b & a
Base.:|(a::Condition, b::Bool) = b ? b : a
Base.:|(a::Bool, b::Condition) = b | a
Base.:(==)(a::Condition, b::Condition) = a.graph === b.graph && a.id == b.id

"""
    when(condition, a, b)

`a` where the condition holds, else `b`; arrays element by element. It switches. Conditions are comparisons, combined by
`&`, `|` and `!`. From Julia 1.8 on `ifelse` does the same.
"""
function when(c::Condition, a::Real, b::Real)
    x, y = Expression(a), Expression(b)
    common_graph((x, y)) in (nothing, c.graph) || mistake(:range, "expressions of two models cannot be combined")
    ids = id_in(c.graph, x), id_in(c.graph, y)
    return in_graph(c.graph, apply(c.graph, Lib.SWB_OPERATOR_WHERE, c.id, ids...))
end
when(c::Condition, a::AbstractArray, b::AbstractArray) = size(a) == size(b) ? map((x, y) -> when(c, x, y), a, b) :
    mistake(:dimension, "when: arrays of sizes $(size(a)) and $(size(b))")
when(c::Bool, a, b) = c ? a : b
when(::Condition, a, b) = mistake(:range, "when: both cases must be numbers or expressions, or arrays of one size, not $(typeof(a)) and $(typeof(b))")
when(c, a, b) = mistake(:range, "when: the condition must be a comparison such as x > 0, not $(repr(c))")
@static if VERSION >= v"1.8"
    Base.ifelse(c::Condition, a, b) = when(c, a, b)
end

# --- matrices, tables, other functions ----------------------------------------------------------------

graph_of(es) = (g = common_graph(es); g === nothing ? mistake(:range, "there is no expression among the operands") : g)

"Solution of a small linear system, which is decomposed numerically where the model runs, not symbolically."
function Base.:\(a::Matrix{Expression}, b::AbstractVector{<:Real})
    n = length(b)
    size(a) == (n, n) || mistake(:dimension, "no linear system: matrix of size $(size(a)), right-hand side of size ($n,)")
    right = Expression[Expression(e) for e in b]
    graph = graph_of(Iterators.flatten((a, right)))
    out = Vector{Int64}(undef, n)
    check(Lib.swb_expr_solve(graph, ids_in(graph, vec(a)), n * n, ids_in(graph, right), out, n))
    return [in_graph(graph, id) for id in out]
end
Base.:\(a::Matrix{Expression}, b::AbstractMatrix{<:Real}) = reduce(hcat, [a \ b[:, j] for j in axes(b, 2)])
Base.inv(a::Matrix{Expression}) = a \ Matrix{Float64}(I, size(a)...)

"By the first row: for the small matrices of mechanics."
function LinearAlgebra.det(a::Matrix{Expression})
    n = LinearAlgebra.checksquare(a)
    n <= 4 || mistake(:unsupported, "det is written out up to 4 rows, not $n: to solve equations use matrix \\ vector")
    n == 0 && return Expression(1.0)
    return sum((-1)^(j + 1) * a[1, j] * det(a[2:end, [1:j-1; j+1:n]]) for j in 1:n)
end

"""
    table(x, points, values; kind = :spline)

Values of a table at the expression `x`: `:spline` through the points, `:lines`, or `:steps` between breaks (one value more
than breaks; for functions of time with breaks on the grid, see `step_table`).
"""
function table(x::Expression, points, values; kind = :spline)
    p, v = reals(points, "points"), reals(values, "values")
    graph, code = graph_of((x,)), enum_number(Lib.NAMES_swb_table, kind, "kind")
    out = Ref{Int64}()
    check(Lib.swb_expr_table(graph, code, p, length(p), v, length(v), Ref(x.id), out, 1))
    return in_graph(graph, out[])
end

"""
    step_table(x, breaks, values)

A table of steps that switches at each break: `values[i]` between `breaks[i-1]` and `breaks[i]`.
"""
function step_table(x::Expression, breaks, values)
    length(values) == length(breaks) + 1 ||
        mistake(:dimension, "$(length(breaks)) breaks and $(length(values)) values: one value more than breaks")
    all(diff(collect(breaks)) .> 0) || mistake(:range, "breaks must increase")
    out = Expression(values[1])
    for (b, v) in zip(breaks, values[2:end])
        out = when(x > b, v, out)
    end
    return out
end

"""
    jacobian(outputs, inputs)

Derivatives of expressions with respect to variables of the model, as expressions: for energies and Lagrangians.
"""
function jacobian(outputs, inputs)
    f = [Expression(e) for e in vec(outputs isa Real ? [outputs] : collect(outputs))]
    x = vec(inputs isa Expression ? [inputs] : collect(inputs))
    graph = graph_of(x)
    out = Matrix{Int64}(undef, length(f), length(x))
    check(Lib.swb_expr_jacobian(graph, ids_in(graph, f), length(f), ids_in(graph, x), length(x), out, length(out)))
    return [in_graph(graph, id) for id in out]
end

# --- text ---------------------------------------------------------------------------------------------

"The text of an expression; the library counts variables from 0."
function text_of(graph, id)
    said = text(Lib.swb_expr_text, graph, id)
    return replace(said, r"\b[xup]\[\d+\]" => v -> string(v[1], "[", parse(Int, v[3:end-1]) + 1, "]"))
end
Base.show(io::IO, e::Expression) = print(io, isnumber(e) ? string(e.number) : text_of(e.graph, e.id))
Base.show(io::IO, c::Condition) = print(io, text_of(c.graph, c.id))
