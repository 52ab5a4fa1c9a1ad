# Transitions of models: guards with resets, discrete states, hysteresis, automata.

"A transition: expressions, and values of discrete states by their places from 0. The guard is a value or a condition."
struct Transition
    guard::Union{Expression,Condition}
    falling::Bool
    from::Vector{Pair{Int64,Float64}}
    reset::Vector{Pair{Int64,Expression}}
    to::Vector{Pair{Int64,Float64}}
    name::String
    effect::Int32
    trigger::Int32
end

const JUMP, NOTE, STOP = Int32(Lib.SWB_EFFECT_JUMP), Int32(Lib.SWB_EFFECT_NOTE), Int32(Lib.SWB_EFFECT_STOP)
const LEVEL, EDGE = Int32(Lib.SWB_TRIGGER_LEVEL), Int32(Lib.SWB_TRIGGER_EDGE)

"Add a transition to a model of the library."
add_to(made::Built, graph::Graph, t::Transition) = add_to(Lib.swb_model_add_event, made, graph, t)
function add_to(add::F, made, graph::Graph, t::Transition) where {F}
    places(list) = Int64[first(d) for d in list]
    values_(list) = Float64[last(d) for d in list]
    resets = ids_in(graph, last.(t.reset))
    guard, n = t.guard isa Condition ? t.guard.id : only(ids_in(graph, [t.guard])), length
    check(add(made, graph, t.name, t.effect, t.trigger, guard, t.falling ? Lib.SWB_DIRECTION_FALLING : Lib.SWB_DIRECTION_RISING,
        places(t.from), n(t.from), values_(t.from), n(t.from), places(t.reset), n(t.reset), resets, n(resets), places(t.to), n(t.to),
        values_(t.to), n(t.to), C_NULL))
    return nothing
end

"A transition of a model of the library, from 0."
function read_transition(made::Built, graph::Graph, k)
    n = integers(3, Lib.swb_model_transition_sizes, made, k)
    places = [Vector{Int64}(undef, i) for i in n]
    from, ids, to = Vector{Float64}(undef, n[1]), Vector{Int64}(undef, n[2]), Vector{Float64}(undef, n[3])
    guard, direction = Ref(Int64(0)), Ref(Int32(0))
    check(Lib.swb_model_get_transition(made, k, guard, direction, places[1], n[1], from, n[1], places[2], n[2], ids, n[2],
        places[3], n[3], to, n[3]))
    resets = Pair{Int64,Expression}[s => in_graph(graph, id) for (s, id) in zip(places[2], ids)]
    effect, trigger = Ref(Int32(0)), Ref(Int32(0))
    name = text(Lib.swb_model_get_rule, made, k, effect, trigger)
    return Transition(in_graph(graph, guard[]), direction[] == Int32(Lib.SWB_DIRECTION_FALLING), places[1] .=> from, resets, places[3] .=> to,
                      name, effect[], trigger[])
end

"""
    discrete!(model, name = ""; initial = 0)

Add a discrete state and return it: only transitions change it. It is the last state; where an initial state is given without
the discrete ones, they begin with `initial`.
"""
function discrete!(m::Model, name = ""; initial = 0)
    value, given = only(finite([number(initial, "initial")], "initial")), plain(name, "the name of a discrete state")
    isempty(given) || !any(block -> given in block, m.names) || mistake(:range, "the model has a variable $given already")
    push!(m.names[1], given)
    push!(m.x, only(inputs(m.graph, Lib.SWB_INPUT_X, length(m.x), 1)))
    push!(m.rhs, Expression(0.0))
    push!(m.discrete, value)
    m.built = nothing
    return m.x[end]
end

"""
    discrete!(scene, name = ""; initial = 0)

Add a discrete state to a scene and return it, as for a model. It stands behind all other states; a start may leave it out.
"""
function discrete!(s::Scene, name = ""; initial = 0)
    value, given = only(finite([number(initial, "initial")], "initial")), plain(name, "the name of a discrete state")
    isempty(given) || !any(block -> given in block, s.names) || mistake(:range, "the scene has a variable $given already")
    place = Ref(Int64(0))
    s.current = false
    check(Lib.swb_scene_add_discrete(s, given, value, place))
    push!(s.names[3], given)
    push!(s.x, only(inputs(s.graph, Lib.SWB_INPUT_X, place[], 1)))
    push!(s.states, s.x[end])
    push!(s.discrete, value)
    return s.x[end]
end

