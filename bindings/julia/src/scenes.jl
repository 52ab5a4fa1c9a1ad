# Scenes: mechanical systems with contacts, written as expressions; projected systems.

"""
A contact of a scene, as `contact!` returns it: for `contact_force` and `contact_mode`. Its `name`, its `gap` and its
`tangents`, expressions. A constraint of a projected system is one without tangents.
"""
struct SceneContact
    name::String
    gap::Expression
    tangents::Vector{Expression}
end

"""
    Scene(q; v = nothing, u = 0, p = 0, states = 0, name = "scene")

A mechanical system with contacts: q' = N(q) v, M(q) v' = force(q, v, u, p, t) + forces of the contacts, gaps not negative,
friction.

Coordinates `q`, velocities `v`, controls `u` and parameters `p` are given by names, `(:x, :y)` or "x y", or by their number;
without `v` there is a velocity for each coordinate, its rate. `s.q`, `s.v`, `s.u`, `s.p` are vectors of expressions, `s.x` is q
and then v, `s.t` is the time. `states` are states beside these, such as currents and temperatures, which end `s.x`; `state_rates!`
gives their rates, and simulations start from the whole state. `force!` completes the scene; `rates!`, `inertia!`, `contact!`, `set_bounds!`, `impact_law!`:

    s = Scene(:y; name = "ball")
    force!(s, [-9.81])
    contact!(s, "floor", s.q[1]; e = 0.8)
    sol = simulate(s, [1.0], [0.0], 3.0)
    sol.impacts
"""
mutable struct Scene <: AnyScene
    address::Ptr{Lib.swb_scene}
    uses::Int
    name::String
    names::NTuple{5,Vector{String}} # of coordinates, velocities, states beside them, controls, parameters
    graph::Graph
    x::Vector{Expression}
    q::Vector{Expression}
    v::Vector{Expression}
    states::Vector{Expression}
    u::Vector{Expression}
    p::Vector{Expression}
    t::Expression
    contacts::Vector{SceneContact}
    current::Bool # nothing was changed since it was built
    discrete::Vector{Float64} # values with which the last states begin
    events::Vector{String} # names of the transitions
end

"""
    Projected(x; u = 0, p = 0, name = "projected")

A projected system, or first-order sweeping process: x' = f(x, u, p, t) + the sum of gradient(c) times multiplier over all
constraints c(x, p, t) >= 0; multipliers are not negative, and zero where their constraint is positive.

A state is held inside of a set, that may move, by the least push; play between two parts is one. `derivatives!` gives f,
`constraint!` adds a constraint. Of a solution `contact_force` has the multipliers, and `contact_mode` is `:open` where a
constraint is not active and `:closed` where it is.

    m = Projected(:y; name = "play")
    input = sin(m.t)
    derivatives!(m, [0.0])
    constraint!(m, "upper", input - m.x[1] + 0.2)
    constraint!(m, "lower", m.x[1] - input + 0.2)
    sol = simulate(m, [0.0], 10.0)
"""
mutable struct Projected <: AnyScene
    address::Ptr{Lib.swb_scene}
    uses::Int
    name::String
    names::NTuple{3,Vector{String}} # of states, controls, parameters
    graph::Graph
    x::Vector{Expression}
    u::Vector{Expression}
    p::Vector{Expression}
    t::Expression
    contacts::Vector{SceneContact}
    current::Bool
end

joined(names) = join(Iterators.flatten(names), "\n")

