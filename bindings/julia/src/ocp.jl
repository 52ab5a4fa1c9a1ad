# Optimal control.

"""
    Ocp(system, horizon, n_stages; lagrange, mayer, initial_state, initial_bounds, state_bounds, control_bounds, params,
        initial_time, on_iteration, on_log, options...)

Optimal control problem of a `System` or `Model`: piecewise constant controls on an equidistant grid of stages. Bounds, a
tuple (lower, upper), are infinite, the initial state is free, the initial time is zero, parameters have no values, without which a problem that has any is not
solved, and there is no cost, until they are set. Functions are those of `ModelFunction`, or expressions of the model.

Terms: `set_lagrange!`, `set_mayer!`, `add_path!`, `add_terminal!`, `add_boundary!`, `add_periodic!`, `add_least_squares!`,
`add_relaxed!`, `add_complementarity!`. Freedoms: `set_free_time!`, `add_horizon!`, `set_linear_controls!`,
`set_param_bounds!`. Data and guesses: `set_initial_state!`, `set_params!`, `set_references!`, `set_state_guess!`,
`set_control_guess!`, `set_modes!`, `shift!`. Then `solve!`.
"""
mutable struct Ocp <: AnyOcp
    address::Ptr{Lib.swb_ocp}
    uses::Int
    nx::Int
    nu::Int
    np::Int
    n_stages::Int
    horizon::Float64
    initial_time::Float64
    serial::Bool # has functions of Julia, which one thread only may call
    graph::Union{Nothing,Graph} # of the model, for functions given as expressions
    names::NTuple{3,Vector{String}}
    iteration::Monitor
    log::Monitor
    starts::Bool # something was said of the initial state; what documents do not say was meant

    Ocp(fields...) = new(fields..., true)
end

sizes(o::Ocp) = (o.nx, o.nu, o.np)

function Ocp(system, horizon, n_stages; lagrange = nothing, mayer = nothing, initial_state = nothing, initial_bounds = nothing,
             state_bounds = nothing, control_bounds = nothing, params = nothing, initial_time = nothing, settings = nothing,
             on_iteration = nothing, on_log = nothing, options...)
    s = system_of(system)
    length_, n = number(horizon, "horizon"), integer(n_stages, "n_stages")
    values = chosen_settings(settings, options, Ocp)
    address = created(AnyOcp, Lib.swb_ocp_create, s, length_, n, raw(values))
    graph = system isa Model ? system.graph : nothing
    o = watched(Ocp(address, 0, sizes(s)..., n, length_, 0.0, s.serial, graph, s.names, Monitor(nothing), Monitor(nothing)),
                on_iteration, on_log)
    o.starts = false
    given(set, v) = v === nothing || set(v)
    given(f -> set_lagrange!(o, f), lagrange)
    given(f -> set_mayer!(o, f), mayer)
    given(x -> set_initial_state!(o, x), initial_state)
    given(t -> set_initial_time!(o, t), initial_time)
    given(p -> set_params!(o, p), params)
    given(b -> set_initial_bounds!(o, bound_pair(b, "initial_bounds")...), initial_bounds)
    given(b -> set_state_bounds!(o, bound_pair(b, "state_bounds")...), state_bounds)
    given(b -> set_control_bounds!(o, bound_pair(b, "control_bounds")...), control_bounds)
    return o
end

"A function of a problem; the problem notes that it has it."
function function_of!(o, f, n, name, sizes_ = sizes(o))
    g = function_of(f, sizes_, n, name, o.graph)
    took!(o, g)
    return g
end

"Number of outputs of a constraint: what the function or the bounds tell."
function row_count(f, lower, upper, name)
    f isa ModelFunction && return f.outputs
    f isa Expression && return 1
    f isa Union{Tuple,AbstractVector} && any_expression(f) && return length(f)
    lengths = unique([length(b) for b in (lower, upper) if b isa Union{Tuple,AbstractArray}])
    length(lengths) <= 1 || mistake(:dimension, "bounds of a $name: $(join(lengths, " and ")) numbers")
    return isempty(lengths) ? 1 : lengths[1]
end

