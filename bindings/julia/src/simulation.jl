# Event-driven simulation: every switch located, sliding modes as the equations they are.

const RETCODES = Dict(:reached => :Success, :max_steps => :MaxIters, :step_too_small => :DtLessThanMin, :stopped => :Terminated, :event => :Terminated)

"""
Result of `simulate`. Call it for states at any times: `sol(t)` is a vector, `sol([t1, t2])` a matrix with a column for each
time, `sol(t; order = 1)` derivatives with respect to time.

- `t`, `u`: starts and ends of the steps, and the states there (vectors); without `dense` the end only. `sol[i, k]` is state i
  at `t[k]`, `sol[:q]` the state named q, `Array(sol)` the matrix of all
- `switches`: in the order of time, NamedTuples with `t`, `kind` (`:cross`, `:enter` a sliding mode, `:leave` it,
  `:spontaneous`), `subsystem`, the active modes `before` and `after`, `simultaneous`, `unique`, `rate` and `transversality`
- `jumps`: the transitions in the order of time, NamedTuples with `t`, `transition`, the states `before` and `after`,
  `simultaneous` and `rate`; `intervals` has the values of discrete states with their times
- `notes`: what `note!` wrote down, NamedTuples with `t`, the number `event`, the state `u` and `rate`; `note_derivatives` are the
  derivatives of their times
- `t_events(sol)`, `u_events(sol)`: times of every event, and the states just before, by name: `t_events(sol)[:landed]`
- `stopped_by`: the event that ended the run, by its name, else its number; nothing if none did
- `impacts`: of a scene, in the order of time, one for every contact with an impulse, NamedTuples with `t`, `contact` and its
  `name`, `kind` (`:collision`, `:last` of accumulating ones, `:painleve`: without collision), `rate_before` and `rate_after` of
  the gap, the impulses `normal` and `tangential`, `depth` (how far the bodies would overlap without it: small where the contact
  is grazing), `simultaneous` and `unique`; `redundant` if contacts were redundant: the motion is unique, the forces are those of
  least norm. See also `contact_force` and `contact_mode`
- `retcode`: `:Success`, `:MaxIters`, `:DtLessThanMin`, `:Terminated` or `:Failure`; `outcome` is the library's own word for
  it, `reason` says it in words; of a run that reached its time it says what is not known to the tolerances
- `dx_dx0`, `dx_dp`, `dx_du`: derivatives of the state reached, and `switch_derivatives`, `jump_derivatives` and `impact_derivatives`, a
  row of derivatives with respect to all of these for the time of each switch, each transition and each impact; nothing without `sensitivity`, and no `dx_dx0` nor its columns with `:inputs`. `one_sided` if they hold for one side only
- `branch_points`, `contacts`, `accumulations`: points with several continuations, surfaces only touched, points at which
  switches accumulate
- `n_modes`: numbers of modes of the subsystems that can switch; `stats`: the work
"""
mutable struct Solution <: AnyRun
    address::Ptr{Lib.swb_run}
    uses::Int
    system::System
    t::Vector{Float64}
    u::Vector{Vector{Float64}}
    outcome::Symbol
    retcode::Symbol
    reason::String
    switches::Vector{NamedTuple}
    jumps::Vector{NamedTuple}
    notes::Vector{NamedTuple}
    stopped_by::Union{Nothing,Symbol,Int}
    impacts::Vector{NamedTuple}
    n_modes::Vector{Int}
    dx_dx0::Union{Nothing,Matrix{Float64}}
    dx_dp::Union{Nothing,Matrix{Float64}}
    dx_du::Union{Nothing,Matrix{Float64}}
    switch_derivatives::Union{Nothing,Matrix{Float64}}
    jump_derivatives::Union{Nothing,Matrix{Float64}}
    note_derivatives::Union{Nothing,Matrix{Float64}}
    impact_derivatives::Union{Nothing,Matrix{Float64}}
    one_sided::Bool
    redundant::Bool
    branch_points::Vector{NamedTuple}
    contacts::Vector{NamedTuple}
    accumulations::Vector{NamedTuple}
    stats::NamedTuple
    t_start::Float64
    t_end::Float64
    unswitched::Vector{Vector{Int}} # active modes of subsystems that never switch, where they are known
end

const NOT_KNOWN = Vector{Int}[]

