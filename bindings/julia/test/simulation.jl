# Event-driven simulation and simulation by finite elements: known solutions, derivatives, stepping, batches.

@testset "oscillator: $(nameof(make))" for make in (oscillator, oscillator_model)
    sol = simulate(make(), OSCILLATOR_X0, (0.0, OSCILLATOR_T); reltol = 1e-11, abstol = 1e-11)
    @test successful(sol) && sol.retcode === :Success && sol.outcome === :reached && sol.reason == ""
    @test maximum(abs, sol.u[end] - OSCILLATOR_XT) < 1e-9
    e = only_(sol.switches)
    @test abs(e.t - 1) < 1e-10 && e.kind === :cross && Set([e.before, e.after]) == Set([[1], [2]]) && e.unique && !e.simultaneous
    @test abs(e.transversality) ≈ 1 / hypot(1, OMEGA) rtol = 1e-8
    t = range(0, OSCILLATOR_T; length = 50)
    @test [norm(x) for x in eachcol(sol(t))] ≈ exp.(t .- 1) rtol = 1e-9
    @test sol(0.3) == sol([0.3])[:, 1]
    @test sol(0.3; order = 1) ≈ (norm(sol(0.3)) < 1 ? A_IN : A_OUT) * sol(0.3) rtol = 1e-6
    @test sol.t[1] == 0 && sol.t[end] == OSCILLATOR_T && length(sol.t) == length(sol.u) && e.t in sol.t
    @test size(Array(sol)) == size(sol) == (2, length(sol)) && sol[1, :] == [x[1] for x in sol.u] && sol[2] == sol.u[2]
    @test active_modes(sol) == [(0.0, e.t, e.before), (e.t, OSCILLATOR_T, e.after)] && switch_times(sol) == [e.t]
    @test sol.stats.steps == length(sol) - 1 && collect(sol)[end] == (sol.t[end], sol.u[end])
    @test occursin("1 switches", string(sol)) && occursin("cross", sprint(show, MIME("text/plain"), sol))
    @test occursin("<td>cross</td>", sprint(show, MIME("text/html"), sol))
end

@testset "stick-slip beside the reference and Python" begin
    sol = simulate(stick_slip(), (q = -0.8, v = -1.0), 40.0; reltol = 1e-11, abstol = 1e-11, sensitivity = true)
    exact = reference_solution("stickslip1")
    @test maximum(abs, sol.u[end] - exact["x_T"]) < 1e-8
    @test maximum(abs, switch_times(sol) - exact["switch_times"]) < 1e-8
    @test sol.dx_dx0 ≈ matrix(exact["sens_xT_x0"]) rtol = 1e-6
    @test sol[:v][1] == -1.0 && count(e -> e.kind === :enter, sol.switches) >= 4
    python = python_reference()
    if python !== nothing
        p = python["stick_slip"]
        near(a, b) = maximum(abs, a - b) <= 1e-12 * max(1, maximum(abs, b))
        @test near(sol.u[end], p["x_end"]) && near(switch_times(sol), p["times"])
        @test [string(e.kind) for e in sol.switches] == p["kinds"]
        @test [e.before for e in sol.switches] == p["before"] && [e.after for e in sol.switches] == p["after"]
        @test near(sol.dx_dx0, matrix(p["dx_dx0"])) && near(sol.switch_derivatives, matrix(p["switch_derivatives"]))
    end
end

