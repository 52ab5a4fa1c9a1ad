# Optimal control: known optima, every kind of term, warm starts, certificates, mode sequences, documents, phases.

@testset "tutorial" begin
    model = Model(states = :x)
    derivatives!(model, [2 - sign(model[:x])])
    x = model[:x]
    by_model = Ocp(model, 2.0, 1; lagrange = x^2, mayer = (x - 5 / 3)^2, initial_bounds = (-5.0, 5.0), n_fe = 4)
    for ocp in (tutorial(), by_model)
        r = solve!(ocp)
        @test successful(r) && r.polished === :done && abs(r.cost - TUTORIAL_COST) < 1e-9
        @test abs(r.trajectory.states[1, 1] - TUTORIAL_X0) < 1e-7
        @test r.optimality.verdict === :local_optimum && isempty(r.optimality.kinks) && r.optimality.residual < 1e-3
        @test r.accuracy.reached && r.accuracy.worst < 1e-8 && length(r.mismatch) == 1 && r.message == ""
        @test r.residuals.primal < 1e-9 && r.stats.iterations > 0 && length(r.trajectory.switches) == 1
        c = certificate(ocp)
        @test c.stationarity === :S && c.b_stationary === true && c.doubt === :none
        @test outcome(ocp) === :solved && occursin("cost 1.52", string(r)) && occursin("simulated again", sprint(show, MIME("text/plain"), r))
        @test occursin("<td>solved</td>", sprint(show, MIME("text/html"), r))
        warm = solve!(ocp; warm = true)
        @test abs(warm.cost - r.cost) < 1e-9 && warm.stats.iterations <= r.stats.iterations
        sequence = modes(ocp)
        @test size(sequence.modes, 2) == length(sequence.times)
        set_modes!(ocp, (times = sequence.times, modes = sequence.modes))
        @test abs(solve!(ocp).cost - TUTORIAL_COST) < 1e-9
        set_modes!(ocp, nothing)
    end
    @test occursin("1 stages", string(by_model))
    again = from_json(Ocp, to_json(by_model))
    @test solve!(again).cost == solve!(by_model).cost && (again.horizon, again.n_stages) == (2.0, 1)
    # functions of Julia are supplied by name
    f = ModelFunction(x -> x[1]^2, 1; name = "rate")
    named_ocp = Ocp(model, 2.0, 1; lagrange = f, mayer = (x - 5 / 3)^2, initial_bounds = (-5.0, 5.0), n_fe = 4)
    @test refused(() -> from_json(Ocp, to_json(named_ocp)), :state, "rate")
    @test abs(solve!(from_json(Ocp, to_json(named_ocp); functions = [f])).cost - TUTORIAL_COST) < 1e-9
    @test solve!(tutorial(; accuracy = :off)).accuracy === nothing
    @test solve!(tutorial(; accuracy = :off)).optimality === nothing
    adapted = solve!(tutorial(; adapt_tol = 1e-6))
    @test adapted.adaptation.reached && adapted.adaptation.rounds[adapted.adaptation.kept].error < 1e-6
end

