# Scenes, projected systems and time stepping: known solutions, references, derivatives, bad input.

const GRAVITY = 9.81
const STRICT = (reltol = 1e-12, abstol = 1e-13)

function bouncing(; contact...)
    s = Scene(:y; name = "ball")
    force!(s, [-GRAVITY])
    return s, contact!(s, "floor", s.q[1]; contact...)
end

@testset "a ball bounces to rest" begin
    e, first_ = 0.5, sqrt(2 / GRAVITY)
    s, ground = bouncing(e = e)
    sol = simulate(s, [1.0], [0.0], 2.0; sensitivity = true, STRICT...)
    t, speed = first_, GRAVITY * first_
    for i in sol.impacts[1:8]
        @test abs(i.t - t) < 1e-12 && abs(i.rate_before + speed) < 1e-11 && abs(i.rate_after - e * speed) < 1e-11
        @test i.normal ≈ (1 + e) * speed && i.depth ≈ speed^2 / 2GRAVITY
        @test (i.contact, i.name, i.kind, i.tangential, i.unique, i.simultaneous) == (1, "floor", :collision, (), true, false)
        speed *= e
        t += 2speed / GRAVITY
    end
    @test sol.impacts[end].kind === :last && abs(sol.accumulations[1].t - first_ * (1 + e) / (1 - e)) < 1e-6
    @test sol.impact_derivatives[1, :] ≈ [0.5first_, 1 / GRAVITY] && size(sol.impact_derivatives) == (length(sol.impacts), 2)
    @test contact_mode(sol, "floor", [0.1, 1.9]) == [:open, :closed] && contact_mode(sol, 1, 0.1) === :open
    @test contact_force(sol, ground, [0.1, 1.9]) ≈ [0.0 GRAVITY] && contact_force(sol, :floor, 1.9) ≈ [GRAVITY]
    @test size(contact_force(sol, ground)) == (1, length(sol.t)) && length(contact_mode(sol, ground)) == length(sol.t)
    @test sol.one_sided && !sol.redundant && maximum(abs, sol.u[end]) < 1e-12
    @test simulate(s, [1.0, 0.0], 2.0; STRICT...).impacts == simulate(s, (y = 1.0,), (v_y = 0.0,), 2.0; STRICT...).impacts
    @test occursin("contact floor: no friction", report(s)) && occursin("1 coordinates", string(s))
    svg = sprint(show, MIME("image/svg+xml"), sol)
    @test occursin("floor closed", svg) && occursin("velocities", svg) && !occursin("NaN", svg)
end

@testset "a slider falls, slides and sticks" begin
    r = scene("particle_slide_stop_stick")
    s = Scene((:x, :y); u = :f, p = :mu)
    force!(s, [s.u[1], -GRAVITY])
    contact!(s, "floor", s.q[2]; tangents = s.q[1], mu = s.p[1])
    x0 = scene_numbers(r["params"]["x0"])
    sol = simulate(s, x0[1:2], x0[3:4], 2.0; p = (mu = 0.35,), u = [1.0], sensitivity = true, STRICT...)
    @test maximum(abs, sol.u[end] - scene_numbers(r["x_T"])) < 1e-11
    @test sol.dx_dx0 ≈ matrix(scene_numbers.(r["dxT_dx0"])) atol = 1e-10
    i, want = sol.impacts[1], r["impacts"][1]
    @test [i.t, i.normal] ≈ scene_numbers([want["t"], want["Lambda_n"]]) && collect(i.tangential) ≈ [scene_numbers(want["Lambda_t"]);]
    @test contact_mode(sol, "floor", [0.1, 0.9, 1.9]) == [:open, :slides, :closed]
    @test contact_force(sol, "floor", [0.9, 1.9]) ≈ [GRAVITY GRAVITY; -0.35GRAVITY -1.0]
    @test occursin("floor sticks", sprint(show, MIME("image/svg+xml"), sol))
    d = 1e-6
    times(mu) = simulate(s, [0, 1.3], [3, -0.5], 1.0; p = [mu], u = [1.0], STRICT...)
    own = simulate(s, [0, 1.3], [3, -0.5], 1.0; p = [0.35], u = [1.0], sensitivity = true, STRICT...)
    @test own.dx_dp[:, 1] ≈ (times(0.35 + d).u[end] - times(0.35 - d).u[end]) / 2d atol = 1e-7
