# Bad input: exceptions that say what to do.

s, m, o = oscillator(), oscillator_model(), tutorial()

@testset "simulations" begin
    for (status, words, arguments, keywords) in (
        (:dimension, ["(1,)", "(2,)"], ([1.0], 1.0), NamedTuple()),
        (:range, [], ([NaN, 0.0], 1.0), NamedTuple()),
        (:range, ["x"], ([1.0, nothing], 1.0), NamedTuple()),
        (:range, ["numbers"], ("text", 1.0), NamedTuple()),
        (:range, ["real"], ([1im, 0], 1.0), NamedTuple()),
        (:range, ["before the start"], (OSCILLATOR_X0, (1.0, 0.5)), NamedTuple()),
        (:range, ["finite"], (OSCILLATOR_X0, (0, Inf)), NamedTuple()),
        (:dimension, ["(start, end)"], (OSCILLATOR_X0, (0, 1, 2)), NamedTuple()),
        (:range, ["rtol"], (OSCILLATOR_X0, 1.0), (reltol = -1.0,)),
        (:range, [], (OSCILLATOR_X0, 1.0), (reltol = [1e-3, -1.0],)),
        (:dimension, [], (OSCILLATOR_X0, 1.0), (abstol = [1e-3, 1e-3, 1e-3],)),
        (:option, ["dp5"], (OSCILLATOR_X0, 1.0), (method = :dp55,)),
        (:option, ["max_steps"], (OSCILLATOR_X0, 1.0), (max_stepps = 3,)),
        (:option, ["none has a name like it", "options()"], (OSCILLATOR_X0, 1.0), (qqqqqqq = 3,)),
        (:option, ["stop_times"], (OSCILLATOR_X0, 1.0), (stop_time = 3,)),
        (:option, ["sol(times)"], (OSCILLATOR_X0, 1.0), (saveat = 0.1,)),
        (:dimension, ["p"], (OSCILLATOR_X0, 1.0), (p = [1.0],)),
        (:dimension, ["u"], (OSCILLATOR_X0, 1.0), (u = zeros(1, 2),)),
        (:range, ["on_step"], (OSCILLATOR_X0, 1.0), (on_step = 3,)),
        (:range, [], (OSCILLATOR_X0, 1.0), (stop_times = [Inf],)),
        (:dimension, ["subsystem"], (OSCILLATOR_X0, 1.0), (preferred = 2 => [1],)),
        (:range, ["settings"], (OSCILLATOR_X0, 1.0), (settings = 3,)),
    )
        @test refused(() -> simulate(s, arguments...; keywords...), status, words...)
    end
    # names
    @test refused(() -> simulate(m, (x = 1.0, z = 2.0), 1.0), :range, "no z", "x, y")
    @test refused(() -> simulate(stick_slip(), (q = 1.0, vv = 2.0), 1.0), :range, "did you mean v")
    @test refused(() -> simulate(m, (x = 1.0,), 1.0), :dimension, "no value for y")
    sol = simulate(m, OSCILLATOR_X0, 1.0)
    @test refused(() -> sol[:z], :range) && refused(() -> sol(2.0), :range) && refused(() -> sol(0.5; order = -1), :range)
    @test refused(() -> sol("now"), :range) || thrown(() -> sol("now")) isa MethodError
    @test refused(() -> simulate("system", [0.0], 1.0), :range, "System or a Model")
    @test refused(() -> simulate_batch(s, zeros(2, 0), 1.0), :dimension) && refused(() -> simulate_batch(s, zeros(3, 1), 1.0), :dimension)
    @test refused(() -> simulate_batch(s, zeros(2, 1), 1.0; reltol = [1e-3, 1e-4]), :range)
    close(sol)
    @test refused(() -> sol(0.5), :state, "closed") && occursin("closed", string(sol))
    @test refused(() -> simulate(System(1), [0.0], 1.0), :state)
    half = Model(states = (:q, :v))
    derivatives!(half, :q => half[:v])
    @test refused(() -> simulate(half, [0.0, 0.0], 1.0), :state, "for v:") && refused(() -> derivatives!(half, :w => 1.0), :range, "only q, v")