"What is given by pairs, in a list, a dictionary or as names."
function pairs_in(given, what)
    given === nothing && return []
    given isa Pair && return [given]
    given isa Union{NamedTuple,AbstractDict} && return collect(pairs(given))
    given isa Union{Tuple,AbstractVector} && all(e -> e isa Pair, given) ||
        mistake(:range, "$what must be pairs, state => value, not $(repr(given))")
    return collect(given)
end

discrete_values(m, given, what) = Pair{Int64,Float64}[state_place(m, k) - 1 => number(v, "$what: $k") for (k, v) in pairs_in(given, what)]

"What is positive where a comparison holds, joined comparisons as they are, or an expression itself."
function guard_of(m::Union{Model,Scene}, guard)
    e = guard isa Condition && guard.margin !== nothing ? guard.margin : guard
    e isa Condition || e isa Expression && !isnumber(e) || mistake(:range, "a guard is a comparison of expressions, such as v > 15, not $(repr(guard))")
    e.graph === m.graph || mistake(:range, "the guard is made of variables of another model")
    return e
end

"""
    transition!(model, guard; when = nothing, reset = nothing, to = nothing, name = "", edge = false)

Add a jump of the state, for event-driven simulation, and return its number.

`guard` is a comparison, such as `v > 15`, comparisons joined by `&`, `|` and `!`, or an expression; the jump happens where the
condition becomes true, or the expression positive. `when` are discrete states and the values they must have for that, `reset` are
states and what they become, expressions of the state before, which may switch and round (`floor`), `to` discrete states and the
values they get: pairs such as `heat => 1`, several in a list or a dictionary. A guard that holds when its discrete states begin,
at the start, too, acts at once; with `edge = true` it has to be false before. Of several at one time the first that was added
comes first. `name` is that of its times in `t_events`.
"""
transition!(m::Union{Model,Scene}, guard; edge = false, keywords...) =
    add_transition(m, guard_of(m, guard); trigger = edge ? EDGE : LEVEL, keywords...)

"""
    stop_at!(model, guard; when = nothing, name = "")

End runs where a condition becomes true, or an expression positive, and return the number of the event. A condition that is true at
the start has to be false first. `stopped_by` of a solution says which event ended it. Derivatives of the last state include that of
the time of the end.
"""
stop_at!(m::Union{Model,Scene}, guard; when = nothing, name = "") =
    add_transition(m, guard_of(m, guard); when = when, name = name, effect = STOP, trigger = EDGE)

"""
    note!(model, guard; when = nothing, name = "")

Note where a condition becomes true, or an expression positive, and return the number of the event. Times and states are in
`t_events` and `u_events` of a solution. No step ends for that. A condition that is true at the start has to be false first.
"""
note!(m::Union{Model,Scene}, guard; when = nothing, name = "") =
    add_transition(m, guard_of(m, guard); when = when, name = name, effect = NOTE, trigger = EDGE)

"The names of the events of a model or of a scene."
event_names(m::Model) = String[t.name for t in m.transitions]
event_names(s::Scene) = s.events

"A transition of what pairs say."
function stated_transition(m, guard, when, reset, to, name, effect, trigger)
    after = Pair{Int64,Expression}[]
    for (k, v) in pairs_in(reset, "reset")
        v isa Real || mistake(:range, "reset: $k becomes one expression, not $(typeof(v))")
        push!(after, state_place(m, k) - 1 => Expression(v))
    end
    given = plain(name, "the name of an event")
    isempty(given) || !(given in event_names(m)) || mistake(:range, "there is an event $given already: give this one another name")
    t = Transition(guard, false, discrete_values(m, when, "when"), after, discrete_values(m, to, "to"), given, effect, trigger)
    effect == JUMP && isempty(t.reset) && isempty(t.to) && mistake(:state, "the transition changes nothing: give a reset, or discrete states `to`")
    for (what, list) in (("when", t.from), ("reset", t.reset), ("to", t.to))
        allunique(first.(list)) || mistake(:range, "$what names a state twice")
    end
    ids_in(m.graph, last.(t.reset)) # refuses those of other models
    return t
end

function add_transition(m::Model, guard; when = nothing, reset = nothing, to = nothing, name = "", effect = JUMP, trigger = LEVEL)
    push!(m.transitions, stated_transition(m, guard, when, reset, to, name, effect, trigger))
    m.built = nothing
    return length(m.transitions)
end

function add_transition(s::Scene, guard; when = nothing, reset = nothing, to = nothing, name = "", effect = JUMP, trigger = LEVEL)
    t = stated_transition(s, guard, when, reset, to, name, effect, trigger)
    s.current = false
    add_to(Lib.swb_scene_add_event, s, s.graph, t)
    push!(s.events, t.name)
    return length(s.events)