@testset "two sliding modes" begin
    ocp = sliding_ocp()
    r = solve!(ocp)
    @test successful(r) && r.polished === :done && abs(r.cost - 9.14960) < 5e-6 && size(r.controls) == (2, 6)
    @test r.trajectory(4.0)[1:2] ≈ [-pi / 6, -pi / 4] rtol = 1e-9
    python = python_reference()
    if python !== nothing
        @test abs(r.cost - python["sliding_ocp"]["cost"]) < 1e-9
        @test maximum(abs, r.controls' - matrix(python["sliding_ocp"]["controls"])) < 1e-7
    end
end

# x' = u, from x(0) = 1: costs and constraints whose answers are known
plain_model() = (m = Model(states = :x, controls = :u, parameters = (:a, :b)); derivatives!(m, [m[:u]]); m)

@testset "terms" begin
    m = plain_model()
    x, u, p = m[:x], m[:u], m.p
    make(n = 4; keywords...) = Ocp(m, 1.0, n; initial_state = [1.0], n_fe = 1, params = (a = 0.5, b = 2.0), keywords...)
    ocp = make(; lagrange = u^2)
    add_terminal!(ocp, x, 0.0, 0.0)
    r = solve!(ocp)
    @test r.cost ≈ 1 rtol = 1e-8
    @test r.controls ≈ fill(-1.0, 1, 4) rtol = 1e-6
    s = sensitivity(ocp)
    @test s.cost_x0 ≈ [2.0] rtol = 1e-6
    @test size(s.controls_x0) == (1, 4, 1) && size(s.controls_p) == (1, 4, 2) && all(abs.(s.controls_x0 .+ 1) .< 1e-6)
    λ = multipliers(ocp, :costates)
    @test λ.times ≈ 0:0.25:1
    @test λ.values ≈ fill(2.0, 1, 5) rtol = 1e-6
    @test multipliers(ocp, :terminal).values ≈ fill(2.0, 1, 1) rtol = 1e-6
    @test refused(() -> multipliers(ocp, :terminal; index = 2), :range)
    set_control_bounds!(ocp, -0.5, 0.5)
    r = solve!(ocp)
    @test r.outcome in (:infeasible, :stalled) && occursin("cannot be met", r.message) && !successful(r)
    ocp = make(; lagrange = u^2)
    add_least_squares!(ocp, x, [3.0], [2.0]; at = :terminal)
    @test solve!(ocp).cost ≈ 3 / 4 rtol = 1e-8 # min of d^2 + 3 (1 - d)^2
    set_references!(ocp, 1, [3.0])
    @test solve!(ocp; warm = true).cost ≈ 3 rtol = 1e-8
    ocp = make(; lagrange = u^2)
    add_relaxed!(ocp, x, 5.0, nothing; weight = 1.0)
    r = solve!(ocp)
    @test r.violation ≈ 3.5 rtol = 1e-6 # min of d^2 + (4 - d)
    ocp = make(; lagrange = u^2, control_bounds = (-3, 3))
    add_path!(ocp, [x + p[1], x], [0, 1.0], [10, 1.5]; at = :elements)
    add_terminal!(ocp, x - 5, nothing, nothing)
    add_terminal!(ocp, (x, u) -> x[1] + 0u[1], 1.5, 1.5)
    @test solve!(ocp).cost ≈ 0.25 rtol = 1e-8
    ocp = Ocp(m, 1.0, 4; lagrange = (u - 1)^2, n_fe = 1, params = (a = 0.5, b = 2.0))
    add_periodic!(ocp)
    @test solve!(ocp).cost ≈ 1 rtol = 1e-8
    ocp = Ocp(m, 1.0, 4; lagrange = u^2, n_fe = 1, params = (a = 0.5, b = 2.0))
    add_boundary!(ocp, between_ends(m, (a, b) -> b[1] - 3a[1]), 0.0, 0.0)
    add_boundary!(ocp, x -> x[1] + x[2], 4.0, 4.0)
    r = solve!(ocp)
    @test r.trajectory.states[:, [1, end]] ≈ [1.0 3.0] rtol = 1e-6
    ocp = make(; lagrange = u^2)
    add_complementarity!(ocp, 2 - u, 2 + u; n = 1)
    @test solve!(ocp).cost ≈ 4 rtol = 1e-6
    ocp = make(; mayer = x, control_bounds = (-2, 2))
    set_free_time!(ocp, :horizon, 0.5, 0.8)
    r = solve!(ocp)
    @test sum(r.durations) ≈ 0.8 rtol = 1e-8
    @test r.cost ≈ 1 - 1.6 rtol = 1e-8
    ocp = make(; lagrange = (u - m.t)^2)
    set_linear_controls!(ocp)
    r = solve!(ocp)
    @test abs(r.cost) < 1e-9 && abs(r.control_ends[1, end] - 1) < 1e-6
    # parameters: one is found, for expressions and for functions of Julia
    for rate in (u^2 + (p[1] - 3)^2, (u, p) -> u[1]^2 + (p[1] - 3)^2)
        ocp = make(; lagrange = rate)
        set_param_bounds!(ocp, [-10, 2], [10, 2])
        r = solve!(ocp)
        @test r.params ≈ [3, 2] rtol = 1e-6
    end
    ocp = make(2; lagrange = (u - p[1])^2)
    set_stage_params!(ocp, [1.0 2.0; 0 0])
    @test solve!(ocp).controls ≈ [1.0 2.0] rtol = 1e-6
    ocp = make(2; lagrange = u^2)
    set_elements!(ocp, [1, 3])
    set_durations!(ocp, [0.4, 0.6])
    set_initial_time!(ocp, 5.0)
    set_state_guess!(ocp, [0.0, 1.0], [1.0 2.0])
    set_control_guess!(ocp, [1.0 1.0])
    r = solve!(ocp)
    @test r.control_times == [5.0, 5.4, 6.0] && count(==(2), r.trajectory.control_stages) == 3
    shift!(ocp)
    @test successful(solve!(ocp))
    set_state_bounds!(ocp, -1, 1)
    set_initial_bounds!(ocp, 0.5, 0.5)
    @test successful(solve!(ocp))
    set_nominal!(ocp; x = [2.0], u = [NaN])
    @test successful(solve!(ocp))
    @test_throws SwitchbackError set_nominal!(ocp; x = [0.0])
end

@testset "several starts and phases" begin
    m = plain_model()
    ocp = Ocp(m, 1.0, 3; lagrange = (m[:u]^2 - 1)^2, initial_state = [0.0], control_bounds = (-2, 2), n_fe = 1, params = (a = 0.5, b = 2.0))
    u = random_starts(ocp, 3; seed = 4)
    @test size(u) == (1, 3, 3) && u == random_starts(ocp, 3; seed = 4)
    found = solve_starts!(ocp, u; threads = 2)
    @test length(found.starts) == 3 && found.starts[found.best].cost == minimum(s.cost for s in found.starts) ≈ result(ocp).cost
    @test all(s -> s.outcome === :solved && s.error == "", found.starts)
    julia = Ocp(m, 1.0, 3; lagrange = u -> (u[1]^2 - 1)^2, initial_state = [0.0], control_bounds = (-2, 2), n_fe = 1, params = (a = 0.5, b = 2.0))
    @test length(solve_starts!(julia, 2).starts) == 2
    @test refused(() -> solve_starts!(julia, 1; threads = 2), :unsupported, "one thread")
    phase(a) = Ocp(m, 1.0, 2; lagrange = (m[:u] - a)^2, n_fe = 1, params = (a = 0.5, b = 2.0))
    first_, second = phase(1.0), phase(-1.0)
    set_initial_state!(first_, [0.0])
    both = MultiPhase([first_, second])
    link_continuous!(both, 1)
    r = solve!(both)
    @test successful(r) && abs(r.cost) < 1e-9 && r.link_violation < 1e-9 && length(r.phases) == 2
    @test abs(r.phases[2].trajectory.states[1, end]) < 1e-6 && r.phases[2].control_times[1] == 1.0
    jump = MultiPhase((first_, second))
    link!(jump, 1, x -> x[2] - x[1] - 5)
    @test solve!(jump).phases[2].trajectory.states[1, 1] ≈ 6 rtol = 1e-6
    @test refused(() -> link_continuous!(both, 2), :dimension) && occursin("2 phases", string(both)) && refused(() -> MultiPhase([1]), :range)
end
