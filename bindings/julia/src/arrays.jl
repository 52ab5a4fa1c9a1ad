# Arrays on their way in: what Julia has, checked, as the library takes it.

shape(v) = v isa AbstractArray ? string(size(v)) : string("of type ", typeof(v))

"A number."
function number(v, name)
    v isa Real || mistake(:range, "$name must be a real number, not $(repr(v))")
    v isa AbstractExpression && mistake(:range, "$name must be a number, not the expression $v")
    return Float64(v)
end

"An integer that fits into 64 bits."
function integer(v, name)
    v isa Integer || mistake(:range, "$name must be an integer, not $(repr(v))")
    typemin(Int64) <= v <= typemax(Int64) || mistake(:range, "$name is too large: $v")
    return Int64(v)
end

"An index from 1 to `n`, as the library counts."
function index(v, n, name)
    i = integer(v, name)
    1 <= i <= n || mistake(:dimension, n == 0 ? "$name is $i, but there are none" : "$name must be one of 1 to $n, not $i")
    return i - 1
end

"Numbers as the library takes them, a copy only where one is needed."
function reals(v, name)
    v isa Real && return [number(v, name)]
    v isa Vector{Float64} && return v
    v isa Tuple && return Float64[number(e, name) for e in v]
    v isa AbstractArray || mistake(:range, "$name must be numbers, not $(repr(v))")
    all(e -> e isa Real && !(e isa AbstractExpression), v) ||
        mistake(:range, "$name must be real numbers, not of type $(eltype(v))")
    return Array{Float64}(v)
end

"`n` numbers; a number alone if `n` is 1."
function vector(v, n, name)
    v === nothing && n == 0 && return Float64[]
    v === nothing && mistake(:null, "$name must be given: $n numbers")
    a = reals(v, name)
    length(a) == n && count(>(1), size(a)) <= 1 ||
        mistake(:dimension, "$name has size $(size(a)), expected ($n,)")
    return vec(a)
end

"A matrix of `rows` rows and, unless it is nothing, `columns` columns; flat if there is one row."
function matrix_of(v, rows, columns, name)
    v isa AbstractVector && any(e -> e isa Union{Tuple,AbstractArray}, v) &&
        mistake(:dimension, "$name must be a matrix, not a list of vectors: reduce(hcat, list) makes one of them")
    a = reals(v, name)
    a = ndims(a) == 1 && rows == 1 ? reshape(a, 1, :) : a
    ndims(a) == 2 && size(a, 1) == rows && (columns === nothing || size(a, 2) == columns) ||
        mistake(:dimension, "$name has size $(size(a)), expected ($rows, $(columns === nothing ? "any" : columns))")
    return a
end

"`n` bounds: nothing is no bound, one number is for all; of what has names also some by their names."
function bound(v, n, default, name, names)
    v === nothing && return fill(default, n)
    v isa Real && return fill(number(v, name), n)
    if v isa Union{NamedTuple,AbstractDict} && any(!isempty, names)
        out = fill(default, n)
        for (k, b) in pairs(v)
            out[place_of(k, names, name)] = number(b, "$name: $k")
        end
        return out
    end
    return vector(v, n, name)
end

function bounds(lower, upper, n, name, names = ())
    low, high = bound(lower, n, -Inf, "lower $name", names), bound(upper, n, Inf, "upper $name", names)
    for k in 1:n
        low[k] <= high[k] && continue
        isnan(low[k]) || isnan(high[k]) ? mistake(:range, "$name: number $k is NaN; use nothing or an infinity for no bound") :
            mistake(:range, "$name: the lower one of number $k is $(low[k]), above the upper one, $(high[k])")
    end
    return low, high
end

function bound_pair(v, name)
    v isa Union{Tuple,AbstractVector} && length(v) == 2 || mistake(:dimension, "$name must be (lower, upper)")
    return v[1], v[2]
end

"A text without NUL characters."
function plain(v, name)
    v isa Union{AbstractString,Symbol} || mistake(:range, "$name must be a text, not $(repr(v))")
    s = String(v)
    isvalid(s) || mistake(:range, "$name is no valid text")
    occursin('\0', s) && mistake(:range, "$name contains a NUL character")
    return s
end

# --- names --------------------------------------------------------------------------------------------

"Numbers by their names, or in their order."
function named_vector(v, names, what)
    if v isa Union{NamedTuple,AbstractDict} || (v isa Union{Tuple,AbstractVector} && !isempty(v) && all(e -> e isa Pair, v))
        given = Dict(Symbol(k) => e for (k, e) in (v isa NamedTuple ? pairs(v) : v))
        known = Symbol.(names)
        foreach(k -> place_of(k, names, what), keys(given))
        missing_ = [k for k in known if !haskey(given, k)]
        isempty(missing_) || mistake(:dimension, "$what: there is no value for $(join(missing_, ", "))")
        return finite(Float64[number(given[k], "$what.$k") for k in known], what, names)
    end
    v === nothing && any(!isempty, names) && mistake(:null, "$what must be given: numbers for $(join(names, ", "))")
    return finite(vector(v, length(names), what), what, names)
end

"Numbers that are all finite."
function finite(values, what, names = String[])
    k = findfirst(!isfinite, values)
    k === nothing && return values
    name = isempty(get(names, k, "")) ? "$what[$k]" : "$what.$(names[k])"
    mistake(:range, "$name is $(values[k]): it must be finite")
end

"The place of a name, or a number as it is, from 1."
function place_of(name::Union{Symbol,AbstractString}, names, what)
    k = findfirst(==(String(name)), names)
    known = Symbol[Symbol(n) for n in names if !isempty(n)]
    k === nothing && mistake(:range, "$what: there is no $name", nearest(name, known),
                             isempty(known) ? "; nothing has a name" : "; the names are $(join(known, ", "))")
    return k
end
place_of(k, names, what) = index(k, length(names), what) + 1

"The places of several, or of one alone."
places(chosen::Union{Symbol,AbstractString,Integer}, names, what) = [place_of(chosen, names, what)]
places(chosen, names, what) = Int[place_of(c, names, what) for c in chosen]

"The name that was meant, perhaps."
function nearest(name, known)
    isempty(known) && return ""
    distances = [edit_distance(lowercase(String(name)), lowercase(String(k))) for k in known]
    best = argmin(distances)
    return distances[best] <= min(1 + length(String(name)) ÷ 4, length(String(name)) - 1) ? ", did you mean $(known[best])?" : ""
end

"Letters to change, add or take away to make one word of another."
function edit_distance(a, b)
    row = collect(0:length(b))
    for (i, x) in enumerate(a)
        diagonal, row[1] = row[1], i
        for (j, y) in enumerate(b)
            diagonal, row[j+1] = row[j+1], min(row[j+1] + 1, row[j] + 1, diagonal + (x != y))
        end
    end
    return row[end]
end