"The result that the library handed out, read."
function Solution(address::Ptr{Lib.swb_run}, system::System)
    s = owned(Solution(address, 0, system, Float64[], [], :none, :none, "", [], [], [], nothing, [], Int[], nothing, nothing, nothing, nothing, nothing,
                       nothing, nothing, false, false, [], [], [], NamedTuple(), 0.0, 0.0, NOT_KNOWN))
    info = record(Lib.swb_run_info, Lib.swb_run_get_info, s)
    s.outcome = symbol(Lib.NAMES_swb_run_outcome, info.outcome)
    s.retcode = get(RETCODES, s.outcome, :Failure)
    s.t_start, s.t_end, s.one_sided = info.t_start, info.t_end, info.one_sided != 0
    s.redundant = info.redundant != 0
    s.reason = own_words(text(Lib.swb_run_reason, s))
    s.stats = named(record(Lib.swb_run_stats, Lib.swb_run_get_stats, s))
    s.n_modes = numbers(Int64, info.n_subsystems, Lib.swb_run_modes, s)
    events = records(Lib.swb_event, info.n_events, Lib.swb_run_events, s)
    s.switches = NamedTuple[switch_of(s, k, e) for (k, e) in enumerate(events)]
    s.jumps = NamedTuple[jump_of(s, k, j, info.nx) for (k, j) in enumerate(records(Lib.swb_jump, info.n_jumps, Lib.swb_run_jumps, s))]
    noted = records(Lib.swb_note, info.n_notes, Lib.swb_run_notes, s)
    s.notes = NamedTuple[(t = c.t, event = Int(c.transition) + 1, u = numbers(Float64, info.nx, Lib.swb_run_note_state, s, k - 1), rate = c.rate)
                         for (k, c) in enumerate(noted)]
    s.stopped_by = info.stopped_by < 0 ? nothing : event_name(system, Int(info.stopped_by) + 1)
    s.impacts = NamedTuple[impact_of(system, i) for i in records(Lib.swb_impact, info.n_impacts, Lib.swb_run_impacts, s)]
    points = records(Lib.swb_branch_point, info.n_branch_points, Lib.swb_run_branch_points, s)
    s.branch_points = [(t = b.t, n_continuations = b.n_continuations, taken = b.taken < 0 ? nothing : b.taken + 1) for b in points]
    touched = records(Lib.swb_contact, info.n_contacts, Lib.swb_run_contacts, s)
    s.contacts = [merge(named(c), (subsystem = c.subsystem + 1,)) for c in touched]
    s.accumulations = named.(records(Lib.swb_accumulation, info.n_accumulations,
                                     Lib.swb_run_accumulations, s))
    if info.n_pieces > 0
        s.t = numbers(Float64, info.n_pieces + 1, Lib.swb_run_times, s)
        x = s(s.t)
        s.u = [copyto!(Vector{Float64}(undef, info.nx), 1, x, (k - 1) * info.nx + 1, info.nx) for k in axes(x, 2)]
    else
        s.t = [s.t_end]
        s.u = [numbers(Float64, info.nx, Lib.swb_run_state, s)]
    end
    info.n_columns > 0 && read_derivatives!(s, info)
    return s
end

function switch_of(s, k, e)
    n = s.n_modes[e.subsystem+1]
    before, after = n <= 64 ? (set_bits(e.before), set_bits(e.after)) : many_modes(s, k, n)
    return (t = e.t, kind = symbol(Lib.NAMES_swb_event_kind, e.kind), subsystem = Int(e.subsystem) + 1, before = before, after = after,
            simultaneous = e.simultaneous != 0, unique = e.unique != 0, rate = e.rate, transversality = e.transversality)
end

function jump_of(s, k, j, nx)
    before, after = Vector{Float64}(undef, nx), Vector{Float64}(undef, nx)
    check(Lib.swb_run_jump_states(s, k - 1, before, after, nx))
    return (t = j.t, transition = Int(j.transition) + 1, before = before, after = after, simultaneous = j.simultaneous != 0, rate = j.rate)
end

"The name of an event, from 1; its number where it has none, or the names are not known."
event_name(system, k) = k <= length(system.events) && !isempty(system.events[k]) ? Symbol(system.events[k]) : k