end

"""
    every!(model, period; reset = nothing, to = nothing, offset = 0, name = "")

A clock of a model or a scene: a transition at the times `offset`, `offset + period`, and so on, to the last digit. `reset` and `to` are those of
`transition!`: a value that is sampled, a controller. Returns the number of times it has struck, a new discrete state called `name`.
"""
function every!(m::Union{Model,Scene}, period; reset = nothing, to = nothing, offset = 0, name = "")
    by, first_ = finite([number(period, "period"), number(offset, "offset")], "period and offset")
    by > 0 || mistake(:range, "period is $by: it must be positive")
    given = [pairs_in(reset, "reset"); pairs_in(to, "to")] # refuses what is none before anything is added
    isempty(given) || foreach(k -> state_place(m, first(k)), given)
    count_ = discrete!(m, name)
    transition!(m, m.t > first_ + by * count_; reset = [count_ => count_ + 1; pairs_in(reset, "reset")], to = to)
    return count_
end

"""
    pwm!(model, duty, period; offset = 0, name = "")

Pulse-width modulation of a model or a scene: 1 from the times `offset`, `offset + period`, and so on, until a part `duty` of the period is over,
then 0. `duty` is a number or an expression. Returns a new discrete state called `name`; another one counts the periods.
"""
function pwm!(m::Union{Model,Scene}, duty, period; offset = 0, name = "")
    duty isa Real || mistake(:range, "duty is $(repr(duty)): give a number or an expression")
    duty isa Expression || 0 <= duty <= 1 || mistake(:range, "duty is $duty: it must be between 0 and 1")
    by, first_ = finite([number(period, "period"), number(offset, "offset")], "period and offset")
    by > 0 || mistake(:range, "period is $by: it must be positive")
    pulse = discrete!(m, name)
    count_ = every!(m, by; to = pulse => 1, offset = first_)
    transition!(m, m.t - first_ - by * (count_ - 1) > by * duty; when = pulse => 1, to = pulse => 0)
    return pulse
end

"""
    choice!(model, control, values; dwell = 0)

Say that a control, an expression `model.u[1]`, its name or its number from 1, chooses among values: on or off, a gear. An optimal control
problem searches the best value for every control stage. Each value that is chosen holds for the time `dwell` at least; the value at the start may
be left at any time, and the end of the horizon may cut the last one short. Simulations take any value of the control.
"""
function choice!(m::Model, control, values; dwell = 0)
    push!(m.choices, (control_place(m, control), Float64.(collect(values)), Float64(dwell)))
    m.built = nothing
    return nothing
end

control_place(m::Model, control::Integer) = Int64(control) - 1
function control_place(m::Model, control)
    same(i) = control isa Expression ? m.u[i].id == control.id : (!isempty(m.names[2][i]) && m.names[2][i] == String(control))
    places = findall(same, eachindex(m.u))
    length(places) == 1 || mistake(:range, "choice: $(repr(control)) is no control of the model")
    return Int64(only(places)) - 1
end

"""
    hysteresis!(model, value; on, off, initial = 0, name = "")

A discrete value that becomes 1 where `value` exceeds `on`, and 0 where it falls below `off`, which is smaller. For a heater,
which goes on below a threshold, negate all three. The thresholds may be expressions.
"""
function hysteresis!(m::Model, value; on, off, initial = 0, name = "")
    initial in (0, 1) || mistake(:range, "initial is $initial: the value is 0 or 1")
    on isa Expression || off isa Expression || number(off, "off") < number(on, "on") ||
        mistake(:range, "on is $on and off is $off: off must be smaller; for what goes on below a threshold negate value, on and off")
    high, low = guard_of(m, Expression(value) - on), guard_of(m, off - Expression(value))
    w = discrete!(m, name; initial = initial)
    add_transition(m, high; when = w => 0, to = w => 1)
    add_transition(m, low; when = w => 1, to = w => 0)
    return w
end

"""
    Automaton(model; states, initial = the first, name = "")

A discrete state of a model with named values, and edges between them (`edge!`), for event-driven simulation. `states` are the
names, `(:idle, :heat)` or "idle heat". `is_in` and `choose` make expressions of it, `intervals` reads the states of a
solution. `automaton.state` is the discrete state; it counts from 0. Documents keep the names.

    Automaton(model, state)

The automaton of a discrete state, given by itself or by its name, of a model that came from a document. Its edges are the
transitions of the model that lead from one of its states to another.
"""
struct Automaton
    model::Model
    states::Vector{Symbol}
    state::Expression
    name::String
    edges::Vector{NamedTuple{(:source, :target, :transition),Tuple{Symbol,Symbol,Int}}}
    known::Dict{Any,Symbol}
