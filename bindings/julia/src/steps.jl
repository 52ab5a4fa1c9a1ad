# Time stepping of scenes with many contacts.

"""
    Stepper(scene, h = 1e-3; theta = 0.5, tolerance = 1e-8, max_iterations = 1000, law = nothing, correct = true,
            look_at_all = false)

Makes steps of a scene by the theta-method of Moreau and Jean: impacts are not located, any number of them may fall into a
step, and the error is of order 1 in `h`. `set_params!`, `set_controls!`, `set_state!`, then `step!(stepper)`,
`advance!(stepper, t)`, `run!(stepper, t)`; `time`, `state`, `impulses`, `stats`.

- `h`: length of a step; `theta`: where in a step functions are evaluated, 1/2 in its middle, 1 at its start
- `tolerance`: impulses of a step are found to this share of them
- `max_iterations`: sweeps over the contacts and steps of conjugate gradients in a step at most; a step that needs more goes on
  with the impulses it has and is counted in `stats(stepper).unconverged`
- `law`: `:newton` or `:sequential`; by default that of the scene
- `correct`: shift back what came to rest too deep
- `look_at_all`: look at all contacts in every step: the result is the same to the last bit, for checks

Forces are taken at the start of a step, so `h` must resolve springs (shorter than 2/omega) and dampers. Ctrl-C is heard when
the call is over.
"""
mutable struct Stepper <: AnyStepper
    address::Ptr{Lib.swb_stepper}
    uses::Int
    system::System
end

function Stepper(scene, h = 1e-3; theta = 0.5, tolerance = 1e-8, max_iterations = 1000, law = nothing, correct = true,
                 look_at_all = false)
    system = system_of(scene)
    options = Lib.swb_step_options(
        sizeof(Lib.swb_step_options), number(h, "h"), number(theta, "theta"), number(tolerance, "tolerance"),
        integer(max_iterations, "max_iterations"), law === nothing ? -1 : enum_number(Lib.NAMES_swb_impact_law, law, "law"),
        Bool(correct), Bool(look_at_all))
    return owned(Stepper(created(AnyStepper, Lib.swb_stepper_create, system, Ref(options)), 0, system))
end

"""
    set_state!(stepper, x, t = 0.0)

Set the state, coordinates and then velocities, and the time, and forget impulses and statistics. Set the parameters first.
"""
function set_state!(s::Stepper, x, t = 0.0)
    values_, at = named_vector(x, s.system.names[1], "x"), number(t, "t")
    using_object(() -> Lib.swb_stepper_set_state(s, at, values_, length(values_)), s)
    return s
end
set_controls!(s::Stepper, u) = give(Lib.swb_stepper_set_controls, s, named_vector(u, s.system.names[2], "u"))
set_params!(s::Stepper, p) = give(Lib.swb_stepper_set_params, s, named_vector(p, s.system.names[3], "p"))

"""
    step!(stepper)

Make one step of length h.
"""
step!(s::Stepper) = (using_object(() -> Lib.swb_stepper_step(s), s); s)

"""
    advance!(stepper, t)

Make equal steps, not longer than h, that end at time `t`.
"""
function advance!(s::Stepper, t)
    stop = number(t, "t")
    using_object(() -> Lib.swb_stepper_advance(s, stop), s)
    return s
end

"""
States after steps.

- `t`: times, the first is the start
- `x`: states, coordinates and then velocities, a column for each time; `q`, `v`: the two parts of it, where they are known
- `impulses`: (3, contacts, times), of the steps that end at these times: normal, then along the tangents there are; nothing if
  they were not asked for
- `names`: names of the contacts, in the order of the impulses
- `stats`: what it cost and how it went, a NamedTuple, see `stats(stepper)`
"""
struct Steps
    t::Vector{Float64}
    x::Matrix{Float64}
    q::Matrix{Float64}
    v::Matrix{Float64}
    impulses::Union{Nothing,Array{Float64,3}}
    names::Vector{String}
    stats::NamedTuple
end
Base.length(s::Steps) = length(s.t)
Base.show(io::IO, s::Steps) = print(io, "Steps from ", s.t[1], " to ", s.t[end], ", ", s.stats.steps, " steps, ", length(s), " states kept")

"""
    run!(stepper, t; every = 1, impulses = false) -> Steps

Make equal steps, not longer than h, that end at time `t`, and keep the state after `every` of them, and the last.
"""
function run!(s::Stepper, t; every = 1, impulses = false)
    stop, each, wanted = number(t, "t"), integer(every, "every"), Bool(impulses)
    n, nx, contacts = value(Int64, Lib.swb_stepper_count, s, stop, each), s.system.nx, s.system.contacts
    times, states = Vector{Float64}(undef, n), Matrix{Float64}(undef, nx, n)
    kept = wanted ? Array{Float64}(undef, 3, length(contacts), n) : nothing
    using_object(s) do
        Lib.swb_stepper_run(s, stop, each, times, n, states, length(states), wanted ? kept : C_NULL, wanted ? length(kept) : 0)
    end
    n_q = length(s.system.scene.q)
    return Steps(times, states, states[1:n_q, :], states[n_q+1:end, :], kept, first.(contacts), stats(s))
end

Base.time(s::Stepper) = value(Float64, Lib.swb_stepper_get_time, s)
state(s::Stepper) = numbers(Float64, s.system.nx, Lib.swb_stepper_get_state, s)

"""
    impulses(stepper)

Impulses of the last step, not forces: (3, contacts), normal, then along the tangents there are.
"""
impulses(s::Stepper) = reshape(numbers(Float64, 3length(s.system.contacts), Lib.swb_stepper_get_impulses, s), 3, :)

function stats(s::Stepper)
    found = named(record(Lib.swb_step_stats, Lib.swb_stepper_get_stats, s))
    return merge(found, (deepest = found.deepest < 0 ? nothing : Int(found.deepest) + 1,))
end

interrupt!(s::Stepper) = (check(Lib.swb_stepper_interrupt(s)); nothing)
Base.show(io::IO, s::Stepper) = isopen(s) ? print(io, "Stepper at t = ", time(s)) : print(io, "Stepper, closed")

"""
    simulate_steps(scene, q0, v0, tspan; h = 1e-3, u, p, every = 1, impulses = false, options...) -> Steps

Simulate a `Scene` with many contacts by time stepping, from coordinates `q0` and velocities `v0` over `tspan`: (start, end), or
the end alone. The state is kept after `every` steps, with the impulses if asked for. `u` are constant controls, `p`
parameters; for further options see `Stepper`. The error is of order 1 in `h`; look at `stats.penetration` and compare two
steps. For accurate simulation of a few contacts use `simulate`.
"""
function simulate_steps(scene, q0, v0, tspan; h = 1e-3, u = nothing, p = nothing, every = 1, impulses = false, options...)
    scene isa Scene || mistake(:range, "simulate_steps takes a Scene, not $(typeof(scene)): a Stepper takes systems of scenes too")
    start, stop = time_span(tspan)
    x0 = state_of(scene, q0, v0)
    s = Stepper(scene, h; options...)
    (p === nothing && s.system.np == 0) || set_params!(s, p)
    (u === nothing && s.system.nu == 0) || set_controls!(s, u)
    set_state!(s, x0, start)
    result_ = run!(s, stop; every = every, impulses = impulses)
    close(s)
    return result_
end
