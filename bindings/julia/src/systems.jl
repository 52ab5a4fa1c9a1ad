# Piecewise smooth systems, given by functions.

"""
    System(nx; controls = 0, parameters = 0, f0 = nothing)

A piecewise smooth system of `nx` states: x' = f0(x, u, p, t) plus, for each subsystem (`add_subsystem!`), a convex
combination of its modes. Functions are given as Julia functions (see `ModelFunction`), as tuples or vectors of them, one
for each mode, as `ModelFunction`s, or as constants.
"""
mutable struct System <: AnySystem
    address::Ptr{Lib.swb_system}
    uses::Int
    nx::Int
    nu::Int
    np::Int
    n_subsystems::Int
    serial::Bool # has functions of Julia, which one thread only may call
    names::NTuple{3,Vector{String}} # of states, controls and parameters
    discrete::Vector{Float64} # values with which the last states begin
    contacts::Vector{Tuple{String,Int}} # of a scene: their names and numbers of tangents
    scene::Any # the scene it is of, or nothing
    events::Vector{String} # names of the transitions

    System(address, uses, nx, nu, np, n_subsystems, serial, names, discrete) =
        new(address, uses, nx, nu, np, n_subsystems, serial, names, discrete, [], nothing, String[])
end

function System(nx::Integer; controls = 0, parameters = 0, f0 = nothing)
    nx, nu, np = integer(nx, "nx"), integer(controls, "controls"), integer(parameters, "parameters")
    address = created(AnySystem, Lib.swb_system_create, nx, nu, np)
    s = owned(System(address, 0, nx, nu, np, 0, false, (fill("", nx), fill("", nu), fill("", np)), Float64[]))
    f0 === nothing || set_f0!(s, f0)
    return s
end

sizes(s::System) = (s.nx, s.nu, s.np)

"An initial state; the discrete states of a model may be left out."
function start_of(s::System, x)
    n = s.nx - length(s.discrete)
    isempty(s.discrete) && return named_vector(x, s.names[1], "x")
    if x isa Union{NamedTuple,AbstractDict} || (x isa Union{Tuple,AbstractVector} && !isempty(x) && all(e -> e isa Pair, x))
        given = Dict{Symbol,Any}(Symbol(name) => v for (name, v) in zip(s.names[1][n+1:end], s.discrete) if !isempty(name))
        merge!(given, Dict(Symbol(k) => v for (k, v) in (x isa NamedTuple ? pairs(x) : x)))
        return named_vector(given, s.names[1], "x")
    end
    x isa Union{Tuple,AbstractVector} && length(x) == n || return named_vector(x, s.names[1], "x")
    return [named_vector(x, s.names[1][1:n], "x"); s.discrete]
end
ModelFunction(f, s::System; keywords...) = ModelFunction(f, sizes(s)...; keywords...)

"Note that an object has a function, for the number of threads."
function took!(owner, fs::ModelFunction...)
    owner.serial |= any(f -> f.serial, fs)
    return nothing
end

"""
    set_f0!(system, f)

Set the part of the right-hand side that does not switch: as many outputs as states.
"""
function set_f0!(s::System, f)
    g = function_of(f, sizes(s), s.nx, "f0")
    guarded(() -> Lib.swb_system_set_f0(s, g))
    took!(s, g)
    return s
end

row_numbers(rows, nx) = rows === nothing ? collect(Int64, 0:nx-1) : Int64[index(i, nx, "rows") for i in rows]

"""
    add_subsystem!(system; modes, psi, signs, rows = all states)

Add a subsystem whose regions are given by switching functions `psi` and a matrix of signs with a row for each mode: mode i
is valid where `signs[i, j] * psi[j] > 0` for every j with `signs[i, j] != 0`. With one switching function `signs` is a
vector. The modes drive the states `rows`; together they give a matrix with a column for each mode, or are one function for
each. Returns the number of the subsystem.
"""
function add_subsystem!(s::System; modes, psi, signs, rows = nothing)
    matrix = signs isa AbstractMatrix ? signs : reshape(collect(signs), :, 1)
    all(v -> v isa Real && v in (-1, 0, 1), matrix) || mistake(:range, "signs must be -1, 0 or 1")
    n_modes, n_psi = size(matrix)
    chosen = row_numbers(rows, s.nx)
    f = function_of(modes, sizes(s), (length(chosen), n_modes), "modes")
    g = switching_of(psi, sizes(s), n_psi, "psi")
    packed = vec(permutedims(Int8.(matrix))) # row after row
    number = Ref{Int64}()
    guarded(() -> Lib.swb_system_add_subsystem(s, chosen, length(chosen), f, n_modes, g, packed, length(packed), number))
    return added(s, number, f, g)
end