"Add lower <= f <= upper, a `what`: `add(function, lower, n, upper, n)` is the call."
function add_rows!(add, o, f, lower, upper, what, name, sizes_ = sizes(o))
    n = row_count(f, lower, upper, what)
    low, high = bounds(lower, upper, n, "bounds of a $what")
    g = function_of!(o, f, n, name, sizes_)
    f isa ModelFunction || require_rows(g, name, "give a function or expression of the model and its bounds")
    using_object(() -> add(g, low, n, high, n), o)
    return o
end

"""
    set_lagrange!(ocp, f)

Set the cost rate, one output: its integral over the horizon is minimised.
"""
function set_lagrange!(o::Ocp, f)
    g = function_of!(o, f, 1, "lagrange")
    using_object(() -> Lib.swb_ocp_set_lagrange(o, g), o)
    return o
end

"""
    set_mayer!(ocp, f)

Set the terminal cost, one output; its control is that of the last stage.
"""
function set_mayer!(o::Ocp, f)
    g = function_of!(o, f, 1, "mayer")
    f isa ModelFunction || f === 0 || f === 0.0 || require_rows(g, "mayer", "the cost at the end is a function or expression of the model")
    using_object(() -> Lib.swb_ocp_set_mayer(o, g), o)
    return o
end

"""
    add_path!(ocp, f, lower = nothing, upper = nothing; at = :control_grid)

Add lower <= f(x, u, p, t) <= upper along the horizon: at `:control_grid`, `:elements` or `:stage_points`. The bounds tell
the number of outputs of a Julia function.
"""
function add_path!(o::Ocp, f, lower = nothing, upper = nothing; at = :control_grid)
    place = enum_number(Lib.NAMES_swb_path_at, at, "at")
    return add_rows!((rows...) -> Lib.swb_ocp_add_path(o, rows..., place), o, f, lower, upper, "path constraint", "path")
end

"""
    add_terminal!(ocp, f, lower = nothing, upper = nothing)

Add lower <= f(x, u, p, t) <= upper at the end of the horizon.
"""
add_terminal!(o::Ocp, f, lower = nothing, upper = nothing) =
    add_rows!((rows...) -> Lib.swb_ocp_add_terminal(o, rows...), o, f, lower, upper, "terminal constraint", "terminal")

"""
    add_boundary!(ocp, f, lower = nothing, upper = nothing)

Add lower <= f(x, u, p, t) <= upper between both ends of the horizon: x holds the initial state, then the final one. For
models see `between_ends`.
"""
function add_boundary!(o::Ocp, f, lower = nothing, upper = nothing)
    o.starts = true
    return add_rows!((rows...) -> Lib.swb_ocp_add_boundary(o, rows...), o, f, lower, upper, "boundary constraint", "boundary",
                     (2o.nx, o.nu, o.np))
end

"""
    add_periodic!(ocp, states = all)

Require that states, given by number or name, have the same values at both ends of the horizon.
"""
function add_periodic!(o::Ocp, states = 1:o.nx)
    chosen = Int64.(places(states, o.names[1], "states") .- 1)
    check(Lib.swb_ocp_add_periodic(o, chosen, length(chosen)))
    o.starts = true
    return o
end

"""
    add_least_squares!(ocp, f, weights, references = 0.0; at = :running)

Add (f - y)' W (f - y) to the cost: integrated (`:running`), summed over the ends of the control stages (`:control_grid`) or
at the end (`:terminal`). `weights` are the diagonal of W or all of it, `references` are y, or a matrix with a column for
every stage.
"""
function add_least_squares!(o::Ocp, f, weights, references = 0.0; at = :running)
    w = reals(weights, "weights")
    n = row_count(f, nothing, w[:, 1], "least-squares term")
    y = references isa Real ? fill(number(references, "references"), n) : reals(references, "references")
    place = enum_number(Lib.NAMES_swb_cost_at, at, "at")
    g = function_of!(o, f, n, "least_squares")
    using_object(() -> Lib.swb_ocp_add_least_squares(o, g, w, length(w), y, length(y), place), o)
    return o
end