function by_event(s, of_jump, of_note)
    s.stats.jumps == length(s.jumps) && s.stats.notes == length(s.notes) ||
        mistake(:state, "the run has more events than its lists: raise max_switches")
    n = maximum([length(s.system.events); [j.transition for j in s.jumps]; [c.event for c in s.notes]])
    found = Dict{Union{Symbol,Int},Any}(event_name(s.system, k) => [] for k in 1:n)
    foreach(j -> push!(found[event_name(s.system, j.transition)], of_jump(j)), s.jumps)
    foreach(c -> push!(found[event_name(s.system, c.event)], of_note(c)), s.notes)
    return found
end

"""
    t_events(solution)

Times of every event, transitions, notes and ends, by name, or by number where it has none: `t_events(sol)[:landed]`.
"""
t_events(s::Solution) = Dict(k => Float64[v...] for (k, v) in by_event(s, j -> j.t, c -> c.t))

"""
    u_events(solution)

States at the times of `t_events`, just before what happens there, a matrix with a column for each time.
"""
u_events(s::Solution) = Dict(k => reshape(reduce(vcat, v; init = Float64[]), s.system.nx, :) for (k, v) in by_event(s, j -> j.before, c -> c.u))

"Places of the bits that are set, from 1."
function set_bits(mask::UInt64)
    out = Int[]
    while mask != 0
        push!(out, trailing_zeros(mask) + 1)
        mask &= mask - 1
    end
    return out
end

function many_modes(s, k, n)
    before, after = zeros(Int32, n), zeros(Int32, n)
    check(Lib.swb_run_event_modes(s, k - 1, before, after, n))
    return findall(!iszero, before), findall(!iszero, after)
end

function read_derivatives!(s, info)
    nx, np, n = s.system.nx, s.system.np, info.n_columns
    n0 = n - np - s.system.nu
    all_ = Matrix{Float64}(undef, nx, n)
    check(Lib.swb_run_sensitivity(s, all_, length(all_)))
    s.dx_dx0 = n0 == 0 ? nothing : all_[:, 1:n0]
    s.dx_dp, s.dx_du = all_[:, n0+1:n0+np], all_[:, n0+np+1:end]
    rows(get, count_) = permutedims(reshape(reduce(vcat, (numbers(Float64, n, get, s, k - 1) for k in 1:count_); init = Float64[]), Int(n), :))
    s.switch_derivatives = rows(Lib.swb_run_event_sensitivity, info.n_events)
    s.jump_derivatives = rows(Lib.swb_run_jump_sensitivity, info.n_jumps)
    s.note_derivatives = rows(Lib.swb_run_note_sensitivity, info.n_notes)
    s.impact_derivatives = rows(Lib.swb_run_impact_sensitivity, info.n_impacts)
end

(s::Solution)(t::Real; order = 0) = vec(s([number(t, "t")]; order = order))
function (s::Solution)(t::AbstractVector; order = 0)
    times = vec(reals(t, "t"))
    out = Matrix{Float64}(undef, s.system.nx, length(times))
    check(Lib.swb_run_evaluate(s, times, length(times), integer(order, "order"), out, length(out)))
    return out
end

Base.Array(s::Solution) = reduce(hcat, s.u)
Base.Matrix(s::Solution) = Array(s)
Base.size(s::Solution) = (s.system.nx, length(s.t))
Base.length(s::Solution) = length(s.t)
Base.getindex(s::Solution, k::Integer) = s.u[k]
Base.getindex(s::Solution, i, k) = Array(s)[i, k]
function Base.getindex(s::Solution, name::Union{Symbol,AbstractString})
    i = place_of(name, s.system.names[1], "states")
    return [x[i] for x in s.u]
end
Base.lastindex(s::Solution) = length(s)
Base.lastindex(s::Solution, d) = size(s)[d]
Base.firstindex(::Solution) = 1
Base.iterate(s::Solution, k = 1) = k > length(s) ? nothing : ((s.t[k], s.u[k]), k + 1)

"""
    successful(result)

Did a simulation reach its end; was a problem solved?
"""
successful(s::Solution) = s.outcome === :reached

"""
    switch_times(solution)

Times of the switches.
"""
switch_times(s::Solution) = Float64[e.t for e in s.switches]

