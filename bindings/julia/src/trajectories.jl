# Trajectories on finite elements, and simulation by them (FESD).

"""
A trajectory on finite elements, which end where the system switches. Call it for states at any times: `trajectory(t)` is
a vector, `trajectory([t1, t2])` a matrix with a column for each time.

`times` and `states` (a column for each) of the element boundaries, `steps`, `control_stages`, the `active` modes of the
elements (a column for each), `stage_times` (n_s, n_elements), `stage_states` (nx, n_s, n_elements), `stage_theta`
(modes, n_s, n_elements), `n_modes` of the subsystems, `switches`.
"""
mutable struct Trajectory <: AnyTrajectory
    address::Ptr{Lib.swb_trajectory}
    uses::Int
    nx::Int
    times::Vector{Float64}
    states::Matrix{Float64}
    steps::Vector{Float64}
    control_stages::Vector{Int}
    active::Matrix{Bool}
    stage_times::Matrix{Float64}
    stage_states::Array{Float64,3}
    stage_theta::Array{Float64,3}
    n_modes::Vector{Int}
    switches::Vector{NamedTuple}
    names::Vector{String} # of the states
end

function Trajectory(get, object, names = String[])
    empty3 = zeros(0, 0, 0)
    s = owned(Trajectory(created(AnyTrajectory, get, object), 0, 0, [], zeros(0, 0), [], [], falses(0, 0), zeros(0, 0), empty3, empty3, [], [], names))
    info = record(Lib.swb_trajectory_info, Lib.swb_trajectory_get_info, s)
    n, n_s, nx, modes = info.n_elements, info.n_s, info.nx, info.n_modes
    nodes = n > 0 ? n + 1 : 0
    s.nx = nx
    s.times = numbers(Float64, nodes, Lib.swb_trajectory_times, s)
    s.states = reshape(numbers(Float64, nodes * nx, Lib.swb_trajectory_states, s), Int(nx), :)
    s.steps = numbers(Float64, n, Lib.swb_trajectory_steps, s)
    s.control_stages = numbers(Int64, n, Lib.swb_trajectory_control_stages, s) .+ 1
    s.n_modes = numbers(Int64, info.n_subsystems, Lib.swb_trajectory_modes, s)
    s.active = reshape(numbers(Int32, n * modes, Lib.swb_trajectory_active, s) .!= 0, Int(modes), Int(n))
    s.stage_times = reshape(numbers(Float64, n * n_s, Lib.swb_trajectory_stage_times, s), Int(n_s), Int(n))
    s.stage_states = reshape(numbers(Float64, n * n_s * nx, Lib.swb_trajectory_stage_states, s), Int(nx), Int(n_s), Int(n))
    s.stage_theta = reshape(numbers(Float64, n * n_s * modes, Lib.swb_trajectory_stage_theta, s), Int(modes), Int(n_s), Int(n))
    found = records(Lib.swb_switch, info.n_switches, Lib.swb_trajectory_switches, s)
    s.switches = [element_switch(s, w) for w in found]
    return s
end

function element_switch(s, w)
    flags = active_modes(s, Int(w.subsystem) + 1)
    modes(element) = 1 <= element <= size(flags, 2) ? findall(flags[:, element]) : Int[]
    return (t = w.t, element = Int(w.element) + 1, subsystem = Int(w.subsystem) + 1,
            kind = symbol(Lib.NAMES_swb_switch_kind, w.kind), before = modes(w.element), after = modes(w.element + 1))
end

function active_modes(s::Trajectory, subsystem = 1)
    k = index(subsystem, length(s.n_modes), "subsystem") + 1
    first_ = sum(s.n_modes[1:k-1])
    return s.active[first_+1:first_+s.n_modes[k], :]
end

(s::Trajectory)(t::Real) = vec(s([number(t, "t")]))
function (s::Trajectory)(t::AbstractVector)
    times = vec(reals(t, "t"))
    out = Matrix{Float64}(undef, s.nx, length(times))
    check(Lib.swb_trajectory_state_at(s, times, length(times), out, length(out)))
    return out
end

Base.length(s::Trajectory) = length(s.steps)
switch_times(s::Trajectory) = Float64[w.t for w in s.switches]
Base.show(io::IO, s::Trajectory) = isempty(s.steps) ? print(io, "Trajectory, empty") :
    print(io, "Trajectory from ", s.times[1], " to ", s.times[end], ", ", length(s), " elements, ", length(s.switches), " switches")

# --- simulation by finite elements --------------------------------------------------------------------

"""
    Simulator(system; on_iteration, on_log, options...)

Simulator of a `System` or `Model` by the finite elements that optimal control problems have: `set_state!`, `set_controls!`,
`set_params!`, `run!`, `step!`; `time`, `state`, `trajectory`. For accurate trajectories `simulate` is faster.
"""
mutable struct Simulator <: AnySimulator
    address::Ptr{Lib.swb_simulator}
    uses::Int
    nx::Int
    nu::Int
    np::Int
    names::NTuple{3,Vector{String}}
    iteration::Monitor
    log::Monitor