"""
    add_subsystem_indicators!(system; modes, indicators, n_modes, rows = all states)

Add a subsystem whose regions are given by Stewart's indicator functions: mode i is valid where the i-th is the smallest.
`n_modes` is needed where neither modes nor indicators tell it. Returns the number of the subsystem.
"""
function add_subsystem_indicators!(s::System; modes, indicators, n_modes = nothing, rows = nothing)
    chosen = row_numbers(rows, s.nx)
    n = n_modes !== nothing ? integer(n_modes, "n_modes") : indicators isa ModelFunction ? indicators.outputs :
        indicators isa Union{Tuple,AbstractVector} ? length(indicators) :
        modes isa Union{Tuple,AbstractVector} ? length(modes) : mistake(:null, "n_modes: the number of modes must be given")
    f = function_of(modes, sizes(s), (length(chosen), n), "modes")
    g = function_of(indicators, sizes(s), n, "indicators")
    number = Ref{Int64}()
    guarded(() -> Lib.swb_system_add_subsystem_indicators(s, chosen, length(chosen), f, n, g, number))
    return added(s, number, f, g)
end

function added(s::System, number, functions...)
    took!(s, functions...)
    s.n_subsystems += 1
    return Int(number[]) + 1
end

"""
    add_inclusion!(system; f, psi, n_psi = 1, rows = all states)

Add `f` to the derivatives of the states `rows`, where `alpha` is the set-valued step of the `n_psi` switching functions
`psi`. The function sees x and behind it alpha as one array of `nx + n_psi` states. Returns the number of the inclusion.
"""
function add_inclusion!(s::System; f, psi, n_psi = 1, rows = nothing)
    chosen, n = row_numbers(rows, s.nx), integer(n_psi, "n_psi")
    c = switching_of(psi, sizes(s), n, "psi")
    g = function_of(f, (s.nx + n, s.nu, s.np), length(chosen), "f")
    number = Ref{Int64}()
    guarded(() -> Lib.swb_system_add_inclusion(s, chosen, length(chosen), g, c, number))
    took!(s, g, c)
    return Int(number[]) + 1
end

"""
    set_algebraic!(system, n, g = nothing)

Make the last `n` states algebraic: what f0 and modes add to their rows, and `g`, adds up to zero. Their initial values are
guesses where the smooth equations determine them. `simulate` takes equations of index 1: they are solved where a run begins, behind
every event, and at every point of a result. Modes may switch inside of them, and surfaces be held there.
"""
function set_algebraic!(s::System, n, g = nothing)
    count_ = integer(n, "n")
    if g === nothing
        check(Lib.swb_system_set_algebraic(s, count_, C_NULL))
    else
        f = function_of(g, sizes(s), count_, "g")
        guarded(() -> Lib.swb_system_set_algebraic(s, count_, f))
        took!(s, f)
    end
    return s
end

"""
    add_complementarity!(system, b; rows, a = nothing)

Add `0 ≤ a ⊥ b ≥ 0` to the equations of the algebraic states `rows`: of every pair one is zero, and the other one is not negative. Without
`a` it is the states themselves. Returns the number of the first of the subsystems, one for each pair with the modes `a = 0` and `b = 0`.
"""
function add_complementarity!(s::System, b; rows, a = nothing)
    chosen = row_numbers(rows, s.nx)
    g = function_of(b, sizes(s), length(chosen), "b")
    f = a === nothing ? nothing : function_of(a, sizes(s), length(chosen), "a")
    number = Ref{Int64}()
    first_ = f === nothing ? C_NULL : f
    guarded(() -> Lib.swb_system_add_complementarity(s, chosen, length(chosen), first_, g, number))
    took!(s, g)
    f === nothing || took!(s, f)
    return Int(number[]) + 1
end

"""
    surfaces(system, x; u, p, t = 0.0, subsystem = 1)

Values whose zeros are the switching surfaces of a subsystem: its switching functions, or the differences g[i] - g[j], i < j,
of its indicators, NaN where both are not the smallest two.
"""
function surfaces(s::System, x; u = zeros(s.nu), p = zeros(s.np), t = 0.0, subsystem = 1)
    k = index(subsystem, s.n_subsystems, "subsystem")
    needed = Ref{Int64}()
    with_point(s, x, u, p, t) do at
        guarded(() -> Lib.swb_system_surfaces(s, k, at, C_NULL, 0, needed))
        out = Vector{Float64}(undef, needed[])
        guarded(() -> Lib.swb_system_surfaces(s, k, at, out, length(out), C_NULL))
        return out
    end
end

Base.show(io::IO, s::System) = print(io, "System of ", s.nx, " states, ", s.nu, " controls, ", s.np, " parameters; ",
                                     s.n_subsystems, " subsystems", s.serial ? ", with functions of Julia" : "")