"""
    set_references!(ocp, term, references)

Change the references of a least-squares term, counted in the order they were added.
"""
function set_references!(o::Ocp, term, references)
    y, k = reals(references, "references"), integer(term, "term")
    k >= 1 || mistake(:range, "term must be 1 or more, not $k")
    check(Lib.swb_ocp_set_references(o, k - 1, y, length(y)))
    return o
end

"""
    add_relaxed!(ocp, f, lower = nothing, upper = nothing; at = :terminal, norm = :l1, weight = 1e3)

Add a constraint that may be violated at the price `weight` times the norm (`:l1`, `:l2`, `:linf`) of the violation, at
`:terminal` or as in `add_path!`. `result.violation` tells what is left; the cost is reported without the price.
"""
function add_relaxed!(o::Ocp, f, lower = nothing, upper = nothing; at = :terminal, norm = :l1, weight = 1e3)
    place = Symbol(at) === :terminal ? Int32(-1) : enum_number(Lib.NAMES_swb_path_at, at, "at")
    kind, price = enum_number(Lib.NAMES_swb_norm, norm, "norm"), number(weight, "weight")
    add(rows...) = Lib.swb_ocp_add_relaxed(o, rows..., place, kind, price)
    return add_rows!(add, o, f, lower, upper, "relaxed constraint", "relaxed")
end

"""
    add_complementarity!(ocp, a, b; at = :control_grid, n = 1)

Add 0 <= a(x, u, p, t) and b(x, u, p, t) >= 0, one of which is zero, for each of their `n` outputs. Pairs of controls alone
belong to the control grid.
"""
function add_complementarity!(o::Ocp, a, b; at = :control_grid, n = a isa ModelFunction ? a.outputs : a isa Union{Tuple,AbstractVector} ? length(a) : 1)
    place = enum_number(Lib.NAMES_swb_path_at, at, "at")
    f, g = function_of!(o, a, n, "a"), function_of!(o, b, n, "b")
    using_object(() -> Lib.swb_ocp_add_complementarity(o, f, g, place), o)
    return o
end

for (name, set, block, what, effect) in (
    (:set_state_bounds!, :swb_ocp_set_state_bounds, 1, "of the states after the initial time", ""),
    (:set_initial_bounds!, :swb_ocp_set_initial_bounds, 1, "of the initial state", "; equal bounds fix it"),
    (:set_control_bounds!, :swb_ocp_set_control_bounds, 2, "of the controls", ""),
    (:set_param_bounds!, :swb_ocp_set_param_bounds, 3,
     "of the parameters", ": those with a lower bound below the upper one become variables, which start at the values set"),
)
    @eval begin
        """
            $($(string(name)))(ocp, lower = nothing, upper = nothing)

        Set bounds $($(what * effect)). `nothing` is no bound, one number is for all, and those of models
        with names may be given for some by name: `(v = 2.0,)`.
        """
        function $name(o::Ocp, lower = nothing, upper = nothing)
            names = o.names[$block]
            low, high = bounds(lower, upper, length(names), "bounds " * $what, names)
            check(Lib.$set(o, low, length(low), high, length(high)))
            o.starts |= $(name === :set_initial_bounds!)
            return o
        end
    end
end

"""
    set_nominal!(ocp; x = nothing, u = nothing, p = nothing)

Say how large states, controls and parameters usually are, in their own units, as vectors (`NaN` where nothing is known); the solver
measures variables by that. What is not given it takes from bounds, initial values, guesses and simulations.
"""
function set_nominal!(o::Ocp; x = nothing, u = nothing, p = nothing)
    of(v, n, what) = v === nothing ? fill(NaN, n) : vector(v, n, what)
    sizes_ = (of(x, o.nx, "x"), of(u, o.nu, "u"), of(p, o.np, "p"))
    check(Lib.swb_ocp_set_nominal(o, sizes_[1], length(sizes_[1]), sizes_[2], length(sizes_[2]), sizes_[3], length(sizes_[3])))
    return o
end

"""
    set_initial_state!(ocp, x0)

Fix the initial state.
"""
function set_initial_state!(o::Ocp, x0)
    o.starts = true
    return give(Lib.swb_ocp_set_initial_state, o, named_vector(x0, o.names[1], "x0"))
