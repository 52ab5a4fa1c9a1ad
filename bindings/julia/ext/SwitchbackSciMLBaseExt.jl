# `solve(FilippovProblem(...))` of SciML. Not tested: no test of this repository can load SciMLBase.
module SwitchbackSciMLBaseExt

using SciMLBase
using Switchback

const RETCODES = Dict(
    :Success => SciMLBase.ReturnCode.Success,
    :MaxIters => SciMLBase.ReturnCode.MaxIters,
    :DtLessThanMin => SciMLBase.ReturnCode.DtLessThanMin,
    :Terminated => SciMLBase.ReturnCode.Terminated,
    :Failure => SciMLBase.ReturnCode.Failure,
)

"""
    solve(problem::FilippovProblem; reltol, abstol, saveat, keywords...)

Solve by the event-driven integrator; the keywords are those of `simulate`. The result is a `Solution`, which has `t`, `u`,
`sol(t)` and `retcode` as solutions of SciML have.
"""
SciMLBase.solve(problem::Switchback.FilippovProblem, ::Nothing = nothing; saveat = nothing, keywords...) =
    saveat === nothing ? Switchback.solve(problem; keywords...) : Switchback.solve(problem; stop_times = saveat, keywords...)

"The return code of a solution as SciML has it."
SciMLBase.ReturnCode.T(sol::Switchback.Solution) = RETCODES[sol.retcode]
SciMLBase.successful_retcode(sol::Switchback.Solution) = sol.retcode === :Success

"The problem of SciML where nothing switches: the right-hand side of an ODEProblem becomes the smooth part of a system."
function Switchback.FilippovProblem(problem::SciMLBase.AbstractODEProblem)
    n, p = length(problem.u0), problem.p
    f0 = SciMLBase.isinplace(problem) ? (out, x, t) -> problem.f(out, x, p, t) : (x, t) -> problem.f(x, p, t)
    return Switchback.FilippovProblem(System(n; f0 = f0), problem.u0, problem.tspan)
end

end