function Scene(q; v = nothing, u = 0, p = 0, states = 0, name = "scene")
    qs = variable_names(q, "q")
    vs = v === nothing ? [isempty(n) ? "" : "v_$n" for n in qs] : variable_names(v, "v")
    zs = variable_names(states, "states")
    names, title = (qs, vs, zs, variable_names(u, "u"), variable_names(p, "p")), plain(name, "name")
    given = filter(!isempty, vcat(names...))
    allunique(given) || mistake(:range, "two variables of the scene have one name: $(join(given, ", "))")
    (isempty(qs) || isempty(vs)) && mistake(:dimension, "a scene needs at least one coordinate and one velocity")
    graph, n = Graph(), length.(names)
    behind = n[1] + n[2]
    x = inputs(graph, Lib.SWB_INPUT_X, 0, behind + n[3])
    address = created(AnyScene, Lib.swb_scene_create_with_states, title, n..., joined(names))
    return owned(Scene(address, 0, title, names, graph, x, x[1:n[1]], x[n[1]+1:behind], x[behind+1:end],
                       inputs(graph, Lib.SWB_INPUT_U, 0, n[4]), inputs(graph, Lib.SWB_INPUT_P, 0, n[5]), inputs(graph, Lib.SWB_INPUT_T, 0, 1)[1], [], false, [], []))
end

function Projected(x; u = 0, p = 0, name = "projected")
    names, title = (variable_names(x, "x"), variable_names(u, "u"), variable_names(p, "p")), plain(name, "name")
    given = filter(!isempty, vcat(names...))
    allunique(given) || mistake(:range, "two variables of the system have one name: $(join(given, ", "))")
    graph, n = Graph(), length.(names)
    address = created(AnyScene, Lib.swb_scene_create_projected, title, n..., joined(names))
    return owned(Projected(address, 0, title, names, graph, inputs(graph, Lib.SWB_INPUT_X, 0, n[1]),
                           inputs(graph, Lib.SWB_INPUT_U, 0, n[2]), inputs(graph, Lib.SWB_INPUT_P, 0, n[3]),
                           inputs(graph, Lib.SWB_INPUT_T, 0, 1)[1], [], false))
end

"Names of the states, controls and parameters."
state_names(s::Scene) = ([s.names[1]; s.names[2]; s.names[3]], s.names[4], s.names[5])
state_names(s::Projected) = s.names
sizes(s::AnyScene) = (length(s.x), length(s.u), length(s.p))

"Give expressions to a scene: `set(scene, graph, ids, n)` is the call."
function give_expressions(set::F, s::AnyScene, values_, n, what) where {F}
    listed = values_ isa Real ? [values_] : collect(values_)
    all(e -> e isa Real, listed) || mistake(:range, "$what must be numbers and expressions, not $(repr(listed))")
    length(listed) == n || mistake(:dimension, "$what has $(length(listed)) expressions, expected $n")
    ids = ids_in(s.graph, Expression[Expression(e) for e in vec(listed)])
    s.current = false
    check(set(s, s.graph, ids, length(ids)))
    return s
end

"""
    rates!(scene, values)

Set the rates of the coordinates, one for each, linear in the velocities; by default they are the velocities.
"""
rates!(s::Scene, values_) = give_expressions(Lib.swb_scene_set_rates, s, values_, length(s.q), "rates")

"""
    force!(scene, values)

Set the forces, one for every velocity: all that stands beside M v' but the forces of the contacts. They may switch.
"""
force!(s::Scene, values_) = give_expressions(Lib.swb_scene_set_force, s, values_, length(s.v), "force")

"""
    state_rates!(scene, values)

Set the rates of the states beside coordinates and velocities, one for each, expressions of states, controls, parameters and time,
which may switch.
"""
state_rates!(s::Scene, values_) =
    give_expressions(Lib.swb_scene_set_state_rates, s, values_, length(s.states) - length(s.discrete), "state_rates")

"""
    inertia!(scene, values)

Set the inertia: a number for every velocity (a diagonal), or a symmetric matrix; by default the unit matrix. It may depend on
coordinates, parameters and time; the terms that Lagrange's equations then put beside M v' belong to `force!`.
"""
function inertia!(s::Scene, values_)
    n = length(s.v)
    given = values_ isa Real ? [values_] : collect(values_)
    given isa AbstractVector && length(given) == n && all(e -> e isa Real, given) &&
        (given = Expression[i == j ? Expression(given[i]) : Expression(0.0) for i in 1:n, j in 1:n])
    size(given) == (n, n) || mistake(:dimension, "inertia has size $(size(given)), expected ($n,), a diagonal, or ($n, $n)")
    return give_expressions(Lib.swb_scene_set_inertia, s, permutedims(given), n * n, "inertia")