end

"""
    set_initial_time!(ocp, t0)

Set the initial time.
"""
function set_initial_time!(o::Ocp, t0)
    t = number(t0, "t0")
    check(Lib.swb_ocp_set_initial_time(o, t))
    o.initial_time = t
    return o
end

set_params!(o::Ocp, p) = give(Lib.swb_ocp_set_params, o, named_vector(p, o.names[3], "p"))

"""
    set_stage_params!(ocp, p)

Set parameters that change from stage to stage, a column for each.
"""
set_stage_params!(o::Ocp, p) = give(Lib.swb_ocp_set_stage_params, o, matrix_of(p, o.np, o.n_stages, "p"))

"""
    set_state_guess!(ocp, times, x)

States to start from, a column of `x` for each of the rising times, linear in between.
"""
function set_state_guess!(o::Ocp, times, x)
    t = vec(reals(times, "times"))
    values = matrix_of(x, o.nx, length(t), "x")
    check(Lib.swb_ocp_set_state_guess(o, t, length(t), values, length(values)))
    return o
end

"""
    set_control_guess!(ocp, u)

Controls to start from, a column for each stage.
"""
set_control_guess!(o::Ocp, u) = give(Lib.swb_ocp_set_control_guess, o, matrix_of(u, o.nu, o.n_stages, "u"))

"""
    set_elements!(ocp, n_fe)

Set the number of finite elements of every control stage: one for all, or one for each.
"""
function set_elements!(o::Ocp, n_fe)
    values = n_fe isa Integer ? fill(integer(n_fe, "n_fe"), o.n_stages) : Int64[integer(n, "n_fe") for n in n_fe]
    check(Lib.swb_ocp_set_elements(o, values, length(values)))
    return o
end

"""
    set_durations!(ocp, durations)

Set the lengths of the control stages; where they are free, those to start from.
"""
set_durations!(o::Ocp, durations) = give(Lib.swb_ocp_set_durations, o, vector(durations, o.n_stages, "durations"))

"""
    set_free_time!(ocp, what, lower, upper)

Let the optimiser choose the length of the `:horizon` or of all `:stages`, between bounds of the horizon or of a stage.
"""
function set_free_time!(o::Ocp, what, lower, upper)
    kind = enum_number(Lib.NAMES_swb_free_time, what, "what")
    check(Lib.swb_ocp_set_free_time(o, kind, number(lower, "lower"), number(upper, "upper")))
    return o
end

"""
    add_horizon!(ocp, lower, upper)

Bound the length of the horizon where those of the stages are free.
"""
function add_horizon!(o::Ocp, lower, upper)
    check(Lib.swb_ocp_add_horizon(o, number(lower, "lower"), number(upper, "upper")))
    return o
end

"""
    set_linear_controls!(ocp, linear = true)

Make controls continuous and linear on every stage: `true` for all, or one truth value for each.
"""
function set_linear_controls!(o::Ocp, linear = true)
    linear isa Bool || (linear isa Union{Tuple,AbstractVector} && all(l -> l isa Bool, linear)) ||
        mistake(:range, "linear must be true or false, or one of them for each control, not $(repr(linear))")
    flags = linear isa Bool ? fill(Int32(linear), o.nu) : Int32[l for l in linear]
    check(Lib.swb_ocp_set_linear_controls(o, flags, length(flags)))
    return o
end

"""
    shift!(ocp)

Make the last solution, one control stage later, the guess of the next solve.
"""
shift!(o::Ocp) = (check(Lib.swb_ocp_shift(o)); o)

# --- solving ------------------------------------------------------------------------------------------