end

@testset "simulations that end early" begin
    undefined = System(1; f0 = x -> x[1] > 0.5 ? NaN : 1.0)
    sol = @test_logs (:warn, r"'f0' is not finite.*NaN.*argument named t") simulate(undefined, [0.0], 1.0)
    @test !successful(sol) && occursin("NaN", sol.reason) && !occursin("swb_", sol.reason)
    @test occursin("NaN", sprint(show, MIME("text/plain"), sol)) && occursin("NaN", sprint(show, MIME("text/html"), sol))
    @test_logs simulate(undefined, [0.0], 1.0; verbose = false)
    @test_logs simulate(undefined, [0.0], 0.4)
    @test_logs simulate(undefined, [0.0], 1.0; on_step = step -> true) # asked for
    batch = simulate_batch(undefined, [0.0 -1.0 0.1], 1.0)
    @test batch.success == [false, true, false] && occursin("run 3: t = ", sprint(show, MIME("text/plain"), batch))
    i = Integrator(undefined)
    reinit!(i, [0.0])
    @test advance!(i, 1.0) === :step_too_small && occursin("NaN", reason(i))
    @test refused(() -> result(tutorial()), :state, "solve!")
end

@testset "names and places" begin
    n = Model(states = (:speed, :place), controls = :force, parameters = :mass)
    derivatives!(n, [n[:force] / n["mass"], n[:speed]])
    run(x0 = (speed = 0, place = 0); u = 1, p = 2) = simulate(n, x0, 1.0; u = u, p = p)
    @test run()["place"] == run()[:place] == [x[2] for x in run(["speed" => 0, "place" => 0]).u]
    @test refused(() -> run((speed = 0, plaec = 0)), :range, "did you mean place?") && refused(() -> run((speed = 0,)), :dimension, "place")
    @test refused(() -> run([0, NaN]), :range, "x.place is NaN") && refused(() -> run(; u = fill(Inf, 1, 2)), :range, "u.force is Inf")
    @test refused(() -> run(; p = nothing), :null, "mass") && refused(() -> run()[:plase], :range, "place") && refused(() -> n[:forc], :range, "force?")
    @test refused(() -> simulate(n, [0, 0], NaN; u = 1, p = 2), :range, "tspan") && refused(() -> simulate(n, [0, 0], -1; u = 1, p = 2), :range, "before the start")
    @test refused(() -> simulate(n, [0, 0], 1; u = 1, p = 2, preferred = 3), :range, "pairs")
    @test refused(() -> simulate_batch(n, [[0, 0], [1, 1]], 1; u = 1, p = 2), :dimension, "reduce(hcat")
    @test refused(() -> Integrator(n; stop_times = 1), :option) && refused(() -> simulate_batch(n, [0 0; 0 0], 1; u = 1, p = 2, thread = 2), :option, "threads")
    @test refused(() -> picture(IOBuffer(), run(); states = :plase), :range, "place?") && refused(() -> picture(IOBuffer(), run(); states = [3]), :dimension)
    @test occursin("speed", sprint(io -> picture(io, run(); states = "speed"))) && !occursin("place", sprint(io -> picture(io, run(); states = :speed)))
    p = Ocp(n, 1.0, 2; lagrange = n[:force]^2, params = 2, initial_state = (speed = 1, place = 0), state_bounds = (nothing, (place = 0.3,)),
            control_bounds = ((force = -9,), 9))
    add_periodic!(p, :place)
    set_elements!(p, 2)
    r = solve!(p)
    @test successful(r) && maximum(r.trajectory.states[2, :]) <= 0.3 + 1e-8 && abs(r.trajectory.states[2, end]) < 1e-8
    @test refused(() -> set_state_bounds!(p, (plase = 1,)), :range, "place?") && refused(() -> set_control_bounds!(p, 1, 0), :range, "number 1", "above")
    @test refused(() -> set_control_bounds!(p, NaN), :range, "NaN") && refused(() -> add_periodic!(p, :x), :range, "speed, place")
    @test refused(() -> set_references!(p, 0, 1.0), :range) && refused(() -> set_linear_controls!(p, 3), :range) && refused(() -> set_modes!(p, 3), :range, "times")
    @test refused(() -> solve_starts!(p, "three"), :dimension) && refused(() -> from_json(Model, to_json(n); functions = [3]), :range, "ModelFunction")
    @test refused(() -> add_least_squares!(p, n.x, 1.0), :dimension, "weights")
    @test simulate(n, [0, 0], 1; u = 1, p = 2, settings = Dict("rtol" => 1e-4)).outcome === :reached && Settings()["n_s"] == Settings().n_s
    careless = System(1; f0 = x -> (push!(x, 1.0); 1.0))
    @test occursin("resize", thrown(() -> simulate(careless, [0.0], 1.0)).msg)