end

@testset "balls in a row: $law" for (law, behind) in ((:newton, [1, 1, 1] / 3), (:sequential, [0.0, 0.25, 0.75]))
    # e = 0 for the pair that touches: the laws differ
    s = Scene(3)
    inertia!(s, [1.0, 1.0, 1.0])
    force!(s, zeros(3))
    for (k, e) in ((1, law === :newton ? 0.0 : 0.5), (2, law === :newton ? 0.0 : 0.5))
        contact!(s, "$k-$(k + 1)", s.q[k+1] - s.q[k] - 1.0; e = e)
    end
    impact_law!(s, law)
    sol = simulate(s, [-0.25, 1.0, 2.0], [1.0, 0.0, 0.0], 0.2501; STRICT...)
    v = sol.u[end][4:6]
    @test sum(v) ≈ 1.0 && (law === :newton ? v ≈ behind : v[3] > v[2] > 0)
    @test report(s; json = true)[1] == '{'
end

@testset "inertia, rates, bounds" begin
    s = Scene(:y; v = :w) # in millimetres
    rates!(s, 1000s.v[1])
    inertia!(s, [2.0 + 0s.t;])
    force!(s, [-2GRAVITY])
    contact!(s, "floor", 1e-3s.q[1]; e = 1.0)
    contact!(s, "top", 10 - 1e-3s.q[1])
    set_bounds!(s, s.q[1], -1000.0, 5000.0)
    sol = simulate(s, [1000.0], [0.0], 2sqrt(2 / GRAVITY); STRICT...)
    @test length(sol.impacts) == 1 && maximum(abs, sol.u[end] - [1000.0, 0.0]) < 1e-7
    @test occursin("left out: contact top", report(s)) && refused(() -> contact_force(sol, "top"), :range, "there is no top", "floor")
    @test thrown(() -> simulate(s, [1000.0], [20.0], 2.0)) isa SwitchbackError
    bench = Scene((:y, :phi))
    inertia!(bench, [2.0 0.0; 0.0 0.5])
    force!(bench, [-2GRAVITY, 0.0])
    legs = [contact!(bench, "leg $k", bench.q[1] + k * sin(bench.q[2])) for k in -1:1]
    sol = simulate(bench, [0.0, 0.0], [0.0, 0.0], 1.0)
    @test sol.redundant && [contact_force(sol, leg, 0.5)[1] for leg in legs] ≈ fill(2GRAVITY / 3, 3)
    f = ModelFunction(bench, legs[3].gap)
    @test f([0.5, 0.1, 0.0, 0.0]) ≈ [0.5 + sin(0.1)]
end

@testset "play" begin
    r = scene("play")
    m = Projected(:y; name = "play")
    y, input, width = m.x[1], 2sin(m.t), 0.5
    derivatives!(m, [0.0])
    high = constraint!(m, "upper", input - y + width)
    low = constraint!(m, "lower", y - input + width)
    sol = simulate(m, [0.0], 6.0; STRICT...)
    @test maximum(abs, switch_times(sol) - scene_numbers(r["switches"])) < 1e-10
    for (t, wanted) in r["y_at"]
        @test abs(sol(t)[1] - scene_numbers(wanted)) < 1e-10
    end
    # where the input drags it along the multiplier is the rate of the input
    @test contact_mode(sol, low, [0.1, 1.0, 2.0, 3.0]) == [:open, :closed, :open, :open]
    @test contact_mode(sol, high, [0.1, 1.0, 2.0, 3.0]) == [:open, :open, :open, :closed]
    @test contact_force(sol, low, [1.0, 2.0]) ≈ [2cos(1.0) 0.0] && contact_force(sol, 1, 3.0) ≈ [-2cos(3.0)]
    @test occursin("2 constraints", string(m)) && refused(() -> Stepper(m), :unsupported)