"""
What a solve of an optimal control problem found.

- `outcome` (`:solved` or another one), `polished` (`:done` where the active set is exact), `cost` (NaN unless solved) and
  `cost_reached`, that of the point also where it is no solution
- `controls`, a column for each control stage, which last from `control_times` on; `control_ends`, others than these where
  controls are linear; `durations` of the stages; `params`, those that were free as they were found
- `trajectory`, `residuals`, `stats`; `violation` of relaxed constraints
- `accuracy`: comparison with a simulation of the controls, and `mismatch`, the largest difference of a state at the end of
  every stage; nothing with the option `accuracy = :off`
- `optimality`: what the answer is as a point of the control problem: `verdict` (`:local_optimum`, `:kink` where switches
  between control stages make the cost rise on either side, `:not_optimal`, `:unknown`), `residual`, `gradient` and `descent` (a
  column for each control stage), `kinks`, `reason`; nothing with the option `accuracy = :off`
- `message`: why there is no exact solution, in the words of the model, which counts from 0
- `adaptation`: how the grid was adapted (option `adapt_tol`), or nothing
"""
struct OcpResult
    outcome::Symbol
    polished::Symbol
    cost::Float64
    cost_reached::Float64
    controls::Matrix{Float64}
    control_times::Vector{Float64}
    control_ends::Matrix{Float64}
    durations::Vector{Float64}
    params::Vector{Float64}
    trajectory::Trajectory
    residuals::NamedTuple
    stats::NamedTuple
    violation::Float64
    accuracy::Union{Nothing,NamedTuple}
    mismatch::Union{Nothing,Vector{Float64}}
    optimality::Union{Nothing,NamedTuple}
    message::String
    adaptation::Union{Nothing,NamedTuple}
    control_names::Vector{String}
end

successful(r::OcpResult) = r.outcome === :solved
Base.show(io::IO, r::OcpResult) = print(io, "OcpResult: ", r.outcome, ", cost ", r.cost, r.polished === :done ? "" : ", not polished")
function Base.show(io::IO, ::MIME"text/plain", r::OcpResult)
    show(io, r)
    isempty(r.message) || print(io, "\n  ", r.message)
    print(io, "\n  ", r.trajectory, "\n  ", r.stats.iterations, " iterations, ", round(r.stats.time_total; sigdigits = 3), " s")
    r.accuracy === nothing ||
        print(io, "\n  simulated again: state differs by ", r.accuracy.worst, ", cost by ", r.accuracy.cost_error)
end
function Base.show(io::IO, ::MIME"text/html", r::OcpResult)
    rows = ("outcome" => r.outcome, "cost" => r.cost, "polished" => r.polished, "switches" => length(r.trajectory.switches),
            "iterations" => r.stats.iterations, "seconds" => r.stats.time_total, "message" => r.message)
    html_table(io, rows)
end

"A table of two columns; texts are escaped."
function html_table(io, rows)
    print(io, "<table>")
    for (name, v) in rows
        print(io, "<tr><th>", escaped(name), "</th><td>", escaped(string(v)), "</td></tr>")
    end
    print(io, "</table>")
end

"""
    solve!(ocp; warm = false) -> OcpResult
    solve!(program; warm = false) -> MpccResult
    solve!(phases) -> MultiPhaseResult

Solve; `warm`: from the last solution, whose active set is tried first. Look at `successful(result)`: the outcome may be
another one than solved.
"""
function solve!(o::Ocp; warm = false)
    o.starts || @warn "nothing is said of the initial state, so the solver chooses it: give initial_state = [...], or initial_bounds = (lower, upper) where it is free"
    o.starts = true # once
    solve = warm ? Lib.swb_ocp_solve_warm : Lib.swb_ocp_solve
    using_object(() -> solve(o, C_NULL), o)
    return result(o)
end

matrix_from(o::Ocp, get) = reshape(numbers(Float64, o.nu * o.n_stages, get, o), o.nu, o.n_stages)