@testset "sliding, choices, accumulation" begin
    sol = simulate(sides(1.0, -1.0; f0 = t -> 0.6t), [-0.5], (0.0, 3.0); reltol = 1e-10)
    @test [e.kind for e in sol.switches] == [:enter, :leave] && abs(switch_times(sol)[2] - 1 / 0.6) < 1e-9
    @test abs(sol(1.0)[1]) < 1e-13 && [m for (_, _, m) in active_modes(sol)] == [[1], [1, 2], [2]]
    still = Model(states = (:x, :y)) # y does not switch
    derivatives!(still, [-0.5 - sign(still[:x]), -sign(still[:y])])
    sol = simulate(still, [1.0, 5.0], 1.0)
    k = only_([k for k in 1:2 if !any(e -> e.subsystem == k, sol.switches)])
    (from, to, on) = only_(active_modes(sol, k))
    @test (from, to) == (0.0, 1.0) && length(on) == 1 && length(active_modes(sol, 3 - k)) == 2
    fork = sides(-1.0, 1.0)
    @test simulate(fork, [0.0], 1.0; preferred = 1 => [2]).u[end] ≈ [1.0] && simulate(fork, [0.0], 1.0; preferred = Dict(1 => [1])).u[end] ≈ [-1.0]
    seen = []
    sol = simulate(fork, [0.0], 1.0; on_branching = b -> (push!(seen, b); findfirst(==([[2]]), b.active)))
    @test sol.u[end] ≈ [1.0] && length(seen) == 1 && seen[1].x == [0.0] && size(seen[1].velocity) == (1, length(seen[1].active))
    @test only_(sol.branch_points).t == 0 && seen[1].active[sol.branch_points[1].taken] == [[2]]
    sol = @test_logs (:warn, r"ambiguous") simulate(fork, [0.0], 1.0; on_branching = b -> nothing)
    @test sol.outcome === :ambiguous && sol.retcode === :Failure && sol.branch_points[1].taken === nothing
    @test thrown(() -> simulate(fork, [0.0], 1.0; on_branching = b -> error("mine"))).msg == "mine"
    m = Model(states = (:x, :y))
    x, y = m.x
    derivatives!(m, [-sign(x) + 2sign(y), -2sign(x) - sign(y)])
    sol = simulate(m, [1.0, 0.3], 5.0; zeno = :stop)
    @test sol.outcome === :zeno && abs(sol.t_end - 0.65) < 1e-9 && occursin("accumulate", sol.reason) && !isempty(sol.accumulations)
    sol = simulate(sides(1.0, 2.0), [-1.0], 5.0; max_steps = 3, h_max = 0.01, verbose = false)
    @test sol.retcode === :MaxIters && occursin("3 steps", sol.reason)
    grazing = System(1; f0 = t -> 2(t - 1))
    add_subsystem!(grazing; modes = ([0.0], [0.0]), psi = x -> x[1], signs = [1, -1])
    @test simulate(grazing, [1.0], 2.0).contacts isa Vector
end

@testset "derivatives" begin
    # x' = p + u - sign x from below: the surface is reached at -x0 / (p + u + 1)
    m = Model(states = :x, controls = :u, parameters = :p)
    derivatives!(m, [m[:p] + m[:u] - sign(m[:x])])
    s = System(1; controls = 1, parameters = 1)
    add_subsystem!(s; modes = ((u, p) -> p[1] + u[1] + 1, (u, p) -> p[1] + u[1] - 1), psi = x -> x[1], signs = [-1, 1])
    slope = 2.0 - 0.25 + 2.0 / 16
    for system in (m, s)
        sol = simulate(system, [-1.0], 2.0; u = [1.0], p = [2.0], reltol = 1e-12, abstol = 1e-12, sensitivity = true)
        @test abs(sol.u[end][1] - 3.5) < 1e-11 && abs(sol.dx_dx0[1] - 0.5) < 1e-8
        @test sol.switch_derivatives ≈ [-0.25 -1 / 16 -1 / 16] rtol = 1e-7
        @test abs(sol.dx_dp[1] - slope) < 1e-7 && abs(sol.dx_du[1] - slope) < 1e-7
        inputs = simulate(system, [-1.0], 2.0; u = [1.0], p = [2.0], reltol = 1e-12, abstol = 1e-12, sensitivity = :inputs)
        @test inputs.dx_dx0 === nothing && inputs.dx_dp == sol.dx_dp && inputs.dx_du == sol.dx_du
        @test inputs.switch_derivatives == sol.switch_derivatives[:, 2:end]
        i = Integrator(system; reltol = 1e-12, abstol = 1e-12, adjoint = :on)
        set_controls!(i, 1.0)
        set_params!(i, 2.0)
        reinit!(i, [-1.0])
        advance!(i, 2.0)
        g = adjoint(i, [1.0])
        @test [g.x0; g.p; g.u] ≈ [0.5, slope, slope] rtol = 1e-7
        g = adjoint(i, [0.0]; switches = [1 => 1.0])
        @test [g.x0; g.p; g.u] ≈ [-0.25, -1 / 16, -1 / 16] rtol = 1e-7
        @test refused(() -> adjoint(i, [0.0]; switches = [4 => 1.0]), :range)
        @test refused(() -> adjoint(i, [0.0]; at = [0.123 => [1.0]]), :range)
    end
    @test simulate(m, (x = -1,), 2.0; u = (u = 1,), p = (p = 2,)).dx_dx0 === nothing