"""
    active_modes(solution, subsystem = 1)

Intervals between the switches of a subsystem as tuples (start, end, active modes). Those of a subsystem that never switches
are not known of a run of a batch. Of an `Integrator` the modes that are active now.
"""
function active_modes(s::Solution, subsystem = 1)
    k = index(subsystem, length(s.n_modes), "subsystem") + 1
    own = [e for e in s.switches if e.subsystem == k]
    if isempty(own)
        constant = k <= length(s.unswitched) ? s.unswitched[k] : Int[]
        return isempty(constant) || s.t_end <= s.t_start ? Tuple{Float64,Float64,Vector{Int}}[] : [(s.t_start, s.t_end, constant)]
    end
    starts, ends = [s.t_start; [e.t for e in own]], [[e.t for e in own]; s.t_end]
    modes = [[own[1].before]; [e.after for e in own]]
    return [(a, b, m) for (a, b, m) in zip(starts, ends, modes) if b > a]
end

function Base.show(io::IO, s::Solution)
    isopen(s) || return print(io, "Solution, closed")
    print(io, "Solution from ", s.t_start, " to ", s.t_end, ", ", s.outcome, ", ", length(s.switches), " switches")
    for (list, word) in ((s.jumps, " transitions"), (s.impacts, " impacts"))
        isempty(list) || print(io, ", ", length(list), word)
    end
end

set_text(modes) = string("{", join(modes, ", "), "}")

"Switches, transitions and impacts in the order of time, to be shown: time, kind, whose, before, after, notes."
function events_shown(s::Solution)
    names = state_labels(s.system.names[1], s.system.nx)
    rows = NamedTuple[]
    for e in s.switches
        notes = (e.simultaneous ? "  simultaneous" : "") * (e.unique ? "" : "  not unique")
        push!(rows, (t = e.t, kind = e.kind, whose = "subsystem $(e.subsystem)", before = set_text(e.before), after = set_text(e.after), notes = notes))
    end
    for j in s.jumps
        changed = findall(j.before .!= j.after)
        states(x) = join((string(names[i], " = ", x[i]) for i in changed), ", ")
        push!(rows, (t = j.t, kind = :transition, whose = "number $(j.transition)", before = states(j.before), after = states(j.after), notes = ""))
    end
    for i in s.impacts
        push!(rows, (t = i.t, kind = :impact, whose = i.name, before = "rate $(i.rate_before)", after = "rate $(i.rate_after)", notes = ""))
    end
    return sort!(rows; by = row -> row.t, alg = MergeSort) # stable
end

function Base.show(io::IO, ::MIME"text/plain", s::Solution)
    show(io, s)
    isempty(s.reason) || print(io, "\n  ", s.reason)
    print(io, "\n  end: ", s.u[end])
    rows = events_shown(s)
    for (k, e) in enumerate(rows)
        k == 21 && (print(io, "\n  ... ", length(rows) - 20, " more"); break)
        print(io, "\n  t = ", e.t, "  ", e.kind, "  ", e.whose, "  ", e.before, " -> ", e.after, e.notes)
    end
end
function Base.show(io::IO, ::MIME"text/html", s::Solution)
    print(io, "<table><caption>", s.outcome, " at t = ", s.t_end, isempty(s.reason) ? "" : ": " * escaped(s.reason), "</caption><tr><th>t</th><th>kind</th><th></th>",
          "<th>before</th><th>after</th></tr>")
    for e in events_shown(s)
        print(io, "<tr><td>", e.t, "</td><td>", e.kind, "</td><td>", escaped(e.whose), "</td><td>", escaped(e.before), "</td><td>",
              escaped(e.after), "</td></tr>")
    end
    print(io, "</table>")
end

# --- step by step -------------------------------------------------------------------------------------

"""
    Integrator(system; reltol, abstol, method, preferred, on_step, on_branching, on_log, options...)

Event-driven integrator of a `System`, `Model` or `Scene`, step by step: `reinit!`, `step!`, `advance!`, `set_controls!`,
`set_params!`, `set_stop_times!`; `time`, `state`, `derivative`, `state_at`, `active_modes`, `solution`, `adjoint`. `reltol` and
`abstol` are one number, or one for each state; `method` is `:auto`, `:dp5`, `:dop853` or `:radau5`.
"""
mutable struct Integrator <: AnyIntegrator
    address::Ptr{Lib.swb_integrator}
    uses::Int
    system::System
    n_modes::Vector{Int} # see subsystem_modes
    progress::Monitor
    decider::Monitor
    log::Monitor
end

Integrator(system; keywords...) = Integrator(system_of(system), given(keywords))

