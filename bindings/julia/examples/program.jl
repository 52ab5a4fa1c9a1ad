# Programs with complementarity constraints: a small one, and one with sparse derivatives: the obstacle problem, in which a
# string is pulled down on an obstacle; forces of contact are there only where it touches.
#
# usage: julia program.jl

using Switchback, SparseArrays

r = minimize(x -> (x[1] - 1)^2 + (x[2] - 2)^2, [0.1, 0.2]; pairs = [(1, 2)])
println("x = ", r.x, ", objective ", r.objective, ", ", r.certificate.stationarity, "-stationary")

n = 50
h = 1 / (n + 1)
# variables: gaps between string and obstacle (at -0.15), forces of contact, and the load, chosen for a point at -0.13
gap, force, load, point = 1:n, n+1:2n, 2n+1, n ÷ 4
position(x, i) = 1 <= i <= n ? x[i] - 0.15 : 0.0
balance(x) = [(position(x, i - 1) - 2position(x, i) + position(x, i + 1)) / h^2 + x[n+i] - x[load] for i in 1:n]
function jac(J, x)
    for i in 1:n
        i > 1 && (J[i, i-1] = 1 / h^2)
        i < n && (J[i, i+1] = 1 / h^2)
        J[i, i] = -2 / h^2
        J[i, n+i], J[i, load] = 1, -1
    end
end
prototype = [spdiagm(-1 => ones(n - 1), 0 => ones(n), 1 => ones(n - 1)) spdiagm(0 => ones(n)) sparse(ones(n, 1))]
target(x) = (position(x, point) + 0.13)^2
program = Mpcc(2n + 1, target; constraints = balance, n_constraints = n, constraint_bounds = (0, 0), jac = jac,
               jac_prototype = prototype, hess = (H, x, weight, y) -> H[point, point] = 2weight,
               hess_prototype = sparse([point], [point], [1.0], 2n + 1, 2n + 1), pairs = [(i, n + i) for i in 1:n],
               bounds = (0, nothing), start = [fill(0.15, n); zeros(n + 1)])
r = solve!(program)
println(r.outcome, ": load ", r.x[load], ", ", count(<(1e-9), r.x[gap]), " points touch, ", r.stats.iterations, " iterations")
