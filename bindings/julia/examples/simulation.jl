# A block on a moving belt, held by a spring: it sticks, and slips when the spring pulls harder than friction holds; then the
# planar oscillator of Julia functions, with the derivatives of its end.
#
# usage: julia simulation.jl FOLDER_FOR_PICTURES

using Switchback

folder = isempty(ARGS) ? "." : ARGS[1]

belt = 0.3
m = Model(states = (:q, :v), parameters = (:F,))
q, v = m.x
friction = m[:F] * when(v > belt, -1 / (1 + v - belt), 1 / (1 - v + belt)) # falls with the speed of slipping
derivatives!(m, [v, -q + friction])
println(report(m))

sol = simulate(m, (q = 0.0, v = 0.0), (0.0, 30.0); p = (F = 1.0,), reltol = 1e-10, abstol = 1e-10)
for e in sol.switches
    what = e.kind === :enter ? "begins to stick" : e.kind === :leave ? "begins to slip" : "crosses"
    println("t = ", rpad(e.t, 19), " ", what)
end
picture(joinpath(folder, "julia_stick_slip.svg"), sol; title = "Stick and slip")

w = 2pi
inside, outside = [1 w; -w 1], [1 -w; w 1]
s = System(2)
add_subsystem!(s; modes = (x -> inside * x, x -> outside * x), psi = x -> x'x - 1, signs = [-1, 1])
sol = simulate(s, [exp(-1), 0], (0, pi / 2); reltol = 1e-10, sensitivity = true)
println("end: ", sol.u[end], ", derivatives with respect to the start: ", sol.dx_dx0)
picture(joinpath(folder, "julia_oscillator.svg"), sol; title = "Through the unit circle")
