# A ball that bounces until it rests, and a block that is pushed over a rough floor harder and harder: when it begins to slide is
# known exactly.
#
# usage: julia scenes.jl FOLDER_FOR_PICTURES

using Switchback

folder = isempty(ARGS) ? "." : ARGS[1]

ball = Scene(:y; name = "ball")
force!(ball, [-9.81])
ground = contact!(ball, "floor", ball.q[1]; e = 0.8)
sol = simulate(ball, [1.0], [0.0], 5.0; reltol = 1e-10, abstol = 1e-10)
println(length(sol.impacts), " impacts, at rest from t = ", sol.accumulations[1].t, ", exactly ", 9sqrt(2 / 9.81))
println("the floor carries ", contact_force(sol, ground, 5.0)[1])
picture(joinpath(folder, "julia_ball.svg"), sol; title = "A ball that comes to rest")

mu, push = 0.3, 4.0
block = Scene((:x, :y); name = "block")
x, y = block.q
force!(block, [push * (1 - exp(-block.t)), -9.81])
contact!(block, "floor", y; tangents = x, mu = mu)
sol = simulate(block, [0.0, 0.0], [0.0, 0.0], 4.0; reltol = 1e-10, abstol = 1e-10)
println("it begins to slide at t = ", switch_times(sol)[end], ", exactly ", -log(1 - mu * 9.81 / push))
picture(joinpath(folder, "julia_block.svg"), sol; title = "A block that is pushed")