end

@testset "steps" begin
    s, _ = bouncing()
    run = simulate_steps(s, [1.0], [0.0], 1.0; every = 10, impulses = true)
    @test run.t[1] == 0 && run.t[end] == 1 && size(run.x) == (2, 101) && size(run.q) == size(run.v) == (1, 101)
    @test run.v[1, end] == 0 && abs(run.q[1, end]) < 1e-5 && run.names == ["floor"]
    @test size(run.impulses) == (3, 1, 101) && run.impulses[1, 1, end] ≈ GRAVITY * 1e-3
    @test run.stats.steps == 1000 && run.stats.unconverged == 0 && 0 < run.stats.penetration < 5e-3 && run.stats.deepest == 1
    one = Stepper(s, 1e-2; law = :newton)
    @test refused(() -> step!(one), :state, "no state to go on from")
    set_state!(one, [1.0, 0.0], 2.0)
    step!(one)
    @test time(one) ≈ 2.01 && state(one)[2] ≈ -0.0981
    advance!(one, 2.6)
    @test time(one) == 2.6 && size(impulses(one)) == (3, 1) && stats(one).steps == 60
    interrupt!(one)
    @test thrown(() -> advance!(one, 3.0)) isa InterruptedSolve && run!(one, 3.0).t[end] == 3.0
    close(one)
    @test refused(() -> step!(one), :state, "closed")
    column = Scene(10)
    force!(column, fill(-GRAVITY, 10))
    foreach(k -> contact!(column, "$k", column.q[k] - (k == 1 ? -0.5 : column.q[k-1]) - 0.5), 1:10)
    a = simulate_steps(column, 0.6 .* (0:9), zeros(10), 1.0)
    b = simulate_steps(column, 0.6 .* (0:9), zeros(10), 1.0; look_at_all = true)
    @test a.x == b.x && maximum(abs, a.v[:, end]) < 1e-9 && a.impulses === nothing
end

@testset "friction at joints, larger friction for sticking, constraints" begin
    s = Scene((:x, :y); p = :F)
    force!(s, [-s.q[1], -GRAVITY])
    guide = friction!(s, "guide", s.q[1], s.p[1]; stiction = 0.2)
    rail = constraint!(s, "rail", s.q[2])
    sol = simulate(s, [1.0, 0.0], [0.0, 0.0], 20.0; p = [0.15], sensitivity = true, STRICT...)
    # every half turn loses twice the friction
    @test sol.u[end] ≈ [-0.1, 0, 0, 0] atol = 1e-10
    @test sol.dx_dp[1, 1] ≈ 6 atol = 1e-7
    @test contact_mode(sol, guide, [1.0, 4.0, 15.0]) == [:slides_back, :slides, :closed]
    @test contact_force(sol, guide, [1.0, 15.0]) ≈ [0 0; 0.15 -0.1] atol = 1e-9
    @test contact_force(sol, rail, [1.0])[1] ≈ GRAVITY
    @test refused(() -> friction!(s, "guide", s.q[1], 0.1), :state, "name of its own")
    @test refused(() -> friction!(s, "", s.q[1], 0.1), :range, "must not be empty")
    @test refused(() -> friction!(s, "other", s.q[1], "0.1"), :range, "expressions and numbers")
    @test refused(() -> constraint!(s, "other", "x"), :range, "must be an expression")
    @test refused(() -> simulate(s, [1.0, 0.5], [0.0, 0.0], 1.0; p = [0.15]), :range, "not satisfied at the start")
    @test refused(() -> simulate(s, [1.0, 0.0], [0.0, 0.0], 1.0; p = [0.3]), :range, "must not be less")
    # a state beside coordinate and velocity: the friction fades with z = exp(-t)
    fading = Scene(:x; states = :z)
    force!(fading, [0.0])
    state_rates!(fading, [-fading.states[1]])
    friction!(fading, "guide", fading.q[1], 0.5 * fading.states[1])
    @test simulate(fading, [0.0, 1.0, 1.0], 1.0; STRICT...).u[end][2:3] ≈ [1 - 0.5 * (1 - exp(-1)), exp(-1)] atol = 1e-9
    @test refused(() -> simulate(fading, [0.0], [1.0], 1.0), :dimension, "whole state")
    @test refused(() -> state_rates!(fading, [0.0, 1.0]), :dimension, "expected 1")
    # a relay holds the current of a motor, which drives a joint towards a far stop
    motor = Scene(:x; states = :z)
    z = motor.states[1]
    force!(motor, [z])
    state_rates!(motor, [2 * sign(1 - z) - z])
    friction!(motor, "gear", motor.q[1], 0.3)
    contact!(motor, "stop", 5 - motor.q[1])
    t1, t2 = -log(0.85), log(2)
    v = 1.7 * (t2 - t1) + 2 * (exp(-t2) - exp(-t1)) + 0.7 * (2 - t2)
    @test simulate(motor, zeros(3), 2.0; STRICT...).u[end][2:3] ≈ [v, 1] atol = 1e-9
    block = Scene((:x, :y))
    force!(block, [block.t, -1.0])
    contact!(block, "floor", block.q[2]; tangents = block.q[1], mu = 0.3, mu_s = 0.5)
    # from 0.5 on it slides: v' = t - 0.3
    @test simulate(block, zeros(2), zeros(2), 0.6; STRICT...).u[end][3] ≈ 0.5 * (0.36 - 0.25) - 0.03 atol = 1e-9
    @test refused(() -> contact!(block, "wall", block.q[1]; mu_s = 0.1), :range, "cannot stick")
