# Transitions, hysteresis, automata, and models with them as documents.

"A car: v, the way s and the wear of its gear box; a driver who drives until 24 and coasts until 6."
function gear_box()
    m = Model(states = (:v, :s, :wear), parameters = (:a, :d, :e, :r))
    (v, _, wear), (a, d, e, r) = copy(m.x), m.p
    gear = Automaton(m; states = (:first, :second, :third), name = "gear")
    driver = Automaton(m; states = "drives coasts", name = :driver)
    up = [v => (1 - e) * v, wear => wear + r * v^2]
    edge!(gear, :first => :second, v > 10; given = driver => :drives, reset = up)
    edge!(gear, :second => :third, v > 18; given = driver => :drives, reset = up)
    edge!(gear, :second => :first, v < 7; reset = wear => wear + r)
    edge!(gear, :third => :second, v < 13; reset = wear => wear + r)
    edge!(driver, :drives => :coasts, v > 24)
    edge!(driver, :coasts => :drives, v < 6)
    force = a * choose(gear, :first => 3.0, :second => 1.5, :third => 1.0) * is_in(driver, :drives)
    derivatives!(m, [force - d * v, v, 0.0])
    return m, gear, driver
end

@testset "gear box" begin
    r = scene("gear_box")
    x0, p, T = scene_numbers(r["x0"]), scene_numbers(r["p"]), scene_numbers(r["T"])
    m, gear, driver = gear_box()
    sol = simulate(m, x0, T; p = p, reltol = 1e-12, abstol = 1e-12, sensitivity = true)
    @test successful(sol) && !sol.one_sided && length(sol.jumps) == length(r["switches"])
    @test occursin(", $(length(sol.jumps)) transitions", string(sol)) && count("  transition  ", sprint(show, MIME("text/plain"), sol)) == min(20, length(sol.jumps))
    @test [j.t for j in sol.jumps] ≈ scene_numbers(r["switches"]) rtol = 1e-11
    @test sol.u[end][1:3] ≈ scene_numbers(r["x_T"]) rtol = 1e-11
    @test sol.dx_dp[1:3, :] ≈ matrix(scene_numbers.(r["dxT_dp"])) rtol = 1e-9
    @test sol.jump_derivatives[:, 6:9] ≈ matrix(scene_numbers.(r["dt_dp"])) rtol = 1e-9
    @test all(iszero, sol.dx_dx0[1:3, 4:5])
    stays = intervals(sol, gear)
    @test [i.value for i in stays[1:5]] == [:first, :second, :third, :second, :first]
    @test stays[end].stop == T && all(stays[k].stop == stays[k+1].start for k in 1:length(stays)-1)
    @test [i.value for i in intervals(sol, :gear)] == [Float64(findfirst(==(i.value), gear.states) - 1) for i in stays]
    @test intervals(sol, 5)[2].value == 1.0 && intervals(sol, driver)[2].value === :coasts
    passed = Dict(e.transition => (e.source, e.target) for e in gear.edges)
    made = [passed[j.transition] for j in sol.jumps if haskey(passed, j.transition)]
    @test made == [(stays[k].value, stays[k+1].value) for k in 1:length(stays)-1]
    # initial states by name, with and without the discrete ones
    named_ = simulate(m, (v = 1.0, s = 0.0, wear = 0.0), T; p = p, reltol = 1e-12, abstol = 1e-12)
    # steps are shorter where derivatives are asked for
    @test named_.u[end] ≈ sol.u[end] rtol = 1e-10
    other = simulate(m, (v = 8.0, s = 0.0, wear = 0.0, driver = 1), 1.0; p = p)
    @test intervals(other, driver)[1].value === :coasts
    batch = simulate_batch(m, [1.0 2.0; 0.0 0.0; 0.0 0.0], T; p = p, reltol = 1e-12, abstol = 1e-12)
    @test batch.x[:, 1] == named_.u[end] && length(batch[2].jumps) > 10

    again = from_json(Model, to_json(m))
    copied = simulate(again, x0, T; p = p, reltol = 1e-12, abstol = 1e-12, sensitivity = true)
    @test copied.u[end] == sol.u[end] && copied.dx_dp == sol.dx_dp && copied.jump_derivatives == sol.jump_derivatives
    @test again.names == m.names && report(again) == report(m) && intervals(copied, :gear) == intervals(sol, :gear)
    same = Automaton(again, :gear)
    @test same.states == gear.states && same.edges == gear.edges && intervals(copied, same) == stays
    @test refused(() -> edge!(same, :third => :second, again[:v] < 13; reset = :wear => 0.0), :range, "already")
    @test refused(() -> Automaton(again, :v), :range, "automata of gear, driver")
    transition!(again, again[:v] > 9; reset = :v => 1.0)
    @test length(simulate(again, x0, T; p = p).jumps) > length(sol.jumps)
    @test occursin("reset0", c_code(m)) && occursin("Automaton gear of first, second, third; 4 edges", string(gear))
