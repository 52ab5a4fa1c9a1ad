# Optimal control problems of several phases.

"""
    MultiPhase(phases; on_iteration)

Optimal control problem of phases (`Ocp`s, copied as they are stated), one after the other. The initial state of a phase is
free unless its problem bounds it; `link!` and `link_continuous!` tie it to the end of the phase before. A function of time
sees the time from the start of the first phase on.
"""
mutable struct MultiPhase <: AnyMultiPhase
    address::Ptr{Lib.swb_multiphase}
    uses::Int
    phases::Vector{Ocp}
    serial::Bool
    graph::Union{Nothing,Graph}
    iteration::Monitor
end

function MultiPhase(phases; on_iteration = nothing)
    all(p -> p isa Ocp, phases) || mistake(:range, "phases must be problems (Ocp)")
    list = collect(Ocp, phases)
    make(place) = GC.@preserve list Lib.swb_multiphase_create([address(p) for p in list], length(list), C_NULL, place)
    o = owned(MultiPhase(created(AnyMultiPhase, make), 0, list, any(p -> p.serial, list), nothing, Monitor(nothing)))
    on_iteration!(o, on_iteration)
    return o
end

phase_number(o::MultiPhase, k) = index(k, length(o.phases) - 1, "phase")

"""
    link!(phases, k, f, lower = 0.0, upper = 0.0)

Require lower <= f(x) <= upper between phase k and the next one: x holds the states at the end of phase k, then those at the
start of the next.
"""
function link!(o::MultiPhase, k, f, lower = 0.0, upper = 0.0)
    i = phase_number(o, k)
    add_rows!((rows...) -> Lib.swb_multiphase_link(o, i, rows...), o, f, lower, upper, "link", "link",
              (o.phases[i+1].nx + o.phases[i+2].nx, 0, 0))
end

"""
    link_continuous!(phases, k)

The next phase begins where phase k ends, in all states.
"""
function link_continuous!(o::MultiPhase, k)
    using_object(() -> Lib.swb_multiphase_link_continuous(o, phase_number(o, k)), o)
    return o
end

"""
    link_reset!(phases, k, f)

The next phase begins at f(x), a function of the states at the end of phase k with a value for each state of the next.
"""
function link_reset!(o::MultiPhase, k, f)
    i = phase_number(o, k)
    r = function_of(f, (o.phases[i+1].nx, 0, 0), o.phases[i+2].nx, "reset")
    using_object(() -> Lib.swb_multiphase_link_reset(o, i, r), o)
    return o
end

"""
What a solve of several phases found: outcome, polished, cost, the results of the `phases`, the largest `link_violation`, the
`error` of a state at the end of a phase against a simulation, iterations, time_total, message.
"""
struct MultiPhaseResult
    outcome::Symbol
    polished::Symbol
    cost::Float64
    phases::Vector{OcpResult}
    link_violation::Float64
    error::Float64
    iterations::Int
    time_total::Float64
    message::String
end
successful(r::MultiPhaseResult) = r.outcome === :solved
Base.show(io::IO, r::MultiPhaseResult) = print(io, "MultiPhaseResult of ", length(r.phases), " phases: ", r.outcome, ", cost ", r.cost)

function solve!(o::MultiPhase)
    using_object(() -> Lib.swb_multiphase_solve(o, C_NULL), o)
    return result(o)
end

function result(o::MultiPhase)
    info = record(Lib.swb_multiphase_info, Lib.swb_multiphase_get_info, o)
    return MultiPhaseResult(
        solve_outcome(info.outcome), symbol(Lib.NAMES_swb_polished, info.polished), info.cost,
        [result(phase_copy(o, k)) for k in eachindex(o.phases)], info.link_violation, info.error, info.iterations, info.time_total,
        own_words(text(Lib.swb_multiphase_get_message, o)),
    )
end

"A copy of a phase with its part of the solution."
function phase_copy(o::MultiPhase, k)
    p = o.phases[k]
    address_ = created(AnyOcp, Lib.swb_multiphase_get_phase, o, k - 1)
    ocp = owned(Ocp(address_, 0, sizes(p)..., p.n_stages, p.horizon, 0.0, p.serial, p.graph, p.names, Monitor(nothing), Monitor(nothing)))
    ocp.initial_time = Trajectory(Lib.swb_ocp_get_trajectory, ocp).times[1]
    return ocp
end

Base.show(io::IO, o::MultiPhase) = print(io, "MultiPhase of ", length(o.phases), " phases")
