# The cheapest way along two curves that catch the state: q' = -sign c(q) + v, v' = u. It reaches one curve, slides on it to
# where the curves cross, stays there for a while, and leaves for the goal.
#
# usage: julia optimal_control.jl FOLDER_FOR_PICTURES

using Switchback

folder = isempty(ARGS) ? "." : ARGS[1]

m = Model(states = (:q1, :q2, :v1, :v2), controls = (:u1, :u2))
q1, q2, v1, v2 = m.x
derivatives!(m, [v1 - sign(q1 + 0.15q2^2), v2 - sign(q2 - 0.05q1^3), m.u...])

ocp = Ocp(m, 4.0, 6; lagrange = m.u'm.u + v1^2 + v2^2, initial_state = [2pi / 3, pi / 3, 0, 0],
          state_bounds = ([-Inf, -Inf, -2, -2], [Inf, Inf, 2, 2]), control_bounds = (-10, 10), n_s = 2, n_fe = 6)
goal = [-pi / 6, -pi / 4]
add_terminal!(ocp, [q1, q2], goal, goal)

r = solve!(ocp)
println(r.outcome, ", cost ", r.cost, ", ", r.stats.iterations, " iterations")
println("the point is ", certificate(ocp).stationarity, "-stationary")
println("simulated again: the states differ by ", r.accuracy.worst)
for e in r.trajectory.switches
    println("  t = ", round(e.t; digits = 6), "  curve ", e.subsystem, ": modes ", e.before, " -> ", e.after)
end
picture(joinpath(folder, "julia_sliding_ocp.svg"), r; title = "Optimal control through two sliding modes")

# the cost does not depend on where the way begins, as its derivatives say, but on the velocity there
println("derivatives of the cost: ", round.(sensitivity(ocp).cost_x0; digits = 6))
set_initial_state!(ocp, [2pi / 3, pi / 3, 0.1, 0])
again = solve!(ocp; warm = true)
println("from another start: cost ", again.cost, ", ", again.stats.iterations, " iterations")