function Integrator(s::System, options::Given, keywords = INTEGRATOR_KEYWORDS)
    preferred, on_step = pop!(options, :preferred, nothing), pop!(options, :on_step, nothing)
    on_branching, on_log = pop!(options, :on_branching, nothing), pop!(options, :on_log, nothing)
    values, tolerances = simulation_options(options, keywords)
    address = created(AnyIntegrator, Lib.swb_integrator_create, s, raw(values))
    i = owned(Integrator(address, 0, s, Int[], Monitor(nothing), Monitor(nothing), Monitor(nothing)))
    tolerances === nothing || set_tolerances!(i, tolerances...)
    for (subsystem, modes) in pairs_of(preferred)
        set_preferred!(i, subsystem, modes)
    end
    preferred === nothing || set!(i; ambiguity = :prefer)
    on_step!(i, on_step)
    on_branching === nothing || on_branching!(i, on_branching)
    on_log === nothing || on_log!(i, on_log)
    return i
end

"Numbers of modes of the subsystems that can switch, asked for once."
function subsystem_modes(i::Integrator)
    isempty(i.n_modes) && (i.n_modes = solution(i).n_modes)
    return i.n_modes
end

pairs_of(::Nothing) = ()
pairs_of(p::Pair) = (p,)
pairs_of(p) = p isa AbstractDict || (p isa Union{Tuple,AbstractVector} && all(e -> e isa Pair, p)) ? p :
    mistake(:range, "preferred must be pairs subsystem => modes, not $(repr(p))")

# keywords besides the options of the library
const INTEGRATOR_KEYWORDS = (:preferred, :on_step, :on_branching, :on_log, :settings)
const SIMULATE_KEYWORDS = (:u, :p, :stop_times, :verbose, INTEGRATOR_KEYWORDS...)
const BATCH_KEYWORDS = (:u, :p, :threads, :settings)

"Settings, and tolerances state by state if there are any."
function simulation_options(options::Given, keywords)
    settings = pop!(options, :settings, nothing)
    reltol, abstol = pop!(options, :reltol, nothing), pop!(options, :abstol, nothing)
    each = reltol isa AbstractVector || abstol isa AbstractVector
    values = chosen_settings(settings, options, keywords)
    if !each
        reltol === nothing || (values.rtol = reltol)
        abstol === nothing || (values.atol = abstol)
        return values, nothing
    end
    return values, (something(reltol, values.rtol), something(abstol, values.atol))
end

"""
    set_tolerances!(integrator, reltol, abstol)

Tolerances of the local error, one number or one for each state.
"""
function set_tolerances!(i::Integrator, reltol, abstol)
    r, a = vec(reals(reltol, "reltol")), vec(reals(abstol, "abstol"))
    check(Lib.swb_integrator_set_tolerances(i, r, length(r), a, length(a)))
    return i
end

"""
    set_preferred!(integrator, subsystem, modes)

The modes a subsystem should take where the continuation is not unique, the preferred first, for `ambiguity = :prefer`.
"""
function set_preferred!(i::Integrator, subsystem, modes)
    k = index(subsystem, length(subsystem_modes(i)), "subsystem")
    list = Int64[index(m, i.n_modes[k+1], "modes") for m in modes]
    check(Lib.swb_integrator_set_preferred(i, k, list, length(list)))
    return i
end

"""
    on_step!(integrator, f)

Set who is called with a NamedTuple (t, x, kind, steps, switches) once per accepted step; the answer `true` stops.
"""
function on_step!(i::Integrator, f)
    set_monitor((p, d) -> Lib.swb_integrator_set_progress(i, p, d), i.progress, PROGRESS, f, "on_step")
    return i
end

"""
    on_branching!(integrator, f)

Set who is called where the continuation is not unique, with a NamedTuple: t, x, the active modes of every subsystem `before`
and in every continuation, `active[continuation][subsystem]`, and the `velocity`, a column for each continuation. It returns
the number of the continuation to take, or `nothing` to stop.
"""
function on_branching!(i::Integrator, f)
    callable(f, "on_branching")
    i.decider.f = (f, subsystem_modes(i))
    check(Lib.swb_integrator_set_decider(i, f === nothing ? C_NULL : DECIDE[], pointer_from_objref(i.decider)))
    return i
end