end

@testset "stepping" begin
    seen = []
    i = Integrator(oscillator(); h_max = 0.2, on_step = s -> (push!(seen, s); nothing), on_log = (level, line) -> nothing)
    set_stop_times!(i, [0.5])
    reinit!(i, OSCILLATOR_X0)
    @test step!(i, 2.0) === :stepped && 0 < time(i) <= 0.2 && active_modes(i) == [1]
    @test state_at(i, time(i)) ≈ state(i)
    @test state_at(i, time(i); order = 1) ≈ derivative(i) rtol = 1e-4
    kinds = [step!(i, 0.6) for _ in 1:3]
    @test :stop_time in kinds || :stepped in kinds
    @test advance!(i, OSCILLATOR_T) === :reached && outcome(i) === :reached && reason(i) == "" && stats(i).steps == length(seen)
    @test state(i) ≈ OSCILLATOR_XT rtol = 1e-6
    @test solution(i).u[end] == state(i) && settings(i).h_max == 0.2 && occursin("1.57", string(i))
    set!(i; h_max = 0.1)
    set_settings!(i, Settings(h_max = 0.3))
    @test settings(i).h_max == 0.3
    logged = []
    simulate(oscillator(), OSCILLATOR_X0, 1.5; log_level = :debug, on_log = (level, line) -> push!(logged, (level, line)))
    @test first.(logged) == [:debug, :info] && startswith(logged[1][2], "switch t = ")
    r = simulate(oscillator(), OSCILLATOR_X0, 0.5; reltol = [1e-4, 1e-10], abstol = 1e-10)
    @test r.stats.steps > simulate(oscillator(), OSCILLATOR_X0, 0.5; reltol = 1e-4, abstol = 1e-4).stats.steps
    @test simulate(oscillator(), OSCILLATOR_X0, 0.5; method = :radau5).stats.newton > 0
    sol = simulate(System(1; controls = 1, f0 = u -> u[1]), [0.0], 3.0; u = [1.0 -2.0 0.5])
    @test abs(sol.u[end][1] + 0.5) < 1e-13 && abs(sol(1.0)[1] - 1) < 1e-13
    @test simulate(oscillator(), OSCILLATOR_X0, 1; dense = false).t == [1.0]
end

@testset "batches" begin
    m = oscillator_model()
    starts = [exp(-1) * [0.5 0.8 1.0 1.2 1.5]; zeros(1, 5)]
    batches = [simulate_batch(m, starts, 1.5; threads = n, reltol = 1e-9) for n in (1, 2)]
    @test batches[1].x == batches[2].x && all(batches[1].success) && length(batches[1]) == 5
    @test simulate(m, starts[:, 3], 1.5; reltol = 1e-9).u[end] == batches[1].x[:, 3] == batches[1][3].u[end] && length(collect(batches[1])) == 5
    @test thrown(() -> batches[1][6]) isa BoundsError
    # functions of Julia are called by one thread
    s = System(1; parameters = 1, f0 = p -> p[1])
    @test simulate_batch(s, [0.0 1.0], 2.0; p = [3.0 4.0]).x ≈ [6.0 9.0] && simulate_batch(s, [0.0 1.0], 2.0; p = [3.0]).x ≈ [6.0 7.0]
    @test refused(() -> simulate_batch(s, [0.0 1.0], 2.0; p = [3.0], threads = 2), :unsupported, "one thread")
    m = Model(states = 1)
    derivatives!(m, [m.x[1]^2])
    b = simulate_batch(m, [0.1 1.0], 2.0)
    @test b.success == [true, false] && b[2].outcome === :step_too_small
    @test occursin("2 runs, 1", string(b))