end

@testset "two tanks" begin
    r = scene("two_tanks")
    m = Model(states = (:h1, :h2), parameters = (:q, :k1, :k2, :c, :lo, :hi, :b, :d))
    h1, h2 = m.x
    q, k1, k2, c, lo, hi, b, d = m.p
    pump = discrete!(m, :pump)
    valve = discrete!(m, :valve)
    transition!(m, h1 < lo - 0.25valve; when = pump => 0, to = pump => 1)
    transition!(m, h1 > hi - 0.25valve; when = Dict(pump => 1), to = [:pump => 0])
    transition!(m, h2 > b; when = valve => 0, to = valve => 1)
    transition!(m, h2 < d; when = valve => 1, to = valve => 0)
    derivatives!(m, [q * pump - k1 * h1, k1 * h1 - k2 * h2 - c * valve])
    sol = simulate(m, scene_numbers(r["x0"]), scene_numbers(r["T"]); p = scene_numbers(r["p"]), reltol = 1e-12, abstol = 1e-12)
    @test [j.t for j in sol.jumps] ≈ scene_numbers(r["switches"]) rtol = 1e-11
    @test sol.u[end] ≈ [scene_numbers(r["x_T"]); Float64.(r["w_T"])] rtol = 1e-11
end

@testset "hysteresis, and states of others" begin
    m = Model(states = :x)
    x = m.x[1]
    w = hysteresis!(m, x; on = 1.0, off = -1.0, name = "w")
    lamp = Automaton(m; states = (:dark, :dim, :bright))
    edge!(lamp, :dark => :dim, nothing; given = w => 1)
    edge!(lamp, :dim => :bright, x < 0)
    edge!(lamp, nothing => :dark; given = (w => (0,),))
    derivatives!(m, [1 - 2w])
    sol = simulate(m, [0.0], 4.0)
    @test [i.value for i in intervals(sol, :w)] == [0.0, 1.0, 0.0] && intervals(sol, :w)[3].start ≈ 3.0
    # it is dim where w goes on, as x is above zero, and dark where w goes off, as it is at the start
    @test [i.value for i in intervals(sol, lamp)] == [:dark, :dim, :bright, :dark]
    @test intervals(sol, lamp)[3].start ≈ 2.0
    f = ModelFunction(m, [is_in(lamp, :dark), is_in(lamp, :dim, :bright), choose(lamp, :dim => x; otherwise = 7.0)])
    @test f([0.3, 0.0, 0.0]) == [1, 0, 7] && f([0.3, 0.0, 1.0]) == [0, 1, 0.3] && f([0.3, 1.0, 2.0]) == [0, 1, 7]
end

@testset "choices" begin
    m = Model(states = :x, controls = :on)
    x, on = m.x[1], m.u[1]
    derivatives!(m, [on - x])
    choice!(m, :on, [1, 0])
    o = Ocp(m, 2.0, 4; initial_state = [1.0], lagrange = (x - 0.5)^2)
    r = solve!(o)
    @test r.optimality.verdict === :global && r.optimality.gap <= 1e-6
    @test all(u -> u == 0 || u == 1, r.controls)
    # the same of a model that was written down
    again = from_json(Model, to_json(m))
    @test to_json(again) == to_json(m) && again.choices == [(0, [0.0, 1.0], 0.0)]
    @test_throws SwitchbackError choice!(m, :off, [0, 1])
end

