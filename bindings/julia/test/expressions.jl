# Expressions: operators, generic code, refusals; models and what they consist of.

m = Model(states = (:a, :b, :c), controls = (:u,), parameters = (:k,))
a, b, c = m.x
at(e; x = [0.3, -0.7, 1.9], u = [0.4], p = [2.5], t = 0.8) = ModelFunction(m, e)(x; u = u, p = p, t = t)[1]
point = (0.3, -0.7, 1.9)

@testset "operators agree with numbers" begin
    for f in (+, -, *, /, atan, (x, y) -> hypot(x, y), (x, y) -> muladd(x, y, 2.0), (x, y) -> x^2 - y^-1, (x, y) -> abs2(x) + inv(y))
        @test at(f(a, b)) ≈ f(point[1], point[2]) rtol = 1e-15
        @test at(f(a, 1.5)) ≈ f(point[1], 1.5) rtol = 1e-15
        @test at(f(2, b)) ≈ f(2, point[2]) rtol = 1e-15
    end
    for f in (sqrt, exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, exp2, log10, log2, x -> x^1.5, x -> x^(1 // 2),
              x -> 3^x, x -> ℯ^x, x -> pi * x, x -> sincos(x)[1], x -> -x, x -> +x,
              exp10, expm1, log1p, sinpi, cospi, asinh, atanh, x -> acosh(1 + x), sec)
        @test at(f(a)) ≈ f(point[1]) rtol = 1e-14
    end
    @test at(Swb.erf(a)) ≈ 0.3286267594591274 rtol = 1e-14
    @test at(m.t * m[:k] + m[:u]) ≈ 0.8 * 2.5 + 0.4
    # numbers stay numbers until they meet an expression
    @test Swb.Expression(2) + Swb.Expression(3) == Swb.Expression(5) && sqrt(Swb.Expression(4)) == 2
    @test a + b == a + b && isequal(a + b, b + a) && !isequal(a + b, b + c) && hash(a * b) == hash(a * b) && a + 0 == a && iszero(zero(a))
    @test Float64(Swb.Expression(2.5)) == 2.5 && Swb.Expression(1) < Swb.Expression(2) && isless(Swb.Expression(1), Swb.Expression(2))
end

@testset "generic code" begin
    A = [1.0 2 3; 4 5 6; 7 8 10]
    x = collect(point)
    @test at((A * m.x)[2]) ≈ (A*x)[2]
    @test at(m.x'm.x) ≈ x'x && at(dot(m.x, A * m.x)) ≈ dot(x, A * x)
    @test at(norm(m.x)) ≈ norm(x) && at(sum(m.x)) ≈ sum(x) && at(prod(m.x)) ≈ prod(x)
    @test at(sum(m.x .^ 2 .+ sin.(m.x))) ≈ sum(x .^ 2 .+ sin.(x))
    @test at((sparse(A) * m.x)[3]) ≈ (A*x)[3]
    M = [2+a^2 b; b 3.0]
    exact = [2+0.09 -0.7; -0.7 3.0] \ [1.0, 1.9]
    @test [at(e) for e in M \ [1.0, c]] ≈ exact rtol = 1e-14
    @test [at(e) for e in M \ [1.0 c; c 2.0]] ≈ [2+0.09 -0.7; -0.7 3.0] \ [1.0 1.9; 1.9 2.0] rtol = 1e-14
    @test [at(e) for e in inv(M)] ≈ inv([2+0.09 -0.7; -0.7 3.0]) rtol = 1e-14
    @test at(det(M)) ≈ 2.09 * 3 - 0.49 && at(det([a b c; b c a; c a 1.0])) ≈ det([0.3 -0.7 1.9; -0.7 1.9 0.3; 1.9 0.3 1.0])
    @test at(norm(m.x, 2)) ≈ norm(x)
    @test [at(e) for e in jacobian([a * b, sin(c)], m.x)] ≈ [-0.7 0.3 0; 0 0 cos(1.9)]
    @test at(table(a, [0.0, 1, 2], [0.0, 1, 4]; kind = :lines)) ≈ 0.3
    @test string(a * b) == "x[1]*x[2]" && occursin("x[1] > 0", string(a > 0))
    f = ModelFunction((x, t) -> x[1] * x[2] + t, 2)
    g = external(f, [a, b]; t = c)[1]
    @test at(2g) ≈ 2(point[1] * point[2] + point[3])
end

@testset "what switches" begin
    slope(rhs, x) = (n = Model(states = 1); derivatives!(n, [rhs(n.x[1])]); simulate(n, [x], 1e-3).u[end][1] - x) / 1e-3
    for (rhs, up, down) in ((x -> sign(x), 1, -1), (x -> abs(x) / abs(x), 1, 1), (x -> min(x, -x), -2, -2), (x -> max(x, -x), 2, 2),
                            (x -> clamp(x, -1, 1), 1, -1), (x -> relay(x, 3, 4), 3, 4), (x -> dead_zone(x, 1.0), 1, -1),
                            (x -> when(x > 0, 5, 6), 5, 6), (x -> when((x > 1) & !(x > 5) | (x < -3), 7, 8), 7, 8),
                            (x -> when(x >= 1, 2, 3) + when(x <= -1, 20, 30), 32, 23),
                            (x -> norm([x, 3.0], 1), 5, 5), (x -> norm([x, x / 4], Inf), 2, 2),
                            (x -> step_table(x, [-1, 1], [1, 2, 3]), 3, 1))
        @test slope(rhs, 2.0) ≈ up rtol = 1e-2
        @test slope(rhs, -2.0) ≈ down rtol = 1e-2
    end
    @test when(true, 1, 2) == 1 && (a > 0) == (a > 0)
end

@testset "models" begin
    n = Model(states = "q v", name = "block")
    @test refused(() -> System(n), :state, "no derivative", "for q, v:")
    derivatives!(n, :q => n[:v], n.x[2] => -n[:q] - 0.4sign(n[:v]))
    @test counts(n) == (subsystems = 1, switching_functions = 1, regions = 2, algebraic = 5, pairs = 2)
    @test occursin("block", report(n)) && occursin("\"", report(n; json = true)) && occursin("double", c_code(n))
    @test occursin("q' = v", sprint(show, MIME("text/plain"), n))
    again = from_json(Model, to_json(n))
    @test to_json(again) == to_json(n) && again.names == n.names && again.name == "block"
    @test simulate(again, (q = 1.0, v = 0.0), 3.0).u[end] == simulate(n, [1.0, 0.0], 3.0).u[end]
    try_at!(n, (q = 1, v = 2))
    @test to_json(from_json(Model, to_json(n))) == to_json(n)
    f = ModelFunction((x, t) -> x[1]^2 + t, 1; name = "mine")
    k = Model(states = 1)
    derivatives!(k, external(f, k.x; t = k.t))
    @test refused(() -> from_json(Model, to_json(k)), :state, "mine")
    same = from_json(Model, to_json(k); functions = [f])
    @test simulate(same, [0.1], 0.5).u[end] == simulate(k, [0.1], 0.5).u[end] && System(same).serial
end

@testset "refusals" begin
    other = Model(states = 1)
    @test refused(() -> a + other.x[1], :range, "two models")
    @test refused(() -> Float64(a), :unsupported, "no value")
    @test refused(() -> zeros(2) .= a, :unsupported)
    @test refused(() -> isless(a, b), :unsupported, "when")
    @test refused(() -> cbrt(a), :unsupported) && refused(() -> ceil(a), :unsupported, "step_table") && refused(() -> a % 2, :unsupported, "rem")
    @test refused(() -> round(a; digits = 2), :unsupported) && refused(() -> det(fill(a, 5, 5)), :unsupported)
    @test refused(() -> when(a, 1, 2), :range, "a comparison") && refused(() -> when(a > 0, 1, "b"), :range, "String")
    @test thrown(() -> a > 0 ? 1 : 2) isa TypeError
    @test refused(() -> derivatives!(other, [1, 2]), :dimension, "2 derivatives for 1")
    @test refused(() -> derivatives!(other, [a]), :range, "another model")
    @test refused(() -> derivatives!(m, :nothing => 1), :range, "no state")
    @test refused(() -> m[:nothing], :range, "no variable")
    @test refused(() -> Model(states = (:q, :q)), :range, "one name")
    @test refused(() -> Model(states = -1), :dimension)
    @test refused(() -> ModelFunction(m, sign(a)), :unsupported)
    @test refused(() -> table(a, [1.0, 0.0], [0.0, 1.0]), :range)
    @test refused(() -> step_table(a, [1, 2], [1, 2]), :dimension)
    @test refused(() -> external(ModelFunction(x -> x[1], 2), [a]), :dimension)
    @test refused(() -> [a b; b a] \ [1.0, 2.0, 3.0], :dimension)
    @test refused(() -> from_json(Model, "{}"), :range)
    @test refused(() -> from_json(Model, "no JSON"), :range)
    @test refused(() -> from_json(Model, 3), :range)
end