"""
    reinit!(integrator, x, t = 0.0)

Set state and time, and begin anew: switches, statistics, derivatives and dense output are cleared.
"""
function reinit!(i::Integrator, x, t = 0.0)
    start = start_of(i.system, x)
    using_object(() -> Lib.swb_integrator_reinit(i, number(t, "t"), start, length(start)), i)
    return i
end

"""
    set_controls!(object, u)

Set the controls of an `Integrator` or `Simulator`, constant from now on.
"""
set_controls!(i::Integrator, u) = give(Lib.swb_integrator_set_controls, i, named_vector(u, i.system.names[2], "u"))

"""
    set_params!(object, p)

Set the parameters.
"""
set_params!(i::Integrator, p) = give(Lib.swb_integrator_set_params, i, named_vector(p, i.system.names[3], "p"))

"""
    set_stop_times!(integrator, t)

Times at which steps end, in any order: for functions of time that are not smooth there, and for output.
"""
set_stop_times!(i::Integrator, t) = give(Lib.swb_integrator_set_stop_times, i, vec(reals(t, "stop times")))

"""
    step!(object, t_stop)

One step of an `Integrator`, not beyond `t_stop` nor a stop time: `:stepped`, `:switched`, `:done` or `:stop_time`. Of a
`Simulator` one step of finite elements over the duration that is given; the outcome.
"""
function step!(i::Integrator, t_stop)
    kind, stop = Ref(Int32(0)), number(t_stop, "t_stop")
    using_object(() -> Lib.swb_integrator_step(i, stop, kind), i)
    return symbol(Lib.NAMES_swb_progress_kind, kind[])
end

"""
    advance!(integrator, t)

Integrate to the time `t`, exactly. The outcome, `:reached` or why it ended early (`reason`).
"""
function advance!(i::Integrator, t)
    outcome_, stop = Ref(Int32(0)), number(t, "t")
    using_object(() -> Lib.swb_integrator_advance(i, stop, outcome_), i)
    return symbol(Lib.NAMES_swb_run_outcome, outcome_[])
end

"""
    state_at(integrator, t; order = 0)

State, or its derivative of an order, at a time in the last step.
"""
function state_at(i::Integrator, t; order = 0)
    out, at, k = Vector{Float64}(undef, i.system.nx), number(t, "t"), integer(order, "order")
    using_object(() -> Lib.swb_integrator_get_dky(i, at, k, out, length(out)), i)
    return out
end

Base.time(i::Integrator) = value(Float64, Lib.swb_integrator_get_time, i)

"""
    state(object)

State reached.
"""
state(i::Integrator) = numbers(Float64, i.system.nx, Lib.swb_integrator_get_state, i)

"""
    derivative(integrator)

Derivative of the state with respect to time under the present active modes.
"""
derivative(i::Integrator) = numbers(Float64, i.system.nx, Lib.swb_integrator_get_derivative, i)

function active_modes(i::Integrator, subsystem = 1)
    k = index(subsystem, length(subsystem_modes(i)), "subsystem")
    return findall(!iszero, numbers(Int32, i.n_modes[k+1], Lib.swb_integrator_get_active, i, k))
end

"""
    outcome(object)

How the last call ended, a Symbol.
"""
outcome(i::Integrator) = symbol(Lib.NAMES_swb_run_outcome, value(Int32, Lib.swb_integrator_get_outcome, i))

"""
    reason(integrator)

Why a simulation ended early, in words.
"""
reason(i::Integrator) = own_words(text(Lib.swb_integrator_get_reason, i))

"""
    stats(object)

Work of the last call, a NamedTuple.
"""
stats(i::Integrator) = named(record(Lib.swb_run_stats, Lib.swb_integrator_get_stats, i))

"""
    solution(integrator)

A copy of the result since the last `reinit!`, a `Solution`.
"""
function solution(i::Integrator)
    address = created(AnyRun, Lib.swb_integrator_get_run, i)
    s = Solution(address, i.system)
    switched = falses(length(s.n_modes))
    foreach(e -> switched[e.subsystem] = true, s.switches)
    if !all(switched)
        s.unswitched = [switched[k] ? Int[] : findall(!iszero, numbers(Int32, n, Lib.swb_integrator_get_active, i, k - 1))
                        for (k, n) in enumerate(s.n_modes)]
    end
    return s
end