end

function Automaton(m::Model; states, initial = nothing, name = "")
    states isa Integer && mistake(:range, "states must be the names of the states of the automaton, not their number")
    names = Symbol.(variable_names(states, "states"))
    length(names) >= 2 || mistake(:dimension, "an automaton has two states at least, not $(length(names))")
    allunique(names) || mistake(:range, "two states of the automaton have one name: $(join(names, ", "))")
    start = initial === nothing ? 0 : location(names, initial, "initial")
    state = discrete!(m, name; initial = start)
    m.value_names[length(m.x)] = names
    return Automaton(m, names, state, isempty(String(name)) ? string(state) : String(name), [], Dict())
end

function Automaton(m::Model, state)
    place = state_place(m, state)
    haskey(m.value_names, place) || mistake(:range, "$state has no named values: the model has automata of ",
                                            join((named_text(m, m.x[k]) for k in sort!(collect(keys(m.value_names)))), ", "))
    names = m.value_names[place]
    a = Automaton(m, names, m.x[place], named_text(m, m.x[place]), [], Dict())
    value_of(list) = (k = findfirst(d -> first(d) == place - 1, list); k === nothing ? nothing : Int(last(list[k])))
    for (k, t) in enumerate(m.transitions)
        source, target = value_of(t.from), value_of(t.to)
        (source === nothing || target === nothing) && continue
        others = sort!([first(d) + 1 => last(d) for d in t.from if first(d) != place - 1]; by = first)
        a.known[(source, t.guard.id, others)] = names[target+1]
        push!(a.edges, (source = names[source+1], target = names[target+1], transition = k))
    end
    return a
end

"The value of a state, from 0."
function location(names, state, what)
    k = state isa Union{Symbol,AbstractString} ? findfirst(==(Symbol(state)), names) : nothing
    k === nothing && mistake(:range, "$what: the automaton has no state $(repr(state)), its states are $(join(names, ", "))")
    return k - 1
end

function locations(a::Automaton, states, what)
    many = states isa Union{Tuple,AbstractVector} ? states : (states,)
    isempty(many) && mistake(:range, "$what is an empty list: name a state")
    return sort!(unique([location(a.states, s, what) for s in many]))
end

"Places of discrete states, from 1, and the values they may have."
function asked_of(m::Model, given)
    asked = Pair{Int,Vector{Float64}}[]
    for (k, v) in pairs_in(given, "given")
        place = state_place(m, k isa Automaton ? k.state : k)
        values_ = k isa Automaton ? locations(k, v, "given") : [number(x, "given: $k") for x in (v isa Union{Tuple,AbstractVector} ? v : (v,))]
        isempty(values_) && mistake(:range, "given: $(named_text(m, m.x[place])) may have no value")
        any(d -> first(d) == place, asked) && mistake(:range, "given: $(named_text(m, m.x[place])) is there twice")
        push!(asked, place => Float64.(values_))
    end
    return asked
end

"""
    edge!(automaton, source => target, guard = nothing; given = nothing, reset = nothing, to = nothing)

Add an edge from `source`, a state, a list of states, or `nothing` for all but the target; return the numbers of its
transitions. It is passed where the guard, a comparison such as `v > 15`, becomes true, or at once where it is true when a
source begins. `given` asks for states of others: pairs such as `driver => :drives`, or `heat => 1`, also of a list. Without a
guard the edge is passed as soon as they are so. `reset` and `to` are those of `transition!`.
"""
function edge!(a::Automaton, ends::Pair, guard = nothing; given = nothing, reset = nothing, to = nothing)
    m = a.model
    goal = location(a.states, last(ends), "target")
    sources = first(ends) === nothing ? [k for k in 0:length(a.states)-1 if k != goal] : locations(a, first(ends), "source")
    asked, own = asked_of(m, given), state_place(m, a.state)
    any(d -> first(d) == own, asked) && mistake(:range, "$(a.name): given asks for a state of the automaton itself, which is what the source does")
    guard === nothing && isempty(asked) &&
        mistake(:range, "the edge to $(last(ends)) has no condition: say where it is passed by a comparison, or by given")
    condition = guard === nothing ? in_graph(m.graph, id_in(m.graph, Expression(1.0))) : guard_of(m, guard)
    goals = pairs_in(to, "to")
    any(d -> state_place(m, first(d)) == own, [pairs_in(reset, "reset"); goals]) &&
        mistake(:range, "reset and to are for other states: the target of the edge is $(last(ends)) already")
    goal in sources && isempty(pairs_in(reset, "reset")) && isempty(goals) &&
        mistake(:range, "an edge from $(last(ends)) to itself changes nothing: give a reset")
    combined = vec([[place => v for (place, v) in zip(first.(asked), values_)] for values_ in Iterators.product(last.(asked)...)])
    key(k, others) = (k, condition.id, sort(others; by = first))
    for k in sources, others in combined
        haskey(a.known, key(k, others)) && mistake(:range, "there is an edge with this condition from $(a.states[k+1]) to ",
                                                    "$(a.known[key(k, others)]) already: only that would be passed")
    end
    made = Int[]
    for k in sources, others in combined
        before = [[m.x[place] => v for (place, v) in others]; a.state => k]
        push!(made, add_transition(m, condition; when = before, reset = reset, to = [goals; a.state => goal]))
        a.known[key(k, others)] = a.states[goal+1]
        push!(a.edges, (source = a.states[k+1], target = a.states[goal+1], transition = made[end]))
    end
    return made