"""
    result(object)

What the last solve found.
"""
function result(o::Ocp)
    durations = numbers(Float64, o.n_stages, Lib.swb_ocp_get_durations, o)
    accuracy, mismatch = accuracy_of(o)
    return OcpResult(
        outcome(o), symbol(Lib.NAMES_swb_polished, value(Int32, Lib.swb_ocp_get_polished, o)),
        value(Float64, Lib.swb_ocp_get_cost, o), value(Float64, Lib.swb_ocp_get_cost_reached, o),
        matrix_from(o, Lib.swb_ocp_get_controls),
        o.initial_time .+ cumsum([0.0; durations]), matrix_from(o, Lib.swb_ocp_get_control_ends), durations,
        numbers(Float64, o.np, Lib.swb_ocp_get_params, o),
        Trajectory(Lib.swb_ocp_get_trajectory, o, o.names[1]), residuals(o), stats(o),
        value(Float64, Lib.swb_ocp_get_violation, o), accuracy, mismatch, optimality_of(o),
        own_words(text(Lib.swb_ocp_get_message, o)), adaptation(o), o.names[2],
    )
end

"What a call gives, or nothing where the state of the object has no such thing."
function unless_absent(get)
    try
        return get()
    catch e
        e isa ArgumentMistake && e.status === :state && return nothing
        rethrow()
    end
end

function accuracy_of(o::Ocp)
    a = unless_absent(() -> record(Lib.swb_accuracy, Lib.swb_ocp_get_accuracy, o))
    a === nothing && return nothing, nothing
    return merge(named(a), (reached = a.reached != 0,)), numbers(Float64, o.n_stages, Lib.swb_ocp_get_mismatch, o)
end

function optimality_of(o::Ocp)
    c = unless_absent(() -> record(Lib.swb_optimality, Lib.swb_ocp_get_optimality, o))
    c === nothing && return nothing
    kink(i) = (k = Ref{Lib.swb_kink}(); check(Lib.swb_ocp_get_kink(o, i, k, sizeof(Lib.swb_kink))); named(k[]))
    return (verdict = symbol(Lib.NAMES_swb_verdict, c.verdict), residual = c.residual,
            gradient = matrix_from(o, Lib.swb_ocp_get_reduced_gradient), descent = matrix_from(o, Lib.swb_ocp_get_descent),
            kinks = [kink(i) for i in 0:(c.n_kinks - 1)], reason = text(Lib.swb_ocp_get_optimality_reason, o), gap = c.gap)
end

"""
    freezing_report(ocp)

What stood for the contacts of a scene in numerical time: the strength a_n of the push or the stiffness k of every contact, the recommended one,
how long a jump takes, warnings. Empty unless the search was by time-freezing.
"""
freezing_report(o::Ocp) = text(Lib.swb_ocp_freezing_report, o)

"""
    certificate(object)

What is known of the point of the last solve: `stationarity` (`:S`, `:M`, `:C`, `:A`, `:W`, `:none`, `:unknown`), `sharp` if
there are no multipliers of a stronger type, `b_stationary` (nothing if undecided, then `doubt` says what failed), `biactive`
pairs, and more.
"""
certificate(o::Ocp) = certificate_of(record(Lib.swb_certificate, Lib.swb_ocp_get_certificate, o))

function certificate_of(c)
    word(pointer) = pointer == C_NULL ? :unknown : Symbol(unsafe_string(pointer))
    answer = c.b_stationarity == Lib.SWB_B_STATIONARITY_YES ? true : c.b_stationarity == Lib.SWB_B_STATIONARITY_NO ? false : nothing
    return (stationarity = word(Lib.swb_stationarity_name(c.stationarity)), sharp = c.sharp != 0, b_stationary = answer,
            doubt = word(Lib.swb_doubt_name(c.doubt)), biactive = Int(c.biactive), min_multiplier = c.min_multiplier,
            strict = c.strict != 0, lps = Int(c.lps), lp_iterations = Int(c.lp_iterations), nodes = Int(c.nodes),
            second_order = word(Lib.swb_second_order_name(c.second_order)), dependent = Int(c.dependent),
            bound = c.bound)
end

"""
    sensitivity(ocp)

Derivatives of the last solution with respect to initial state and parameters while the order of modes stays as it is: a
NamedTuple with `cost_x0`, `cost_p`, `controls_x0` (nu, n_stages, nx), `controls_p` and `one_sided`.
"""
function sensitivity(o::Ocp)
    n, flag = o.nx + o.np, Ref(Int32(0))
    cost, u = zeros(n), zeros(o.nu, o.n_stages, n)
    using_object(() -> Lib.swb_ocp_get_sensitivity(o, cost, n, u, length(u), flag), o)
    return (cost_x0 = cost[1:o.nx], cost_p = cost[o.nx+1:end], controls_x0 = u[:, :, 1:o.nx], controls_p = u[:, :, o.nx+1:end],
            one_sided = flag[] != 0)