"""
    adjoint(integrator, v; at = [], switches = [])

Gradient of a function of the run with respect to initial state, parameters and controls, with the option
`adjoint = :on`: `v` is its derivative with respect to the state reached, `at` has pairs `t => derivative` for times where
the run had stopped, `switches` pairs `number => derivative` for switching times. A NamedTuple (x0, p, u).
"""
function Base.adjoint(i::Integrator, v; at = (), switches = ())
    s = i.system
    final = vector(v, s.nx, "v")
    times = Float64[number(t, "at") for (t, _) in at]
    states = isempty(times) ? Float64[] : reduce(vcat, [vector(w, s.nx, "at") for (_, w) in at])
    events = Int64[integer(k, "switches") - 1 for (k, _) in switches]
    weights = Float64[number(w, "switches") for (_, w) in switches]
    g = (x0 = zeros(s.nx), p = zeros(s.np), u = zeros(s.nu))
    using_object(i) do
        Lib.swb_integrator_adjoint(i, final, length(final), times, length(times), states, length(states), events, length(events),
                                   weights, length(weights), g.x0, s.nx, g.p, s.np, g.u, s.nu)
    end
    return g
end

Base.show(io::IO, i::Integrator) = isopen(i) ? print(io, "Integrator at t = ", time(i)) : print(io, "Integrator, closed")

# --- all at once --------------------------------------------------------------------------------------

function time_span(t)
    ends = t isa Real ? (0.0, t) : t
    ends isa Union{Tuple,AbstractVector} && length(ends) == 2 || mistake(:dimension, "tspan must be the end, or (start, end)")
    start, stop = (number(e, "tspan") for e in ends)
    isfinite(start) && isfinite(stop) || mistake(:range, "tspan must be finite, not ($start, $stop)")
    start <= stop || mistake(:range, "tspan is $start to $stop: the end must not lie before the start")
    return start, stop
end

"""
    simulate(system, x0, tspan; u, p, reltol = 1e-8, abstol = 1e-10, sensitivity = false, ...) -> Solution

Simulate a `System`, `Model`, `Scene` or `Projected` system from `x0` over `tspan`: (start, end), or the end alone. States, parameters and controls of
models with names may be given by name: `p = (k = 2.0,)`.

- `u`: constant controls, or a matrix with a column for each of several equal pieces of the time span; `p`: parameters
- `reltol`, `abstol`: one number, or one for each state; `method`: `:auto`, `:dp5`, `:dop853`, `:radau5`
- `sensitivity = true`: derivatives with respect to initial state, parameters and controls; `:inputs`: to parameters and controls only
- `dense = false`: no states in between; `stop_times`: times at which steps end
- `on_branching`, `preferred`, `ambiguity`: what to do where the continuation is not unique (see `on_branching!`,
  `set_preferred!`)
- `on_step`, `on_log`, `settings`, and every option of the library (`options()`), such as `h_max`, `max_steps`, `zeno`

A simulation may end early: look at `successful(sol)` or `sol.retcode`. A warning says why, unless it was asked to stop;
`verbose = false` silences it.
"""
simulate(system, x0, tspan; keywords...) = simulate(system_of(system), x0, tspan, given(keywords))

function simulate(s::System, @nospecialize(x0), @nospecialize(tspan), options::Given)
    start, stop = time_span(tspan)
    u, p, stop_times = pop!(options, :u, nothing), pop!(options, :p, nothing), pop!(options, :stop_times, nothing)
    verbose = pop!(options, :verbose, true)
    get!(options, :dense, true)
    i = Integrator(s, options, SIMULATE_KEYWORDS)
    (p === nothing && s.np == 0) || set_params!(i, p)
    pieces = control_pieces(u, s)
    stop_times === nothing || set_stop_times!(i, stop_times)
    reinit!(i, x0, start)
    n = size(pieces, 2)
    for k in 1:n
        s.nu > 0 && set_controls!(i, pieces[:, k])
        advance!(i, k == n ? stop : start + (stop - start) * k / n) === :reached || break
    end
    sol = solution(i)
    close(i)
    # `:stopped` by on_step and `:zeno` by the option of that name were asked for
    verbose === false || sol.outcome in (:reached, :stopped, :zeno) ||
        @warn "the simulation ended at t = $(sol.t_end), before $stop ($(sol.outcome)): $(sol.reason)"
    return sol
end

