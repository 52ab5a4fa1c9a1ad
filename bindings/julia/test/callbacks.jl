# Functions of Julia: what they take and return, derivatives, exceptions, interrupts, what they keep.

struct Mine <: Exception
    where_::String
end
throw_mine(x) = x[1] > 0.5 ? throw(Mine("beyond")) : 1.0

@testset "what functions take and return" begin
    f = ModelFunction((x, u, t) -> (x[1] * u[1], [x[2], t]), 2, 1, 1; outputs = 3)
    @test f([2.0, 3]; u = [5], p = [0], t = 7) == [10, 3, 7]
    f = ModelFunction(2, 0, 1; outputs = 2) do out, x, p
        out[1] = x[1] + p[1]
        out[2] = x[2]
    end
    @test f([1, 2]; p = 10) == [11, 2] && f.outputs == 2 && occursin("2 outputs", string(f))
    @test ModelFunction(w -> sum(w), 3)([1, 2, 3]) == [6]
    @test ModelFunction(() -> 4.0, 1)([0]) == [4]
    @test ModelFunction(+, 1; inputs = (:x,))([3]) == [3]
    @test ModelFunction(sin, 0; inputs = :t)(; t = 0.5) == [sin(0.5)]
    @test affine([1, 2], [1 2; 3 4]; nx = 2)([1, 1]) == [4, 9]
    @test affine(5.0; nx = 1)([3]) == [5]
    @test refused(() -> ModelFunction((x, y) -> 1, 1), :range, "no input 'y'")
    @test refused(() -> ModelFunction(sin, 1), :range, "methods", "inputs")
    @test refused(() -> ModelFunction((x...) -> 1, 1), :range, "inputs")
    @test refused(() -> ModelFunction(3, 1), :range, "function")
    @test refused(() -> ModelFunction(x -> 1, -1), :dimension)
    @test refused(() -> ModelFunction(x -> 1, 1; linear = true, hess = x -> 0), :range)
    @test refused(() -> ModelFunction(x -> [1, 2], 1)([0]), :dimension, "returned 2", "expected 1")
    @test refused(() -> ModelFunction(x -> 1, 1; outputs = 2)([0]), :dimension, "returned 1")
    @test occursin("return missing", thrown(() -> ModelFunction(x -> nothing, 1)([0])).msg)
    @test occursin("real numbers", thrown(() -> ModelFunction(x -> "text", 1)([0])).msg)
    @test refused(() -> ModelFunction((out, x) -> push!(out, 1), 1)([0]), :dimension)
    @test refused(() -> ModelFunction(x -> 1, 2)([0]), :dimension)
    @test refused(() -> ModelFunction(x -> 1, 1)("text"), :range)
end