end

"""
    derivatives!(projected, f)

Set the derivatives of the states of a projected system without constraints, one for each. They may switch, for simulation by events.
"""
derivatives!(s::Projected, f) = give_expressions(Lib.swb_scene_set_force, s, f, length(s.x), "f")

"""
    contact!(scene, name, gap; tangents = (), mu = 0.0, e = 0.0, mu_s = nothing)

Add a contact and return it, a `SceneContact`.

`gap` is an expression of coordinates, parameters and time, positive where the bodies are apart. `tangents` are none (no
friction), one (in the plane) or two (in space): expressions whose rates are the sliding velocity, or which are its components,
linear in the velocities. `mu` and `e` are friction and restitution, numbers or expressions; `mu_s` is the coefficient by which
it sticks, where that is larger than `mu`. With friction, gap and tangents are lengths.
"""
function contact!(s::Scene, name, gap; tangents = (), mu = 0.0, e = 0.0, mu_s = nothing)
    title = plain(name, "the name of a contact")
    listed = tangents isa Real ? [tangents] : collect(tangents)
    for (what, v) in (("gap", gap), ("mu", mu), ("e", e), (("tangents", t) for t in listed)...)
        v isa Real || mistake(:range, "$what of contact $title must be an expression or a number, not $(repr(v))")
    end
    # friction that nothing slides along would be ignored
    isempty(listed) && ((mu isa Expression && !isnumber(mu)) || Float64(mu) > 0) &&
        mistake(:range, "contact $title has friction and no tangents: give one in the plane, two in space")
    mu_s === nothing || mu_s isa Real ||
        mistake(:range, "mu_s of contact $title must be an expression or a number, not $(repr(mu_s))")
    mu_s === nothing || !isempty(listed) || mistake(:range, "contact $title has no tangents: it cannot stick by mu_s")
    made = add_contact(s, title, gap, listed, mu, e)
    mu_s === nothing || give(s, Lib.swb_scene_set_stiction, length(s.contacts) - 1, mu_s)
    return made
end

"Give a part of a scene one expression more."
function give(s::AnyScene, set::F, place, value) where {F}
    s.current = false
    check(set(s, s.graph, place, only(ids_in(s.graph, [Expression(value)]))))
end

"""
    friction!(scene, name, sliding, bound; stiction = nothing)

Add dry friction at a joint and return it, a `SceneContact`: a force opposite to a sliding velocity with a bound that is given.

`sliding` is an expression of coordinates, parameters and time whose rate is the sliding velocity, or which is that velocity,
linear in the velocities. `bound` is an expression of states, controls, parameters and time, not negative: the force where it
slides. `stiction` is the bound where it sticks, not less than the other. The force is the second of `contact_force`.
"""
function friction!(s::Scene, name, sliding, bound; stiction = nothing)
    title = plain(name, "the name of friction")
    isempty(title) && mistake(:range, "the name of friction must not be empty")
    given = stiction === nothing ? Any[sliding, bound] : Any[sliding, bound, stiction]
    all(v -> v isa Real, given) || mistake(:range, "friction $title takes expressions and numbers, not $(repr(given))")
    ids = ids_in(s.graph, Expression[Expression(v) for v in given])
    s.current = false
    check(Lib.swb_scene_add_friction(s, s.graph, title, ids[1], ids[2], length(ids) > 2 ? ids[3] : Int64(-1), C_NULL))
    zero_gap = in_graph(s.graph, only(ids_in(s.graph, [Expression(0.0)])))
    made = SceneContact(title, zero_gap, [in_graph(s.graph, ids[1])])
    push!(s.contacts, made)
    return made
end