@testset "nonsense" begin
    m = Model(states = (:v,))
    v = m.x[1]
    a, b = Automaton(m; states = "idle heat", name = "a"), Automaton(m; states = "off on", name = "b")
    other = Automaton(Model(states = :v); states = "x y")
    edge!(a, :idle => :heat, v > 1)
    n = length(m.transitions)
    for (status, words, call) in (
        (:dimension, ["two states"], () -> Automaton(m; states = :one)),
        (:range, ["names"], () -> Automaton(m; states = 3)),
        (:range, ["one name"], () -> Automaton(m; states = "on on")),
        (:range, ["its states are on, off"], () -> Automaton(m; states = "on off", initial = :of)),
        (:range, ["already"], () -> Automaton(m; states = "on off", name = "a")),
        (:range, ["no state :hot"], () -> edge!(a, :idle => :hot, v > 1)),
        (:range, ["source"], () -> edge!(a, 1 => :heat, v > 1)),
        (:range, ["empty"], () -> edge!(a, () => :heat, v > 1)),
        (:range, ["no condition"], () -> edge!(a, :idle => :heat)),
        (:range, ["comparison"], () -> edge!(a, :idle => :heat, true)),
        (:range, ["already"], () -> edge!(a, :idle => :heat, v > 1)),
        (:range, ["changes nothing"], () -> edge!(a, :idle => :idle, v > 2)),
        (:range, ["no state :red"], () -> edge!(a, :idle => :heat, v > 2; given = b => :red)),
        (:range, ["pairs"], () -> edge!(a, :idle => :heat, v > 2; given = b)),
        (:range, ["source does"], () -> edge!(a, :idle => :heat, v > 2; given = a => :idle)),
        (:range, ["no state of the model"], () -> edge!(a, :idle => :heat, v > 2; given = other => :x)),
        (:range, ["twice"], () -> edge!(a, :idle => :heat, v > 2; given = (b => :off, b.state => 1))),
        (:range, ["target of the edge"], () -> edge!(a, :idle => :heat, v > 2; to = a.state => 1)),
        (:range, ["another model"], () -> edge!(a, :idle => :heat, other.model.x[1] > 2)),
        (:range, ["no state :warm"], () -> is_in(a, :warm)),
        (:range, ["no value for heat"], () -> choose(a, :idle => 1.0)),
        (:state, ["changes nothing"], () -> transition!(m, v > 1)),
        (:range, ["twice"], () -> transition!(m, v > 1; reset = [v => 0.0, :v => 1.0])),
        (:range, ["negate"], () -> hysteresis!(m, v; on = 1, off = 2)),
        (:range, ["0 or 1"], () -> hysteresis!(m, v; on = 2, off = 1, initial = 2)),
        (:range, ["finite"], () -> discrete!(m, "z"; initial = Inf)),
    )
        @test refused(call, status, words...)
        @test length(m.transitions) == n
    end
    derivatives!(m, [1.0])
    sol = simulate(m, [0.0], 2.0)
    @test refused(() -> intervals(sol, :speed), :range) && refused(() -> intervals(sol, 9), :dimension)
    @test thrown(() -> from_json(Model, replace(to_json(m), "rising" => "upward"))) isa ArgumentMistake
end

@testset "events by name" begin
    m = Model(states = (:q, :v))
    q, v = m.x
    n = discrete!(m, "n")
    derivatives!(m, [v, -q])
    @test note!(m, (q > 0) & (v > 0); name = :quadrant) == 1
    @test transition!(m, q > 0.5; reset = n => n + floor(2.5q), edge = true) == 2
    @test stop_at!(m, !(m.t < 12); name = "late") == 3
    sol = simulate(m, [1.0, 0.0], 20.0; reltol = 1e-10, abstol = 1e-10, sensitivity = true)
    @test sol.outcome == :event && sol.retcode == :Terminated && sol.stopped_by == :late && sol.t[end] ≈ 12
    @test t_events(sol)[:quadrant] ≈ [1.5pi, 3.5pi] && t_events(sol)[2] ≈ [5pi / 3, 11pi / 3] && sol.u[end][3] == 2
    @test u_events(sol)[:quadrant] ≈ [0.0 0.0; 1.0 1.0; 0.0 1.0] atol = 1e-8
    @test size(sol.note_derivatives) == (2, 3)
    @test sol.note_derivatives[1, 2] ≈ 1 atol = 1e-6
    again = from_json(Model, to_json(m))
    quadrants(model) = t_events(simulate(model, [1.0, 0.0], 20.0; reltol = 1e-10, abstol = 1e-10))[:quadrant]
    @test quadrants(again) == quadrants(m) ≈ t_events(sol)[:quadrant]
    @test refused(() -> note!(m, q > 1; name = :late), :range, "late already")
    other = Model(states = :x)
    derivatives!(other, [mod(other.x[1], 2)])
    @test refused(() -> simulate(other, [1.0], 1.0), :unsupported, "floor")
end