end

"""
    multipliers(ocp, of; index = 1)

Multipliers of the last solution, which must be exact: `times` and a matrix `values` with a column for each of them. `of` is
`:costates`, `:initial_state`, `:states`, `:controls`, `:params`, or with `index`, in the order in which they were added, `:path`,
`:terminal`, `:boundary`, `:relaxed`.

Costates are, at the start of every stage, derivatives of the cost that is still to come with respect to the state, and at the end
of the horizon those of terminal cost and constraints. The others are positive where an upper bound is active and negative where a
lower one is: raising that bound by `d` changes the optimal cost by `-d` times the multiplier.
"""
function multipliers(o::Ocp, of::Symbol; index::Integer = 1)
    kinds = (:costates, :initial_state, :states, :controls, :params, :path, :terminal, :boundary, :relaxed)
    kind = findfirst(==(of), kinds)
    kind === nothing && throw(ArgumentError("multipliers of :$of: known are $(join(kinds, ", "))"))
    n, width = Ref(Int64(0)), Ref(Int64(0))
    using_object(() -> Lib.swb_ocp_multiplier_sizes(o, kind - 1, index - 1, n, width), o)
    times, values = zeros(n[]), zeros(width[], n[])
    using_object(() -> Lib.swb_ocp_get_multipliers(o, kind - 1, index - 1, times, n[], values, length(values)), o)
    return (times = times, values = values)
end

# --- mode sequences, several starts, adapted grids ----------------------------------------------------

"""
    modes(ocp)

Mode sequence of the last solution: `times` at which phases begin, from the start of the horizon, and matrices `modes` and
`cells` with a column for each phase. Several modes of a subsystem are active while it slides. `transitions` are those
that are made: `t` from the start of the horizon, the number of the `transition`, its control `stage`, both from 1, and `at_once`
where the guard does not pass zero.
"""
function modes(o::Ocp)
    n, n_modes, n_cells = integers(3, Lib.swb_ocp_mode_sizes, o)
    times, flags, cells = zeros(n), zeros(Int32, n_modes, n), zeros(Int32, n_cells, n)
    check(Lib.swb_ocp_get_modes(o, times, n, flags, length(flags), cells, length(cells)))
    count = integers(1, Lib.swb_ocp_jump_count, o)[1]
    t, which, stages, now = zeros(count), zeros(Int64, count), zeros(Int64, count), zeros(Int32, count)
    count > 0 && check(Lib.swb_ocp_get_mode_transitions(o, t, which, stages, now, count))
    made = [(t = t[k], transition = which[k] + 1, stage = stages[k] + 1, at_once = now[k] != 0) for k in 1:count]
    return (times = times, modes = flags .!= 0, cells = cells .!= 0, transitions = made)
end

"""
    set_modes!(ocp, sequence)

Give the order of modes, as `modes` returns it (`cells` may be left out): the next solves start with it and follow the
homotopy only where it has no solution. Of a model with transitions only motions with this order of modes and `transitions` count; times and
stages say nothing. `nothing` forgets it.
"""
function set_modes!(o::Ocp, sequence)
    if sequence === nothing
        check(Lib.swb_ocp_set_modes(o, C_NULL, 0, C_NULL, 0, C_NULL, 0))
        return o
    end
    hasproperty(sequence, :times) && hasproperty(sequence, :modes) ||
        mistake(:range, "a mode sequence has times and modes, as modes(ocp) returns it")
    times = vec(reals(sequence.times, "times"))
    isempty(times) && mistake(:dimension, "a mode sequence needs a start for every phase")
    function flags(v, name)
        v isa AbstractMatrix && size(v, 2) == length(times) ||
            mistake(:dimension, "$name has size $(size(v)), expected a column for each of $(length(times)) phases")
        return Int32.(v .!= 0)
    end
    active = flags(sequence.modes, "modes")
    cells = haskey(sequence, :cells) && sequence.cells !== nothing ? flags(sequence.cells, "cells") : zeros(Int32, 0, 0)
    check(Lib.swb_ocp_set_modes(o, times, length(times), active, length(active), cells, length(cells)))
    made = haskey(sequence, :transitions) ? sequence.transitions : ()
    isempty(made) && return o
    t, which, stages = Float64[a.t for a in made], Int64[a.transition - 1 for a in made], Int64[a.stage - 1 for a in made]
    check(Lib.swb_ocp_set_mode_transitions(o, t, which, stages, Int32[a.at_once for a in made], length(t)))
    return o