end

function Simulator(system; settings = nothing, on_iteration = nothing, on_log = nothing, options...)
    s = system_of(system)
    values = chosen_settings(settings, options, Simulator)
    address = created(AnySimulator, Lib.swb_simulator_create, s, raw(values))
    return watched(Simulator(address, 0, sizes(s)..., s.names, Monitor(nothing), Monitor(nothing)), on_iteration, on_log)
end

function watched(object, on_iteration, on_log)
    owned(object)
    on_iteration!(object, on_iteration)
    on_log === nothing || on_log!(object, on_log)
    return object
end

"""
    set_state!(simulator, x, t = 0.0)

Set state and time, and begin a new trajectory.
"""
function set_state!(s::Simulator, x, t = 0.0)
    values = named_vector(x, s.names[1], "x")
    check(Lib.swb_simulator_set_state(s, number(t, "t"), values, length(values)))
    return s
end
set_controls!(s::Simulator, u) = give(Lib.swb_simulator_set_controls, s, named_vector(u, s.names[2], "u"))
set_params!(s::Simulator, p) = give(Lib.swb_simulator_set_params, s, named_vector(p, s.names[3], "p"))

solve_outcome(number) = symbol(Lib.NAMES_swb_outcome, number)

"""
    run!(simulator, duration, n_steps)

Simulate in equal steps of `n_fe` finite elements each, from where the last call ended. The outcome, `:solved` or that of
the step that failed.
"""
function run!(s::Simulator, duration, n_steps)
    outcome_, span, n = Ref(Int32(0)), number(duration, "duration"), integer(n_steps, "n_steps")
    using_object(() -> Lib.swb_simulator_run(s, span, n, outcome_), s)
    return solve_outcome(outcome_[])
end
function step!(s::Simulator, h)
    outcome_, span = Ref(Int32(0)), number(h, "h")
    using_object(() -> Lib.swb_simulator_step(s, span, outcome_), s)
    return solve_outcome(outcome_[])
end

"""
    clear!(simulator)

Forget trajectory and statistics; time and state stay.
"""
clear!(s::Simulator) = (check(Lib.swb_simulator_clear(s)); s)

Base.time(s::Simulator) = value(Float64, Lib.swb_simulator_get_time, s)
state(s::Simulator) = numbers(Float64, s.nx, Lib.swb_simulator_get_state, s)

"""
    trajectory(simulator)

A copy of the trajectory since the state was set.
"""
trajectory(s::Simulator) = Trajectory(Lib.swb_simulator_get_trajectory, s, s.names[1])

Base.show(io::IO, s::Simulator) = isopen(s) ? print(io, "Simulator at t = ", time(s)) : print(io, "Simulator, closed")

"""
Result of `simulate_fesd`: outcome, time, state, trajectory, residuals, stats, and the controls, a column for each step, which
last from `control_times` on.
"""
struct FesdSolution
    outcome::Symbol
    time::Float64
    state::Vector{Float64}
    trajectory::Trajectory
    residuals::NamedTuple
    stats::NamedTuple
    controls::Matrix{Float64}
    control_times::Vector{Float64}
end
successful(r::FesdSolution) = r.outcome === :solved
Base.show(io::IO, r::FesdSolution) = print(io, "FesdSolution at t = ", r.time, ", ", r.outcome, ", ", length(r.trajectory.switches), " switches")

"""
    simulate_fesd(system, x0, duration, n_steps; t0 = 0.0, u, p, options...) -> FesdSolution

Simulate from `x0` over a duration in equal steps of finite elements, by the equations an optimal control problem has. `u`
are constant controls, or a matrix with a column for each step. Look at `successful(result)`.
"""
function simulate_fesd(system, x0, duration, n_steps; t0 = 0.0, u = nothing, p = nothing, keywords...)
    sim = Simulator(system; keywords...)
    span, n = number(duration, "duration"), integer(n_steps, "n_steps")
    set_state!(sim, x0, t0)
    (p === nothing && sim.np == 0) || set_params!(sim, p)
    if u isa AbstractMatrix
        controls = matrix_of(u, sim.nu, n, "u")
        times = collect(t0 .+ span / n .* (0:n))
        outcome_ = :solved
        for k in 1:n
            set_controls!(sim, controls[:, k])
            outcome_ = step!(sim, span / n)
            outcome_ === :solved || break
        end
    else
        (u === nothing && sim.nu == 0) || set_controls!(sim, u)
        controls = u === nothing ? zeros(0, 1) : reshape(named_vector(u, sim.names[2], "u"), :, 1)
        times = [t0, t0 + span]
        outcome_ = run!(sim, span, n)
    end
    return FesdSolution(outcome_, time(sim), state(sim), trajectory(sim), residuals(sim), stats(sim), copy(controls), times)
end
