# Lives of objects: created, used and collected often; dropped in any order; functions unrooted when the library is done.

resident() = parse(Int, split(read("/proc/self/statm", String))[2]) * 4096

@testset "1e5 objects" begin
    collect_all() = (foreach(_ -> GC.gc(), 1:3); Swb.sweep())
    collect_all()
    rooted, live = Swb.sweep(), Swb.Lib.swb_live_objects()
    function once(k)
        f = ModelFunction(x -> x[1] + k, 1)
        f([1.0])[1] == 1 + k || error("wrong value")
        return nothing
    end
    foreach(once, 1:10_000)
    collect_all()
    before = resident()
    foreach(once, 1:100_000)
    collect_all()
    @test Swb.sweep() <= rooted + 2 && Swb.Lib.swb_live_objects() <= live + 2
    @test resident() - before < 20 << 20 # a leak of 200 bytes each would show
    # a system keeps its functions, whatever becomes of the handles
    s = System(1)
    set_f0!(s, ModelFunction(x -> -x[1], 1))
    collect_all()
    @test simulate(s, [1.0], 1.0).u[end][1] ≈ exp(-1) rtol = 1e-6
end

@testset "1e3 objects in any order" begin
    state_ = Ref(12345) # the same order every time
    random(n) = (state_[] = (state_[] * 1664525 + 1013904223) % 2^32; (state_[] >> 8) % n + 1)
    m, kept = oscillator_model(), Any[]
    makers = (() -> ModelFunction(x -> x[1], 2), oscillator, () -> System(m), () -> Integrator(m), () -> Simulator(m), tutorial, () -> Settings(),
              () -> Mpcc(2, x -> x'x; pairs = [(1, 2)], hess = (x, weight) -> [2weight 0; 0 2weight]), () -> simulate(m, OSCILLATOR_X0, 0.1),
              () -> Model(states = 2), () -> Ocp(m, 1.0, 2; mayer = m.x[1]), () -> simulate_batch(m, [0.1 0.2; 0 0], 0.1)[1])
    live = Swb.Lib.swb_live_objects()
    for k in 1:1000
        push!(kept, makers[random(length(makers))]())
        for _ in 1:random(3)-1
            isempty(kept) || deleteat!(kept, random(length(kept)))
        end
        k % 50 == 0 && GC.gc()
        k % 100 == 0 && !isempty(kept) && kept[end] isa Swb.Handle && close(kept[end])
    end
    @test all(o -> !(o isa Mpcc) || !isopen(o) || successful(solve!(o)), kept)
    empty!(kept)
    foreach(_ -> GC.gc(), 1:3)
    @test Swb.Lib.swb_live_objects() <= live + 3
end