"""
    constraint!(scene, name, zero)

Add a constraint to a scene and return it, a `SceneContact`: a contact that never opens, with a force of either sign. `zero` is an
expression of coordinates, parameters and time, or one that is linear in the velocities. The state at the start must satisfy it.
"""
function constraint!(s::Scene, name, zero)
    title = plain(name, "the name of a constraint")
    isempty(title) && mistake(:range, "the name of a constraint must not be empty")
    zero isa Real || mistake(:range, "constraint $title must be an expression, not $(repr(zero))")
    id = only(ids_in(s.graph, [Expression(zero)]))
    s.current = false
    check(Lib.swb_scene_add_constraint(s, s.graph, title, id, C_NULL))
    made = SceneContact(title, in_graph(s.graph, id), Expression[])
    push!(s.contacts, made)
    return made
end

"""
    constraint!(projected, name, c)

Add a constraint c >= 0 to a projected system, an expression of states, parameters and time, and return it, a `SceneContact`.
"""
function constraint!(s::Projected, name, c)
    title = plain(name, "the name of a constraint")
    c isa Real || mistake(:range, "constraint $title must be an expression, not $(repr(c))")
    return add_contact(s, title, c, (), nothing, nothing)
end

function add_contact(s::AnyScene, title, gap, tangents, mu, e)
    isempty(title) && mistake(:range, "the name of a contact must not be empty")
    expressions = Expression[Expression(gap); Expression[Expression(t) for t in tangents]]
    ids = ids_in(s.graph, expressions)
    number_of(v) = v === nothing ? Int64(-1) : only(ids_in(s.graph, [Expression(v)]))
    s.current = false
    check(Lib.swb_scene_add_contact(s, s.graph, title, ids[1], ids[2:end], length(ids) - 1, number_of(mu), number_of(e), C_NULL))
    made = SceneContact(title, in_graph(s.graph, ids[1]), [in_graph(s.graph, id) for id in ids[2:end]])
    push!(s.contacts, made)
    return made
end

"""
    set_bounds!(scene, coordinate, low, high)

State that a coordinate, given by itself, its name or its number, stays between bounds: contacts that cannot close there are
left out (see `report`). A simulation that leaves the bounds ends with an error. `-Inf` and `Inf` say nothing about their side.
"""
function set_bounds!(s::Scene, coordinate, low, high)
    k = coordinate isa Expression ? findfirst(x -> isequal(x, coordinate), s.q) : place_of(coordinate, s.names[1], "coordinates")
    k === nothing && mistake(:range, "$coordinate is no coordinate of the scene")
    s.current = false
    check(Lib.swb_scene_set_bounds(s, k - 1, number(low, "low"), number(high, "high")))
    return s
end

"""
    impact_law!(scene, law)

What happens where several contacts close at once: `:newton` (all in one problem) or `:sequential` (one after the other, the
fastest first).
"""
function impact_law!(s::Scene, law)
    s.current = false
    check(Lib.swb_scene_set_impact_law(s, enum_number(Lib.NAMES_swb_impact_law, law, "law")))
    return s
end

function built(s::AnyScene)
    s.current || check(Lib.swb_scene_build(s, s.graph))
    s.current = true
    return s
end

"""
    report(scene)

What a scene consists of, what each contact costs, which were left out and why. `report(scene; json = true)` is the same as
JSON.
"""
report(s::AnyScene; json = false) = (made = built(s); text(Lib.swb_scene_report, made, json))

"""
    System(scene)

The system of a scene or a projected system, for event-driven simulation; simulations make it themselves.
"""
function System(s::AnyScene)
    discrete = s isa Scene ? copy(s.discrete) : Float64[]
    made = System(created(AnySystem, Lib.swb_scene_system, built(s)), 0, sizes(s)..., 0, s.graph.serial, map(copy, state_names(s)), discrete)
    s isa Scene && (made.events = copy(s.events))
    made.contacts = [(String(c["name"]), Int(c["tangents"])) for c in parse_json(report(s; json = true))["contacts"]]
    made.scene = s
    return owned(made)
end
system_of(s::AnyScene) = System(s)