end

"""
    random_starts(ocp, n; seed = 0)

Controls to start from, an array (nu, n_stages, n): the guess a solve starts from, then random ones within the bounds; the
same for the same seed.
"""
function random_starts(o::Ocp, n; seed = 0)
    count_, number_ = integer(n, "n"), integer(seed, "seed")
    count_ >= 1 && number_ >= 0 || mistake(:range, "at least one start, and a seed that is not negative")
    u = zeros(o.nu, o.n_stages, count_)
    using_object(() -> Lib.swb_ocp_random_starts(o, number_, u, length(u)), o)
    return u
end

"""
    solve_starts!(ocp, starts; threads)

Solve from several guesses of the controls, an array (nu, n_stages, n), or from so many random ones; the problem keeps the
best solution (`result(ocp)`). `threads`: 0 for one on each processor; functions written in Julia are called by one only.
Returns `best` and, for each of `starts`, its outcome, polished, cost, controls and error.
"""
function solve_starts!(o::Ocp, starts; threads = nothing)
    u = starts isa Integer ? random_starts(o, starts) : starts
    u isa AbstractArray{<:Real,3} && size(u)[1:2] == (o.nu, o.n_stages) ||
        mistake(:dimension, "starts has size $(shape(u)), expected ($(o.nu), $(o.n_stages), n)")
    flat, best, count_ = Array{Float64}(u), Ref(Int64(0)), thread_count(threads, o.serial)
    using_object(() -> Lib.swb_ocp_solve_starts(o, flat, length(flat), count_, best), o)
    return (best = Int(best[]) + 1, starts = [start_of(o, k) for k in axes(u, 3)])
end

function start_of(o, k)
    outcome_, polished, cost, u = Ref(Int32(0)), Ref(Int32(0)), Ref(0.0), zeros(o.nu, o.n_stages)
    status = Lib.swb_ocp_get_start(o, k - 1, outcome_, polished, cost, u, length(u))
    status == Lib.SWB_OK || return (outcome = :failed, polished = :none, cost = NaN, controls = fill(NaN, size(u)),
                                    error = unsafe_string(Lib.swb_last_error()))
    return (outcome = solve_outcome(outcome_[]), polished = symbol(Lib.NAMES_swb_polished, polished[]), cost = cost[],
            controls = u, error = "")
end

function adaptation(o::Ocp)
    n, kept, reached = Ref(Int64(0)), Ref(Int64(0)), Ref(Int32(0))
    unless_absent(() -> check(Lib.swb_ocp_get_adaptation(o, n, kept, reached)) === nothing) === nothing && return nothing
    rounds = map(0:n[]-1) do k
        elements, variables, iterations = zeros(Int64, o.n_stages), Ref(Int64(0)), Ref(Int64(0))
        error_, cost = Ref(0.0), Ref(0.0)
        check(Lib.swb_ocp_get_round(o, k, elements, length(elements), variables, iterations, error_, cost))
        (elements = elements, n_variables = variables[], iterations = iterations[], error = error_[], cost = cost[])
    end
    return (rounds = rounds, kept = Int(kept[]) + 1, reached = reached[] != 0)
end

Base.show(io::IO, o::Ocp) = print(io, "Ocp of ", o.nx, " states, ", o.nu, " controls, ", o.np, " parameters; horizon ", o.horizon,
                                  ", ", o.n_stages, " stages", isopen(o) ? "" : ", closed")