end

@testset "systems" begin
    empty_ = System(2)
    add(; keywords...) = add_subsystem!(empty_; modes = ([1.0], [2.0]), psi = x -> x[1], signs = [1, -1], rows = [1], keywords...)
    @test refused(() -> add(signs = [1, 2]), :range, "-1, 0 or 1") && refused(() -> add(rows = [3]), :dimension, "1 to 2")
    @test refused(() -> add(modes = ([1.0], [2.0, 3.0])), :dimension) && refused(() -> add(modes = ([1.0], "b")), :range)
    @test refused(() -> add(psi = nothing), :null) && refused(() -> add(rows = [1, 1]), :dimension) && refused(() -> System(-1), :dimension)
    @test refused(() -> System(1.5; f0 = 1), :range) || thrown(() -> System(1.5)) isa MethodError
    @test refused(() -> surfaces(s, [1.0, 2.0]; subsystem = 2), :dimension) && refused(() -> add_subsystem_indicators!(empty_; modes = x -> x, indicators = x -> x), :null)
    @test refused(() -> set_f0!(empty_, ModelFunction(x -> x, 3; outputs = 3)), :dimension)
end

@testset "problems" begin
    @test refused(() -> set_control_guess!(o, zeros(2, 2)), :dimension) && refused(() -> set_initial_state!(o, [1, 2]), :dimension)
    @test refused(() -> add_path!(o, x -> x[1], [0, 0], [1]), :dimension) && refused(() -> add_path!(o, x -> x[1], 2.0, 1.0), :range)
    @test refused(() -> add_path!(o, x -> x[1], 0.0; at = :everywhere), :range, ":control_grid")
    @test refused(() -> Ocp(m, 1.0, 0), :dimension) && refused(() -> Ocp(m, -1.0, 2), :range) && refused(() -> Ocp(m, 1.0, 2; n_ss = 2), :option, "n_s") &&
          refused(() -> Ocp(m, 1.0, 2; lagrang = 2), :option, "did you mean lagrange?", "options()")
    @test refused(() -> Ocp(m, 1.0, 2; control_bounds = 3), :dimension, "(lower, upper)")
    @test refused(() -> result(tutorial()), :state) && refused(() -> certificate(tutorial()), :state) && refused(() -> sensitivity(tutorial()), :state)
    @test refused(() -> set_free_time!(o, :never, 1, 2), :range, ":horizon") && refused(() -> from_json(Ocp, "{}"), :range)
    @test refused(() -> set!(o; tol = "text"), :option) && refused(() -> set!(o; n_sss = 1), :option)
    @test refused(() -> set_modes!(o, (times = Float64[], modes = zeros(0, 0))), :dimension) && refused(() -> solve_starts!(o, zeros(2, 2)), :dimension)
    @test refused(() -> picture(IOBuffer(), simulate(m, OSCILLATOR_X0, 1.0; dense = false)), :state, "dense")
end

