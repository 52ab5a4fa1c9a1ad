"""
Simulation and optimal control of systems that switch.

    using Switchback
    m = Model(states = (:q, :v))
    q, v = m.x
    derivatives!(m, [v, -q - 0.4sign(v) + cos(0.5m.t)])
    sol = simulate(m, [1.0, 0.0], (0.0, 6.0))

Models: `Model` (expressions), `Scene` (bodies with contacts), `Projected` and `System` (functions). Simulation: `simulate`,
`Integrator`, `simulate_batch`, `simulate_steps` (many contacts), `simulate_fesd`. Optimal control: `Ocp`, `MultiPhase`. Programs with complementarity constraints: `Mpcc`, `minimize`. The C
interface is `Switchback.Lib`.
"""
module Switchback

using Libdl
using LinearAlgebra
using Printf
using SparseArrays

include("Lib.jl")
include("library.jl")
include("errors.jl")
include("call.jl")
include("expressions.jl")
include("arrays.jl")
include("settings.jl")
include("functions.jl")
include("monitors.jl")
include("systems.jl")
include("models.jl")
include("simulation.jl")
include("scenes.jl")
include("automata.jl")
include("steps.jl")
include("trajectories.jl")
include("ocp.jl")
include("programs.jl")
include("multiphase.jl")
include("shared.jl")
include("documents.jl")
include("pictures.jl")
include("problems.jl")

export Model, derivatives!, try_at!, counts, report, c_code, between_ends, external, jacobian, when, relay, dead_zone, table,
    step_table
export discrete!, transition!, every!, pwm!, stop_at!, note!, t_events, u_events, hysteresis!, choice!, Automaton, edge!, is_in, choose, intervals
export Scene, Projected, SceneContact, rates!, inertia!, force!, state_rates!, contact!, friction!, constraint!, impact_law!, contact_mode, contact_force
export simulate_steps, Stepper, Steps, impulses
export System, ModelFunction, set_f0!, add_subsystem!, add_subsystem_indicators!, add_inclusion!, set_algebraic!, add_complementarity!, surfaces,
    affine, casadi_function, jacobian_at, hessian_at, check_derivatives
export simulate, simulate_batch, simulate_fesd, Solution, Batch, Integrator, Simulator, Trajectory, FesdSolution, reinit!, step!,
    advance!, run!, clear!, set_state!, set_controls!, set_params!, set_stop_times!, set_tolerances!, set_preferred!, on_step!,
    on_branching!, state, derivative, state_at, active_modes, solution, switch_times, trajectory, outcome, reason, stats,
    residuals, successful
export Ocp, OcpResult, MultiPhase, MultiPhaseResult, solve!, result, set_lagrange!, set_mayer!, add_path!, add_terminal!,
    add_boundary!, add_periodic!, add_least_squares!, set_references!, add_relaxed!, add_complementarity!, set_state_bounds!,
    set_initial_bounds!, set_control_bounds!, set_param_bounds!, set_nominal!, set_initial_state!, set_initial_time!, set_stage_params!,
    set_state_guess!, set_control_guess!, set_elements!, set_durations!, set_free_time!, add_horizon!, set_linear_controls!,
    shift!, certificate, freezing_report, sensitivity, multipliers, modes, set_modes!, random_starts, solve_starts!, link!, link_continuous!, link_reset!
export Mpcc, Nlp, MpccResult, minimize, variable, constraint, add_pair!, add_box!, set_hessian!, set_bounds!, set_constraint_bounds!,
    set_start!, set_warm_start!, set_names!
export Settings, options, validate, set!, settings, set_settings!, on_iteration!, on_log!, interrupt!, print_iteration, to_json,
    from_json, picture, FilippovProblem
export SwitchbackError, ArgumentMistake, UserError, NumericError, LibraryError, InterruptedSolve, InternalError

function __init__()
    load_library()
    make_pointers() # addresses of compiled code do not outlive a process
end

end
