# Plot recipes for Plots.jl: `plot(sol)`, `plot(result)`. Not tested: no test of this repository can load RecipesBase.
module SwitchbackRecipesBaseExt

using RecipesBase
using Switchback
using Switchback: dense_times, state_labels

@recipe function f(sol::Switchback.Solution; switches = true)
    t = dense_times(sol.t)
    xguide --> "time"
    yguide --> "states"
    label --> permutedims(state_labels(sol.system.names[1], sol.system.nx))
    if switches && !isempty(sol.switches)
        @series begin
            seriestype := :vline
            linestyle := :dot
            linecolor := :grey
            label := ""
            unique(switch_times(sol))
        end
    end
    t, permutedims(sol(clamp.(t, sol.t_start, sol.t_end)))
end

@recipe function f(trajectory::Switchback.Trajectory)
    t = dense_times(trajectory.times)
    xguide --> "time"
    yguide --> "states"
    t, permutedims(trajectory(clamp.(t, trajectory.times[1], trajectory.times[end])))
end

@recipe function f(result::Switchback.OcpResult)
    layout := (2, 1)
    @series begin
        subplot := 1
        result.trajectory
    end
    @series begin
        subplot := 2
        seriestype := :steppost
        yguide := "controls"
        label := permutedims(["u$k" for k in axes(result.controls, 1)])
        result.control_times, permutedims([result.controls result.controls[:, end]])
    end
end

end
