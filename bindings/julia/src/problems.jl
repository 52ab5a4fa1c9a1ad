# A problem and its solution apart, as packages of SciML have them.

"""
    FilippovProblem(system, x0, tspan, p = nothing; u = nothing)

The problem that `simulate` solves, as data: `Switchback.solve(problem; reltol = 1e-10)`. With SciMLBase loaded (Julia 1.9
and later) it is `solve(problem)` of that package.
"""
struct FilippovProblem{S,X,P,U}
    system::S
    x0::X
    tspan::Tuple{Float64,Float64}
    p::P
    u::U
end

FilippovProblem(system, x0, tspan, p = nothing; u = nothing) = FilippovProblem(system_of(system), x0, time_span(tspan), p, u)

"""
    Switchback.solve(problem; keywords...) -> Solution

Solve a `FilippovProblem`; the keywords are those of `simulate`.
"""
solve(problem::FilippovProblem; keywords...) =
    simulate(problem.system, problem.x0, problem.tspan; p = problem.p, u = problem.u, keywords...)

Base.show(io::IO, problem::FilippovProblem) = print(io, "FilippovProblem from ", problem.tspan[1], " to ", problem.tspan[2], " of a ", problem.system)

"""
    Switchback.optimizer()

An optimizer of MathOptInterface for nonlinear programs with `Complements`; there is one where that package is loaded (Julia
1.9 and later): `using MathOptInterface; model = JuMP.Model(Switchback.optimizer)`.
"""
function optimizer end