end

@testset "discrete states, transitions and clocks" begin
    s = Scene(:y; p = 1, name = "gripper")
    held = discrete!(s, "held"; initial = 1)
    force!(s, [-10.0 * (1.0 - held)])
    floor_ = contact!(s, "floor", s.q[1]; e = s.p[1])
    @test transition!(s, s.q[1] > 1.2; when = held => 1, to = held => 0, name = "let go") == 1
    hit, left = 0.7 + (1 + 5) / 10, 2 - (0.7 + 0.6)
    for start in ([0.5, 1.0], [0.5, 1.0, 1.0])
        r = simulate(s, start, 2.0; p = [0.8], STRICT...)
        @test successful(r)
        @test r.jumps[1].t ≈ 0.7 atol = 1e-10
        @test r.impacts[1].t ≈ hit atol = 1e-10
        @test r.u[end] ≈ [4left - 5left^2, 4 - 10left, 0] atol = 1e-8
        @test t_events(r)[Symbol("let go")] ≈ [0.7] atol = 1e-10
    end
    @test stop_at!(s, s.v[1] < -3; name = "fast") == 2
    @test simulate(s, [0.5, 1.0], 2.0; p = [0.8]).t[end] ≈ 0.7 + 0.4 atol = 1e-7
    # a controller that holds what it samples, and pulses
    s = Scene("x y")
    kept = discrete!(s, "kept")
    pulse = pwm!(s, 0.25, 0.4; name = "pulse")
    force!(s, [-kept, pulse])
    strikes = every!(s, 0.5; reset = kept => s.v[1], name = "strikes")
    r = simulate(s, [0.0, 0.0, 1.0, 0.0], 1.25; STRICT...)
    @test r.u[end][3:4] ≈ [0.1875, 0.35] atol = 1e-10
    @test r.u[end][end] == 3 && length(r.u[end]) == 8
    # the same as a model
    m = Model(states = "a v")
    kept = discrete!(m, "kept")
    every!(m, 0.5; reset = kept => m.x[2])
    derivatives!(m, [m.x[2], -kept])
    @test simulate(m, [0.0, 1.0], 1.25; STRICT...).u[end][2] ≈ 0.1875 atol = 1e-10
    for (status, words, call) in (
        (:range, ["must be positive"], () -> every!(s, -1.0; reset = kept => 1.0)),
        (:range, ["no state"], () -> every!(s, 1.0; reset = kept => 1.0)),
        (:range, ["between 0 and 1"], () -> pwm!(s, 1.5, 1.0)),
        (:range, ["already"], () -> discrete!(s, "pulse")),
        (:state, ["changes nothing"], () -> transition!(s, s.q[1] > 1)),
        (:range, ["another model"], () -> transition!(s, m.x[1] > 1; to = pulse => 1)),
    )
        @test refused(call, status, words...)
    end
    @test length(s.x) == 8