"Controls of pieces of time, a column for each."
function control_pieces(u, s::System)
    u === nothing && s.nu == 0 && return zeros(0, 1)
    u isa AbstractMatrix || return reshape(named_vector(u, s.names[2], "u"), :, 1)
    size(u, 2) > 0 || mistake(:dimension, "u has no columns")
    return matrix_of(u, s.nu, nothing, "u")
end

# --- many ---------------------------------------------------------------------------------------------

"""
Results of `simulate_batch`: `x` are the final states, a column for each run, NaN where it failed; `success`; `batch[k]` is a
`Solution`, or throws what the run failed with.
"""
mutable struct Batch <: AnyBatch
    address::Ptr{Lib.swb_batch}
    uses::Int
    system::System
    x::Matrix{Float64}
    success::Vector{Bool}
end

"How many threads may be used; 1 where functions of Julia are called."
function thread_count(threads, serial)
    n = threads === nothing ? (serial ? 1 : 0) : integer(threads, "threads")
    serial && n != 1 && mistake(:unsupported, "functions written in Julia can be called by one thread only: leave `threads` out, ",
                                "or write the model as expressions (Model), which many threads can evaluate")
    return n
end

"""
    simulate_batch(system, x0, tspan; u, p, threads, reltol, abstol, dense = false, sensitivity = false, ...) -> Batch

Simulate from every column of `x0` on several `threads` (0: one for each processor). `u` and `p` are one vector for all
runs, or a matrix with a column for each. The results are those of single runs to the last bit, whatever the number of
threads. Functions written in Julia are called by one thread, which is the default for systems that have them.
"""
function simulate_batch(system, x0, tspan; u = nothing, p = nothing, threads = nothing, keywords...)
    s = system_of(system)
    smooth = s.nx - length(s.discrete)
    starts = x0 isa AbstractMatrix && !isempty(s.discrete) && size(x0, 1) == smooth ?
        [matrix_of(x0, smooth, nothing, "x0"); repeat(s.discrete, 1, size(x0, 2))] : matrix_of(x0, s.nx, nothing, "x0")
    n = size(starts, 2)
    n > 0 || mistake(:dimension, "x0 has no columns")
    inputs(v, names, what) = v isa AbstractMatrix ? matrix_of(v, length(names), n, what) :
        v === nothing && isempty(names) ? Float64[] : named_vector(v, names, what)
    controls, params = inputs(u, s.names[2], "u"), inputs(p, s.names[3], "p")
    options = given(keywords)
    get!(options, :dense, false)
    values, each = simulation_options(options, BATCH_KEYWORDS)
    each === nothing || mistake(:range, "a batch takes one reltol and one abstol for all states")
    start, stop = time_span(tspan)
    count_ = thread_count(threads, s.serial)
    address = created(AnyBatch, Lib.swb_batch_create, s, raw(values))
    b = owned(Batch(address, 0, s, fill(NaN, s.nx, n), fill(false, n)))
    using_object(b) do
        Lib.swb_batch_run(b, start, stop, starts, length(starts), controls, length(controls), params, length(params), count_)
    end
    check(Lib.swb_batch_states(b, b.x, length(b.x)))
    b.success = numbers(Int32, n, Lib.swb_batch_outcomes, b) .== Lib.SWB_RUN_OUTCOME_REACHED
    return b
end

Base.length(b::Batch) = length(b.success)
Base.firstindex(::Batch) = 1
Base.lastindex(b::Batch) = length(b)
Base.iterate(b::Batch, k = 1) = k > length(b) ? nothing : (b[k], k + 1)
function Base.getindex(b::Batch, k::Integer)
    1 <= k <= length(b) || throw(BoundsError(b, k))
    return Solution(created(AnyRun, Lib.swb_batch_get_run, b, k - 1), b.system)
end
interrupt!(b::Batch) = check(Lib.swb_batch_interrupt(b))
Base.show(io::IO, b::Batch) = print(io, "Batch of ", length(b), " runs, ", count(b.success), " reached their end")
function Base.show(io::IO, ::MIME"text/plain", b::Batch)
    show(io, b)
    isopen(b) || return
    failed_ones = findall(!, b.success)
    for k in failed_ones[1:min(end, 5)]
        print(io, "\n  run ", k, ": ", try b[k].reason catch e; sprint(showerror, e) end)
    end
    length(failed_ones) > 5 && print(io, "\n  ... ", length(failed_ones) - 5, " more")
end