@testset "derivatives" begin
    value(x, u) = [x[1]^2 * u[1], x[2] * x[1]]
    jac(x, u) = [2x[1]*u[1] 0 x[1]^2; x[2] x[1] 0]
    hess(x, u, weights) = [2u[1]*weights[1] weights[2] 2x[1]*weights[1]; weights[2] 0 0; 2x[1]*weights[1] 0 0]
    at, u = [1.5, -0.5], [2.0]
    f = ModelFunction(value, 2, 1; outputs = 2, jac = jac, hess = hess)
    @test check_derivatives(f, at; u = u).passed
    @test jacobian_at(f, at; u = u)[:, 1:3] == jac(at, u) && hessian_at(f, at; u = u, weights = [3, 4])[1:3, 1:3] == hess(at, u, [3, 4])
    prototype = sparse([1, 2, 2, 1], [1, 1, 2, 3], 1.0)
    upper = sparse([1, 1, 1], [1, 2, 3], 1.0, 3, 3)
    in_place = (J, x, u) -> (J[1, 1] = 2x[1] * u[1]; J[2, 1] = x[2]; J[2, 2] = x[1]; J[1, 3] = x[1]^2)
    forms = [
        (jac = in_place, jac_prototype = prototype),
        (jac = (x, u) -> sparse(jac(x, u)), jac_prototype = prototype),
        (jac = (x, u) -> [2x[1] * u[1], x[2], x[1], x[1]^2], jac_prototype = prototype),
        (jac = (J, x, u) -> J .= jac(x, u),),
        (jac_prototype = Matrix(prototype), hess_prototype = upper),
        (hess = (H, x, u, weights) -> H .= hess(x, u, weights), hess_prototype = upper),
        (hess = (x, u, weights) -> [2u[1] * weights[1], weights[2], 2x[1] * weights[1]], hess_prototype = upper),
    ]
    for keywords in forms
        g = ModelFunction(value, 2, 1; outputs = 2, keywords...)
        @test jacobian_at(g, at; u = u) ≈ jacobian_at(f, at; u = u) rtol = 1e-6
        @test hessian_at(g, at; u = u) ≈ hessian_at(f, at; u = u) rtol = 1e-4
        haskey(keywords, :jac_prototype) && @test nnz(jacobian_at(g, at; u = u)) == 4
    end
    gradient = ModelFunction(x -> x'x, 2; jac = x -> 2x)
    @test jacobian_at(gradient, at)[1, 1:2] == 2at
    wrong = check_derivatives(ModelFunction(x -> x[1]^2, 1; jac = x -> 3x[1]), [1.0])
    @test !wrong.passed && wrong.max_error > 0.1 && !isempty(sprint(show, MIME("text/plain"), wrong))
    @test refused(() -> jacobian_at(ModelFunction(x -> x[1], 2; jac = x -> [1 0 0 0]), at), :dimension)
    @test refused(() -> jacobian_at(ModelFunction((x, t) -> x[1] * t, 2; jac = x -> [1 0]), at), :dimension)
    @test refused(() -> ModelFunction(x -> x[1], 2; jac = x -> 1, jac_prototype = ones(3, 3)), :dimension)
    @test refused(() -> jacobian_at(ModelFunction(x -> x, 2; outputs = 2, jac = x -> sparse([1 1; 1 1]), jac_prototype = sparse([1 0; 0 1])), at),
                  :range, "prototype has none")
    # parameters count, too
    g = ModelFunction((x, p) -> x[1] * p[1], 1, 0, 1)
    @test jacobian_at(g, [2.0]; p = [3.0])[1, 1:2] ≈ [3, 2] rtol = 1e-7
end

@testset "exceptions" begin
    s = System(1; f0 = throw_mine)
    e = thrown(() -> simulate(s, [0.0], 1.0))
    @test e isa Mine && e.where_ == "beyond"
    # the place where it was thrown is shown as its cause
    trace = try
        simulate(s, [0.0], 1.0)
    catch
        string(Base.catch_stack())
    end
    @test occursin("throw_mine", trace) && occursin("callbacks.jl", trace)
    @test simulate(s, [-2.0], 1.0).u[end][1] ≈ -1 # the system can be used further
    # a solver tries another point where a function is not defined, and says why if there is none
    for f in (x -> x[1] - log(x[1]), x -> x[1] < 0 ? NaN : x[1] - log(x[1]))
        program = Nlp(1, f; start = [5.0])
        @test solve!(program).x[1] ≈ 1 atol = 1e-6
        set_start!(program, [-1.0])
        e = thrown(() -> solve!(program))
        @test e isa UserError && e.status === :nonfinite && occursin("objective", e.msg)
        @test (e.cause isa DomainError) == (f([1.0]) isa Float64 && thrown(() -> f([-1.0])) isa DomainError)
        @test occursin("objective", sprint(showerror, e)) && outcome(program) === :failed
        set_start!(program, [2.0])
        @test successful(solve!(program))
    end
    # monitors
    ocp = tutorial()
    on_iteration!(ocp, i -> throw(Mine("iteration")))
    @test thrown(() -> solve!(ocp)).where_ == "iteration"
    on_iteration!(ocp, nothing)
    on_log!(ocp, (level, line) -> throw(Mine("log")))
    set!(ocp; log_level = :info)
    @test thrown(() -> solve!(ocp)).where_ == "log"
    on_log!(ocp, nothing)
    @test successful(solve!(ocp))
    i = Integrator(oscillator(); on_step = s -> throw(Mine("step")))
    reinit!(i, OSCILLATOR_X0)
    @test thrown(() -> advance!(i, 1.0)).where_ == "step"
end

@testset "stopping" begin
    seen = []
    ocp = tutorial(; on_iteration = i -> (push!(seen, i); i.iter == 3))
    r = solve!(ocp)
    @test r.outcome === :stopped && !successful(r) && seen[end].iter == 3 && seen[1].phase isa Char
    sol = simulate(oscillator(), OSCILLATOR_X0, OSCILLATOR_T; on_step = s -> s.steps == 4, h_max = 0.05)
    @test sol.retcode === :Terminated && sol.outcome === :stopped && sol.stats.steps == 4
    # interrupts: thrown by a function, and by Ctrl-C, after which the object can be used again
    s = System(1; f0 = (x, t) -> t > 0.5 && armed[] ? throw(InterruptException()) : 1.0)
    armed = Ref(true)
    @test thrown(() -> simulate(s, [0.0], 1.0)) isa InterruptException
    armed[] = false
    @test simulate(s, [0.0], 1.0).u[end][1] ≈ 1
    ccall(:jl_exit_on_sigint, Cvoid, (Cint,), 0)
    press() = ccall(:kill, Cint, (Cint, Cint), getpid(), 2)
    pressed = Ref(0)
    m = oscillator_model() # no function of Julia but the monitor
    waiting = s -> (pressed[] += 1) == 3 ? (press(); wait_a_little()) : false
    wait_a_little() = (until = time() + 5; while time() < until; sin(1.0); end; false)
    i = Integrator(m; h_max = 0.01, on_step = waiting)
    reinit!(i, OSCILLATOR_X0)
    @test thrown(() -> advance!(i, OSCILLATOR_T)) isa InterruptException
    @test pressed[] < 100
    on_step!(i, nothing)
    reinit!(i, OSCILLATOR_X0)
    @test advance!(i, OSCILLATOR_T) === :reached
    @test state(i) ≈ OSCILLATOR_XT rtol = 1e-6
    interrupt!(i)
    reinit!(i, OSCILLATOR_X0)
    @test advance!(i, OSCILLATOR_T) === :stopped && advance!(i, OSCILLATOR_T) === :reached
end

@testset "callbacks that capture, keep and mutate" begin
    kept, count_ = Vector{Float64}[], Ref(0)
    s = System(1; f0 = x -> (push!(kept, copy(x)); count_[] += 1; x[1] = 1e9; 1.0))
    sol = simulate(s, [0.0], 1.0)
    @test sol.u[end][1] ≈ 1 && count_[] == length(kept) > 3 && all(k -> abs(k[1]) < 1e6, kept)
    # a function that uses the library, and itself
    inner = ModelFunction(x -> x[1]^2, 1)
    calls = Ref(0)
    outer_f = Ref{Any}()
    outer = ModelFunction(1) do x
        calls[] += 1
        before = x[1]
        v = calls[] == 1 ? outer_f[]([10.0])[1] : 0.0
        @assert x[1] == before
        return inner(x)[1] + v + simulate(System(1; f0 = () -> 1.0), [0.0], 1.0).u[end][1]
    end
    outer_f[] = outer
    @test outer([3.0])[1] ≈ 9 + 1 + 100 + 1
    # an object cannot be used from its own callbacks, others can
    i = Integrator(oscillator())
    on_step!(i, s -> (advance!(i, 2.0); false))
    reinit!(i, OSCILLATOR_X0)
    @test refused(() -> advance!(i, 1.0), :state)
    on_step!(i, s -> (close(i); false))
    @test refused(() -> advance!(i, 1.0), :state, "in use")
    close(i)
    @test !isopen(i) && refused(() -> advance!(i, 1.0), :state, "closed") && close(i) === nothing
    @test occursin("closed", string(i))
    @test thrown(() -> copy(oscillator())) isa ErrorException && thrown(() -> deepcopy(oscillator())) isa ErrorException
end

@testset "calls allocate nothing" begin
    function allocated(f, n)
        at = Ref(Swb.Lib.swb_point(0.0, pointer(f.x), C_NULL, C_NULL))
        call() = GC.@preserve at Base.disable_sigint(() -> (for _ in 1:n; Swb.value_entry(Base.unsafe_convert(Ptr{Swb.Lib.swb_point}, at), pointer(f.out), f.c); end))
        call()
        return @allocated call()
    end
    x, out = [0.3, 0.4], zeros(2)
    callbacks(f) = Swb.Callbacks(0, (2, 0, 0, 2), Swb.Caller(f, Swb.BLOCKS, (:out,), nothing, "f"), nothing, nothing, Swb.Inputs(2, 0, 0, 2),
                                 zeros(2), Threads.Atomic{Int}(0))
    for f in (x -> (x[2], -x[1]), (out, x) -> (out[1] = x[2]; out[2] = -x[1]; nothing))
        few, many = (allocated((x = x, out = out, c = callbacks(f)), n) for n in (10, 1000))
        @test few == many
        @test out == [0.4, -0.3]
    end
end