end

@testset "nonsense" begin
    function plane()
        made = Scene((:x, :y))
        return force!(made, [0, -GRAVITY])
    end
    function with_contact(gap; tangent = nothing, keywords...)
        made = plane()
        contact!(made, "floor", gap(made); tangents = tangent === nothing ? () : tangent(made), keywords...)
        return System(made)
    end
    other, foreign = bouncing()
    s, ground = bouncing()
    sol = simulate(s, [1.0], [0.0], 1.0)
    for (status, words, call) in (
        (:dimension, ["at least one coordinate"], () -> Scene(0)),
        (:range, ["one name"], () -> Scene("y y")),
        (:state, ["no force on v_x"], () -> System(Scene("x y"))),
        (:dimension, ["force has 1 expressions, expected 2"], () -> force!(Scene("x y"), [0.0])),
        (:range, ["numbers and expressions"], () -> force!(Scene("x"), ["g"])),
        (:dimension, ["a diagonal, or (2, 2)"], () -> inertia!(plane(), [1, 2, 3])),
        (:range, ["two models"], () -> force!(Scene(:x), [s.q[1]])),
        (:range, ["must be an expression or a number"], () -> contact!(plane(), "floor", "y")),
        (:range, ["friction and no tangents"], () -> with_contact(c -> c.q[2]; mu = 0.3)),
        (:range, ["friction of contact floor is -0.1"], () -> with_contact(c -> c.q[2]; tangent = c -> c.q[1], mu = -0.1)),
        (:range, ["depends on velocities"], () -> with_contact(c -> c.q[2] + c.v[2])),
        (:range, ["restitution of contact floor is 1.1"], () -> System(first(bouncing(e = 1.1)))),
        (:range, ["must not be empty"], () -> contact!(plane(), "", 1.0)),
        (:range, ["the lower comes first"], () -> set_bounds!(plane(), :x, 1, 0)),
        (:range, ["there is no z"], () -> set_bounds!(plane(), :z, 0, 1)),
        (:range, ["no coordinate of the scene"], () -> (p = plane(); set_bounds!(p, p.v[1], 0, 1))),
        (:range, [":newton, :sequential"], () -> impact_law!(plane(), :poisson)),
        (:dimension, ["q0"], () -> simulate(s, [1.0, 2.0], [0.0], 1.0)),
        (:range, ["v0"], () -> simulate(s, [1.0], [NaN], 1.0)),
        (:range, ["gap of contact floor is -0.25"], () -> simulate(s, [-0.25], [0.0], 1.0)),
        (:range, ["one of another scene"], () -> contact_force(sol, foreign)),
        (:dimension, ["contacts must be one of 1 to 1"], () -> contact_mode(sol, 2)),
        (:range, ["outside"], () -> contact_force(sol, ground, 2.0)),
        (:range, ["not that of a scene"], () -> contact_mode(simulate(oscillator(), OSCILLATOR_X0, 0.1), 1)),
        (:range, ["the step h is 0"], () -> Stepper(s, 0.0)),
        (:range, ["takes a Scene"], () -> simulate_steps(oscillator(), [1.0], [0.0], 1.0)),
        (:state, ["no scene"], () -> Stepper(oscillator())),
        (:range, ["gap of contact floor is -1"], () -> simulate_steps(s, [-1.0], [0.0], 1.0)),
    )
        @test refused(call, status, words...)
    end
    close(s)
    @test refused(() -> contact!(s, "top", 1 - s.q[1]), :state, "Scene is closed") && occursin("closed", string(s))
    @test sol(0.3) ≈ [1 - GRAVITY * 0.045, -GRAVITY * 0.3]
end