end

@testset "systems of other kinds" begin
    @test surfaces(oscillator(), [0.5, 0.5]) ≈ [-0.5]
    s = System(1)
    @test add_subsystem_indicators!(s; modes = ([1.0], [2.0], [3.0]), indicators = x -> (x[1], -x[1], 9.0)) == 1
    @test isequal(surfaces(s, [1.0]), [2.0, NaN, NaN])
    @test simulate(s, [-0.5], 0.25).u[end] ≈ [-0.25]
    # a relay as an inclusion: alpha is the step of x
    s = System(1)
    add_inclusion!(s; f = x -> 1 - 2x[2], psi = x -> x[1])
    r = simulate_fesd(s, [-0.5], 1.0, 10)
    @test successful(r) && abs(r.state[1]) < 1e-9
    # x' = -z, 0 = z - x
    s = System(2; f0 = x -> (-x[2], x[2] - x[1]))
    set_algebraic!(s, 1)
    @test simulate_fesd(s, [1.0, 1.0], 1.0, 5; n_s = 3).state[1] ≈ exp(-1) rtol = 1e-8
    r = simulate(s, [1.0, 7.0], 1.0)
    @test successful(r)
    @test r.u[end] ≈ [exp(-1), exp(-1)] rtol = 1e-6
    @test occursin("with functions of Julia", string(s))
    # 0 ≤ z ⊥ z + x - sin t ≥ 0, x' = z - x: a diode with a resistance
    s = System(2; f0 = x -> (x[2] - x[1], 0.0))
    set_algebraic!(s, 1)
    @test add_complementarity!(s, x -> x[2] + x[1] - 0.5; rows = [2]) == 1
    r = simulate(s, [0.0, 0.0], 1.0)
    @test successful(r)
    @test r.u[end] ≈ [0.25 * (1 - exp(-2)), 0.25 * (1 + exp(-2))] rtol = 1e-6
    @test_throws SwitchbackError add_complementarity!(s, x -> x[1]; rows = [1])
end

@testset "finite elements" begin
    r = simulate_fesd(oscillator(), OSCILLATOR_X0, OSCILLATOR_T, 20; n_s = 4, n_fe = 2)
    @test successful(r) && maximum(abs, r.state - OSCILLATOR_XT) < 1e-6 && r.time == OSCILLATOR_T
    tr = r.trajectory
    @test abs(switch_times(tr)[1] - 1) < 1e-6 && size(tr.states) == (2, length(tr) + 1) && size(tr.stage_states) == (2, 4, length(tr))
    @test tr(OSCILLATOR_T) ≈ r.state && tr.switches[1].before == [1] && tr.switches[1].after == [2] && size(active_modes(tr), 1) == 2
    @test sum(tr.stage_theta; dims = 1) ≈ ones(1, 4, length(tr)) && occursin("1 switches", string(tr))
    s = System(1; controls = 1, f0 = u -> u[1])
    r = simulate_fesd(s, [0.0], 3.0, 3; u = [1.0 -2.0 0.5])
    @test abs(r.state[1] + 0.5) < 1e-12 && r.control_times == [0, 1, 2, 3]
    sim = Simulator(oscillator_model(); n_s = 3)
    set_state!(sim, (x = exp(-1), y = 0.0))
    @test step!(sim, 0.1) === :solved && time(sim) ≈ 0.1
    document = to_json(sim, 0.5, 4)
    @test run!(sim, 0.5, 4) === :solved && length(trajectory(sim)) > 0 && residuals(sim).primal < 1e-8 && stats(sim).n_steps >= 4
    again, duration, n_steps = from_json(Simulator, document)
    @test (duration, n_steps) == (0.5, 4) && run!(again, duration, n_steps) === :solved && state(again) == state(sim)
    clear!(sim)
    @test occursin("0.6", string(sim))
    problem = FilippovProblem(oscillator_model(), OSCILLATOR_X0, (0, OSCILLATOR_T))
    @test Swb.solve(problem; reltol = 1e-10).u[end] ≈ OSCILLATOR_XT rtol = 1e-8
end