end

"""
    is_in(automaton, states...)

An expression that is exactly 1 in these states and 0 in all others: a table of steps between the states, which is nothing
that switches, and whose derivative is zero.
"""
function is_in(a::Automaton, states...)
    wanted = locations(a, states, "is_in")
    return steps_of(a, [k in wanted ? 1.0 : 0.0 for k in 0:length(a.states)-1])
end

function steps_of(a::Automaton, values_)
    changes = findall(!iszero, diff(values_))
    isempty(changes) && return in_graph(a.model.graph, id_in(a.model.graph, Expression(values_[1])))
    return table(a.state, changes .- 0.5, [values_[1]; values_[changes.+1]]; kind = :steps)
end

"""
    choose(automaton, :idle => 0.0, :heat => 5.0; otherwise = nothing)

An expression with a value for each state, numbers or expressions. Expressions are all evaluated and multiplied by 1 or 0, so
each must be defined in all states.
"""
function choose(a::Automaton, pairs_::Pair...; otherwise = nothing)
    named_ = Dict(location(a.states, s, "choose") => v for (s, v) in pairs_)
    missing_ = [a.states[k+1] for k in 0:length(a.states)-1 if !haskey(named_, k)]
    isempty(missing_) || otherwise !== nothing || mistake(:range, "choose has no value for $(join(missing_, ", ")): give it, or otherwise")
    values_ = [get(named_, k, otherwise) for k in 0:length(a.states)-1]
    all(v -> v isa Real, values_) || mistake(:range, "choose: values must be numbers or expressions")
    any(v -> v isa Expression && !isnumber(v), values_) || return steps_of(a, [Float64(v) for v in values_])
    return sum(v * is_in(a, s) for (s, v) in zip(a.states, values_))
end

"""
    intervals(solution, state)

The values of a discrete state in their order, with their times: NamedTuples (start, stop, value). `state` is an `Automaton`,
whose values are its states, or a discrete state by its name or number. Values it had for no time are left out.
"""
function intervals(s::Solution, state)
    place = state isa Automaton ? state_place(state.model, state.state) : place_of(state, s.system.names[1], "states")
    1 <= place <= s.system.nx || mistake(:dimension, "there is no state $place, the system has $(s.system.nx)")
    s.stats.jumps == length(s.jumps) ||
        mistake(:state, "the run made $(s.stats.jumps) transitions and noted $(length(s.jumps)): raise max_switches")
    start, value_ = s.t_start, isempty(s.jumps) ? s.u[end][place] : s.jumps[1].before[place]
    found = NamedTuple{(:start, :stop, :value),Tuple{Float64,Float64,Float64}}[]
    add(stop, last_) = if !isempty(found) && found[end].value == value_
        found[end] = (start = found[end].start, stop = stop, value = value_)
    elseif stop > start || last_
        push!(found, (start = start, stop = stop, value = value_))
    end
    for j in s.jumps
        j.after[place] == value_ && continue
        add(j.t, false)
        start, value_ = j.t, j.after[place]
    end
    add(s.t_end, true)
    state isa Automaton || return found
    all(i -> i.value in 0:length(state.states)-1, found) ||
        mistake(:range, "$(state.name) has values that are none of its states: does the solution belong to another model?")
    return [(start = i.start, stop = i.stop, value = state.states[Int(i.value)+1]) for i in found]
end

Base.show(io::IO, a::Automaton) = print(io, "Automaton ", a.name, " of ", join(a.states, ", "), "; ", length(a.edges), " edges")