@testset "programs" begin
    f = x -> x'x
    @test refused(() -> Mpcc(2, f; pairs = [(1, 3)]), :dimension) && refused(() -> Mpcc(2, f; pairs = [1]), :dimension)
    @test refused(() -> Mpcc(2, f; pairs = [(1, constraint(1))]), :dimension, "there are none") && refused(() -> Mpcc(2, f; start = [1, NaN]), :range, "start[2] is NaN")
    @test refused(() -> Mpcc(2, f; pairs = [(1, "two")]), :range, "variable(i)") && refused(() -> Mpcc(2, f; bounds = 1), :dimension)
    @test refused(() -> Mpcc(2, f; constraints = x -> x), :null, "n_constraints") && refused(() -> Mpcc(2, f; jac = x -> x), :range)
    @test refused(() -> Mpcc(2, f; hess = x -> x, hess_prototype = ones(3, 3)), :dimension) && refused(() -> Mpcc(2, f; start = [1]), :dimension)
    @test refused(() -> Mpcc(2, f; bounds = (2, 1)), :range) && refused(() -> Mpcc(2, f; names = ["a"]), :dimension) && refused(() -> Mpcc(2, f; tool = 1), :option)
    @test refused(() -> Mpcc(2, "f"), :range) && refused(() -> solve!(Mpcc(2, f); warm = true), :state)
    @test refused(() -> Mpcc(2, f; names = ["a\0b", "c"]), :range, "NUL")
end

@testset "wrong without a word" begin
    k = Model(states = (:q, :v, :w))
    q, v, w = k.x
    for wrong in (() -> q == 0, () -> 0 == q, () -> q != 1.5, () -> when(q == v, 1, 2), () -> when(2q == 1, v, w), () -> when((q > 0) & (v == w), 1, 2))
        @test refused(wrong, :unsupported, "Compare by < or >", "isequal")
    end
    @test Dict(q => 1)[k[:q]] == 1 && length(Set([q, k.x[1], v])) == 2 && q == k[:q] && any(e -> isequal(e, v), k.x)
    # names
    @test_logs (:warn, r"'x' .* all states") (:warn, r"'t' .* the time") Model(states = (:x, :t))
    @test_logs (:warn, r"'x' .* all states") Model(states = (:k,), parameters = (:x,))
    @test_logs Model(states = (:x,), controls = (:u,), parameters = (:p,))
    # constants in the place of functions
    for constant in (1.0, [2.0], () -> 3.0)
        @test refused(() -> add_subsystem!(System(1); modes = [[1.0], [-1.0]], psi = constant, signs = [1, -1]), :range, "psi is a constant")
        @test refused(() -> add_terminal!(tutorial(), constant, 0, 1), :range, "terminal is a constant")
        @test refused(() -> set_mayer!(tutorial(), constant), :range, "mayer is a constant")
    end
    # constants stay constants: no Julia runs, and threads may do it
    for modes in ([[-3.0], [1.0]], [-3.0 1.0])
        s1 = System(1)
        add_subsystem!(s1; modes = modes, psi = affine(0.0, [1.0]; nx = 1), signs = [1, -1])
        @test !s1.serial && abs(simulate(s1, [1.5], 1.0).u[end][1]) < 1e-9
        @test simulate(s1, [-1.5], 1.0).u[end] ≈ [-0.5]
    end
    f = affine([1.0, 2.0], [1 0 3 0; 0 4 0 5]; nx = 2, nu = 1, np = 0)
    @test f([1, 2]; u = [3], t = 2.0) == [11.0, 20.0] && jacobian_at(f, [1, 2]; u = [3]) == [1 0 3 0; 0 4 0 5]
    # a free initial state
    k = Model(states = (:q,), controls = (:F,))
    derivatives!(k, [k.u[1]])
    problem(; given...) = Ocp(k, 1.0, 2; lagrange = k.u[1]^2 + k.x[1]^2, given...)
    @test_logs (:warn, r"give initial_state") solve!(problem())
    @test_logs solve!(problem(initial_state = [1.0]))
    @test_logs solve!(problem(initial_bounds = ([1.0], [2.0])))
end