ModelFunction(s::AnyScene, outputs; name = "f") =
    expression_function(s.graph, outputs, sizes(s), outputs isa Real ? 1 : length(outputs), name)

function state_of(s::Scene, q0, v0)
    n = length(s.states) - length(s.discrete)
    n == 0 || mistake(:dimension, "the scene has $n states beside q and v: give the whole state, simulate(scene, x0, tspan)")
    return [named_vector(q0, s.names[1], "q0"); named_vector(v0, s.names[2], "v0")]
end

"""
    simulate(scene, q0, v0, tspan; ...) -> Solution

Simulate a `Scene` from coordinates `q0` and velocities `v0`; the rest is that of `simulate(system, x0, tspan; ...)`.
"""
simulate(s::Scene, q0, v0, tspan; keywords...) = simulate(s, state_of(s, q0, v0), tspan; keywords...)

Base.show(io::IO, s::Scene) = isopen(s) ? print(io, "Scene '", s.name, "': ", length(s.q), " coordinates, ", length(s.v),
    " velocities, ", length(s.contacts), " contacts") : print(io, "Scene, closed")
Base.show(io::IO, s::Projected) = isopen(s) ? print(io, "Projected '", s.name, "': ", length(s.x), " states, ",
    length(s.contacts), " constraints") : print(io, "Projected, closed")

# --- results ------------------------------------------------------------------------------------------

function impact_of(system, i)
    name, n = system.contacts[i.contact+1]
    return (t = i.t, contact = Int(i.contact) + 1, name = name, kind = symbol(Lib.NAMES_swb_impact_kind, i.kind),
            rate_before = i.rate_before, rate_after = i.rate_after, normal = i.normal, tangential = (i.tangential, i.tangential2)[1:n],
            depth = i.depth, simultaneous = i.simultaneous != 0, unique = i.unique != 0)
end

"The place of a contact of a run, from 1: given by itself, its name or its number."
function contact_place(s::Solution, contact)
    scene, names = s.system.scene, first.(s.system.contacts)
    scene === nothing && mistake(:range, "the solution is not that of a scene: it has no contacts of bodies")
    contact isa SceneContact && !any(c -> c === contact, scene.contacts) &&
        mistake(:range, "contact $(contact.name) is one of another scene")
    return place_of(contact isa SceneContact ? contact.name : contact, names, "contacts")
end

"Numbers of all contacts at times: `get(run, times, n_times, out, n)` is the call."
function of_contacts(::Type{T}, get::F, s::Solution, times, rows) where {T,F}
    out = Array{T}(undef, rows, length(s.system.contacts), length(times))
    check(get(s, times, length(times), out, length(out)))
    return out
end

times_of(s, t) = t === nothing ? s.t : vec(reals(t, "t"))

"""
    contact_mode(solution, contact, t = solution.t)

Modes of a contact of a scene, which is a `SceneContact`, its name or its number: `:open`, `:closed` (with friction: sticks),
`:slides`, `:slides_back`; a Symbol for one time, a vector for several. At the time of an event it is the mode before it.
"""
function contact_mode(s::Solution, contact, t = nothing)
    k, times = contact_place(s, contact), times_of(s, t)
    found = of_contacts(Int64, Lib.swb_run_contact_modes, s, times, 1)
    modes = [symbol(Lib.NAMES_swb_contact_mode, m) for m in found[1, k, :]]
    return t isa Real ? modes[1] : modes
end

"""
    contact_force(solution, contact, t = solution.t)

Forces of a contact of a scene, which is a `SceneContact`, its name or its number: the normal force, then those along the
tangents; a vector for one time, a matrix with a column for each of several. Forces, not impulses, which are in
`solution.impacts`.
"""
function contact_force(s::Solution, contact, t = nothing)
    k, times = contact_place(s, contact), times_of(s, t)
    found = of_contacts(Float64, Lib.swb_run_contact_forces, s, times, 3)[1:1+s.system.contacts[k][2], k, :]
    return t isa Real ? vec(found) : found
end
