# The C interface, generated from include/api.json by gen/generate.py; do not edit.
"""
The functions of the library as they are in C: `Switchback.Lib.swb_version()`.

Indices count from 0, matrices are stored by columns, sizes follow their arrays. A function whose result is a
`swb_status` returns 0 or a negative code; `swb_last_error` has the message. Arrays, `Ref`s, strings, `C_NULL` and the
objects of `Switchback` can be given as arguments. Nothing is checked here: a wrong length is a crash.
"""
module Lib

# Addresses of the functions in the loaded library, in the order of NAMES. They are looked up when the package is
# loaded, not when it is precompiled.
const ADDRESSES = Ptr{Cvoid}[]
address(i) = @inbounds ADDRESSES[i]

const HEADER_VERSION = v"0.2.0"

# --- enumerations: plain integers, so that numbers of a newer library are no error ---

"""
Runge-Kutta family (option rk_family).

- `SWB_RK_FAMILY_RADAU_IIA`: Radau IIA: stiffly accurate, order 2 n_s - 1.
- `SWB_RK_FAMILY_GAUSS_LEGENDRE`: Gauss-Legendre: order 2 n_s, no stage at the end of the element.
- `SWB_RK_FAMILY_EXPLICIT`: Explicit methods, for modes that are not stiff.
- `SWB_RK_FAMILY_RADAU_IA`: Radau IA: order 2 n_s - 1, a stage near the start instead of the end.
- `SWB_RK_FAMILY_LOBATTO_IIIA`: Lobatto IIIA: order 2 n_s - 2, stages at both ends; not for sliding modes.
- `SWB_RK_FAMILY_LOBATTO_IIIB`: Lobatto IIIB: order 2 n_s - 2; not for sliding modes.
- `SWB_RK_FAMILY_LOBATTO_IIIC`: Lobatto IIIC: order 2 n_s - 2, stiffly accurate.
"""
const swb_rk_family = Int64
const SWB_RK_FAMILY_RADAU_IIA = swb_rk_family(0)
const SWB_RK_FAMILY_GAUSS_LEGENDRE = swb_rk_family(1)
const SWB_RK_FAMILY_EXPLICIT = swb_rk_family(2)
const SWB_RK_FAMILY_RADAU_IA = swb_rk_family(3)
const SWB_RK_FAMILY_LOBATTO_IIIA = swb_rk_family(4)
const SWB_RK_FAMILY_LOBATTO_IIIB = swb_rk_family(5)
const SWB_RK_FAMILY_LOBATTO_IIIC = swb_rk_family(6)
const NAMES_swb_rk_family = [:radau_iia => 0, :gauss_legendre => 1, :explicit => 2, :radau_ia => 3, :lobatto_iiia => 4, :lobatto_iiib => 5, :lobatto_iiic => 6]

"""
Complementarity form of switching terms (option dcs_form).

- `SWB_DCS_FORM_AUTO`: Chosen for each subsystem. Stewart's form, unless the Heaviside form has fewer pairs and no more variables, or controls alone decide some of its switching functions and not the others.
- `SWB_DCS_FORM_STEWART`: One pair for each region.
- `SWB_DCS_FORM_HEAVISIDE`: Two pairs for each switching function; subsystems given by indicators stay in Stewart's form.
"""
const swb_dcs_form = Int64
const SWB_DCS_FORM_AUTO = swb_dcs_form(0)
const SWB_DCS_FORM_STEWART = swb_dcs_form(1)
const SWB_DCS_FORM_HEAVISIDE = swb_dcs_form(2)
const NAMES_swb_dcs_form = [:auto => 0, :stewart => 1, :heaviside => 2]

"""
Treatment of switches by the discretisation (option discretisation).

- `SWB_DISCRETISATION_FESD`: Finite elements with switch detection: element boundaries move onto the switches.
- `SWB_DISCRETISATION_STANDARD`: Fixed step sizes; switches lie inside the elements and the order drops to one.
"""
const swb_discretisation = Int64
const SWB_DISCRETISATION_FESD = swb_discretisation(0)
const SWB_DISCRETISATION_STANDARD = swb_discretisation(1)
const NAMES_swb_discretisation = [:fesd => 0, :standard => 1]

"""
Unknowns at the stage points (option stage_form).

- `SWB_STAGE_FORM_AUTO`: The library chooses.
- `SWB_STAGE_FORM_VALUES`: States at the stage points (integral form).
- `SWB_STAGE_FORM_DERIVATIVES`: State derivatives at the stage points (differential form).
"""
const swb_stage_form = Int64
const SWB_STAGE_FORM_AUTO = swb_stage_form(0)
const SWB_STAGE_FORM_VALUES = swb_stage_form(1)
const SWB_STAGE_FORM_DERIVATIVES = swb_stage_form(2)
const NAMES_swb_stage_form = [:auto => 0, :values => 1, :derivatives => 2]

"""
Granularity of the cross complementarity (option cross).

- `SWB_CROSS_ELEMENT`: One pair for each finite element and component, between two sums over the stage points.
- `SWB_CROSS_STAGE`: One pair for each stage point and component, against the sum over the element.
- `SWB_CROSS_FULL`: One pair for each pair of stage points and component.
- `SWB_CROSS_POINT`: One pair for each point and component, between the multiplier there and the sum of the weights over the element.
"""
const swb_cross = Int64
const SWB_CROSS_ELEMENT = swb_cross(0)
const SWB_CROSS_STAGE = swb_cross(1)
const SWB_CROSS_FULL = swb_cross(2)
const SWB_CROSS_POINT = swb_cross(3)
const NAMES_swb_cross = [:element => 0, :stage => 1, :full => 2, :point => 3]

"""
Step equilibration during the homotopy (option step_equilibration).

- `SWB_STEP_EQUILIBRATION_NONE`: No term: step sizes without a switch between them are not determined.
- `SWB_STEP_EQUILIBRATION_MEAN`: Penalty on the deviation from the mean step size.
- `SWB_STEP_EQUILIBRATION_DIFFERENCE`: Penalty on the difference of neighbouring step sizes.
- `SWB_STEP_EQUILIBRATION_ETA_PRODUCT`: Difference of neighbouring step sizes weighted by the switch indicator eta.
- `SWB_STEP_EQUILIBRATION_ETA_SQUARED`: Difference of neighbouring step sizes weighted by the square of the switch indicator eta.
- `SWB_STEP_EQUILIBRATION_ETA_EQUATION`: Products of switch indicator and difference of step sizes equal to zero.
- `SWB_STEP_EQUILIBRATION_ETA_SATURATED`: Difference of neighbouring step sizes weighted by the hyperbolic tangent of the switch indicator eta, whose size then counts only where it is small.
"""
const swb_step_equilibration = Int64
const SWB_STEP_EQUILIBRATION_NONE = swb_step_equilibration(0)
const SWB_STEP_EQUILIBRATION_MEAN = swb_step_equilibration(1)
const SWB_STEP_EQUILIBRATION_DIFFERENCE = swb_step_equilibration(2)
const SWB_STEP_EQUILIBRATION_ETA_PRODUCT = swb_step_equilibration(3)
const SWB_STEP_EQUILIBRATION_ETA_SQUARED = swb_step_equilibration(4)
const SWB_STEP_EQUILIBRATION_ETA_EQUATION = swb_step_equilibration(5)
const SWB_STEP_EQUILIBRATION_ETA_SATURATED = swb_step_equilibration(6)
const NAMES_swb_step_equilibration = [:none => 0, :mean => 1, :difference => 2, :eta_product => 3, :eta_squared => 4, :eta_equation => 5, :eta_saturated => 6]

"""
Polishing after the homotopy (option polish).

- `SWB_POLISH_OFF`: The interior point solution is final.
- `SWB_POLISH_ON`: Fix the active set and solve the smooth problem to polish_tol.
"""
const swb_polish = Int64
const SWB_POLISH_OFF = swb_polish(0)
const SWB_POLISH_ON = swb_polish(1)
const NAMES_swb_polish = [:off => 0, :on => 1]

"""
Initial guess of the discretised problem (option initial_guess).

- `SWB_INITIAL_GUESS_CONSTANT`: Initial value of the states at every node.
- `SWB_INITIAL_GUESS_SIMULATION`: A simulation with the guessed controls.
- `SWB_INITIAL_GUESS_SMOOTHED`: A simulation of the system smoothed as at the start of the homotopy, with weights and multipliers that fit.
- `SWB_INITIAL_GUESS_TIME_STEPPING`: The solution of the problem with fixed steps, early in its homotopy.
"""
const swb_initial_guess = Int64
const SWB_INITIAL_GUESS_CONSTANT = swb_initial_guess(0)
const SWB_INITIAL_GUESS_SIMULATION = swb_initial_guess(1)
const SWB_INITIAL_GUESS_SMOOTHED = swb_initial_guess(2)
const SWB_INITIAL_GUESS_TIME_STEPPING = swb_initial_guess(3)
const NAMES_swb_initial_guess = [:constant => 0, :simulation => 1, :smoothed => 2, :time_stepping => 3]

"""
Search for the solution of an optimal control problem (option ocp_start).

- `SWB_OCP_START_PORTFOLIO`: All ways in one race: the guess, smoothed problems, descents on simulations from random controls, and the homotopy. Each has its share of the work, and what gains has more. The cheapest solution that a simulation confirms is kept.
- `SWB_OCP_START_HOMOTOPY`: The homotopy from the guess alone.
- `SWB_OCP_START_SMOOTHING`: Smoothed problems and sequences next to their solutions; the homotopy only where they lead to no solution.
"""
const swb_ocp_start = Int64
const SWB_OCP_START_PORTFOLIO = swb_ocp_start(0)
const SWB_OCP_START_HOMOTOPY = swb_ocp_start(1)
const SWB_OCP_START_SMOOTHING = swb_ocp_start(2)
const NAMES_swb_ocp_start = [:portfolio => 0, :homotopy => 1, :smoothing => 2]

"""
Strategies for a program with complementarity constraints (option portfolio).

- `SWB_PORTFOLIO_OFF`: Only the homotopy that the other options describe.
- `SWB_PORTFOLIO_RESCUE`: The homotopy, and where it ends without a solution other strategies, until one has a solution.
- `SWB_PORTFOLIO_ALL`: All strategies; the best solution is kept.
- `SWB_PORTFOLIO_AGREE`: The strategies of rescue, then homotopies with heavier objectives until two have the same objective, then branches next to the best solution. The best solution is kept.
"""
const swb_portfolio = Int64
const SWB_PORTFOLIO_OFF = swb_portfolio(0)
const SWB_PORTFOLIO_RESCUE = swb_portfolio(1)
const SWB_PORTFOLIO_ALL = swb_portfolio(2)
const SWB_PORTFOLIO_AGREE = swb_portfolio(3)
const NAMES_swb_portfolio = [:off => 0, :rescue => 1, :all => 2, :agree => 3]

"""
Factorisation of the Newton matrices (option linear_solver).

- `SWB_LINEAR_SOLVER_AUTO`: Chosen by the fill of the factors: columns where they are sparse, dense blocks where they are not.
- `SWB_LINEAR_SOLVER_SUITESPARSE`: SuiteSparse LDL, column by column; only in a library linked with it.
- `SWB_LINEAR_SOLVER_FAER`: Dense blocks of columns, by faer; only in a library built with it.
- `SWB_LINEAR_SOLVER_NATIVE`: SuiteSparse's column-by-column algorithm, built into this library.
"""
const swb_linear_solver = Int64
const SWB_LINEAR_SOLVER_AUTO = swb_linear_solver(0)
const SWB_LINEAR_SOLVER_SUITESPARSE = swb_linear_solver(1)
const SWB_LINEAR_SOLVER_FAER = swb_linear_solver(2)
const SWB_LINEAR_SOLVER_NATIVE = swb_linear_solver(3)
const NAMES_swb_linear_solver = [:auto => 0, :suitesparse => 1, :faer => 2, :native => 3]

"""
Order of elimination in the Newton matrices (option ordering).

- `SWB_ORDERING_AMD`: Approximate minimum degree.
- `SWB_ORDERING_NATURAL`: Variables as they are numbered (for a horizon: along time), every row behind its last variable.
"""
const swb_ordering = Int64
const SWB_ORDERING_AMD = swb_ordering(0)
const SWB_ORDERING_NATURAL = swb_ordering(1)
const NAMES_swb_ordering = [:amd => 0, :natural => 1]

"""
Inputs with respect to which a simulation is differentiated (option sensitivity).

- `SWB_SENSITIVITY_OFF`: Nothing.
- `SWB_SENSITIVITY_ON`: Initial states, parameters and controls.
- `SWB_SENSITIVITY_INPUTS`: Parameters and controls, without initial states.
"""
const swb_sensitivity = Int64
const SWB_SENSITIVITY_OFF = swb_sensitivity(0)
const SWB_SENSITIVITY_ON = swb_sensitivity(1)
const SWB_SENSITIVITY_INPUTS = swb_sensitivity(2)
const NAMES_swb_sensitivity = [:off => 0, :on => 1, :inputs => 2]

"""
An ingredient of a method that can be left out.

- `SWB_TOGGLE_OFF`: The ingredient is left out.
- `SWB_TOGGLE_ON`: The ingredient is used.
"""
const swb_toggle = Int64
const SWB_TOGGLE_OFF = swb_toggle(0)
const SWB_TOGGLE_ON = swb_toggle(1)
const NAMES_swb_toggle = [:off => 0, :on => 1]

"""
Relaxation or penalty in the place of the complementarity constraints until the active set is identified (option relaxation).

- `SWB_RELAXATION_SCHOLTES`: Products at most sigma.
- `SWB_RELAXATION_SCHOLTES_EQ`: Products equal to sigma.
- `SWB_RELAXATION_SCHOLTES_LUMPED`: Sums of products at most sigma: one row per group, or one in all where pairs form no groups.
- `SWB_RELAXATION_LIN_FUKUSHIMA`: Products at most sigma, and products of the members shifted by sqrt(sigma) at least sigma.
- `SWB_RELAXATION_KADRANI`: Members at least -sqrt(sigma), products of the members less sqrt(sigma) not positive.
- `SWB_RELAXATION_STEFFENSEN_ULBRICH`: The corner of the feasible set rounded by a sine.
- `SWB_RELAXATION_STEFFENSEN_ULBRICH_POLY`: The corner of the feasible set rounded by a polynomial.
- `SWB_RELAXATION_KANZOW_SCHWARTZ`: One of the members at most sqrt(sigma).
- `SWB_RELAXATION_FISCHER_BURMEISTER`: Smoothed function of Fischer and Burmeister equal to zero.
- `SWB_RELAXATION_NATURAL_RESIDUAL`: Smoothed minimum of the members equal to zero.
- `SWB_RELAXATION_CHEN_CHEN_KANZOW`: Smoothed function of Chen, Chen and Kanzow equal to zero.
- `SWB_RELAXATION_TWO_SIDED`: Bounds and products relaxed pair by pair, tightened by the signs of the multipliers.
- `SWB_RELAXATION_RAGHUNATHAN_BIEGLER`: Products at most the barrier parameter.
- `SWB_RELAXATION_L1_PENALTY`: Sum of the products in the objective.
- `SWB_RELAXATION_LINF_PENALTY`: Largest product in the objective.
- `SWB_RELAXATION_L1_ELASTIC`: Products at most an elastic variable each, whose sum is in the objective.
- `SWB_RELAXATION_ELASTIC`: Products in the objective, ordinary rows relaxed by one elastic variable.
- `SWB_RELAXATION_DIRECT`: Products at most zero.
"""
const swb_relaxation = Int64
const SWB_RELAXATION_SCHOLTES = swb_relaxation(0)
const SWB_RELAXATION_SCHOLTES_EQ = swb_relaxation(1)
const SWB_RELAXATION_SCHOLTES_LUMPED = swb_relaxation(2)
const SWB_RELAXATION_LIN_FUKUSHIMA = swb_relaxation(3)
const SWB_RELAXATION_KADRANI = swb_relaxation(4)
const SWB_RELAXATION_STEFFENSEN_ULBRICH = swb_relaxation(5)
const SWB_RELAXATION_STEFFENSEN_ULBRICH_POLY = swb_relaxation(6)
const SWB_RELAXATION_KANZOW_SCHWARTZ = swb_relaxation(7)
const SWB_RELAXATION_FISCHER_BURMEISTER = swb_relaxation(8)
const SWB_RELAXATION_NATURAL_RESIDUAL = swb_relaxation(9)
const SWB_RELAXATION_CHEN_CHEN_KANZOW = swb_relaxation(10)
const SWB_RELAXATION_TWO_SIDED = swb_relaxation(11)
const SWB_RELAXATION_RAGHUNATHAN_BIEGLER = swb_relaxation(12)
const SWB_RELAXATION_L1_PENALTY = swb_relaxation(13)
const SWB_RELAXATION_LINF_PENALTY = swb_relaxation(14)
const SWB_RELAXATION_L1_ELASTIC = swb_relaxation(15)
const SWB_RELAXATION_ELASTIC = swb_relaxation(16)
const SWB_RELAXATION_DIRECT = swb_relaxation(17)
const NAMES_swb_relaxation = [:scholtes => 0, :scholtes_eq => 1, :scholtes_lumped => 2, :lin_fukushima => 3, :kadrani => 4, :steffensen_ulbrich => 5, :steffensen_ulbrich_poly => 6, :kanzow_schwartz => 7, :fischer_burmeister => 8, :natural_residual => 9, :chen_chen_kanzow => 10, :two_sided => 11, :raghunathan_biegler => 12, :l1_penalty => 13, :linf_penalty => 14, :l1_elastic => 15, :elastic => 16, :direct => 17]

"""
Changes of relaxation or penalty and barrier parameter (option homotopy).

- `SWB_HOMOTOPY_COUPLED`: Relaxation and barrier parameter fall together, and every problem is solved loosely.
- `SWB_HOMOTOPY_OUTER`: Every problem is solved to the tolerance, from a larger barrier parameter again.
"""
const swb_homotopy = Int64
const SWB_HOMOTOPY_COUPLED = swb_homotopy(0)
const SWB_HOMOTOPY_OUTER = swb_homotopy(1)
const NAMES_swb_homotopy = [:coupled => 0, :outer => 1]

"""
Integration method of the modes in event-driven simulation (option integration).

- `SWB_INTEGRATION_AUTO`: An explicit pair chosen by the tolerance, that of order 5 where switches cut one step after the other short; Radau IIA in modes that turn out to be stiff.
- `SWB_INTEGRATION_DP5`: Dormand and Prince 5(4).
- `SWB_INTEGRATION_DOP853`: Dormand and Prince 8(5,3).
- `SWB_INTEGRATION_RADAU5`: Radau IIA of order 5.
"""
const swb_integration = Int64
const SWB_INTEGRATION_AUTO = swb_integration(0)
const SWB_INTEGRATION_DP5 = swb_integration(1)
const SWB_INTEGRATION_DOP853 = swb_integration(2)
const SWB_INTEGRATION_RADAU5 = swb_integration(3)
const NAMES_swb_integration = [:auto => 0, :dp5 => 1, :dop853 => 2, :radau5 => 3]

"""
Continuation of an event-driven simulation where switches accumulate (option zeno).

- `SWB_ZENO_POLICY_CONTINUE`: Go on in the sliding mode on the surfaces where the switches accumulate, also in one of order two, whose indicators have no rate either. Without such a mode go on by steps with a stated error. Derivatives are NaN behind a mode of order two.
- `SWB_ZENO_POLICY_STOP`: End the run with the outcome zeno.
- `SWB_ZENO_POLICY_TIME_STEPPING`: Pass the accumulation by steps of a method that needs no switches, which also finds a sliding mode that begins there. Slower and less accurate than continue. Derivatives are NaN behind it.
"""
const swb_zeno_policy = Int64
const SWB_ZENO_POLICY_CONTINUE = swb_zeno_policy(0)
const SWB_ZENO_POLICY_STOP = swb_zeno_policy(1)
const SWB_ZENO_POLICY_TIME_STEPPING = swb_zeno_policy(2)
const NAMES_swb_zeno_policy = [:continue => 0, :stop => 1, :time_stepping => 2]

"""
Continuation of an event-driven simulation where it is not unique (option ambiguity).

- `SWB_AMBIGUITY_POLICY_FIRST`: Keep the present active set if it may continue, else take the fewest active cells, else the lowest indices.
- `SWB_AMBIGUITY_POLICY_STOP`: End the run with the outcome ambiguous.
- `SWB_AMBIGUITY_POLICY_PREFER`: Take the continuation whose active modes come first in the list of preferred modes; among equals as first.
"""
const swb_ambiguity_policy = Int64
const SWB_AMBIGUITY_POLICY_FIRST = swb_ambiguity_policy(0)
const SWB_AMBIGUITY_POLICY_STOP = swb_ambiguity_policy(1)
const SWB_AMBIGUITY_POLICY_PREFER = swb_ambiguity_policy(2)
const NAMES_swb_ambiguity_policy = [:first => 0, :stop => 1, :prefer => 2]

"""
Velocity of a sliding mode where surfaces meet and their effects multiply (option selection).

- `SWB_SELECTION_BILINEAR`: Every surface has a weight, and weights of modes are their products, as independent smoothings of the surfaces lead to.
- `SWB_SELECTION_MOMENTS`: Moments method for two surfaces: modes are balanced by the norms of their rates. Where more surfaces meet the simulation stops.
- `SWB_SELECTION_NORM`: Weights of the least Euclidean norm, as long as none of them vanishes.
- `SWB_SELECTION_FEWEST`: Fewest active cells that keep the surfaces: an extreme velocity.
"""
const swb_selection = Int64
const SWB_SELECTION_BILINEAR = swb_selection(0)
const SWB_SELECTION_MOMENTS = swb_selection(1)
const SWB_SELECTION_NORM = swb_selection(2)
const SWB_SELECTION_FEWEST = swb_selection(3)
const NAMES_swb_selection = [:bilinear => 0, :moments => 1, :norm => 2, :fewest => 3]

"""
Verbosity of the log sink; each level contains the ones before it (option log_level).

- `SWB_LOG_LEVEL_SILENT`: Nothing.
- `SWB_LOG_LEVEL_ERROR`: Failures.
- `SWB_LOG_LEVEL_WARNING`: Results that need attention.
- `SWB_LOG_LEVEL_INFO`: One summary per solve.
- `SWB_LOG_LEVEL_DEBUG`: One line per iteration.
- `SWB_LOG_LEVEL_TRACE`: Inner steps: line search, factorisations, active-set changes.
"""
const swb_log_level = Int64
const SWB_LOG_LEVEL_SILENT = swb_log_level(0)
const SWB_LOG_LEVEL_ERROR = swb_log_level(1)
const SWB_LOG_LEVEL_WARNING = swb_log_level(2)
const SWB_LOG_LEVEL_INFO = swb_log_level(3)
const SWB_LOG_LEVEL_DEBUG = swb_log_level(4)
const SWB_LOG_LEVEL_TRACE = swb_log_level(5)
const NAMES_swb_log_level = [:silent => 0, :error => 1, :warning => 2, :info => 3, :debug => 4, :trace => 5]

"""
Status of a call: 0 or a negative code that says why the call could not do its work.

How an algorithm ended (solved, infeasible, out of iterations, ...) is not a status but an outcome.
Numbers are only ever added. -1 to -19: arguments; -20 to -29: user functions; -30 to -49: numerics;
-50 to -59: resources.

- `SWB_OK`: The call did its work.
- `SWB_ERR_NULL`: A required pointer is NULL.
- `SWB_ERR_DIMENSION`: A size or an index does not fit.
- `SWB_ERR_RANGE`: A value is outside its range.
- `SWB_ERR_STATE`: The call does not fit the state of the object.
- `SWB_ERR_UNSUPPORTED`: The combination is not supported.
- `SWB_ERR_OPTION`: Unknown option, or a value of the wrong type.
- `SWB_ERR_USER`: A user function returned a negative code; see swb_last_user_code.
- `SWB_ERR_NONFINITE`: A user function has no finite value where one is needed.
- `SWB_ERR_INTERRUPTED`: Interrupted; the object can be used again.
- `SWB_ERR_NUMERIC`: The numerical method cannot go on and there is no usable result.
- `SWB_ERR_LIBRARY`: A foreign library failed, or a resource is missing.
- `SWB_ERR_INTERNAL`: A defect of the library; the object can only be freed.
"""
const swb_status = Int32
const SWB_OK = swb_status(0)
const SWB_ERR_NULL = swb_status(-1)
const SWB_ERR_DIMENSION = swb_status(-2)
const SWB_ERR_RANGE = swb_status(-3)
const SWB_ERR_STATE = swb_status(-4)
const SWB_ERR_UNSUPPORTED = swb_status(-5)
const SWB_ERR_OPTION = swb_status(-6)
const SWB_ERR_USER = swb_status(-20)
const SWB_ERR_NONFINITE = swb_status(-21)
const SWB_ERR_INTERRUPTED = swb_status(-23)
const SWB_ERR_NUMERIC = swb_status(-30)
const SWB_ERR_LIBRARY = swb_status(-50)
const SWB_ERR_INTERNAL = swb_status(-99)
const NAMES_swb_status = [:ok => 0, :null => -1, :dimension => -2, :range => -3, :state => -4, :unsupported => -5, :option => -6, :user => -20, :nonfinite => -21, :interrupted => -23, :numeric => -30, :library => -50, :internal => -99]

"""
Kind of an option.

- `SWB_KIND_INT`: Integer.
- `SWB_KIND_FLOAT`: Floating-point number.
- `SWB_KIND_ENUM`: Integer with value names; see swb_option_value_name.
"""
const swb_kind = Int64
const SWB_KIND_INT = swb_kind(0)
const SWB_KIND_FLOAT = swb_kind(1)
const SWB_KIND_ENUM = swb_kind(2)
const NAMES_swb_kind = [:int => 0, :float => 1, :enum => 2]

"""
How a solve ended. Numbers are only ever added.

- `SWB_OUTCOME_SOLVED`: All residuals are below the tolerance.
- `SWB_OUTCOME_MAX_ITER`: Out of iterations; the point is the last iterate.
- `SWB_OUTCOME_MAX_TIME`: Out of time; the point is the last iterate.
- `SWB_OUTCOME_STOPPED`: A callback or an interrupt asked to stop; the point is the last iterate.
- `SWB_OUTCOME_INFEASIBLE`: There is no point: all branches show it, or the linear rows of a program without pairs, or a point minimises the violation of the constraints.
- `SWB_OUTCOME_STALLED`: No progress is possible although the tolerance is not reached.
- `SWB_OUTCOME_DIVERGING`: The iterates diverge.
- `SWB_OUTCOME_FAILED`: There is no usable point; the call returned an error that says why.
- `SWB_OUTCOME_NOT_FOLLOWED`: Only for an optimal control problem: its discretised problem is solved, but simulations of the controls, single stages included, are another motion.
- `SWB_OUTCOME_LOCALLY_INFEASIBLE`: Converged to a point that minimises the violation of the constraints locally; whether there is a point elsewhere is not known.
"""
const swb_outcome = Int64
const SWB_OUTCOME_SOLVED = swb_outcome(0)
const SWB_OUTCOME_MAX_ITER = swb_outcome(1)
const SWB_OUTCOME_MAX_TIME = swb_outcome(2)
const SWB_OUTCOME_STOPPED = swb_outcome(3)
const SWB_OUTCOME_INFEASIBLE = swb_outcome(4)
const SWB_OUTCOME_STALLED = swb_outcome(5)
const SWB_OUTCOME_DIVERGING = swb_outcome(6)
const SWB_OUTCOME_FAILED = swb_outcome(7)
const SWB_OUTCOME_NOT_FOLLOWED = swb_outcome(8)
const SWB_OUTCOME_LOCALLY_INFEASIBLE = swb_outcome(9)
const NAMES_swb_outcome = [:solved => 0, :max_iter => 1, :max_time => 2, :stopped => 3, :infeasible => 4, :stalled => 5, :diverging => 6, :failed => 7, :not_followed => 8, :locally_infeasible => 9]

"""
Outcomes of the polish, which identifies the active set and solves the smooth problem that remains.

- `SWB_POLISHED_NONE`: Not asked for, or not reached.
- `SWB_POLISHED_DONE`: Yes: the pairs are exactly complementary.
- `SWB_POLISHED_REJECTED`: The identified branch has no solution; the point is that of the relaxation.
"""
const swb_polished = Int64
const SWB_POLISHED_NONE = swb_polished(0)
const SWB_POLISHED_DONE = swb_polished(1)
const SWB_POLISHED_REJECTED = swb_polished(2)
const NAMES_swb_polished = [:none => 0, :done => 1, :rejected => 2]

"""
Input blocks of a function, to be added up.

- `SWB_INPUT_X`: States, or variables.
- `SWB_INPUT_U`: Controls.
- `SWB_INPUT_P`: Parameters.
- `SWB_INPUT_T`: Time.
"""
const swb_input = Int64
const SWB_INPUT_X = swb_input(1)
const SWB_INPUT_U = swb_input(2)
const SWB_INPUT_P = swb_input(4)
const SWB_INPUT_T = swb_input(8)
const NAMES_swb_input = [:x => 1, :u => 2, :p => 4, :t => 8]

"""
Properties of a function, to be added up; see swb_function_set_flags.

- `SWB_SERIAL`: The callbacks are called by the thread that calls the library only, and one at a time: calls that would work on several threads use one. For functions in languages whose run time does not know the threads of the library, and for functions that keep something between calls.
"""
const swb_function_flag = Int64
const SWB_SERIAL = swb_function_flag(1)
const NAMES_swb_function_flag = [:serial => 1]

"""
Operators of expressions. Operands are called a, b and c; conditions are operands of Not, And, Or, and the first
of Where.

- `SWB_OPERATOR_NEG`: -a
- `SWB_OPERATOR_SQRT`: Square root.
- `SWB_OPERATOR_EXP`: Exponential.
- `SWB_OPERATOR_LOG`: Natural logarithm.
- `SWB_OPERATOR_SIN`: Sine.
- `SWB_OPERATOR_COS`: Cosine.
- `SWB_OPERATOR_TAN`: Tangent.
- `SWB_OPERATOR_ASIN`: Inverse sine.
- `SWB_OPERATOR_ACOS`: Inverse cosine.
- `SWB_OPERATOR_ATAN`: Inverse tangent.
- `SWB_OPERATOR_SINH`: Hyperbolic sine.
- `SWB_OPERATOR_COSH`: Hyperbolic cosine.
- `SWB_OPERATOR_TANH`: Hyperbolic tangent.
- `SWB_OPERATOR_ERF`: Error function.
- `SWB_OPERATOR_FLOOR`: The largest whole number that is not larger: in resets of transitions, and nowhere else.
- `SWB_OPERATOR_ADD`: a + b
- `SWB_OPERATOR_SUB`: a - b
- `SWB_OPERATOR_MUL`: a b
- `SWB_OPERATOR_DIV`: a / b
- `SWB_OPERATOR_POW`: a to the power of b; for a constant integer b any a is allowed.
- `SWB_OPERATOR_ATAN2`: Angle of the point (b, a).
- `SWB_OPERATOR_POSITIVE`: Condition a > 0; the same as a >= 0, the solution is Filippov's.
- `SWB_OPERATOR_NOT`: Condition: not a.
- `SWB_OPERATOR_AND`: Condition: a and b.
- `SWB_OPERATOR_OR`: Condition: a or b.
- `SWB_OPERATOR_WHERE`: b where the condition a holds, else c.
- `SWB_OPERATOR_SIGN`: Sign of a. This one and those below switch: they are for the derivatives of models only.
- `SWB_OPERATOR_ABS`: Modulus of a.
- `SWB_OPERATOR_MIN`: The smaller of a and b.
- `SWB_OPERATOR_MAX`: The larger of a and b.
- `SWB_OPERATOR_CLIP`: a limited to the interval from b to c.
- `SWB_OPERATOR_RELAY`: b where a > 0, else c.
- `SWB_OPERATOR_DEAD_ZONE`: Distance of a from the interval from -b to b, with sign.
"""
const swb_operator = Int64
const SWB_OPERATOR_NEG = swb_operator(0)
const SWB_OPERATOR_SQRT = swb_operator(1)
const SWB_OPERATOR_EXP = swb_operator(2)
const SWB_OPERATOR_LOG = swb_operator(3)
const SWB_OPERATOR_SIN = swb_operator(4)
const SWB_OPERATOR_COS = swb_operator(5)
const SWB_OPERATOR_TAN = swb_operator(6)
const SWB_OPERATOR_ASIN = swb_operator(7)
const SWB_OPERATOR_ACOS = swb_operator(8)
const SWB_OPERATOR_ATAN = swb_operator(9)
const SWB_OPERATOR_SINH = swb_operator(10)
const SWB_OPERATOR_COSH = swb_operator(11)
const SWB_OPERATOR_TANH = swb_operator(12)
const SWB_OPERATOR_ERF = swb_operator(13)
const SWB_OPERATOR_FLOOR = swb_operator(14)
const SWB_OPERATOR_ADD = swb_operator(20)
const SWB_OPERATOR_SUB = swb_operator(21)
const SWB_OPERATOR_MUL = swb_operator(22)
const SWB_OPERATOR_DIV = swb_operator(23)
const SWB_OPERATOR_POW = swb_operator(24)
const SWB_OPERATOR_ATAN2 = swb_operator(25)
const SWB_OPERATOR_POSITIVE = swb_operator(40)
const SWB_OPERATOR_NOT = swb_operator(41)
const SWB_OPERATOR_AND = swb_operator(42)
const SWB_OPERATOR_OR = swb_operator(43)
const SWB_OPERATOR_WHERE = swb_operator(44)
const SWB_OPERATOR_SIGN = swb_operator(45)
const SWB_OPERATOR_ABS = swb_operator(46)
const SWB_OPERATOR_MIN = swb_operator(47)
const SWB_OPERATOR_MAX = swb_operator(48)
const SWB_OPERATOR_CLIP = swb_operator(49)
const SWB_OPERATOR_RELAY = swb_operator(50)
const SWB_OPERATOR_DEAD_ZONE = swb_operator(51)
const NAMES_swb_operator = [:neg => 0, :sqrt => 1, :exp => 2, :log => 3, :sin => 4, :cos => 5, :tan => 6, :asin => 7, :acos => 8, :atan => 9, :sinh => 10, :cosh => 11, :tanh => 12, :erf => 13, :floor => 14, :add => 20, :sub => 21, :mul => 22, :div => 23, :pow => 24, :atan2 => 25, :positive => 40, :not => 41, :and => 42, :or => 43, :where => 44, :sign => 45, :abs => 46, :min => 47, :max => 48, :clip => 49, :relay => 50, :dead_zone => 51]

"""
Kinds of tables.

- `SWB_TABLE_STEPS`: Constant pieces between breaks, one value more than breaks; jumps without switching functions: for functions of time with breaks on the grid.
- `SWB_TABLE_LINES`: Straight lines through points, constant outside.
- `SWB_TABLE_SPLINE`: Cubic spline through points with two continuous derivatives.
"""
const swb_table = Int64
const SWB_TABLE_STEPS = swb_table(0)
const SWB_TABLE_LINES = swb_table(1)
const SWB_TABLE_SPLINE = swb_table(2)
const NAMES_swb_table = [:steps => 0, :lines => 1, :spline => 2]

"""
Kinds of switches.

- `SWB_SWITCH_KIND_CROSS`: Modes leave the active set and others enter it.
- `SWB_SWITCH_KIND_ENTER`: Modes enter: a sliding mode begins, or gets another mode.
- `SWB_SWITCH_KIND_LEAVE`: Modes leave: a sliding mode ends, or loses a mode.
"""
const swb_switch_kind = Int64
const SWB_SWITCH_KIND_CROSS = swb_switch_kind(0)
const SWB_SWITCH_KIND_ENTER = swb_switch_kind(1)
const SWB_SWITCH_KIND_LEAVE = swb_switch_kind(2)
const NAMES_swb_switch_kind = [:cross => 0, :enter => 1, :leave => 2]

"""
How an event-driven simulation stands. Numbers are only ever added.

- `SWB_RUN_OUTCOME_REACHED`: The time asked for is reached.
- `SWB_RUN_OUTCOME_MAX_STEPS`: More steps than the option max_steps allows.
- `SWB_RUN_OUTCOME_STEP_TOO_SMALL`: The step became too short: a solution that grows without bound, a function that is not defined, tolerances below rounding.
- `SWB_RUN_OUTCOME_ZENO`: Switches accumulate, and there is no sliding mode beyond, or the option zeno says stop.
- `SWB_RUN_OUTCOME_AMBIGUOUS`: The continuation is not unique and the option ambiguity says stop.
- `SWB_RUN_OUTCOME_NO_CONTINUATION`: No active set continues the solution.
- `SWB_RUN_OUTCOME_EVENT`: A transition of the effect SWB_EFFECT_STOP happened: the run has ended where it was to.
- `SWB_RUN_OUTCOME_STOPPED`: A callback or an interrupt asked to stop; the next call goes on.
"""
const swb_run_outcome = Int64
const SWB_RUN_OUTCOME_REACHED = swb_run_outcome(0)
const SWB_RUN_OUTCOME_MAX_STEPS = swb_run_outcome(1)
const SWB_RUN_OUTCOME_STEP_TOO_SMALL = swb_run_outcome(2)
const SWB_RUN_OUTCOME_ZENO = swb_run_outcome(3)
const SWB_RUN_OUTCOME_AMBIGUOUS = swb_run_outcome(4)
const SWB_RUN_OUTCOME_NO_CONTINUATION = swb_run_outcome(5)
const SWB_RUN_OUTCOME_EVENT = swb_run_outcome(6)
const SWB_RUN_OUTCOME_STOPPED = swb_run_outcome(100)
const NAMES_swb_run_outcome = [:reached => 0, :max_steps => 1, :step_too_small => 2, :zeno => 3, :ambiguous => 4, :no_continuation => 5, :event => 6, :stopped => 100]

"""
Kinds of switches of an event-driven simulation.

- `SWB_EVENT_KIND_CROSS`: Modes leave the active set and others enter it.
- `SWB_EVENT_KIND_ENTER`: Modes enter: a sliding mode begins, or gets another mode.
- `SWB_EVENT_KIND_LEAVE`: Modes leave: a sliding mode ends, or loses a mode.
- `SWB_EVENT_KIND_SPONTANEOUS`: Modes leave although they could stay: the solution is not unique.
"""
const swb_event_kind = Int64
const SWB_EVENT_KIND_CROSS = swb_event_kind(0)
const SWB_EVENT_KIND_ENTER = swb_event_kind(1)
const SWB_EVENT_KIND_LEAVE = swb_event_kind(2)
const SWB_EVENT_KIND_SPONTANEOUS = swb_event_kind(3)
const NAMES_swb_event_kind = [:cross => 0, :enter => 1, :leave => 2, :spontaneous => 3]

"""
The direction in which the guard of a transition passes zero.

- `SWB_DIRECTION_RISING`: From below: the transition happens where the guard becomes positive.
- `SWB_DIRECTION_FALLING`: From above: the transition happens where the guard becomes negative.
"""
const swb_direction = Int64
const SWB_DIRECTION_RISING = swb_direction(0)
const SWB_DIRECTION_FALLING = swb_direction(1)
const NAMES_swb_direction = [:rising => 0, :falling => 1]

"""
What happens where the condition of a transition becomes true.

- `SWB_EFFECT_JUMP`: The state jumps.
- `SWB_EFFECT_NOTE`: Time and state are written down; no step ends for that.
- `SWB_EFFECT_STOP`: The run ends there.
"""
const swb_effect = Int64
const SWB_EFFECT_JUMP = swb_effect(0)
const SWB_EFFECT_NOTE = swb_effect(1)
const SWB_EFFECT_STOP = swb_effect(2)
const NAMES_swb_effect = [:jump => 0, :note => 1, :stop => 2]

"""
Does a transition happen where its condition is true, or where it becomes true?

- `SWB_TRIGGER_LEVEL`: Where it is true: at once when its discrete states begin, if it is true then.
- `SWB_TRIGGER_EDGE`: Where it becomes true: what is true when its discrete states begin has to be false before. All that note or stop have this one.
"""
const swb_trigger = Int64
const SWB_TRIGGER_LEVEL = swb_trigger(0)
const SWB_TRIGGER_EDGE = swb_trigger(1)
const NAMES_swb_trigger = [:level => 0, :edge => 1]

"""
Laws for several contacts that close at once.

- `SWB_IMPACT_LAW_NEWTON`: Newton's law for all contacts in one complementarity problem (Moreau).
- `SWB_IMPACT_LAW_SEQUENTIAL`: Newton's law for one contact after the other, the one that closes fastest first.
"""
const swb_impact_law = Int64
const SWB_IMPACT_LAW_NEWTON = swb_impact_law(0)
const SWB_IMPACT_LAW_SEQUENTIAL = swb_impact_law(1)
const NAMES_swb_impact_law = [:newton => 0, :sequential => 1]

"""
Causes of impacts.

- `SWB_IMPACT_KIND_COLLISION`: A contact closed.
- `SWB_IMPACT_KIND_PAINLEVE`: No forces continue the motion (Painleve): sliding stops by an impact without collision.
- `SWB_IMPACT_KIND_LAST`: Impacts accumulate: this is the last, the contact stays closed.
"""
const swb_impact_kind = Int64
const SWB_IMPACT_KIND_COLLISION = swb_impact_kind(0)
const SWB_IMPACT_KIND_PAINLEVE = swb_impact_kind(1)
const SWB_IMPACT_KIND_LAST = swb_impact_kind(2)
const NAMES_swb_impact_kind = [:collision => 0, :painleve => 1, :last => 2]

"""
Modes of a contact.

- `SWB_CONTACT_MODE_OPEN`: Open: no force.
- `SWB_CONTACT_MODE_CLOSED`: Closed; with friction, sticking. Of a switch: its function stays at zero.
- `SWB_CONTACT_MODE_SLIDES`: Sliding: in the plane along the tangent, in space in any direction. Of a switch: its function is positive.
- `SWB_CONTACT_MODE_SLIDES_BACK`: Sliding against the tangent, in the plane. Of a switch: its function is negative.
"""
const swb_contact_mode = Int64
const SWB_CONTACT_MODE_OPEN = swb_contact_mode(0)
const SWB_CONTACT_MODE_CLOSED = swb_contact_mode(1)
const SWB_CONTACT_MODE_SLIDES = swb_contact_mode(2)
const SWB_CONTACT_MODE_SLIDES_BACK = swb_contact_mode(3)
const NAMES_swb_contact_mode = [:open => 0, :closed => 1, :slides => 2, :slides_back => 3]

"""
Results of a step.

- `SWB_PROGRESS_KIND_STEPPED`: A step inside of a mode.
- `SWB_PROGRESS_KIND_SWITCHED`: A step that ends at a switch.
- `SWB_PROGRESS_KIND_DONE`: Nothing, or no more: the time asked for is reached, or the simulation ended; see swb_integrator_get_outcome.
- `SWB_PROGRESS_KIND_STOP_TIME`: A step that ends at a stop time.
"""
const swb_progress_kind = Int64
const SWB_PROGRESS_KIND_STEPPED = swb_progress_kind(0)
const SWB_PROGRESS_KIND_SWITCHED = swb_progress_kind(1)
const SWB_PROGRESS_KIND_DONE = swb_progress_kind(2)
const SWB_PROGRESS_KIND_STOP_TIME = swb_progress_kind(3)
const NAMES_swb_progress_kind = [:stepped => 0, :switched => 1, :done => 2, :stop_time => 3]

"""
Work done between two samples.

- `SWB_NMPC_SCHEME_RTI`: One linearisation at the last iterate per sample.
- `SWB_NMPC_SCHEME_MLI`: One iteration of a level per sample; levels A, B, C keep the matrices of the first linearisation.
- `SWB_NMPC_SCHEME_AS_RTI`: Iterations of a level on the problem with the predicted state, then a linearisation.
- `SWB_NMPC_SCHEME_ASC`: The problem with the predicted state is solved until it converges, then linearised.
"""
const swb_nmpc_scheme = Int64
const SWB_NMPC_SCHEME_RTI = swb_nmpc_scheme(0)
const SWB_NMPC_SCHEME_MLI = swb_nmpc_scheme(1)
const SWB_NMPC_SCHEME_AS_RTI = swb_nmpc_scheme(2)
const SWB_NMPC_SCHEME_ASC = swb_nmpc_scheme(3)
const NAMES_swb_nmpc_scheme = [:rti => 0, :mli => 1, :as_rti => 2, :asc => 3]

"""
Levels of an iteration by what it evaluates.

- `SWB_NMPC_LEVEL_A`: Nothing: another initial value in the same quadratic program.
- `SWB_NMPC_LEVEL_B`: Values of the constraints; the gradient from the frozen Hessian.
- `SWB_NMPC_LEVEL_C`: Besides, the gradient of the Lagrangian by an adjoint sweep.
- `SWB_NMPC_LEVEL_D0`: All Jacobians; the Hessian is that of Gauss and Newton.
- `SWB_NMPC_LEVEL_D1`: All Jacobians; the Hessian is updated from gradients.
- `SWB_NMPC_LEVEL_D2`: All Jacobians and the exact Hessian, made convex.
"""
const swb_nmpc_level = Int64
const SWB_NMPC_LEVEL_A = swb_nmpc_level(0)
const SWB_NMPC_LEVEL_B = swb_nmpc_level(1)
const SWB_NMPC_LEVEL_C = swb_nmpc_level(2)
const SWB_NMPC_LEVEL_D0 = swb_nmpc_level(3)
const SWB_NMPC_LEVEL_D1 = swb_nmpc_level(4)
const SWB_NMPC_LEVEL_D2 = swb_nmpc_level(5)
const NAMES_swb_nmpc_level = [:a => 0, :b => 1, :c => 2, :d0 => 3, :d1 => 4, :d2 => 5]

"""
How quadratic programs are solved.

- `SWB_NMPC_QP_CONDENSING`: States eliminated, dual active set on the prepared inverse of the Hessian.
- `SWB_NMPC_QP_STAGEWISE`: States kept: active sets by a Riccati recursion, and an interior point where these do not settle. Work is linear in the number of stages.
- `SWB_NMPC_QP_AUTO`: The one of both that needs fewer operations at the size of the problem.
"""
const swb_nmpc_qp = Int64
const SWB_NMPC_QP_CONDENSING = swb_nmpc_qp(0)
const SWB_NMPC_QP_STAGEWISE = swb_nmpc_qp(1)
const SWB_NMPC_QP_AUTO = swb_nmpc_qp(2)
const NAMES_swb_nmpc_qp = [:condensing => 0, :stagewise => 1, :auto => 2]

"""
Numbers of C code.

- `SWB_C_REAL_DOUBLE`: double
- `SWB_C_REAL_FLOAT`: float
"""
const swb_c_real = Int64
const SWB_C_REAL_DOUBLE = swb_c_real(0)
const SWB_C_REAL_FLOAT = swb_c_real(1)
const NAMES_swb_c_real = [:double => 0, :float => 1]

"""
Sources of a control.

- `SWB_NMPC_SOURCE_QP`: The quadratic program.
- `SWB_NMPC_SOURCE_SOFT_QP`: The quadratic program with constraints at a price, since they cannot all be met.
- `SWB_NMPC_SOURCE_TANGENT`: The affine law, an unfinished quadratic program or the plan, cut off at the bounds of the controls: what costs least.
- `SWB_NMPC_SOURCE_PLAN`: The last plan.
- `SWB_NMPC_SOURCE_HOLD`: The last control again.
"""
const swb_nmpc_source = Int64
const SWB_NMPC_SOURCE_QP = swb_nmpc_source(0)
const SWB_NMPC_SOURCE_SOFT_QP = swb_nmpc_source(1)
const SWB_NMPC_SOURCE_TANGENT = swb_nmpc_source(2)
const SWB_NMPC_SOURCE_PLAN = swb_nmpc_source(3)
const SWB_NMPC_SOURCE_HOLD = swb_nmpc_source(4)
const NAMES_swb_nmpc_source = [:qp => 0, :soft_qp => 1, :tangent => 2, :plan => 3, :hold => 4]

"""
How a quadratic program ended.

- `SWB_NMPC_QP_STATUS_SOLVED`: Solved.
- `SWB_NMPC_QP_STATUS_INFEASIBLE`: Constraints contradict each other.
- `SWB_NMPC_QP_STATUS_OUT_OF_TIME`: The deadline or the bound on changes came first.
- `SWB_NMPC_QP_STATUS_FAILED`: Not convex on the controls, or not finite.
"""
const swb_nmpc_qp_status = Int64
const SWB_NMPC_QP_STATUS_SOLVED = swb_nmpc_qp_status(0)
const SWB_NMPC_QP_STATUS_INFEASIBLE = swb_nmpc_qp_status(1)
const SWB_NMPC_QP_STATUS_OUT_OF_TIME = swb_nmpc_qp_status(2)
const SWB_NMPC_QP_STATUS_FAILED = swb_nmpc_qp_status(3)
const NAMES_swb_nmpc_qp_status = [:solved => 0, :infeasible => 1, :out_of_time => 2, :failed => 3]

"""
Places at which a path constraint holds.

- `SWB_PATH_AT_CONTROL_GRID`: At both ends of every control stage, with the control of that stage.
- `SWB_PATH_AT_ELEMENTS`: At the start of every control stage and the end of every finite element.
- `SWB_PATH_AT_STAGE_POINTS`: At the start of every control stage and at every stage point.
"""
const swb_path_at = Int64
const SWB_PATH_AT_CONTROL_GRID = swb_path_at(0)
const SWB_PATH_AT_ELEMENTS = swb_path_at(1)
const SWB_PATH_AT_STAGE_POINTS = swb_path_at(2)
const NAMES_swb_path_at = [:control_grid => 0, :elements => 1, :stage_points => 2]

"""
Owners of multipliers. Those of constraints and bounds are positive where an upper bound is active and negative where a
lower one is: raising that bound by d changes the optimal cost by -d times the multiplier, to first order.

- `SWB_MULTIPLIERS_OF_COSTATES`: Costates, nx at the start of every control stage and at the end of the horizon: derivatives of the cost that is still to come, constraints behind that time included, with respect to the state; at the end, of terminal cost and constraints.
- `SWB_MULTIPLIERS_OF_INITIAL_STATE`: Bounds of the initial state, nx: where it is fixed, the negative derivative of the optimal cost with respect to it.
- `SWB_MULTIPLIERS_OF_STATES`: Bounds of the states, nx at the stage points and ends of all finite elements.
- `SWB_MULTIPLIERS_OF_CONTROLS`: Bounds of the controls, nu at the start of every control stage; zero for controls that are linear, whose values are bounded as states are.
- `SWB_MULTIPLIERS_OF_PARAMS`: Bounds of the parameters, np; zero for those that are given.
- `SWB_MULTIPLIERS_OF_PATH`: A path constraint, at all points at which it holds; those of all points together are the effect of its bound.
- `SWB_MULTIPLIERS_OF_TERMINAL`: A terminal constraint.
- `SWB_MULTIPLIERS_OF_BOUNDARY`: A constraint between both ends of the horizon.
- `SWB_MULTIPLIERS_OF_RELAXED`: A constraint that may be violated at a price.
"""
const swb_multipliers_of = Int64
const SWB_MULTIPLIERS_OF_COSTATES = swb_multipliers_of(0)
const SWB_MULTIPLIERS_OF_INITIAL_STATE = swb_multipliers_of(1)
const SWB_MULTIPLIERS_OF_STATES = swb_multipliers_of(2)
const SWB_MULTIPLIERS_OF_CONTROLS = swb_multipliers_of(3)
const SWB_MULTIPLIERS_OF_PARAMS = swb_multipliers_of(4)
const SWB_MULTIPLIERS_OF_PATH = swb_multipliers_of(5)
const SWB_MULTIPLIERS_OF_TERMINAL = swb_multipliers_of(6)
const SWB_MULTIPLIERS_OF_BOUNDARY = swb_multipliers_of(7)
const SWB_MULTIPLIERS_OF_RELAXED = swb_multipliers_of(8)
const NAMES_swb_multipliers_of = [:costates => 0, :initial_state => 1, :states => 2, :controls => 3, :params => 4, :path => 5, :terminal => 6, :boundary => 7, :relaxed => 8]

"""
Verdicts on an optimal control as a point of the control problem: whether the cost is stationary under changes of controls, free
lengths, free parameters and free initial states, when every change is simulated by events.

- `SWB_VERDICT_UNKNOWN`: Not known; swb_ocp_get_optimality_reason says why.
- `SWB_VERDICT_LOCAL_OPTIMUM`: No change lowers the cost to first order, or a descent on simulations gains nothing.
- `SWB_VERDICT_KINK`: Local optimum at a kink: switches lie exactly between control stages, surfaces are touched, or modes change, and the cost rises towards either side.
- `SWB_VERDICT_NOT_OPTIMAL`: Some change lowers the cost to first order.
- `SWB_VERDICT_GLOBAL`: An exact search over all choices (swb_system_add_choice) found no answer that costs less by more than the gap of swb_optimality.
"""
const swb_verdict = Int64
const SWB_VERDICT_UNKNOWN = swb_verdict(0)
const SWB_VERDICT_LOCAL_OPTIMUM = swb_verdict(1)
const SWB_VERDICT_KINK = swb_verdict(2)
const SWB_VERDICT_NOT_OPTIMAL = swb_verdict(3)
const SWB_VERDICT_GLOBAL = swb_verdict(4)
const NAMES_swb_verdict = [:unknown => 0, :local_optimum => 1, :kink => 2, :not_optimal => 3, :global => 4]

"""
How an optimal control problem of a scene finds contact modes and impacts.

- `SWB_JUMPS_AUTO`: By descents on simulations and by time stepping; where descents lead to no answer, also from a simulation of the guess and by finite elements with jumps.
- `SWB_JUMPS_MODES`: From a simulation of the guess and the orders of modes next to it.
- `SWB_JUMPS_FESD_J`: By finite elements with jumps: complementarity between gaps and forces in every element.
- `SWB_JUMPS_STEPS`: By time stepping: complementarity at the ends of equal steps of implicit Euler.
- `SWB_JUMPS_SHOTS`: By descents on simulations, from the guess and from controls that are drawn at random, always the same ones.
- `SWB_JUMPS_FREEZING`: By time-freezing: finite elements in a numerical time in which nothing jumps; without friction where there is restitution.
"""
const swb_jumps = Int64
const SWB_JUMPS_AUTO = swb_jumps(0)
const SWB_JUMPS_MODES = swb_jumps(1)
const SWB_JUMPS_FESD_J = swb_jumps(2)
const SWB_JUMPS_STEPS = swb_jumps(3)
const SWB_JUMPS_SHOTS = swb_jumps(4)
const SWB_JUMPS_FREEZING = swb_jumps(5)
const NAMES_swb_jumps = [:auto => 0, :modes => 1, :fesd_j => 2, :steps => 3, :shots => 4, :freezing => 5]

"""
Freedom of the optimiser in the lengths of the control stages.

- `SWB_FREE_TIME_NONE`: Nothing.
- `SWB_FREE_TIME_HORIZON`: The horizon; the stages keep their shares of it.
- `SWB_FREE_TIME_STAGES`: Every stage.
"""
const swb_free_time = Int64
const SWB_FREE_TIME_NONE = swb_free_time(0)
const SWB_FREE_TIME_HORIZON = swb_free_time(1)
const SWB_FREE_TIME_STAGES = swb_free_time(2)
const NAMES_swb_free_time = [:none => 0, :horizon => 1, :stages => 2]

"""
Places at which a least-squares term counts.

- `SWB_COST_AT_RUNNING`: Integrated along the horizon.
- `SWB_COST_AT_CONTROL_GRID`: Summed over the ends of the control stages.
- `SWB_COST_AT_TERMINAL`: At the end of the horizon.
"""
const swb_cost_at = Int64
const SWB_COST_AT_RUNNING = swb_cost_at(0)
const SWB_COST_AT_CONTROL_GRID = swb_cost_at(1)
const SWB_COST_AT_TERMINAL = swb_cost_at(2)
const NAMES_swb_cost_at = [:running => 0, :control_grid => 1, :terminal => 2]

"""
How the violation of a relaxed constraint is penalised.

- `SWB_NORM_L1`: Sum of the violations, integrated along the horizon.
- `SWB_NORM_L2`: Sum of their squares, integrated along the horizon.
- `SWB_NORM_LINF`: The largest violation.
"""
const swb_norm = Int64
const SWB_NORM_L1 = swb_norm(0)
const SWB_NORM_L2 = swb_norm(1)
const SWB_NORM_LINF = swb_norm(2)
const NAMES_swb_norm = [:l1 => 0, :l2 => 1, :linf => 2]

"""
Kinds of members of complementarity pairs.

- `SWB_MEMBER_VARIABLE`: A variable; its lower bound becomes zero.
- `SWB_MEMBER_CONSTRAINT`: A row of the constraints; its own bounds are not used.
"""
const swb_member = Int64
const SWB_MEMBER_VARIABLE = swb_member(0)
const SWB_MEMBER_CONSTRAINT = swb_member(1)
const NAMES_swb_member = [:variable => 0, :constraint => 1]

"""
On which sides of a parameter a derivative of a solution holds.

- `SWB_SIDES_BOTH`: On both: the solution is differentiable.
- `SWB_SIDES_RISING`: Where the parameter rises: a bound or pair is active without a multiplier, and on the other side the derivative is another.
- `SWB_SIDES_FALLING`: Where it falls, likewise.
- `SWB_SIDES_NEITHER`: On neither: the derivative is not known and is NaN. Active gradients are dependent, or several bounds or pairs are active without multipliers and do not stay so together.
"""
const swb_sides = Int64
const SWB_SIDES_BOTH = swb_sides(0)
const SWB_SIDES_RISING = swb_sides(1)
const SWB_SIDES_FALLING = swb_sides(2)
const SWB_SIDES_NEITHER = swb_sides(3)
const NAMES_swb_sides = [:both => 0, :rising => 1, :falling => 2, :neither => 3]

"""
Parts of a program that have names and can be violated. The first two are those of enum swb_member.

- `SWB_ITEM_VARIABLE`: A variable, by its bounds.
- `SWB_ITEM_CONSTRAINT`: A row of the constraints, by its bounds.
- `SWB_ITEM_PAIR`: A complementarity pair, in the order they were added, by min(G, H).
- `SWB_ITEM_BOX`: A box, in the order they were added, by the distance of its variable and constraint from complementarity.
"""
const swb_item = Int64
const SWB_ITEM_VARIABLE = swb_item(0)
const SWB_ITEM_CONSTRAINT = swb_item(1)
const SWB_ITEM_PAIR = swb_item(2)
const SWB_ITEM_BOX = swb_item(3)
const NAMES_swb_item = [:variable => 0, :constraint => 1, :pair => 2, :box => 3]

"""
The strongest type of stationarity for which multipliers of the pairs are known; nu of G, xi of H, at pairs of which
both members are zero.

- `SWB_STATIONARITY_S`: Strong: both not negative.
- `SWB_STATIONARITY_M`: Mordukhovich: both positive, or one of them zero.
- `SWB_STATIONARITY_C`: Clarke: the product not negative.
- `SWB_STATIONARITY_A`: Abadie: one of them not negative.
- `SWB_STATIONARITY_W`: Weak: any signs.
- `SWB_STATIONARITY_NONE`: There are no multipliers at all.
- `SWB_STATIONARITY_UNKNOWN`: Not known: the point is no exact one, or certificates are off.
"""
const swb_stationarity = Int64
const SWB_STATIONARITY_S = swb_stationarity(0)
const SWB_STATIONARITY_M = swb_stationarity(1)
const SWB_STATIONARITY_C = swb_stationarity(2)
const SWB_STATIONARITY_A = swb_stationarity(3)
const SWB_STATIONARITY_W = swb_stationarity(4)
const SWB_STATIONARITY_NONE = swb_stationarity(5)
const SWB_STATIONARITY_UNKNOWN = swb_stationarity(6)
const NAMES_swb_stationarity = [:s => 0, :m => 1, :c => 2, :a => 3, :w => 4, :none => 5, :unknown => 6]

"""
Answers to whether no step to first order leads to a better point.

- `SWB_B_STATIONARITY_YES`: None does: a B-stationary point, which has no descent.
- `SWB_B_STATIONARITY_NO`: There is a descent.
- `SWB_B_STATIONARITY_UNDECIDED`: Not decided; the doubt says why.
"""
const swb_b_stationarity = Int64
const SWB_B_STATIONARITY_YES = swb_b_stationarity(0)
const SWB_B_STATIONARITY_NO = swb_b_stationarity(1)
const SWB_B_STATIONARITY_UNDECIDED = swb_b_stationarity(2)
const NAMES_swb_b_stationarity = [:yes => 0, :no => 1, :undecided => 2]

"""
Reasons why a certificate does not say more.

- `SWB_DOUBT_NONE`: Nothing.
- `SWB_DOUBT_DATA`: Values that are not finite.
- `SWB_DOUBT_INFEASIBLE`: The point violates constraints, bounds or pairs.
- `SWB_DOUBT_NODES`: Too many pairs of which both members are zero.
- `SWB_DOUBT_ACCURACY`: A linear program could not be solved well enough to believe it.
- `SWB_DOUBT_STOPPED`: Interrupted, or out of time.
"""
const swb_doubt = Int64
const SWB_DOUBT_NONE = swb_doubt(0)
const SWB_DOUBT_DATA = swb_doubt(1)
const SWB_DOUBT_INFEASIBLE = swb_doubt(2)
const SWB_DOUBT_NODES = swb_doubt(3)
const SWB_DOUBT_ACCURACY = swb_doubt(4)
const SWB_DOUBT_STOPPED = swb_doubt(5)
const NAMES_swb_doubt = [:none => 0, :data => 1, :infeasible => 2, :nodes => 3, :accuracy => 4, :stopped => 5]

"""
Verdicts of the conditions of second order on a point with multipliers of type S.

- `SWB_SECOND_ORDER_STRICT_MINIMUM`: Sufficient conditions hold: a local minimum, and the only one near by.
- `SWB_SECOND_ORDER_SADDLE`: The objective falls along the active constraints, whose gradients are independent: no local minimum.
- `SWB_SECOND_ORDER_UNDECIDED`: Neither could be shown.
- `SWB_SECOND_ORDER_UNKNOWN`: Not asked, or no point with multipliers of type S.
"""
const swb_second_order = Int64
const SWB_SECOND_ORDER_STRICT_MINIMUM = swb_second_order(0)
const SWB_SECOND_ORDER_SADDLE = swb_second_order(1)
const SWB_SECOND_ORDER_UNDECIDED = swb_second_order(2)
const SWB_SECOND_ORDER_UNKNOWN = swb_second_order(3)
const NAMES_swb_second_order = [:strict_minimum => 0, :saddle => 1, :undecided => 2, :unknown => 3]

# --- structs ---

"""
Function with first and second derivatives: reference counted inside, so the handle may be freed as
soon as the function was handed to a model.
"""
mutable struct swb_function end

"""
Piecewise smooth system: x' = f0(x,u,p,t) plus, for each subsystem, a convex combination of its modes.
"""
mutable struct swb_system end

"""
Graph of expressions. Every expression is a number in its graph and exists once: equal expressions have equal
numbers. Expressions live as long as the graph; functions and models made of them are independent of it.
"""
mutable struct swb_expr end

"""
Model made of expressions: a piecewise smooth system with a report of what it consists of.
"""
mutable struct swb_model end

"""
Trajectory of a simulation or of an optimal control problem: finite elements, each a polynomial, that
end where the system switches. Owned by the caller, independent of the object it comes from.
"""
mutable struct swb_trajectory end

"""
Simulator of a system: time, state, and the trajectory since the state was set.
"""
mutable struct swb_simulator end

"""
Result of an event-driven simulation: state, switches, derivatives, dense output. Owned by the caller, independent
of the object it comes from.
"""
mutable struct swb_run end

"""
Scene: coordinates q, velocities v, inertia, forces and contacts, made of expressions in which the states are q, then v, then what is
beside them.
"""
mutable struct swb_scene end

"""
Event-driven integrator of a system: explicit or implicit steps inside of modes, sliding modes as
differential-algebraic equations, every switch located to rounding. swb_simulator solves the equations of FESD
instead.
"""
mutable struct swb_integrator end

"""
Stepper: makes steps of a scene by the theta-method of Moreau and Jean, in which impacts need not be located. For
scenes with many contacts; of order 1 in the step.
"""
mutable struct swb_stepper end

"""
Event-driven simulations of one system from several initial states, with controls and parameters of their own.
"""
mutable struct swb_batch end

"""
Estimator: states and constant parameters from the measurements of the last samples.
"""
mutable struct swb_mhe end

"""
Controller: feedback for measured states by a few iterations per sample on an optimal control problem.
"""
mutable struct swb_nmpc end

"""
Optimal control problem of a system: piecewise constant controls on an equidistant grid of stages.
"""
mutable struct swb_ocp end

"""
Optimal control problem of phases, each with its own system, horizon, costs and constraints, linked by constraints
between the end of one and the start of the next.
"""
mutable struct swb_multiphase end

"""
Nonlinear program with complementarity constraints: minimise f(w,p) subject to bounds on w and c(w,p),
0 <= G _|_ H >= 0 for pairs of variables or rows of c, and boxes lower <= w_i <= upper _|_ c_j. Without pairs and boxes, a
nonlinear program.
"""
mutable struct swb_mpcc end

"""
Settings of discretisation and solver.

Fill with `swb_settings_init` in C, `Settings::default()` in Rust, then change what differs. Fields
are only ever appended; every field is 8 bytes wide, so there are no holes. An integer field that is
an enumeration takes the values of the enumeration named in its description. Ranges: see the option
table (`swb_option_range`).

- `struct_size`: Size of this struct in bytes, written by the init function: tells the library how much to read.
- `rk_family`: Runge-Kutta family (enum rk_family).
- `n_s`: Stage points of the Runge-Kutta method.
- `n_fe`: Finite elements of a control stage or a simulation step.
- `discretisation`: Treatment of switches: moving element boundaries or fixed steps (enum discretisation).
- `stage_form`: Unknowns at the stage points (enum stage_form).
- `cross`: Granularity of the cross complementarity (enum cross).
- `step_equilibration`: Step equilibration during the homotopy (enum step_equilibration).
- `rho_h`: Weight of the soft step equilibration, in optimal control in multiples of the steepest change of the cost.
- `gamma_h`: Step sizes stay between (1 - gamma_h) and (1 + gamma_h) times the nominal one.
- `tol`: Convergence tolerance of the interior point at sigma = 0, before polishing.
- `max_iter`: Limit on the interior point iterations of one solve, over all homotopy steps.
- `max_time`: Limit on the wall time of one solve in seconds, with guesses, certificate, comparison and further rounds. The solve ends at most one factorisation or 16 model evaluations later, and returns the best point so far. A model function that runs is not interrupted.
- `mu_init`: Initial barrier parameter.
- `sigma_init`: Initial relaxation of the complementarity.
- `sigma_min`: Smallest relaxation of the complementarity.
- `sigma_factor`: Linear reduction of the relaxation: sigma becomes at most sigma_factor sigma.
- `sigma_exponent`: Superlinear reduction of the relaxation: sigma becomes at most sigma^sigma_exponent.
- `mu_over_sigma`: Barrier parameter of a relaxed problem as a multiple of its relaxation.
- `plateau_mu`: Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses.
- `plateau_viol`: Constraint violation at which the first problem, at sigma_init, counts as solved.
- `polish`: Identify the active set and solve the smooth problem that remains (enum polish).
- `polish_tol`: Tolerance of the solution after the option polish.
- `initial_guess`: Initial guess of a solve without a guess of the states (enum initial_guess).
- `log_level`: Verbosity of the log sink (enum log_level).
- `linear_solver`: Factorisation of the Newton matrices (enum linear_solver).
- `ordering`: Order of elimination in the Newton matrices (enum ordering).
- `scaling`: Scale objective and rows by their gradients at the starting point (enum toggle).
- `centre_pairs`: Start the pairs of a program on the central path instead of at the starting point (enum toggle).
- `convexify_pairs`: Limit the multipliers of products pair by pair before the whole Hessian is perturbed (enum toggle).
- `early_polish`: Polish with a clear active set before the relaxation is small (enum toggle).
- `square_newton`: Solve the square system of the active set by Newton's method (enum toggle).
- `certify`: Certify exact points, and follow descent directions from points that are not B-stationary (enum toggle).
- `sigma_retries`: Number of homotopy steps that may be repeated from the last relaxation with a smaller reduction, when steps at the next one stay short.
- `max_soc`: Limit on the second-order corrections of an interior-point step.
- `restore_tiny`: Restore feasibility after several tiny interior-point steps in a row (enum toggle).
- `relaxation`: Relaxation or penalty in the place of the complementarity constraints until the active set is identified (enum relaxation).
- `homotopy`: Changes of relaxation or penalty and barrier parameter: together, or one problem after the other (enum homotopy).
- `penalty_init`: First penalty parameter of the penalties among the relaxations; sigma is its inverse.
- `accuracy`: Compare a solution of optimal control with an event-driven simulation of its controls (enum toggle).
- `accuracy_tol`: Relative and absolute tolerance of the simulation that the option accuracy compares a solution of optimal control with.
- `mode_search`: Mode sequences that a search tries before it ends of itself; 0: as many as its effort says.
- `dcs_form`: Complementarity form of switching terms (enum dcs_form).
- `lift_depth`: Largest number of factors in a product of the Heaviside form; longer products are lifted.
- `integration`: Integration method of the modes in event-driven simulation (enum integration).
- `rtol`: Relative tolerance of the local error in event-driven simulation.
- `atol`: Absolute tolerance of the local error in event-driven simulation.
- `h_init`: First step of an event-driven simulation; 0: the library chooses.
- `h_max`: Longest step of an event-driven simulation.
- `max_steps`: Limit on the steps of an event-driven simulation, accepted and rejected.
- `max_switches`: Limit on the switches in the log of an event-driven simulation; further ones are only counted.
- `zeno`: Continuation of an event-driven simulation where switches accumulate (enum zeno_policy).
- `ambiguity`: Continuation of an event-driven simulation where it is not unique (enum ambiguity_policy).
- `dense`: Keep the dense output of an event-driven simulation (enum toggle).
- `sensitivity`: Compute the derivatives of an event-driven simulation and of its switching times (enum sensitivity).
- `adjoint`: Record an event-driven simulation for adjoint derivatives (enum toggle).
- `explain`: Compute by another solve the least violation of constraints that cannot be met (enum toggle).
- `adapt_tol`: Error at the ends of the control stages down to which the grid of an optimal control problem is refined; 0: the grid stays.
- `adapt_rounds`: Limit on the number of refined grids of an optimal control problem, when adapt_tol is positive.
- `adapt_elements`: Limit on the finite elements of a refined grid over all control stages, when adapt_tol is positive.
- `max_memory`: Limit on the bytes that building, solving or simulating may take; 0: no limit.
- `ocp_start`: Search for the solution of an optimal control problem (enum ocp_start).
- `portfolio`: Strategies for a program with complementarity constraints within its iterations (enum portfolio).
- `selection`: Velocity of a sliding mode where surfaces meet and their effects multiply. Where the chosen rule has no weights between 0 and 1, an extreme velocity is taken (enum selection).
- `search_effort`: Work of a search after its last gain as a multiple of that until it: more finds better optima, less ends sooner.
- `search_gain`: Share of the cost by which a solution has to be better for a search to go on for it: smaller gains are taken, but not worked for.
- `search_samples`: Random controls that a search draws and simulates at a time; 0: none.
- `search_seed`: Seed of the random controls of a search.
- `search_exact`: Work of an exact search over choices at most, in variables of a program times iterations, or states times steps of simulations; 0: none.
- `dense_steps`: Dense output keeps at least so many of the last steps, and at most a quarter more: older ones are dropped; 0: all.
- `branch_work`: Work of a branch and bound over the branches of a program with linear rows and a convex quadratic objective at most, in entries of tableaus; 0: none. Where it is enough the solution is global, with proof, or the program is shown to be infeasible. Other programs get a tenth of it for every model of them that is searched for better branches.
"""
struct swb_settings
    struct_size::UInt64
    rk_family::Int64
    n_s::Int64
    n_fe::Int64
    discretisation::Int64
    stage_form::Int64
    cross::Int64
    step_equilibration::Int64
    rho_h::Cdouble
    gamma_h::Cdouble
    tol::Cdouble
    max_iter::Int64
    max_time::Cdouble
    mu_init::Cdouble
    sigma_init::Cdouble
    sigma_min::Cdouble
    sigma_factor::Cdouble
    sigma_exponent::Cdouble
    mu_over_sigma::Cdouble
    plateau_mu::Cdouble
    plateau_viol::Cdouble
    polish::Int64
    polish_tol::Cdouble
    initial_guess::Int64
    log_level::Int64
    linear_solver::Int64
    ordering::Int64
    scaling::Int64
    centre_pairs::Int64
    convexify_pairs::Int64
    early_polish::Int64
    square_newton::Int64
    certify::Int64
    sigma_retries::Int64
    max_soc::Int64
    restore_tiny::Int64
    relaxation::Int64
    homotopy::Int64
    penalty_init::Cdouble
    accuracy::Int64
    accuracy_tol::Cdouble
    mode_search::Int64
    dcs_form::Int64
    lift_depth::Int64
    integration::Int64
    rtol::Cdouble
    atol::Cdouble
    h_init::Cdouble
    h_max::Cdouble
    max_steps::Int64
    max_switches::Int64
    zeno::Int64
    ambiguity::Int64
    dense::Int64
    sensitivity::Int64
    adjoint::Int64
    explain::Int64
    adapt_tol::Cdouble
    adapt_rounds::Int64
    adapt_elements::Int64
    max_memory::Int64
    ocp_start::Int64
    portfolio::Int64
    selection::Int64
    search_effort::Cdouble
    search_gain::Cdouble
    search_samples::Int64
    search_seed::Int64
    search_exact::Cdouble
    dense_steps::Int64
    branch_work::Cdouble
end
sizeof(swb_settings) == 568 || error("swb_settings has another size than in C")

"""
Residuals of the optimality conditions, unscaled, maximum norm.

- `struct_size`: Size of this struct in bytes.
- `primal`: Violation of constraints and bounds.
- `dual`: Gradient of the Lagrangian; 0 for simulations.
- `complementarity`: Products of slacks and multipliers of bounds; 0 for simulations.
- `pair_product`: Largest product G_i H_i of a pair; 0 for simulations.
- `pair_min`: Largest min(G_i, H_i) of a pair.
"""
struct swb_residuals
    struct_size::UInt64
    primal::Cdouble
    dual::Cdouble
    complementarity::Cdouble
    pair_product::Cdouble
    pair_min::Cdouble
end
sizeof(swb_residuals) == 48 || error("swb_residuals has another size than in C")

"""
Work and time of a solve, or of all steps of a simulation.

- `struct_size`: Size of this struct in bytes.
- `iterations`: Interior-point iterations, restoration included.
- `factorisations`: Numeric factorisations.
- `evaluations`: Evaluations of objective and constraints.
- `restoration_iterations`: Iterations inside the restoration phase.
- `polish_iterations`: Iterations spent in the polish.
- `max_delta_w`: Largest perturbation of the Hessian.
- `time_eval`: Seconds in functions and derivatives.
- `time_linalg`: Seconds in factorisations and solves.
- `time_total`: Seconds in all.
- `time_build`: Seconds to build the problem, not part of time_total; 0 when an earlier structure was used again.
- `n_variables`: Variables of the solved program; 0 for simulations.
- `n_constraints`: Constraints of the solved program; 0 for simulations.
- `n_pairs`: Complementarity pairs of the solved program; 0 for simulations.
- `n_steps`: Steps of a simulation; else 0.
- `n_homotopies`: Steps of a simulation that the homotopy had to decide; else 0.
- `moved_bounds`: Bounds that were moved outwards by 1e-9, relative to them or to the unit of the scaled problem, because constraints left no room between them; the polish is under those given.
"""
struct swb_stats
    struct_size::UInt64
    iterations::Int64
    factorisations::Int64
    evaluations::Int64
    restoration_iterations::Int64
    polish_iterations::Int64
    max_delta_w::Cdouble
    time_eval::Cdouble
    time_linalg::Cdouble
    time_total::Cdouble
    time_build::Cdouble
    n_variables::Int64
    n_constraints::Int64
    n_pairs::Int64
    n_steps::Int64
    n_homotopies::Int64
    moved_bounds::Int64
end
sizeof(swb_stats) == 136 || error("swb_stats has another size than in C")

"""
The linear systems of a solve: sizes, and work since the program was built.

- `struct_size`: Size of this struct in bytes.
- `n`: Order of the matrix.
- `nnz_k`: Entries of its upper triangle.
- `nnz_l`: Entries of the factor below the diagonal.
- `flops`: Floating-point operations of one factorisation.
- `min_abs_pivot`: Smallest modulus of a pivot of the last factorisation, of the equilibrated matrix.
- `max_abs_pivot`: Largest one.
- `shift`: Shift of the diagonal in the last factorisation, of the equilibrated matrix.
- `factorisations`: Numeric factorisations.
- `solves`: Solutions.
- `refinement_steps`: Steps of refinement in all solutions.
- `equilibrations`: Times the scaling was computed.
"""
struct swb_linear_stats
    struct_size::UInt64
    n::Int64
    nnz_k::Int64
    nnz_l::Int64
    flops::Cdouble
    min_abs_pivot::Cdouble
    max_abs_pivot::Cdouble
    shift::Cdouble
    factorisations::Int64
    solves::Int64
    refinement_steps::Int64
    equilibrations::Int64
end
sizeof(swb_linear_stats) == 96 || error("swb_linear_stats has another size than in C")

"""
One iteration of a solve.

- `struct_size`: Size of this struct in bytes, as the library knows it.
- `iter`: Iteration number; starts again with every step of a simulation.
- `objective`: Objective.
- `inf_pr`: Primal infeasibility.
- `inf_du`: Dual infeasibility.
- `mu`: Barrier parameter.
- `sigma`: Relaxation of the complementarity, 0 without one.
- `inf_cc`: Largest product of a pair.
- `step`: Length of the last primal step.
- `delta_w`: Perturbation of the Hessian.
- `alpha_du`: Dual step length.
- `alpha_pr`: Primal step length.
- `trials`: Trial points of the line search.
- `phase`: Character: ' ' main phase, 'r' restoration, 'p' polish, 'j' relaxation raised after a jam, 's' step that lowers the error as a whole, 'c' linear program of a certificate, numbered on its own.
- `incumbent`: Cost of the best solution that a search around this solve has verified so far; infinite where there is none.
"""
struct swb_iteration_info
    struct_size::UInt64
    iter::Int64
    objective::Cdouble
    inf_pr::Cdouble
    inf_du::Cdouble
    mu::Cdouble
    sigma::Cdouble
    inf_cc::Cdouble
    step::Cdouble
    delta_w::Cdouble
    alpha_du::Cdouble
    alpha_pr::Cdouble
    trials::Int64
    phase::Int64
    incumbent::Cdouble
end
sizeof(swb_iteration_info) == 120 || error("swb_iteration_info has another size than in C")

"""
How a scene is made a piecewise smooth system in numerical time; swb_freeze_options_init sets the defaults.

- `struct_size`: Size of this struct in bytes.
- `step`: Numerical time that a jump should take: the length of a step or of a finite element.
- `speed`: Rate at which gaps usually close.
- `a_n`: Strength a_n of the push of contacts without restitution; 0 for the recommended one.
- `stiffness`: Stiffness of contacts with restitution; 0 for the recommended one.
- `creep`: Sliding speed below which a contact in space creeps; 0 for a thousandth of speed.
- `speed_of_time`: 1: a control behind the others multiplies all rates, the speed of time.
"""
struct swb_freeze_options
    struct_size::UInt64
    step::Cdouble
    speed::Cdouble
    a_n::Cdouble
    stiffness::Cdouble
    creep::Cdouble
    speed_of_time::Int64
end
sizeof(swb_freeze_options) == 56 || error("swb_freeze_options has another size than in C")

"""
Places of states and controls in a model in numerical time: the states of the scene come first and keep their numbers.

- `struct_size`: Size of this struct in bytes.
- `first_depth`: First state that is the depth of a contact with restitution.
- `n_depths`: Number of those states.
- `clock`: The state that is the physical time.
- `first_cost`: First state that is the integral of a cost over physical time.
- `n_costs`: Number of those states.
- `speed`: The control that is the speed of time, or -1.
"""
struct swb_freeze_layout
    struct_size::UInt64
    first_depth::Int64
    n_depths::Int64
    clock::Int64
    first_cost::Int64
    n_costs::Int64
    speed::Int64
end
sizeof(swb_freeze_layout) == 56 || error("swb_freeze_layout has another size than in C")

"""
Inputs of a function that is evaluated. Derivatives number the inputs in this order: x, u, p, then t.

- `t`: Time; NAN during a solve for functions that do not say that they depend on it.
- `x`: [nx] states, or the variables of a program; NULL if nx is 0.
- `u`: [nu] controls; NULL if nu is 0.
- `p`: [np] parameters; NULL if np is 0.
"""
struct swb_point
    t::Cdouble
    x::Ptr{Cdouble}
    u::Ptr{Cdouble}
    p::Ptr{Cdouble}
end
sizeof(swb_point) == 32 || error("swb_point has another size than in C")

"""
Addresses of what CasADi generates for a function f; NULL where there is nothing. SWB_CASADI(f) makes one of code
that is linked.

- `struct_size`: sizeof(swb_casadi)
- `eval`: f
- `n_in`: f_n_in
- `n_out`: f_n_out
- `name_in`: f_name_in
- `sparsity_in`: f_sparsity_in
- `sparsity_out`: f_sparsity_out
- `work`: f_work
- `checkout`: f_checkout
- `release`: f_release
- `incref`: f_incref
- `decref`: f_decref
- `int_size`: Size of an integer in the generated file, since CasADi 3.8.
- `real_size`: Size of a number in the generated file, since CasADi 3.8.
"""
struct swb_casadi
    struct_size::UInt64
    eval::Ptr{Cvoid}
    n_in::Ptr{Cvoid}
    n_out::Ptr{Cvoid}
    name_in::Ptr{Cvoid}
    sparsity_in::Ptr{Cvoid}
    sparsity_out::Ptr{Cvoid}
    work::Ptr{Cvoid}
    checkout::Ptr{Cvoid}
    release::Ptr{Cvoid}
    incref::Ptr{Cvoid}
    decref::Ptr{Cvoid}
    int_size::Ptr{Cvoid}
    real_size::Ptr{Cvoid}
end
sizeof(swb_casadi) == 112 || error("swb_casadi has another size than in C")

"""
Numbers of a trajectory, the lengths of its arrays.

- `struct_size`: Size of this struct in bytes.
- `nx`: States.
- `n_elements`: Finite elements.
- `n_s`: Stage points of each element.
- `n_subsystems`: Subsystems that can switch: those with more than one mode, in the order they were added.
- `n_modes`: Modes of all these subsystems, one after the other.
- `n_switches`: Switches.
- `t_start`: Start.
- `t_end`: End.
"""
struct swb_trajectory_info
    struct_size::UInt64
    nx::Int64
    n_elements::Int64
    n_s::Int64
    n_subsystems::Int64
    n_modes::Int64
    n_switches::Int64
    t_start::Cdouble
    t_end::Cdouble
end
sizeof(swb_trajectory_info) == 72 || error("swb_trajectory_info has another size than in C")

"""
A change of the active set of a subsystem.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `element`: The element that begins here.
- `subsystem`: The subsystem.
- `kind`: An enum swb_switch_kind.
- `before`: Active modes before, bit i for mode i; modes from 64 on are in swb_trajectory_active only.
- `after`: Active modes after.
"""
struct swb_switch
    struct_size::UInt64
    t::Cdouble
    element::Int64
    subsystem::Int64
    kind::Int64
    before::UInt64
    after::UInt64
end
sizeof(swb_switch) == 56 || error("swb_switch has another size than in C")

"""
A change of the active set of a subsystem.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `kind`: An enum swb_event_kind.
- `subsystem`: The subsystem, counted among those with more than one mode.
- `before`: Active modes before, bit i for mode i; modes from 64 on are in swb_run_event_modes only.
- `after`: Active modes after.
- `simultaneous`: 1 if another subsystem switches at the same time.
- `unique`: 1 if the continuation was unique.
- `rate`: Rate at which the quantity that vanishes (a difference of indicators g, or a weight theta) goes through zero before the switch; NaN where the switch is not caused by one.
- `transversality`: Cosine between the gradient of the surface and the velocity: near zero the contact is grazing. NaN for a weight.
"""
struct swb_event
    struct_size::UInt64
    t::Cdouble
    kind::Int64
    subsystem::Int64
    before::UInt64
    after::UInt64
    simultaneous::Int64
    unique::Int64
    rate::Cdouble
    transversality::Cdouble
end
sizeof(swb_event) == 80 || error("swb_event has another size than in C")

"""
Work of an event-driven simulation.

- `struct_size`: Size of this struct in bytes.
- `steps`: Accepted steps.
- `rejections`: Rejected steps.
- `relocations`: Steps repeated to end at a switch.
- `evaluations`: Evaluations of the right-hand side.
- `jacobians`: Evaluations of its Jacobian.
- `newton`: Newton iterations.
- `factorisations`: Factorisations.
- `switches`: Switches, all subsystems together, those beyond the option max_switches included.
- `accumulations`: Points at which switches accumulate.
- `time_total`: Seconds.
- `jumps`: Transitions.
- `impacts`: Impacts, each contact for itself.
- `notes`: What transitions noted, that beyond the option max_switches included.
"""
struct swb_run_stats
    struct_size::UInt64
    steps::Int64
    rejections::Int64
    relocations::Int64
    evaluations::Int64
    jacobians::Int64
    newton::Int64
    factorisations::Int64
    switches::Int64
    accumulations::Int64
    time_total::Cdouble
    jumps::Int64
    impacts::Int64
    notes::Int64
end
sizeof(swb_run_stats) == 112 || error("swb_run_stats has another size than in C")

"""
Numbers of a run, the lengths of its arrays.

- `struct_size`: Size of this struct in bytes.
- `nx`: States.
- `outcome`: An enum swb_run_outcome.
- `t_start`: Start.
- `t_end`: Time reached.
- `n_events`: Switches in the log.
- `n_subsystems`: Subsystems that can switch: those with more than one mode, in the order they were added.
- `n_pieces`: Steps with dense output; 0 without the option dense.
- `n_columns`: Columns of the derivatives: initial states (none where the option sensitivity is \"inputs\"), parameters, controls; 0 without the option.
- `one_sided`: 1 if the derivatives hold for one side only: simultaneous switches, a continuation that is not unique, a surface that is only touched, accumulating switches.
- `n_branch_points`: Points with several continuations.
- `n_contacts`: Surfaces only touched.
- `n_accumulations`: Points at which switches accumulate.
- `n_jumps`: Transitions in the log.
- `n_impacts`: Impacts in the log, one for every contact with an impulse.
- `n_scene_contacts`: Contacts of the scene.
- `redundant`: 1 if contacts of the scene were redundant at some time: the motion is unique, the forces are those of least norm.
- `n_notes`: What transitions noted, see swb_run_notes.
- `stopped_by`: The transition that ended the run, from 0; -1 if none did.
"""
struct swb_run_info
    struct_size::UInt64
    nx::Int64
    outcome::Int64
    t_start::Cdouble
    t_end::Cdouble
    n_events::Int64
    n_subsystems::Int64
    n_pieces::Int64
    n_columns::Int64
    one_sided::Int64
    n_branch_points::Int64
    n_contacts::Int64
    n_accumulations::Int64
    n_jumps::Int64
    n_impacts::Int64
    n_scene_contacts::Int64
    redundant::Int64
    n_notes::Int64
    stopped_by::Int64
end
sizeof(swb_run_info) == 152 || error("swb_run_info has another size than in C")

"""
A point from which several solutions go on.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `n_continuations`: Continuations that differ in their velocity.
- `taken`: The continuation that was taken, from 0; -1 where the run stopped.
"""
struct swb_branch_point
    struct_size::UInt64
    t::Cdouble
    n_continuations::Int64
    taken::Int64
end
sizeof(swb_branch_point) == 32 || error("swb_branch_point has another size than in C")

"""
A surface that is only touched.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `subsystem`: The subsystem, counted among those with more than one mode.
- `rate`: Derivative of the difference of indicators along the solution.
- `transversality`: Cosine between the gradient of the surface and the velocity.
"""
struct swb_contact
    struct_size::UInt64
    t::Cdouble
    subsystem::Int64
    rate::Cdouble
    transversality::Cdouble
end
sizeof(swb_contact) == 40 || error("swb_contact has another size than in C")

"""
Accumulating switches.

- `struct_size`: Size of this struct in bytes.
- `t`: Time at which they accumulate, by the geometric series of the last intervals.
- `until`: Time at which ordinary integration begins again.
- `steps`: Steps of the policy time_stepping, 0 with the others.
- `error`: Error that these steps added to the state, relative to the tolerance.
"""
struct swb_accumulation
    struct_size::UInt64
    t::Cdouble
    until::Cdouble
    steps::Int64
    error::Cdouble
end
sizeof(swb_accumulation) == 40 || error("swb_accumulation has another size than in C")

"""
What a transition of the effect SWB_EFFECT_NOTE wrote down.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `transition`: The transition, in the order they were added to the system.
- `rate`: Rate at which the guard passes zero, positive in its direction; NaN where a jump of the state has made the condition true.
"""
struct swb_note
    struct_size::UInt64
    t::Cdouble
    transition::Int64
    rate::Cdouble
end
sizeof(swb_note) == 32 || error("swb_note has another size than in C")

"""
A transition that was made.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `transition`: The transition, in the order they were added to the system.
- `simultaneous`: 1 if another transition was made at the same time.
- `rate`: Rate at which the guard passes zero, positive in its direction; NaN where it held when its discrete state began.
"""
struct swb_jump
    struct_size::UInt64
    t::Cdouble
    transition::Int64
    simultaneous::Int64
    rate::Cdouble
end
sizeof(swb_jump) == 40 || error("swb_jump has another size than in C")

"""
The part of one contact in an impact.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `contact`: The contact; those that were left out do not count.
- `kind`: An enum swb_impact_kind.
- `simultaneous`: 1 if other contacts had impulses at the same time.
- `unique`: 1 if velocities behind it and impulses are unique.
- `rate_before`: Rate of the gap before.
- `rate_after`: Rate of the gap behind.
- `normal`: Normal impulse.
- `tangential`: Impulse along the first tangent.
- `tangential2`: Impulse along the second tangent.
- `depth`: How far the bodies would overlap without the impact: small where the contact is grazing.
"""
struct swb_impact
    struct_size::UInt64
    t::Cdouble
    contact::Int64
    kind::Int64
    simultaneous::Int64
    unique::Int64
    rate_before::Cdouble
    rate_after::Cdouble
    normal::Cdouble
    tangential::Cdouble
    tangential2::Cdouble
    depth::Cdouble
end
sizeof(swb_impact) == 96 || error("swb_impact has another size than in C")

"""
A step of an event-driven simulation.

- `struct_size`: Size of this struct in bytes, as the library knows it.
- `t`: Time reached.
- `x`: [nx] state reached; valid during the call only.
- `nx`: States.
- `kind`: An enum swb_progress_kind.
- `steps`: Steps so far, rejected ones not counted.
- `switches`: Switches so far.
"""
struct swb_progress
    struct_size::UInt64
    t::Cdouble
    x::Ptr{Cdouble}
    nx::Int64
    kind::Int64
    steps::Int64
    switches::Int64
end
sizeof(swb_progress) == 56 || error("swb_progress has another size than in C")

"""
A point from which several solutions go on.

- `struct_size`: Size of this struct in bytes, as the library knows it.
- `t`: Time.
- `x`: [nx] state.
- `nx`: States.
- `n_continuations`: Continuations.
- `n_modes`: Modes of all subsystems that can switch, one after the other.
- `before`: [n_modes] active modes before, 0 or 1.
- `active`: [n_continuations * n_modes] active modes of the continuations, those of one together.
- `velocity`: [n_continuations * nx] derivatives of the state, those of one continuation together.
"""
struct swb_branching
    struct_size::UInt64
    t::Cdouble
    x::Ptr{Cdouble}
    nx::Int64
    n_continuations::Int64
    n_modes::Int64
    before::Ptr{Int32}
    active::Ptr{Int32}
    velocity::Ptr{Cdouble}
end
sizeof(swb_branching) == 72 || error("swb_branching has another size than in C")

"""
Options of a stepper; swb_step_options_init sets the defaults.

- `struct_size`: Size of this struct in bytes.
- `h`: Length of a step.
- `theta`: Place in a step at which functions are evaluated: 1/2 in its middle, 1 at its start.
- `tolerance`: Impulses of a step are found to this share of them, measured by energy.
- `max_iterations`: Sweeps over the contacts and steps of conjugate gradients in a step at most.
- `law`: An enum swb_impact_law, or -1 for that of the scene.
- `correct`: 1: what came to rest too deep is shifted back; 0: it is not.
- `look_at_all`: 1: every step looks at all contacts, for checks: the result is the same to the last bit.
"""
struct swb_step_options
    struct_size::UInt64
    h::Cdouble
    theta::Cdouble
    tolerance::Cdouble
    max_iterations::Int64
    law::Int64
    correct::Int64
    look_at_all::Int64
end
sizeof(swb_step_options) == 64 || error("swb_step_options has another size than in C")

"""
Counts of the steps since the state was set, and how they went.

- `struct_size`: Size of this struct in bytes.
- `steps`: Steps.
- `gaps`: Gaps evaluated.
- `bounds`: Bounds of gaps over boxes.
- `contacts`: Closed contacts, summed over the steps.
- `most_contacts`: Most contacts closed at once.
- `sweeps`: Sweeps over the contacts.
- `gradients`: Steps of conjugate gradients.
- `unconverged`: Steps whose impulses were not found to the tolerance.
- `worst_change`: The largest relative change left in such a step.
- `penetration`: The deepest penetration seen, in the unit of its gap.
- `deepest`: The contact it was at, -1 if there was none.
"""
struct swb_step_stats
    struct_size::UInt64
    steps::Int64
    gaps::Int64
    bounds::Int64
    contacts::Int64
    most_contacts::Int64
    sweeps::Int64
    gradients::Int64
    unconverged::Int64
    worst_change::Cdouble
    penetration::Cdouble
    deepest::Int64
end
sizeof(swb_step_stats) == 96 || error("swb_step_stats has another size than in C")

"""
Options of an estimator; swb_mhe_options_init sets the defaults.

- `struct_size`: Size of this struct in bytes.
- `iterations`: Iterations of Gauss and Newton per sample at most, 1 to 10000; those behind the first linearise in swb_mhe_estimate.
- `rk_family`: An enum swb_rk_family for the model, or -1 for that of the problem's settings.
- `n_s`: Stages of the method, 0 for as many as the settings say.
- `steps`: Steps in every stage, 0 for as many as the settings have finite elements.
- `tol`: Iterations end where a step is below this share of the standard deviations of the start.
- `deadline`: Seconds that swb_mhe_estimate may take; infinite for as many as it needs.
"""
struct swb_mhe_options
    struct_size::UInt64
    iterations::Int64
    rk_family::Int64
    n_s::Int64
    steps::Int64
    tol::Cdouble
    deadline::Cdouble
end
sizeof(swb_mhe_options) == 56 || error("swb_mhe_options has another size than in C")

"""
Options of a controller; swb_nmpc_options_init sets the defaults.

- `struct_size`: Size of this struct in bytes.
- `scheme`: Work done between two samples, an enum swb_nmpc_scheme.
- `level`: Level of an iteration by what it evaluates, an enum swb_nmpc_level: that of SWB_NMPC_SCHEME_MLI, and of the inner iterations of SWB_NMPC_SCHEME_AS_RTI; levels D also say where Hessians come from.
- `inner`: Inner iterations of advanced steps per sample, at most 10000.
- `qp_solver`: How quadratic programs are solved, an enum swb_nmpc_qp.
- `shift`: 1: the iterate moves by one stage at every sample; 0: it does not.
- `rk_family`: An enum swb_rk_family for the predictions, or -1 for that of the problem's settings.
- `n_s`: Stages of the method, 0 for as many as the settings say.
- `steps`: Steps in every control stage, 0 for as many as the settings have finite elements.
- `tol`: SWB_NMPC_SCHEME_ASC ends its iterations where states and controls change by less than this share of their size, SWB_NMPC_SCHEME_AS_RTI where they would change by less from then on, by the estimated contraction (10.18).
- `deadline`: Seconds that swb_nmpc_feedback may take; infinite for as many as it needs.
- `elastic_price`: Price per unit of violation where constraints cannot all be met; 0: a thousand times the cost of meeting them one by one.
- `flips`: Systems that switch: alternatives to the plan at most, prepared where a control moves nothing since the system sticks, and other sequences of controls that choose; at most 64.
- `hysteresis`: Systems that switch: an alternative is taken where its predicted cost is lower than that of the plan by more than this share.
- `max_changes`: Changes of the active set in swb_nmpc_feedback at most (SWB_NMPC_QP_STAGEWISE: Newton steps), 0 for as many as it needs. What is left of them is made in the next preparation.
"""
struct swb_nmpc_options
    struct_size::UInt64
    scheme::Int64
    level::Int64
    inner::Int64
    qp_solver::Int64
    shift::Int64
    rk_family::Int64
    n_s::Int64
    steps::Int64
    tol::Cdouble
    deadline::Cdouble
    elastic_price::Cdouble
    flips::Int64
    hysteresis::Cdouble
    max_changes::Int64
end
sizeof(swb_nmpc_options) == 120 || error("swb_nmpc_options has another size than in C")

"""
Result of a preparation, a feedback or an estimate.

- `struct_size`: Size of this struct in bytes.
- `ready`: Preparation: 1 if there is a quadratic program for the next sample.
- `inner`: Preparation: inner iterations. Estimate: iterations of Gauss and Newton.
- `source`: Feedback and estimate: where the result comes from, an enum swb_nmpc_source.
- `qp_status`: Feedback and estimate: how the quadratic program ended, an enum swb_nmpc_qp_status.
- `qp_iterations`: Feedback: changes of the active set.
- `time`: Seconds.
"""
struct swb_nmpc_info
    struct_size::UInt64
    ready::Int64
    inner::Int64
    source::Int64
    qp_status::Int64
    qp_iterations::Int64
    time::Cdouble
end
sizeof(swb_nmpc_info) == 56 || error("swb_nmpc_info has another size than in C")

"""
Counts and times of a controller's own work since it was made or reset. Evaluations are counted for the whole horizon at once,
those of dynamics at every point of a Runge-Kutta step.

- `struct_size`: Size of this struct in bytes.
- `kappa`: Estimate of the linear rate of contraction (10.18), the ratio of the last two inner steps; NaN without two.
- `omega`: Estimate of omega/2 of (10.18); NaN without three inner steps.
- `step`: The last inner step, relative to the size of states and controls.
- `prediction`: Distance of the last measured from the predicted state, relative to the size of the states; NaN without a prediction.
- `preparations`: Preparations, and their seconds: of the last, of all, of the longest.
- `preparation_last`: Seconds of the last preparation.
- `preparation_total`: Seconds of all preparations.
- `preparation_worst`: Seconds of the longest preparation.
- `feedbacks`: Feedbacks, and their seconds: of the last, of all, of the longest.
- `feedback_last`: Seconds of the last feedback.
- `feedback_total`: Seconds of all feedbacks.
- `feedback_worst`: Seconds of the longest feedback.
- `values`: Values of functions.
- `jacobians`: Jacobians.
- `adjoints`: Adjoint sweeps.
- `hessians`: Hessians.
- `last_values`: Values in the last preparation.
- `last_jacobians`: Jacobians in the last preparation.
- `last_adjoints`: Adjoint sweeps in the last preparation.
- `last_hessians`: Hessians in the last preparation.
- `qps`: Quadratic programs solved.
- `qp_iterations`: Iterations of all of them.
- `failed_linearisations`: Linearisations whose functions had no value, or whose program was not convex.
- `from_qp`: Feedbacks from the quadratic program.
- `from_soft_qp`: Feedbacks from the program with constraints at a price.
- `from_tangent`: Feedbacks from the affine law, cut off.
- `from_plan`: Feedbacks from the last plan.
- `from_hold`: Feedbacks that repeat the last control.
- `alternatives`: Systems that switch: alternatives to the plan that were prepared.
- `flips`: Flips that were taken.
"""
struct swb_nmpc_monitor
    struct_size::UInt64
    kappa::Cdouble
    omega::Cdouble
    step::Cdouble
    prediction::Cdouble
    preparations::Int64
    preparation_last::Cdouble
    preparation_total::Cdouble
    preparation_worst::Cdouble
    feedbacks::Int64
    feedback_last::Cdouble
    feedback_total::Cdouble
    feedback_worst::Cdouble
    values::Int64
    jacobians::Int64
    adjoints::Int64
    hessians::Int64
    last_values::Int64
    last_jacobians::Int64
    last_adjoints::Int64
    last_hessians::Int64
    qps::Int64
    qp_iterations::Int64
    failed_linearisations::Int64
    from_qp::Int64
    from_soft_qp::Int64
    from_tangent::Int64
    from_plan::Int64
    from_hold::Int64
    alternatives::Int64
    flips::Int64
end
sizeof(swb_nmpc_monitor) == 248 || error("swb_nmpc_monitor has another size than in C")

"""
Comparison of an optimal control with a simulation of its controls: by the event-driven engine, or by finite elements of
another order where there are inclusions or algebraic equations. NaN from where the simulation did not get.

- `struct_size`: Size of this struct in bytes.
- `reached`: 1 if the simulation reached the end of the horizon.
- `n_switches`: Switches of the simulation.
- `worst`: Largest difference of a state at the ends of the control stages.
- `terminal`: Largest difference of a state at the end of the horizon.
- `terminal_violation`: Largest violation of a terminal constraint by the end of the simulation.
- `cost`: Cost of the simulation.
- `cost_error`: Cost of the solution less that of the simulation.
- `along_violation`: Largest violation of a path constraint or of a bound of a state along the simulation, also between the points at which they are imposed, in their unit; 0 where there is none.
- `along_time`: Its time; NaN where there is none.
- `along_constraint`: Number of that path constraint, in the order in which they were added; -1 for a bound of a state, -2 where there is none.
- `along_row`: Row of the path constraint, or the state.
"""
struct swb_accuracy
    struct_size::UInt64
    reached::Int64
    n_switches::Int64
    worst::Cdouble
    terminal::Cdouble
    terminal_violation::Cdouble
    cost::Cdouble
    cost_error::Cdouble
    along_violation::Cdouble
    along_time::Cdouble
    along_constraint::Int64
    along_row::Int64
end
sizeof(swb_accuracy) == 96 || error("swb_accuracy has another size than in C")

"""
Optimality of an optimal control.

- `struct_size`: Size of this struct in bytes.
- `verdict`: enum swb_verdict.
- `n_kinks`: Switches that lie between two control stages, see swb_ocp_get_kink.
- `residual`: Largest first-order change of the cost by one quantity within its bounds, over the size of the quantity, relative to what single terms of cost and constraints change; NaN where it is not known. Up to 1e-4 counts as none.
- `gap`: Largest share of the cost by which an answer with other choices may be cheaper; NaN where that is not known.
"""
struct swb_optimality
    struct_size::UInt64
    verdict::Int64
    n_kinks::Int64
    residual::Cdouble
    gap::Cdouble
end
sizeof(swb_optimality) == 40 || error("swb_optimality has another size than in C")

"""
A switch that lies between two control stages, or a surface that is touched: there the cost has a kink.

- `struct_size`: Size of this struct in bytes.
- `stage`: The control stage behind the switch, the number of stages at the end of the horizon; or the one in which a surface is touched.
- `t`: Time of the switch.
- `before`: Derivative of the cost towards a switch in the stage before, relative as the residual of swb_optimality: negative where that lowers the cost, NaN where there is no such switch.
- `after`: Derivative towards a switch in the stage behind.
- `touch`: 1 where nothing switches, but a surface is touched and left to the side the state came from: `before` is then the derivative away from it, `after` that of a moment behind it; where the control turns the state back at the end of a stage, on both sides, that of passing it; where the controls of the stage stay on the surface, as on u = 0 of |u|, they are those towards either side. 0 otherwise.
"""
struct swb_kink
    struct_size::UInt64
    stage::Int64
    t::Cdouble
    before::Cdouble
    after::Cdouble
    touch::Int64
end
sizeof(swb_kink) == 48 || error("swb_kink has another size than in C")

"""
A transition of an optimal control.

- `struct_size`: Size of this struct in bytes.
- `t`: Time.
- `transition`: The transition, in the order they were added to the system.
- `stage`: The control stage it is made in, from 0.
- `at_once`: 1 if its guard was beyond zero where its discrete state began, or where the control changed: it does not pass zero.
"""
struct swb_ocp_jump
    struct_size::UInt64
    t::Cdouble
    transition::Int64
    stage::Int64
    at_once::Int64
end
sizeof(swb_ocp_jump) == 40 || error("swb_ocp_jump has another size than in C")

"""
Result of a solve of several phases; the phases are asked for theirs, see swb_multiphase_get_phase.

- `struct_size`: Size of this struct in bytes.
- `outcome`: An enum swb_outcome.
- `polished`: An enum swb_polished.
- `n_phases`: Number of phases.
- `cost`: Sum of the costs of the phases; NaN unless the outcome is SWB_OUTCOME_SOLVED.
- `link_violation`: Largest violation of a link.
- `error`: Largest difference of a state at the end of a phase from the simulation of its controls; NaN without one.
- `iterations`: Iterations.
- `time_total`: Seconds in all.
"""
struct swb_multiphase_info
    struct_size::UInt64
    outcome::Int64
    polished::Int64
    n_phases::Int64
    cost::Cdouble
    link_violation::Cdouble
    error::Cdouble
    iterations::Int64
    time_total::Cdouble
end
sizeof(swb_multiphase_info) == 72 || error("swb_multiphase_info has another size than in C")

"""
Knowledge of the point of a program. Without pairs type S says that it satisfies the conditions of Karush, Kuhn and Tucker.

- `struct_size`: Size of this struct in bytes.
- `stationarity`: Type of stationarity (enum swb_stationarity).
- `sharp`: 1 if it is shown that there are no multipliers of a stronger type.
- `b_stationarity`: B-stationarity (enum swb_b_stationarity).
- `doubt`: Reason why questions are left open (enum swb_doubt).
- `biactive`: Pairs of which both members are zero.
- `min_multiplier`: Smallest of their multipliers, over the largest modulus there or 1; 0 without such pairs.
- `strict`: 1 if none of their multipliers is zero.
- `lps`: Linear programs solved.
- `lp_iterations`: Iterations in them.
- `nodes`: Nodes of the searches.
- `second_order`: Verdict of the conditions of second order (enum swb_second_order). Discretised problems with modes are not asked.
- `dependent`: Active constraints and bounds whose gradients depend on those of others; 0 where the conditions of second order were not looked at.
- `bound`: No point of the program has a lower objective than this, as branch and bound has shown (option branch_work); at the solution, up to rounding, where that is global. Minus infinity where nothing is shown.
"""
struct swb_certificate
    struct_size::UInt64
    stationarity::Int64
    sharp::Int64
    b_stationarity::Int64
    doubt::Int64
    biactive::Int64
    min_multiplier::Cdouble
    strict::Int64
    lps::Int64
    lp_iterations::Int64
    nodes::Int64
    second_order::Int64
    dependent::Int64
    bound::Cdouble
end
sizeof(swb_certificate) == 112 || error("swb_certificate has another size than in C")

# --- functions ---

const NAMES = [
    :swb_last_error,
    :swb_last_user_code,
    :swb_last_error_copy,
    :swb_live_objects,
    :swb_error_handled,
    :swb_status_string,
    :swb_status_name,
    :swb_version,
    :swb_abi_version,
    :swb_check_version,
    :swb_settings_log,
    :swb_settings_init,
    :swb_settings_set_int,
    :swb_settings_set_double,
    :swb_settings_set_string,
    :swb_settings_get_int,
    :swb_settings_get_double,
    :swb_settings_get_string,
    :swb_settings_validate,
    :swb_settings_to_json,
    :swb_option_count,
    :swb_option_find,
    :swb_option_name,
    :swb_option_doc,
    :swb_option_symbol,
    :swb_option_value_name,
    :swb_option_kind,
    :swb_option_range,
    :swb_option_default,
    :swb_option_setup_only,
    :swb_outcome_name,
    :swb_freeze_options_init,
    :swb_scene_freeze,
    :swb_scene_freeze_report,
    :swb_function_create,
    :swb_function_set_jacobian,
    :swb_function_set_hessian,
    :swb_function_set_linear,
    :swb_function_set_inputs,
    :swb_function_set_flags,
    :swb_function_sizes,
    :swb_function_name,
    :swb_function_jacobian_pattern,
    :swb_function_hessian_pattern,
    :swb_function_eval,
    :swb_function_eval_jacobian,
    :swb_function_eval_hessian,
    :swb_function_check_derivatives,
    :swb_function_free,
    :swb_function_from_casadi_library,
    :swb_function_from_casadi_pointers,
    :swb_function_from_casadi_file,
    :swb_system_create,
    :swb_system_set_f0,
    :swb_system_add_subsystem,
    :swb_system_add_subsystem_indicators,
    :swb_system_add_inclusion,
    :swb_system_set_algebraic,
    :swb_system_add_complementarity,
    :swb_system_sizes,
    :swb_system_surfaces,
    :swb_system_free,
    :swb_expr_create,
    :swb_expr_constants,
    :swb_expr_inputs,
    :swb_expr_apply,
    :swb_expr_matmul,
    :swb_expr_solve,
    :swb_expr_unknowns,
    :swb_expr_implicit,
    :swb_expr_inner_minimum,
    :swb_expr_signed_distance,
    :swb_expr_lagrangian_forces,
    :swb_expr_table,
    :swb_expr_call,
    :swb_expr_jacobian,
    :swb_expr_text,
    :swb_expr_function,
    :swb_expr_free,
    :swb_model_create,
    :swb_model_system,
    :swb_model_counts,
    :swb_model_report,
    :swb_model_write_c,
    :swb_model_write_fmu,
    :swb_model_free,
    :swb_system_add_choice,
    :swb_model_add_choice,
    :swb_trajectory_get_info,
    :swb_trajectory_times,
    :swb_trajectory_states,
    :swb_trajectory_steps,
    :swb_trajectory_control_stages,
    :swb_trajectory_modes,
    :swb_trajectory_active,
    :swb_trajectory_stage_times,
    :swb_trajectory_stage_states,
    :swb_trajectory_stage_theta,
    :swb_trajectory_switches,
    :swb_trajectory_state_at,
    :swb_trajectory_free,
    :swb_simulator_create,
    :swb_simulator_set_state,
    :swb_simulator_set_controls,
    :swb_simulator_set_params,
    :swb_simulator_run,
    :swb_simulator_step,
    :swb_simulator_clear,
    :swb_simulator_sizes,
    :swb_simulator_get_time,
    :swb_simulator_get_state,
    :swb_simulator_get_outcome,
    :swb_simulator_get_residuals,
    :swb_simulator_get_stats,
    :swb_simulator_get_trajectory,
    :swb_simulator_set_int,
    :swb_simulator_set_double,
    :swb_simulator_set_string,
    :swb_simulator_set_settings,
    :swb_simulator_get_settings,
    :swb_simulator_set_iteration,
    :swb_simulator_set_log,
    :swb_simulator_interrupt,
    :swb_simulator_free,
    :swb_run_outcome_name,
    :swb_run_get_info,
    :swb_run_reason,
    :swb_run_get_stats,
    :swb_run_state,
    :swb_run_events,
    :swb_run_branch_points,
    :swb_run_contacts,
    :swb_run_accumulations,
    :swb_run_modes,
    :swb_run_event_modes,
    :swb_run_sensitivity,
    :swb_run_event_sensitivity,
    :swb_run_times,
    :swb_run_evaluate,
    :swb_run_free,
    :swb_system_add_transition,
    :swb_system_add_event,
    :swb_system_add_known_times,
    :swb_run_notes,
    :swb_run_note_state,
    :swb_run_note_sensitivity,
    :swb_run_jumps,
    :swb_run_jump_states,
    :swb_run_jump_sensitivity,
    :swb_scene_create,
    :swb_scene_create_with_states,
    :swb_scene_create_projected,
    :swb_scene_set_rates,
    :swb_scene_set_inertia,
    :swb_scene_set_force,
    :swb_scene_set_state_rates,
    :swb_scene_add_contact,
    :swb_scene_set_stiction,
    :swb_scene_set_separation,
    :swb_scene_add_friction,
    :swb_scene_add_constraint,
    :swb_scene_set_bounds,
    :swb_scene_set_impact_law,
    :swb_scene_build,
    :swb_scene_system,
    :swb_scene_report,
    :swb_scene_free,
    :swb_run_impacts,
    :swb_run_impact_sensitivity,
    :swb_run_contact_modes,
    :swb_run_contact_forces,
    :swb_scene_add_discrete,
    :swb_scene_add_event,
    :swb_scene_add_clock,
    :swb_scene_add_times,
    :swb_scene_add_pwm,
    :swb_model_set_discrete,
    :swb_model_set_value_names,
    :swb_model_get_value_names,
    :swb_model_add_transition,
    :swb_model_add_event,
    :swb_model_add_clock,
    :swb_model_add_times,
    :swb_model_add_pwm,
    :swb_model_get_rule,
    :swb_model_transition_counts,
    :swb_model_get_discrete,
    :swb_model_transition_sizes,
    :swb_model_get_transition,
    :swb_integrator_create,
    :swb_integrator_reinit,
    :swb_integrator_set_controls,
    :swb_integrator_set_params,
    :swb_integrator_set_tolerances,
    :swb_integrator_set_stop_times,
    :swb_integrator_set_preferred,
    :swb_integrator_set_decider,
    :swb_integrator_step,
    :swb_integrator_advance,
    :swb_integrator_sample,
    :swb_integrator_get_dky,
    :swb_integrator_get_time,
    :swb_integrator_get_state,
    :swb_integrator_get_derivative,
    :swb_integrator_get_active,
    :swb_integrator_get_outcome,
    :swb_integrator_get_reason,
    :swb_integrator_get_stats,
    :swb_integrator_get_run,
    :swb_integrator_adjoint,
    :swb_integrator_adjoint_along,
    :swb_integrator_set_int,
    :swb_integrator_set_double,
    :swb_integrator_set_string,
    :swb_integrator_set_settings,
    :swb_integrator_get_settings,
    :swb_integrator_set_progress,
    :swb_integrator_set_poll,
    :swb_integrator_set_log,
    :swb_integrator_interrupt,
    :swb_integrator_free,
    :swb_step_options_init,
    :swb_stepper_create,
    :swb_stepper_set_state,
    :swb_stepper_set_controls,
    :swb_stepper_set_params,
    :swb_stepper_step,
    :swb_stepper_advance,
    :swb_stepper_count,
    :swb_stepper_run,
    :swb_stepper_sizes,
    :swb_stepper_get_time,
    :swb_stepper_get_state,
    :swb_stepper_get_impulses,
    :swb_stepper_get_stats,
    :swb_stepper_interrupt,
    :swb_stepper_free,
    :swb_batch_create,
    :swb_batch_run,
    :swb_batch_size,
    :swb_batch_states,
    :swb_batch_outcomes,
    :swb_batch_get_run,
    :swb_batch_interrupt,
    :swb_batch_free,
    :swb_mhe_options_init,
    :swb_mhe_create,
    :swb_mhe_sizes,
    :swb_mhe_prepare,
    :swb_mhe_estimate,
    :swb_mhe_set_params,
    :swb_mhe_reset,
    :swb_mhe_write_c,
    :swb_mhe_get_window,
    :swb_mhe_get_covariance,
    :swb_mhe_interrupt,
    :swb_mhe_free,
    :swb_nmpc_options_init,
    :swb_nmpc_create,
    :swb_nmpc_sizes,
    :swb_nmpc_initialise,
    :swb_nmpc_prepare,
    :swb_nmpc_prepare_async,
    :swb_nmpc_wait,
    :swb_nmpc_feedback,
    :swb_nmpc_finish,
    :swb_nmpc_set_params,
    :swb_nmpc_set_references,
    :swb_nmpc_set_time,
    :swb_nmpc_set_weights,
    :swb_nmpc_set_control_bounds,
    :swb_nmpc_set_state_bounds,
    :swb_nmpc_get_objective,
    :swb_nmpc_get_gain,
    :swb_nmpc_count_rows,
    :swb_nmpc_get_multipliers,
    :swb_nmpc_set_deadline,
    :swb_nmpc_set_iterate,
    :swb_nmpc_write_c,
    :swb_nmpc_reset,
    :swb_nmpc_get_plan,
    :swb_nmpc_get_monitor,
    :swb_nmpc_interrupt,
    :swb_nmpc_free,
    :swb_ocp_create,
    :swb_ocp_set_lagrange,
    :swb_ocp_set_mayer,
    :swb_ocp_add_path,
    :swb_ocp_add_terminal,
    :swb_ocp_set_state_bounds,
    :swb_ocp_set_initial_bounds,
    :swb_ocp_set_initial_state,
    :swb_ocp_set_control_bounds,
    :swb_ocp_set_nominal,
    :swb_ocp_set_params,
    :swb_ocp_set_initial_time,
    :swb_ocp_set_state_guess,
    :swb_ocp_set_control_guess,
    :swb_ocp_solve,
    :swb_ocp_get_outcome,
    :swb_ocp_get_polished,
    :swb_ocp_get_cost,
    :swb_ocp_get_cost_reached,
    :swb_ocp_get_controls,
    :swb_ocp_get_sensitivity,
    :swb_ocp_get_residuals,
    :swb_ocp_get_stats,
    :swb_ocp_get_trajectory,
    :swb_ocp_set_int,
    :swb_ocp_set_double,
    :swb_ocp_set_string,
    :swb_ocp_set_settings,
    :swb_ocp_get_settings,
    :swb_ocp_set_iteration,
    :swb_ocp_set_log,
    :swb_ocp_interrupt,
    :swb_ocp_free,
    :swb_ocp_sizes,
    :swb_ocp_get_accuracy,
    :swb_ocp_get_certificate,
    :swb_ocp_get_mismatch,
    :swb_ocp_get_message,
    :swb_ocp_count_multipliers,
    :swb_ocp_multiplier_sizes,
    :swb_ocp_get_multipliers,
    :swb_verdict_name,
    :swb_ocp_get_optimality,
    :swb_ocp_get_kink,
    :swb_ocp_get_reduced_gradient,
    :swb_ocp_get_descent,
    :swb_ocp_get_optimality_reason,
    :swb_ocp_create_scene,
    :swb_ocp_set_jumps,
    :swb_ocp_get_contacts,
    :swb_ocp_impacts,
    :swb_ocp_contact_modes,
    :swb_ocp_contact_forces,
    :swb_ocp_freezing_report,
    :swb_ocp_mode_sizes,
    :swb_ocp_get_modes,
    :swb_ocp_set_modes,
    :swb_ocp_get_mode_transitions,
    :swb_ocp_set_mode_transitions,
    :swb_ocp_random_starts,
    :swb_ocp_solve_starts,
    :swb_ocp_get_start,
    :swb_ocp_get_adaptation,
    :swb_ocp_get_round,
    :swb_ocp_add_boundary,
    :swb_ocp_add_periodic,
    :swb_ocp_add_least_squares,
    :swb_ocp_set_references,
    :swb_ocp_add_relaxed,
    :swb_ocp_add_complementarity,
    :swb_ocp_set_elements,
    :swb_ocp_set_durations,
    :swb_ocp_set_free_time,
    :swb_ocp_add_horizon,
    :swb_ocp_set_linear_controls,
    :swb_ocp_set_param_bounds,
    :swb_ocp_set_stage_params,
    :swb_ocp_solve_warm,
    :swb_ocp_shift,
    :swb_ocp_get_durations,
    :swb_ocp_get_params,
    :swb_ocp_get_control_ends,
    :swb_ocp_get_violation,
    :swb_ocp_jump_count,
    :swb_ocp_jumps,
    :swb_ocp_jump_states,
    :swb_multiphase_create,
    :swb_multiphase_link,
    :swb_multiphase_link_continuous,
    :swb_multiphase_link_reset,
    :swb_multiphase_solve,
    :swb_multiphase_get_info,
    :swb_multiphase_get_message,
    :swb_multiphase_get_phase,
    :swb_multiphase_set_iteration,
    :swb_multiphase_interrupt,
    :swb_multiphase_free,
    :swb_model_to_json,
    :swb_model_from_json,
    :swb_scene_to_json,
    :swb_scene_from_json,
    :swb_model_sizes,
    :swb_simulator_to_json,
    :swb_simulator_from_json,
    :swb_ocp_to_json,
    :swb_ocp_from_json,
    :swb_mpcc_create,
    :swb_mpcc_add_pair,
    :swb_mpcc_add_box,
    :swb_mpcc_set_hessian,
    :swb_mpcc_set_bounds,
    :swb_mpcc_set_constraint_bounds,
    :swb_mpcc_set_params,
    :swb_mpcc_set_start,
    :swb_mpcc_set_warm_start,
    :swb_mpcc_solve,
    :swb_mpcc_resolve,
    :swb_mpcc_get_outcome,
    :swb_mpcc_get_polished,
    :swb_mpcc_get_objective,
    :swb_mpcc_get_solution,
    :swb_mpcc_get_constraints,
    :swb_mpcc_get_multipliers,
    :swb_mpcc_get_pairs,
    :swb_mpcc_get_residuals,
    :swb_mpcc_get_stats,
    :swb_mpcc_set_int,
    :swb_mpcc_set_double,
    :swb_mpcc_set_string,
    :swb_mpcc_set_settings,
    :swb_mpcc_get_settings,
    :swb_mpcc_set_iteration,
    :swb_mpcc_set_log,
    :swb_mpcc_interrupt,
    :swb_mpcc_free,
    :swb_mpcc_get_tangents,
    :swb_mpcc_vjp,
    :swb_stationarity_name,
    :swb_doubt_name,
    :swb_second_order_name,
    :swb_mpcc_set_name,
    :swb_mpcc_set_names,
    :swb_mpcc_get_name,
    :swb_mpcc_get_worst,
    :swb_mpcc_get_conflict,
    :swb_mpcc_get_certificate,
    :swb_mpcc_get_scaled_residuals,
    :swb_mpcc_get_linear_stats,
    :swb_mpcc_statistics_json,
    :swb_mpcc_report_text,
]

"""
    swb_last_error() -> Cstring

Message of the last call that failed on this thread; \"\" if none did.

The text stays valid until the next call that fails on this thread; a successful call does not
change it. Never NULL.
"""
swb_last_error() = ccall(address(1), Cstring, ())

"""
    swb_last_user_code() -> Int32

Code that the user function returned, if the last failed call of this thread failed by it; else 0.
"""
swb_last_user_code() = ccall(address(2), Int32, ())

"""
    swb_last_error_copy(buf, len, needed) -> swb_status

Copy the message of the last failed call on this thread.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL, written in any case; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short. The last error is unchanged; if there was none, it is that
        of this call.
"""
swb_last_error_copy(buf, len, needed) = ccall(address(3), swb_status, (Ptr{UInt8}, Int64, Ptr{Int64}), buf, len, needed)

"""
    swb_live_objects() -> Int64

Number of objects that were created and not freed: for tests that look for leaks. Objects of the library are found
through a table, so tools that search the memory for lost pointers do not miss those that were not freed.
"""
swb_live_objects() = ccall(address(4), Int64, ())

"""
    swb_error_handled() -> Cvoid

Say that the failure of the last call of this thread that set or added something was dealt with: the object runs without
what failed. Else an object for which such a call failed refuses to run, with the first error.

Bindings that throw an exception call it there, and programs that go on after a failure. Does nothing after a success.
"""
swb_error_handled() = ccall(address(5), Cvoid, ())

"""
    swb_status_string(status) -> Cstring

General message of a status code; \"unknown status\" for any other number. Never NULL, static.
"""
swb_status_string(status) = ccall(address(6), Cstring, (Int32,), status)

"""
    swb_status_name(status) -> Cstring

Name of a status code, such as \"SWB_ERR_NULL\"; NULL for any other number. Static.
"""
swb_status_name(status) = ccall(address(7), Cstring, (Int32,), status)

"""
    swb_version() -> Cstring

Version of the library, such as \"0.2.0\". Static.
"""
swb_version() = ccall(address(8), Cstring, ())

"""
    swb_abi_version() -> Int32

Number of the ABI: libraries of the same number replace each other. The number in the SONAME:
before 1.0 the minor version, from then on 1000 times the major version.
"""
swb_abi_version() = ccall(address(9), Int32, ())

"""
    swb_check_version(major, minor) -> swb_status

Compares this library with the header of the given version that a program was compiled with.

Call as swb_check_version(SWB_VERSION_MAJOR, SWB_VERSION_MINOR). Before 1.0 both numbers must be
equal; from then on the major ones, and the library must not be older.

@return SWB_OK; SWB_ERR_UNSUPPORTED with both versions in the message
"""
swb_check_version(major, minor) = ccall(address(10), swb_status, (Int32, Int32), major, minor)

"""
    swb_settings_log(settings, log, user_data) -> swb_status

Send the settings to a log sink, one option a line, those that differ from the default at level info,
the others at level debug.

@param[in] settings  NULL for the defaults
@param[in] log       the sink
@param[in] user_data passed on unchanged
@return SWB_OK; SWB_ERR_NULL without a sink
"""
swb_settings_log(settings, log, user_data) =
    ccall(address(11), swb_status, (Ptr{swb_settings}, Ptr{Cvoid}, Ptr{Cvoid}), settings, log, user_data)

"""
    swb_settings_init(settings, struct_size) -> swb_status

Fill settings with the defaults.

@param[out] settings    every word is written
@param[in]  struct_size sizeof(swb_settings)
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
"""
swb_settings_init(settings, struct_size) =
    ccall(address(12), swb_status, (Ptr{swb_settings}, UInt64), settings, struct_size)

"""
    swb_settings_set_int(settings, name, value) -> swb_status

Set an integer or enumeration option (or a float one, to an integer) by name.

@return SWB_OK; SWB_ERR_OPTION if there is no such option (the message names the nearest one);
        SWB_ERR_RANGE if the value is outside the range; SWB_ERR_STATE without swb_settings_init
"""
swb_settings_set_int(settings, name, value) =
    ccall(address(13), swb_status, (Ptr{swb_settings}, Cstring, Int64), settings, name, value)

"""
    swb_settings_set_double(settings, name, value) -> swb_status

Set a float option by name.

@return as swb_settings_set_int; SWB_ERR_OPTION if the option is an integer
"""
swb_settings_set_double(settings, name, value) =
    ccall(address(14), swb_status, (Ptr{swb_settings}, Cstring, Cdouble), settings, name, value)

"""
    swb_settings_set_string(settings, name, value) -> swb_status

Set any option by name from text: a number, or the value name of an enumeration.

@return as swb_settings_set_int; SWB_ERR_OPTION if the text is no value of the option
"""
swb_settings_set_string(settings, name, value) =
    ccall(address(15), swb_status, (Ptr{swb_settings}, Cstring, Cstring), settings, name, value)

"""
    swb_settings_get_int(settings, name, value) -> swb_status

Get an integer or enumeration option by name.

@param[in] settings NULL for the defaults
@return SWB_OK; SWB_ERR_OPTION if there is no such option or it is a float
"""
swb_settings_get_int(settings, name, value) =
    ccall(address(16), swb_status, (Ptr{swb_settings}, Cstring, Ptr{Int64}), settings, name, value)

"""
    swb_settings_get_double(settings, name, value) -> swb_status

Get an option by name as a number.

@param[in] settings NULL for the defaults
@return SWB_OK; SWB_ERR_OPTION if there is no such option
"""
swb_settings_get_double(settings, name, value) =
    ccall(address(17), swb_status, (Ptr{swb_settings}, Cstring, Ptr{Cdouble}), settings, name, value)

"""
    swb_settings_get_string(settings, name, buf, len, needed) -> swb_status

Get an option by name as text that reads back to the same value; enumerations as value name.

@param[in]  settings NULL for the defaults
@param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed   length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_OPTION if there is no such option; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_settings_get_string(settings, name, buf, len, needed) =
    ccall(address(18), swb_status, (Ptr{swb_settings}, Cstring, Ptr{UInt8}, Int64, Ptr{Int64}), settings, name, buf,
        len, needed)

"""
    swb_settings_validate(settings) -> swb_status

Check every option against its range, and those that belong together.

@return SWB_OK; SWB_ERR_RANGE with option, value and range in the message
"""
swb_settings_validate(settings) = ccall(address(19), swb_status, (Ptr{swb_settings},), settings)

"""
    swb_settings_to_json(settings, buf, len, needed) -> swb_status

Write all options as one JSON object; enumerations as value name, infinite values as \"inf\".

@param[in]  settings NULL for the defaults
@param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed   length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_settings_to_json(settings, buf, len, needed) =
    ccall(address(20), swb_status, (Ptr{swb_settings}, Ptr{UInt8}, Int64, Ptr{Int64}), settings, buf, len, needed)

"""
    swb_option_count() -> Int64

Number of options; their indices are 0 to count - 1, in the order of the fields of swb_settings.
"""
swb_option_count() = ccall(address(21), Int64, ())

"""
    swb_option_find(name, index) -> swb_status

Index of an option by name.

@return SWB_OK; SWB_ERR_OPTION if there is no such option (the message names the nearest one)
"""
swb_option_find(name, index) = ccall(address(22), swb_status, (Cstring, Ptr{Int64}), name, index)

"""
    swb_option_name(index) -> Cstring

Name of an option; NULL if there is no such index. Static.
"""
swb_option_name(index) = ccall(address(23), Cstring, (Int64,), index)

"""
    swb_option_doc(index) -> Cstring

Description of an option in one sentence; NULL if there is no such index. Static.
"""
swb_option_doc(index) = ccall(address(24), Cstring, (Int64,), index)

"""
    swb_option_symbol(index) -> Cstring

Symbol of an option in the literature, or \"\"; NULL if there is no such index. Static.
"""
swb_option_symbol(index) = ccall(address(25), Cstring, (Int64,), index)

"""
    swb_option_value_name(index, value) -> Cstring

Name of a value of an enumeration option; NULL if there is no such value. Static.
"""
swb_option_value_name(index, value) = ccall(address(26), Cstring, (Int64, Int64), index, value)

"""
    swb_option_kind(index, kind) -> swb_status

Kind of an option.

@param[out] kind an enum swb_kind
@return SWB_OK; SWB_ERR_DIMENSION if there is no such index
"""
swb_option_kind(index, kind) = ccall(address(27), swb_status, (Int64, Ptr{Int32}), index, kind)

"""
    swb_option_range(index, min, max, min_open, max_open) -> swb_status

Range of an option. Any output may be NULL.

@param[out] min_open 1 if min itself is not allowed
@param[out] max_open 1 if max itself is not allowed
@return SWB_OK; SWB_ERR_DIMENSION if there is no such index
"""
swb_option_range(index, min, max, min_open, max_open) =
    ccall(address(28), swb_status, (Int64, Ptr{Cdouble}, Ptr{Cdouble}, Ptr{Int32}, Ptr{Int32}), index, min, max,
        min_open, max_open)

"""
    swb_option_default(index, value) -> swb_status

Default of an option, as a number.

@return SWB_OK; SWB_ERR_DIMENSION if there is no such index
"""
swb_option_default(index, value) = ccall(address(29), swb_status, (Int64, Ptr{Cdouble}), index, value)

"""
    swb_option_setup_only(index, setup_only) -> swb_status

Tells whether an option is fixed once an object is built with it.

@param[out] setup_only 1 if it is fixed, 0 if it may change between solves
@return SWB_OK; SWB_ERR_DIMENSION if there is no such index
"""
swb_option_setup_only(index, setup_only) = ccall(address(30), swb_status, (Int64, Ptr{Int32}), index, setup_only)

"""
    swb_outcome_name(outcome) -> Cstring

Name of an outcome, such as \"solved\"; NULL for any other number. Static.
"""
swb_outcome_name(outcome) = ccall(address(31), Cstring, (Int32,), outcome)

"""
    swb_freeze_options_init(options, struct_size) -> swb_status

Set options of time-freezing to their defaults.

@param[out] options     written
@param[in]  struct_size sizeof(swb_freeze_options)
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION for a size that cannot be
"""
swb_freeze_options_init(options, struct_size) =
    ccall(address(32), swb_status, (Ptr{swb_freeze_options}, UInt64), options, struct_size)

"""
    swb_scene_freeze(scene, graph, options, at, n_at, costs, n_costs, layout, layout_size, out) -> swb_status

Make a scene a piecewise smooth model in numerical time: its states get a clock, which stands still while auxiliary dynamics
take the velocities from one side of an impact to the other. Where the clock runs the states are those of the scene.

@param[in]  graph   the graph of all expressions of the scene; it grows
@param[in]  options NULL for the defaults
@param[in]  at      [n_at] state of the scene where a_n and stiffness are recommended; n_at = 0 for zeros
@param[in]  costs   [n_costs] expressions whose integrals over physical time become states
@param[out] layout  where things are; may be NULL
@param[in]  layout_size sizeof(swb_freeze_layout); any number if layout is NULL
@param[out] out     the new object, NULL on failure; free with swb_model_free
@return SWB_OK; SWB_ERR_STATE if forces are missing or the graph is another one; SWB_ERR_RANGE for options that are not
        positive; SWB_ERR_UNSUPPORTED for restitution that is no number, and friction beside restitution; SWB_ERR_DIMENSION
"""
swb_scene_freeze(scene, graph, options, at, n_at, costs, n_costs, layout, layout_size, out) =
    ccall(address(33), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{swb_freeze_options}, Ptr{Cdouble}, Int64,
        Ptr{Int64}, Int64, Ptr{swb_freeze_layout}, UInt64, Ptr{Ptr{swb_model}}), scene, graph, options, at, n_at,
        costs, n_costs, layout, layout_size, out)

"""
    swb_scene_freeze_report(scene, buf, len, needed) -> swb_status

Report on the contacts in the last call of swb_scene_freeze: strengths, the recommended ones, warnings.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before swb_scene_freeze
"""
swb_scene_freeze_report(scene, buf, len, needed) =
    ccall(address(34), swb_status, (Ptr{swb_scene}, Ptr{UInt8}, Int64, Ptr{Int64}), scene, buf, len, needed)

"""
    swb_function_create(name, nx, nu, np, n_out, value, user_data, destroy, out) -> swb_status

Create a function given by its values.

Derivatives are added by swb_function_set_jacobian and swb_function_set_hessian; without them they are
finite differences of a function of all x, u and p that does not depend on t (swb_function_set_inputs says
otherwise, and fewer inputs make cheaper differences).

@param[in]  name      used in messages, such as \"f0\"
@param[in]  value     the callback
@param[in]  user_data passed on to all callbacks unchanged
@param[in]  destroy   called with user_data when handle and models are gone; may be NULL. Not called if
                      this call fails.
@param[out] out       the new object, NULL on failure; free with swb_function_free
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if a size is negative
"""
swb_function_create(name, nx, nu, np, n_out, value, user_data, destroy, out) =
    ccall(address(35), swb_status, (Cstring, Int64, Int64, Int64, Int64, Ptr{Cvoid}, Ptr{Cvoid}, Ptr{Cvoid},
        Ptr{Ptr{swb_function}}), name, nx, nu, np, n_out, value, user_data, destroy, out)

"""
    swb_function_set_jacobian(f, col_ptr, n_col_ptr, row_idx, nnz, jacobian) -> swb_status

Give the Jacobian, n_out rows and a column for each of x, u, p and t.

Entries outside the pattern are zero for the library.

@param[in] col_ptr   [nx + nu + np + 2] where the columns start; the last one is nnz
@param[in] row_idx   [nnz] rows from 0, increasing within each column
@param[in] jacobian  NULL: the pattern alone; the values are differences
@return SWB_OK; SWB_ERR_DIMENSION or SWB_ERR_RANGE if this is no such pattern; SWB_ERR_STATE if the
        function belongs to a model already
"""
swb_function_set_jacobian(f, col_ptr, n_col_ptr, row_idx, nnz, jacobian) =
    ccall(address(36), swb_status, (Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cvoid}), f,
        col_ptr, n_col_ptr, row_idx, nnz, jacobian)

"""
    swb_function_set_hessian(f, col_ptr, n_col_ptr, row_idx, nnz, hessian) -> swb_status

Give the Hessian of the weighted sum of the outputs, upper triangle (row <= column); a row and a column
for each of x, u, p and t.

@param[in] col_ptr   [nx + nu + np + 2] where the columns start; the last one is nnz
@param[in] row_idx   [nnz] rows from 0, increasing within each column
@param[in] hessian   NULL: the pattern alone; the values are differences
@return as swb_function_set_jacobian
"""
swb_function_set_hessian(f, col_ptr, n_col_ptr, row_idx, nnz, hessian) =
    ccall(address(37), swb_status, (Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cvoid}), f,
        col_ptr, n_col_ptr, row_idx, nnz, hessian)

"""
    swb_function_set_linear(f) -> swb_status

Say that all second derivatives vanish.

@return SWB_OK; SWB_ERR_STATE if the function belongs to a model already
"""
swb_function_set_linear(f) = ccall(address(38), swb_status, (Ptr{swb_function},), f)

"""
    swb_function_set_inputs(f, inputs) -> swb_status

Say which inputs the function depends on; the Jacobian is dense in them and made by differences.

@param[in] inputs sum of enum swb_input, such as SWB_INPUT_X + SWB_INPUT_T
@return SWB_OK; SWB_ERR_RANGE if there are no such inputs; SWB_ERR_STATE if the function belongs to a
        model already
"""
swb_function_set_inputs(f, inputs) = ccall(address(39), swb_status, (Ptr{swb_function}, Int32), f, inputs)

"""
    swb_function_set_flags(f, flags) -> swb_status

Set properties of a function; those that are not given are taken back.

@param[in] flags sum of enum swb_function_flag; 0: none
@return SWB_OK; SWB_ERR_RANGE if there are no such flags; SWB_ERR_STATE if the function belongs to a model already, or
        was made by the library
"""
swb_function_set_flags(f, flags) = ccall(address(40), swb_status, (Ptr{swb_function}, Int32), f, flags)

"""
    swb_function_sizes(f, nx, nu, np, n_out, jacobian_nnz, hessian_nnz) -> swb_status

Sizes of a function. Any output may be NULL.

@param[out] jacobian_nnz entries of the Jacobian pattern, declared or derived
@param[out] hessian_nnz  entries of the Hessian pattern, declared or derived
@return SWB_OK
"""
swb_function_sizes(f, nx, nu, np, n_out, jacobian_nnz, hessian_nnz) =
    ccall(address(41), swb_status, (Ptr{swb_function}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64},
        Ptr{Int64}), f, nx, nu, np, n_out, jacobian_nnz, hessian_nnz)

"""
    swb_function_name(f, buf, len, needed) -> swb_status

Name of a function.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_function_name(f, buf, len, needed) =
    ccall(address(42), swb_status, (Ptr{swb_function}, Ptr{UInt8}, Int64, Ptr{Int64}), f, buf, len, needed)

"""
    swb_function_jacobian_pattern(f, col_ptr, n_col_ptr, row_idx, nnz) -> swb_status

Pattern of the Jacobian, declared or derived.

@param[out] col_ptr [nx + nu + np + 2]
@param[out] row_idx [nnz]
@return SWB_OK; SWB_ERR_DIMENSION if a length is not that of the pattern
"""
swb_function_jacobian_pattern(f, col_ptr, n_col_ptr, row_idx, nnz) =
    ccall(address(43), swb_status, (Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Int64}, Int64), f, col_ptr, n_col_ptr,
        row_idx, nnz)

"""
    swb_function_hessian_pattern(f, col_ptr, n_col_ptr, row_idx, nnz) -> swb_status

Pattern of the Hessian, upper triangle, declared or derived.

@param[out] col_ptr [nx + nu + np + 2]
@param[out] row_idx [nnz]
@return SWB_OK; SWB_ERR_DIMENSION if a length is not that of the pattern
"""
swb_function_hessian_pattern(f, col_ptr, n_col_ptr, row_idx, nnz) =
    ccall(address(44), swb_status, (Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Int64}, Int64), f, col_ptr, n_col_ptr,
        row_idx, nnz)

"""
    swb_function_eval(f, at, out, n_out) -> swb_status

Evaluate a function.

@param[out] out [n_out]
@return SWB_OK; SWB_ERR_NONFINITE if it is not defined at the point; SWB_ERR_USER if the callback
        returned a negative code
"""
swb_function_eval(f, at, out, n_out) =
    ccall(address(45), swb_status, (Ptr{swb_function}, Ptr{swb_point}, Ptr{Cdouble}, Int64), f, at, out, n_out)

"""
    swb_function_eval_jacobian(f, at, out, nnz) -> swb_status

Evaluate the Jacobian of a function.

@param[out] out [nnz] values of the entries of the pattern
@return as swb_function_eval
"""
swb_function_eval_jacobian(f, at, out, nnz) =
    ccall(address(46), swb_status, (Ptr{swb_function}, Ptr{swb_point}, Ptr{Cdouble}, Int64), f, at, out, nnz)

"""
    swb_function_eval_hessian(f, at, weights, n_weights, out, nnz) -> swb_status

Evaluate the Hessian of the weighted sum of the outputs of a function.

@param[in]  weights [n_weights] one for each output
@param[out] out     [nnz] values of the entries of the pattern
@return as swb_function_eval
"""
swb_function_eval_hessian(f, at, weights, n_weights, out, nnz) =
    ccall(address(47), swb_status, (Ptr{swb_function}, Ptr{swb_point}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), f,
        at, weights, n_weights, out, nnz)

"""
    swb_function_check_derivatives(f, at, passed, max_error, buf, len, needed) -> swb_status

Compare the derivatives of a function at a point with finite differences, inside and outside the
declared patterns. The work grows with the square of the number of inputs, and no interrupt reaches it: for functions
of thousands of inputs it takes minutes, and only a negative code of a callback ends it before.

@param[out] passed    1 if nothing disagrees; may be NULL
@param[out] max_error largest relative error of an entry, accepted ones included; may be NULL
@param[out] buf       [len] the report with its final NUL; NULL with len 0 to ask for the length only
@param[out] needed    length with the final NUL; may be NULL
@return SWB_OK, also if something disagrees; SWB_ERR_RANGE if the point is not finite;
        SWB_ERR_DIMENSION if the buffer is too short; else as swb_function_eval
"""
swb_function_check_derivatives(f, at, passed, max_error, buf, len, needed) =
    ccall(address(48), swb_status, (Ptr{swb_function}, Ptr{swb_point}, Ptr{Int32}, Ptr{Cdouble}, Ptr{UInt8}, Int64,
        Ptr{Int64}), f, at, passed, max_error, buf, len, needed)

"""
    swb_function_free(f) -> Cvoid

Free the handle; models that have the function keep it. NULL is allowed.
"""
swb_function_free(f) = ccall(address(49), Cvoid, (Ptr{swb_function},), f)

"""
    swb_function_from_casadi_library(path, name, inputs, nx, nu, np, out) -> swb_status

Create a function from a shared library made of C code that CasADi generated.

A function f of CasADi has inputs named x, u, p and t, those it needs, with dense entries; the value is all its
outputs, one after the other, by columns. Derivatives are further functions of the library: jac_f or f_jac, as
f.jacobian() makes it, or one matrix with a column for each entry of the inputs; hess_f or f_hess of the inputs and
weights, one for each output, with the Hessian of the weighted sum, any triangle; or jac_adj1_f, as
f.reverse(1).jacobian() makes it. Those that are missing are finite differences. Integers may have 32 or 64 bits,
numbers must be double. What the library says of itself is checked; it is called once with zeros. It stays open as
long as the function is used. A code that is not 0 counts as not defined at the point.

The code must be smooth: what jumps or has a kink (sign, fabs, if_else, fmin, floor ...) is stated by modes and
switching functions. Compiled code does not show what is inside of it; simulations notice that they chatter, solves of
optimal control problems take many iterations. The library must be the whole file: those that end too early are
refused, but a file that is damaged otherwise, or changes while it is loaded, can end the process, as with dlopen.

@param[in]  path   of the library, as for dlopen
@param[in]  name   f
@param[in]  inputs what the inputs are, such as \"x u\"; NULL: they have the names x, u, p, t
@param[out] out    the new object, NULL on failure; free with swb_function_free
@return SWB_OK; SWB_ERR_LIBRARY if the library cannot be loaded or has no such function, or says of itself what
        cannot be; SWB_ERR_DIMENSION or SWB_ERR_RANGE if sizes or names do not fit; SWB_ERR_UNSUPPORTED for numbers
        that are not double
"""
swb_function_from_casadi_library(path, name, inputs, nx, nu, np, out) =
    ccall(address(50), swb_status, (Cstring, Cstring, Cstring, Int64, Int64, Int64, Ptr{Ptr{swb_function}}), path,
        name, inputs, nx, nu, np, out)

"""
    swb_function_from_casadi_pointers(name, value, jacobian, hessian, inputs, nx, nu, np, out) -> swb_status

Create a function from C code that CasADi generated and that is linked to the program; as
swb_function_from_casadi_library.

@param[in]  name     used in messages
@param[in]  value    addresses of f
@param[in]  jacobian addresses of jac_f, of any of the forms; NULL: finite differences
@param[in]  hessian  addresses of hess_f or jac_adj1_f; NULL: finite differences
@param[in]  inputs   what the inputs are, such as \"x u\"; NULL: they have the names x, u, p, t
@param[out] out      the new object, NULL on failure; free with swb_function_free
@return as swb_function_from_casadi_library
"""
swb_function_from_casadi_pointers(name, value, jacobian, hessian, inputs, nx, nu, np, out) =
    ccall(address(51), swb_status, (Cstring, Ptr{swb_casadi}, Ptr{swb_casadi}, Ptr{swb_casadi}, Cstring, Int64,
        Int64, Int64, Ptr{Ptr{swb_function}}), name, value, jacobian, hessian, inputs, nx, nu, np, out)

"""
    swb_function_from_casadi_file(casadi, file, name, inputs, nx, nu, np, out) -> swb_status

Create a function from a file of functions that CasADi saved, evaluated by CasADi itself: no compiler is needed. Else
as swb_function_from_casadi_library.

The functions of the file stay loaded until the program ends.

@param[in]  casadi path of CasADi's library, such as \".../casadi/libcasadi.so\"
@param[in]  file   a list of functions, f and its derivatives, written by CasADi's FileSerializer
@param[in]  name   f
@param[in]  inputs what the inputs are, such as \"x u\"; NULL: they have the names x, u, p, t
@param[out] out    the new object, NULL on failure; free with swb_function_free
@return as swb_function_from_casadi_library
"""
swb_function_from_casadi_file(casadi, file, name, inputs, nx, nu, np, out) =
    ccall(address(52), swb_status, (Cstring, Cstring, Cstring, Cstring, Int64, Int64, Int64,
        Ptr{Ptr{swb_function}}), casadi, file, name, inputs, nx, nu, np, out)

"""
    swb_system_create(nx, nu, np, out) -> swb_status

Create a system without dynamics.

@param[in]  nx  states, at least 1
@param[in]  nu  controls
@param[in]  np  parameters
@param[out] out the new object, NULL on failure; free with swb_system_free
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_system_create(nx, nu, np, out) =
    ccall(address(53), swb_status, (Int64, Int64, Int64, Ptr{Ptr{swb_system}}), nx, nu, np, out)

"""
    swb_system_set_f0(system, f0) -> swb_status

Set the part of the right-hand side that does not switch: nx outputs.

@return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit
"""
swb_system_set_f0(system, f0) = ccall(address(54), swb_status, (Ptr{swb_system}, Ptr{swb_function}), system, f0)

"""
    swb_system_add_subsystem(system, rows, n_rows, modes, n_modes, psi, signs, n_signs, index) -> swb_status

Add a subsystem whose regions are given by switching functions and a sign matrix: mode i is valid where
signs[i][j] psi_j(x) > 0 for every j with signs[i][j] != 0.

@param[in]  rows    [n_rows] the states the modes drive
@param[in]  modes   n_rows * n_modes outputs: the vector fields, mode after mode
@param[in]  psi     switching functions, one output each
@param[in]  signs   [n_signs] n_modes rows with an entry -1, 0 or 1 for each switching function, row
                    after row
@param[out] index   number of the subsystem; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat or regions overlap
"""
swb_system_add_subsystem(system, rows, n_rows, modes, n_modes, psi, signs, n_signs, index) =
    ccall(address(55), swb_status, (Ptr{swb_system}, Ptr{Int64}, Int64, Ptr{swb_function}, Int64, Ptr{swb_function},
        Ptr{Int8}, Int64, Ptr{Int64}), system, rows, n_rows, modes, n_modes, psi, signs, n_signs, index)

"""
    swb_system_add_subsystem_indicators(system, rows, n_rows, modes, n_modes, indicators, index) -> swb_status

Add a subsystem whose regions are given by Stewart's indicator functions: mode i is valid where g_i(x)
is the smallest.

@param[in]  rows       [n_rows] the states the modes drive
@param[in]  modes      n_rows * n_modes outputs: the vector fields, mode after mode
@param[in]  indicators g: n_modes outputs
@param[out] index      number of the subsystem; may be NULL
@return as swb_system_add_subsystem
"""
swb_system_add_subsystem_indicators(system, rows, n_rows, modes, n_modes, indicators, index) =
    ccall(address(56), swb_status, (Ptr{swb_system}, Ptr{Int64}, Int64, Ptr{swb_function}, Int64, Ptr{swb_function},
        Ptr{Int64}), system, rows, n_rows, modes, n_modes, indicators, index)

"""
    swb_system_add_inclusion(system, rows, n_rows, f, psi, index) -> swb_status

Add an inclusion in the steps of switching functions: f(x, alpha, u, p, t) is added to the derivatives of some
states, where alpha_j is 1 where psi_j > 0, 0 where psi_j < 0, and anything between where psi_j = 0. There are no
modes: the discretisation takes such terms in the Heaviside form, and trajectories list every switching function as
two modes, psi_j > 0 and psi_j < 0, behind the subsystems. Event-driven simulation does the same, behind the contacts of a
scene. It keeps psi_j at zero by an alpha_j between 0 and 1 that solves d psi_j / dt = 0, which need not be linear in it; where
several ways go on, the switch is not unique, and the option ambiguity says what follows. In a scene the row of a velocity is
a force, and a coordinate is driven by none. Where forces of contacts push what psi_j depends on, and f is linear in every
alpha_j, the weight is found with these forces: the modes are those of a contact that slides either way or sticks.

@param[in]  rows  [n_rows] the states driven
@param[in]  f     n_rows outputs; it is made with as many states as the system has, plus one for each switching
                  function: x in front, alpha behind
@param[in]  psi   switching functions, one output each
@param[out] index number of the inclusion; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat
"""
swb_system_add_inclusion(system, rows, n_rows, f, psi, index) =
    ccall(address(57), swb_status, (Ptr{swb_system}, Ptr{Int64}, Int64, Ptr{swb_function}, Ptr{swb_function},
        Ptr{Int64}), system, rows, n_rows, f, psi, index)

"""
    swb_system_set_algebraic(system, n_z, g) -> swb_status

Make the last n_z states algebraic: what f0 and modes add to their rows, and the outputs of g, adds up to zero
instead of being a derivative. Functions see them among the states. Their initial values are guesses where the
smooth equations determine them. Event-driven simulation takes equations of index 1: the matrix of their derivatives by
the algebraic states is regular. They are solved where a run begins, behind every event and at every point of a result;
a run that comes to a singular matrix ends there, and says so. Modes may switch inside of the equations. Where neither of
two modes goes on beyond the surface between them, it is held by a weight of both, as by a relay in its own loop.
In a scene they are the last of the states beside coordinates and velocities. Forces and friction may depend on them, gaps and
constraints may not.
States that transitions alone change, and that stand behind all others as those of a model do, are not counted: add
transitions before.

@param[in] n_z fewer than nx; 0: none
@param[in] g   n_z outputs; may be NULL if f0 and modes hold the equations
@return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit
"""
swb_system_set_algebraic(system, n_z, g) =
    ccall(address(58), swb_status, (Ptr{swb_system}, Int64, Ptr{swb_function}), system, n_z, g)

"""
    swb_system_add_complementarity(system, rows, n_rows, a, b, index) -> swb_status

Add complementarity conditions 0 <= a_k, b_k >= 0, a_k b_k = 0 to the equations of algebraic states: one of both is zero,
and the other one is not negative, as current and voltage of an ideal diode. Linear complementarity systems have the
algebraic states themselves as a, and b = C x + D z + F u. Each condition is a subsystem with the modes a_k = 0 and
b_k = 0, in this order. Call swb_system_set_algebraic before.

@param[in]  rows  [n_rows] algebraic states, one for each condition
@param[in]  a     n_rows outputs; may be NULL: the states in rows
@param[in]  b     n_rows outputs
@param[out] index number of the first subsystem; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat; SWB_ERR_STATE if a row is no
        algebraic state
"""
swb_system_add_complementarity(system, rows, n_rows, a, b, index) =
    ccall(address(59), swb_status, (Ptr{swb_system}, Ptr{Int64}, Int64, Ptr{swb_function}, Ptr{swb_function},
        Ptr{Int64}), system, rows, n_rows, a, b, index)

"""
    swb_system_sizes(system, nx, nu, np, n_subsystems) -> swb_status

Sizes of a system. Any output may be NULL.

@return SWB_OK
"""
swb_system_sizes(system, nx, nu, np, n_subsystems) =
    ccall(address(60), swb_status, (Ptr{swb_system}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), system, nx,
        nu, np, n_subsystems)

"""
    swb_system_surfaces(system, subsystem, at, values, n, needed) -> swb_status

Values whose zeros are the switching surfaces of a subsystem: its switching functions, or the differences
g_i - g_j, i < j, of its indicators, NaN where both are not the smallest two.

@param[in]  subsystem number of the subsystem
@param[in]  at        the point
@param[out] values    [n] one for each; NULL with n 0 to ask for their number
@param[out] needed    their number, written in any case; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NONFINITE if a function is not defined at the point
"""
swb_system_surfaces(system, subsystem, at, values, n, needed) =
    ccall(address(61), swb_status, (Ptr{swb_system}, Int64, Ptr{swb_point}, Ptr{Cdouble}, Int64, Ptr{Int64}),
        system, subsystem, at, values, n, needed)

"""
    swb_system_free(system) -> Cvoid

Free; objects made of the system keep what they need. NULL is allowed.
"""
swb_system_free(system) = ccall(address(62), Cvoid, (Ptr{swb_system},), system)

"""
    swb_expr_create(out) -> swb_status

Create a graph without expressions.

@param[out] out the new object, NULL on failure; free with swb_expr_free
@return SWB_OK; SWB_ERR_NULL
"""
swb_expr_create(out) = ccall(address(63), swb_status, (Ptr{Ptr{swb_expr}},), out)

"""
    swb_expr_constants(graph, values, n, out, n_out) -> swb_status

Constants. Values that are not finite are refused when a function is made of them.

@param[in]  values [n]
@param[out] out    [n_out] the expressions, as many as values
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_expr_constants(graph, values, n, out, n_out) =
    ccall(address(64), swb_status, (Ptr{swb_expr}, Ptr{Cdouble}, Int64, Ptr{Int64}, Int64), graph, values, n, out,
        n_out)

"""
    swb_expr_inputs(graph, block, first, out, n) -> swb_status

Inputs of one block.

@param[in]  block one value of enum swb_input
@param[in]  first index of the first one
@param[out] out   [n] the expressions
@return SWB_OK; SWB_ERR_RANGE if there is no such block; SWB_ERR_DIMENSION
"""
swb_expr_inputs(graph, block, first, out, n) =
    ccall(address(65), swb_status, (Ptr{swb_expr}, Int32, Int64, Ptr{Int64}, Int64), graph, block, first, out, n)

"""
    swb_expr_apply(graph, op, a, b, c, out, n) -> swb_status

Apply an operator element by element.

@param[in]  op  enum swb_operator
@param[in]  a   [n]
@param[in]  b   [n]; NULL for operators of one operand
@param[in]  c   [n]; NULL for operators of one or two operands
@param[out] out [n] the expressions
@return SWB_OK; SWB_ERR_RANGE if there is no such operator or expression, or for a condition in the place of a
        value; SWB_ERR_NULL; SWB_ERR_DIMENSION if an operand is too many
"""
swb_expr_apply(graph, op, a, b, c, out, n) =
    ccall(address(66), swb_status, (Ptr{swb_expr}, Int32, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Int64),
        graph, op, a, b, c, out, n)

"""
    swb_expr_matmul(graph, m, k, n, a, n_a, b, n_b, out, n_out) -> swb_status

Product of matrices stored by columns: a is m times k, b is k times n.

@param[in]  a   [n_a] m * k expressions
@param[in]  b   [n_b] k * n expressions
@param[out] out [n_out] m * n expressions
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
"""
swb_expr_matmul(graph, m, k, n, a, n_a, b, n_b, out, n_out) =
    ccall(address(67), swb_status, (Ptr{swb_expr}, Int64, Int64, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64,
        Ptr{Int64}, Int64), graph, m, k, n, a, n_a, b, n_b, out, n_out)

"""
    swb_expr_solve(graph, matrix, n_matrix, rhs, out, n) -> swb_status

Solution of a small linear system. The matrix is decomposed numerically where the solution is evaluated, once for
all right-hand sides and derivatives.

@param[in]  matrix [n_matrix] n * n expressions by columns
@param[in]  rhs    [n]
@param[out] out    [n] the expressions
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if the matrix is singular whatever its entries are
"""
swb_expr_solve(graph, matrix, n_matrix, rhs, out, n) =
    ccall(address(68), swb_status, (Ptr{swb_expr}, Ptr{Int64}, Int64, Ptr{Int64}, Ptr{Int64}, Int64), graph, matrix,
        n_matrix, rhs, out, n)

"""
    swb_expr_unknowns(graph, out, n) -> swb_status

Unknowns of an inner problem: they stand for what swb_expr_implicit, swb_expr_inner_minimum and swb_expr_signed_distance find, and occur
nowhere else.

@param[out] out [n] the expressions
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_expr_unknowns(graph, out, n) = ccall(address(69), swb_status, (Ptr{swb_expr}, Ptr{Int64}, Int64), graph, out, n)

"""
    swb_expr_implicit(graph, equations, unknowns, start, out, n) -> swb_status

Solution of n equations G = 0 of n unknowns, found by a damped Newton method where it is evaluated. Its derivatives are exact and of any
order (implicit function theorem). Where none is found the expression is not defined.

@param[in]  equations [n] what is zero
@param[in]  unknowns  [n] from swb_expr_unknowns, each once
@param[in]  start     [n] where they are looked for, without unknowns
@param[out] out       [n] the expressions
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
"""
swb_expr_implicit(graph, equations, unknowns, start, out, n) =
    ccall(address(70), swb_status, (Ptr{swb_expr}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Int64), graph,
        equations, unknowns, start, out, n)

"""
    swb_expr_inner_minimum(graph, cost, unknowns, start, least, out, n) -> swb_status

Least value of an expression over n unknowns near a start, and where it is. Newton's method descends in every step. Derivatives are exact and
of any order (envelope theorem), where the second derivatives of the cost are positive definite.

@param[in]  cost     what is least
@param[in]  unknowns [n] from swb_expr_unknowns, each once
@param[in]  start    [n] where they are looked for, without unknowns
@param[out] least    [1] the least value
@param[out] out      [n] where it is
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
"""
swb_expr_inner_minimum(graph, cost, unknowns, start, least, out, n) =
    ccall(address(71), swb_status, (Ptr{swb_expr}, Int64, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Int64),
        graph, cost, unknowns, start, least, out, n)

"""
    swb_expr_signed_distance(graph, between, support, direction, start, size, gap, normal, n) -> swb_status

Signed distance of two strictly convex bodies A and B, and the unit normal from B to A: the largest value of d . between - support over unit
vectors d. It is smooth through zero, and its derivatives are exact.

@param[in]  between   [n] the way from the origin of B to that of A
@param[in]  support   expression of the direction d: the support function of A at -d plus that of B at d, where the support function of a body
                      is the largest value of d . x over its points x from its origin; of an ellipsoid sqrt(d . S d)
@param[in]  direction [n] from swb_expr_unknowns: the components of d
@param[in]  start     [n] a first guess of the normal, such as between, without unknowns
@param[in]  size      a length of the order of the bodies, positive: it scales the iteration
@param[out] gap       [1] the signed distance
@param[out] normal    [n] the normal
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
"""
swb_expr_signed_distance(graph, between, support, direction, start, size, gap, normal, n) =
    ccall(address(72), swb_status, (Ptr{swb_expr}, Ptr{Int64}, Int64, Ptr{Int64}, Ptr{Int64}, Cdouble, Ptr{Int64},
        Ptr{Int64}, Int64), graph, between, support, direction, start, size, gap, normal, n)

"""
    swb_expr_lagrangian_forces(graph, inertia, n_inertia, potential, q, v, out, n) -> swb_status

Forces of Lagrange's equations that follow from an inertia matrix M and a potential V: with T = v' M v / 2 these are
-dV/dq + dT/dq - d(M v)/dq v - dM/dt v, what stands beside M v' where q' = v. Add to them what else there is.

@param[in]  inertia   [n_inertia] n times n expressions of coordinates, parameters and time, symmetric
@param[in]  potential expression of the same
@param[in]  q         [n] the coordinates, inputs
@param[in]  v         [n] the velocities, inputs
@param[out] out       [n] the forces
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_UNSUPPORTED for operators that switch
"""
swb_expr_lagrangian_forces(graph, inertia, n_inertia, potential, q, v, out, n) =
    ccall(address(73), swb_status, (Ptr{swb_expr}, Ptr{Int64}, Int64, Int64, Ptr{Int64}, Ptr{Int64}, Ptr{Int64},
        Int64), graph, inertia, n_inertia, potential, q, v, out, n)

"""
    swb_expr_table(graph, kind, points, n_points, values, n_values, a, out, n) -> swb_status

Values of a table.

@param[in]  kind   enum swb_table
@param[in]  points [n_points] increasing
@param[in]  values [n_values]
@param[in]  a      [n] arguments
@param[out] out    [n] the expressions
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION
"""
swb_expr_table(graph, kind, points, n_points, values, n_values, a, out, n) =
    ccall(address(74), swb_status, (Ptr{swb_expr}, Int32, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64},
        Ptr{Int64}, Int64), graph, kind, points, n_points, values, n_values, a, out, n)

"""
    swb_expr_call(graph, f, args, n_args, out, n_out) -> swb_status

Outputs of a function at expressions. Derivatives are those of the function.

@param[in]  args [n_args] one for each input: x, u, p, then t
@param[out] out  [n_out] the expressions, one for each output
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
"""
swb_expr_call(graph, f, args, n_args, out, n_out) =
    ccall(address(75), swb_status, (Ptr{swb_expr}, Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Int64}, Int64), graph,
        f, args, n_args, out, n_out)

"""
    swb_expr_jacobian(graph, outputs, n_outputs, wrt, n_wrt, out, n_out) -> swb_status

Jacobian of expressions as expressions, by columns; entries that vanish are the constant 0.

@param[in]  outputs [n_outputs]
@param[in]  wrt     [n_wrt] inputs, each once
@param[out] out     [n_out] n_outputs * n_wrt expressions
@return SWB_OK; SWB_ERR_RANGE if wrt holds what is no input; SWB_ERR_UNSUPPORTED for operators that switch
"""
swb_expr_jacobian(graph, outputs, n_outputs, wrt, n_wrt, out, n_out) =
    ccall(address(76), swb_status, (Ptr{swb_expr}, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64), graph,
        outputs, n_outputs, wrt, n_wrt, out, n_out)

"""
    swb_expr_text(graph, expression, buf, len, needed) -> swb_status

An expression as text, cut where it is long.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_expr_text(graph, expression, buf, len, needed) =
    ccall(address(77), swb_status, (Ptr{swb_expr}, Int64, Ptr{UInt8}, Int64, Ptr{Int64}), graph, expression, buf,
        len, needed)

"""
    swb_expr_function(graph, name, nx, nu, np, outputs, n_outputs, out) -> swb_status

A function with exact derivatives. It does not need the graph any more. With one output it may have abs, min and max in it as
swb_ocp_set_lagrange says; others than the costs of optimal control problems refuse it then.

@param[in]  name    used in messages, such as \"f0\"
@param[in]  outputs [n_outputs]
@param[out] out     the new object, NULL on failure; free with swb_function_free
@return SWB_OK; SWB_ERR_DIMENSION if an input is outside its block; SWB_ERR_NONFINITE for constants that are not
        finite; SWB_ERR_UNSUPPORTED for other operators that switch
"""
swb_expr_function(graph, name, nx, nu, np, outputs, n_outputs, out) =
    ccall(address(78), swb_status, (Ptr{swb_expr}, Cstring, Int64, Int64, Int64, Ptr{Int64}, Int64,
        Ptr{Ptr{swb_function}}), graph, name, nx, nu, np, outputs, n_outputs, out)

"""
    swb_expr_free(graph) -> Cvoid

Free the graph; functions and models made of it stay. NULL is allowed.
"""
swb_expr_free(graph) = ccall(address(79), Cvoid, (Ptr{swb_expr},), graph)

"""
    swb_model_create(graph, name, nx, nu, np, rhs, names, trial, out) -> swb_status

Build a model from the derivatives of its states; operators that switch become switching functions and modes.

The time it takes grows with the number of expressions the derivatives consist of, about ten microseconds each. There
may be 2097152 of them.

@param[in]  name  used in messages
@param[in]  rhs   [nx] the derivative of every state
@param[in]  names names of states, controls and parameters, one in each line, empty lines for x[0] and so on; may be
                  NULL
@param[in]  trial where all functions should be defined, which the report says if not; may be NULL
@param[out] out   the new object, NULL on failure; free with swb_model_free
@return SWB_OK; SWB_ERR_UNSUPPORTED if too many switching functions are coupled or there are too many expressions; else
        as swb_expr_function
"""
swb_model_create(graph, name, nx, nu, np, rhs, names, trial, out) =
    ccall(address(80), swb_status, (Ptr{swb_expr}, Cstring, Int64, Int64, Int64, Ptr{Int64}, Cstring,
        Ptr{swb_point}, Ptr{Ptr{swb_model}}), graph, name, nx, nu, np, rhs, names, trial, out)

"""
    swb_model_system(model, out) -> swb_status

The system of a model.

@param[out] out the new object, NULL on failure; free with swb_system_free
@return SWB_OK; SWB_ERR_NULL
"""
swb_model_system(model, out) = ccall(address(81), swb_status, (Ptr{swb_model}, Ptr{Ptr{swb_system}}), model, out)

"""
    swb_model_counts(model, n_subsystems, n_switching_functions, n_regions, n_algebraic, n_pairs) -> swb_status

Sizes of the parts of a model. Any output may be NULL.

@param[out] n_subsystems          groups of terms that switch together
@param[out] n_switching_functions of all subsystems
@param[out] n_regions             of all subsystems
@param[out] n_algebraic           algebraic variables at each point
@param[out] n_pairs               complementarity pairs at each point
@return SWB_OK
"""
swb_model_counts(model, n_subsystems, n_switching_functions, n_regions, n_algebraic, n_pairs) =
    ccall(address(82), swb_status, (Ptr{swb_model}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}),
        model, n_subsystems, n_switching_functions, n_regions, n_algebraic, n_pairs)

"""
    swb_model_report(model, json, buf, len, needed) -> swb_status

Report of a model: states, switching functions, modes, algebraic variables and pairs with where they come from, what
was dropped or merged and why, and what looks wrong.

@param[in]  json   0 for text, 1 for an object of JSON
@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_model_report(model, json, buf, len, needed) =
    ccall(address(83), swb_status, (Ptr{swb_model}, Int32, Ptr{UInt8}, Int64, Ptr{Int64}), model, json, buf, len,
        needed)

"""
    swb_model_write_c(model, buf, len, needed) -> swb_status

C code of all functions of a model with their derivatives: f0, then modes0, psi0, modes1, ..., then guard0 and, if there is
one, reset0, guard1, ...

Functions g that are called (swb_expr_call) are declared as g_value, g_jacobian, g_hessian, those that are needed, to
be supplied where the code is linked: the arguments are (t, x, u, p, out), of the Hessian (t, x, u, p, weights, out);
they write all entries, of the patterns beside the declarations, and return 0, or a code to return.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_RANGE if a function that is called has no name in C, or that of another; SWB_ERR_DIMENSION if
        the buffer is too short
"""
swb_model_write_c(model, buf, len, needed) =
    ccall(address(84), swb_status, (Ptr{swb_model}, Ptr{UInt8}, Int64, Ptr{Int64}), model, buf, len, needed)

"""
    swb_model_write_fmu(model, path, library, version, x0, nx, u0, nu, p0, np, rtol, atol, duration) -> swb_status

Write a model as a functional mock-up unit (FMI) for model exchange and co-simulation. A copy of the shared library is in it: no compiler is
needed.

Variables are the states, their derivatives, the controls (inputs) and the parameters (tunable), by their names. Models with more coupled switching
functions than a list of modes can hold become units for co-simulation alone.

@param[in] path     of the file, UTF-8; its name without the ending .fmu is that of the unit, a C identifier
@param[in] library  path of the shared library of switchback, as dlopen or the linker has found it
@param[in] version  2 for FMI 2.0, 3 for FMI 3.0
@param[in] x0       [nx] states at the start, the discrete ones too
@param[in] u0       [nu] controls at the start
@param[in] p0       [np] parameters
@param[in] rtol     relative tolerance of co-simulation; importers may ask for another one
@param[in] atol     absolute tolerance of co-simulation
@param[in] duration usual length of a simulation
@return SWB_OK; SWB_ERR_RANGE if the name is no C identifier, a value is not finite or not positive, or a file cannot be read or written;
        SWB_ERR_DIMENSION; SWB_ERR_STATE if the model calls functions of the caller
"""
swb_model_write_fmu(model, path, library, version, x0, nx, u0, nu, p0, np, rtol, atol, duration) =
    ccall(address(85), swb_status, (Ptr{swb_model}, Cstring, Cstring, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble},
        Int64, Ptr{Cdouble}, Int64, Cdouble, Cdouble, Cdouble), model, path, library, version, x0, nx, u0, nu, p0,
        np, rtol, atol, duration)

"""
    swb_model_free(model) -> Cvoid

Free; systems made of the model stay. NULL is allowed.
"""
swb_model_free(model) = ccall(address(86), Cvoid, (Ptr{swb_model},), model)

"""
    swb_system_add_choice(system, control, values, n, dwell, index) -> swb_status

Say that a control chooses among values: on or off, a gear, a number of machines. Optimal control problems made of the system later search the
best choice of every control stage; simulations take any value.

@param[in]  control from 0
@param[in]  values  [n] in any order
@param[in]  dwell   time for which a value holds at least once it was chosen, 0 for none. The value at the start of a horizon may be left at any
                    time, and the end of the horizon may cut the last one short.
@param[out] index   number of the choice; may be NULL
@return SWB_OK; SWB_ERR_RANGE for a control that does not exist or chooses already, for values that are not finite, repeat or are none,
        and for a dwell time that is negative or not finite
"""
swb_system_add_choice(system, control, values, n, dwell, index) =
    ccall(address(87), swb_status, (Ptr{swb_system}, Int64, Ptr{Cdouble}, Int64, Cdouble, Ptr{Int64}), system,
        control, values, n, dwell, index)

"""
    swb_model_add_choice(model, control, values, n, dwell, index) -> swb_status

Say that a control of a model, and thereby of all systems made of it later, chooses among values; see swb_system_add_choice.

@param[in]  control from 0
@param[in]  values  [n] in any order
@param[in]  dwell   time for which a value holds at least once it was chosen, 0 for none
@param[out] index   number of the choice; may be NULL
@return as swb_system_add_choice
"""
swb_model_add_choice(model, control, values, n, dwell, index) =
    ccall(address(88), swb_status, (Ptr{swb_model}, Int64, Ptr{Cdouble}, Int64, Cdouble, Ptr{Int64}), model,
        control, values, n, dwell, index)

"""
    swb_trajectory_get_info(trajectory, info, struct_size) -> swb_status

Numbers of a trajectory.

@param[out] info        every field is written
@param[in]  struct_size sizeof(swb_trajectory_info)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_trajectory_get_info(trajectory, info, struct_size) =
    ccall(address(89), swb_status, (Ptr{swb_trajectory}, Ptr{swb_trajectory_info}, UInt64), trajectory, info,
        struct_size)

"""
    swb_trajectory_times(trajectory, t, n) -> swb_status

Times of the element boundaries.

@param[out] t [n] n_elements + 1; none if there are no elements
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_times(trajectory, t, n) =
    ccall(address(90), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64), trajectory, t, n)

"""
    swb_trajectory_states(trajectory, x, n) -> swb_status

States at the element boundaries.

@param[out] x [n] (n_elements + 1) * nx, the states of one boundary together; none if there are no
              elements
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_states(trajectory, x, n) =
    ccall(address(91), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64), trajectory, x, n)

"""
    swb_trajectory_steps(trajectory, h, n) -> swb_status

Lengths of the elements.

@param[out] h [n] n_elements
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_steps(trajectory, h, n) =
    ccall(address(92), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64), trajectory, h, n)

"""
    swb_trajectory_control_stages(trajectory, stage, n) -> swb_status

Control stages the elements belong to; 0 in simulations.

@param[out] stage [n] n_elements
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_control_stages(trajectory, stage, n) =
    ccall(address(93), swb_status, (Ptr{swb_trajectory}, Ptr{Int64}, Int64), trajectory, stage, n)

"""
    swb_trajectory_modes(trajectory, n_modes, n) -> swb_status

Numbers of modes of the subsystems that can switch.

@param[out] n_modes [n] n_subsystems
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_modes(trajectory, n_modes, n) =
    ccall(address(94), swb_status, (Ptr{swb_trajectory}, Ptr{Int64}, Int64), trajectory, n_modes, n)

"""
    swb_trajectory_active(trajectory, active, n) -> swb_status

Active modes in the elements: one alone, or several in a sliding mode.

@param[out] active [n] n_elements * n_modes, 0 or 1, the modes of one element together
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_active(trajectory, active, n) =
    ccall(address(95), swb_status, (Ptr{swb_trajectory}, Ptr{Int32}, Int64), trajectory, active, n)

"""
    swb_trajectory_stage_times(trajectory, t, n) -> swb_status

Times of the stage points.

@param[out] t [n] n_elements * n_s
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_stage_times(trajectory, t, n) =
    ccall(address(96), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64), trajectory, t, n)

"""
    swb_trajectory_stage_states(trajectory, x, n) -> swb_status

States at the stage points.

@param[out] x [n] n_elements * n_s * nx, the states of one point together
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_stage_states(trajectory, x, n) =
    ccall(address(97), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64), trajectory, x, n)

"""
    swb_trajectory_stage_theta(trajectory, theta, n) -> swb_status

Convex multipliers of the modes at the stage points; NaN where the states are those of a simulation and several modes are active.

@param[out] theta [n] n_elements * n_s * n_modes, the multipliers of one point together
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_stage_theta(trajectory, theta, n) =
    ccall(address(98), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64), trajectory, theta, n)

"""
    swb_trajectory_switches(trajectory, switches, n, struct_size) -> swb_status

Switches in the order of time.

@param[out] switches    [n] n_switches
@param[in]  struct_size sizeof(swb_switch)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_trajectory_switches(trajectory, switches, n, struct_size) =
    ccall(address(99), swb_status, (Ptr{swb_trajectory}, Ptr{swb_switch}, Int64, UInt64), trajectory, switches, n,
        struct_size)

"""
    swb_trajectory_state_at(trajectory, t, n_t, x, n_x) -> swb_status

States at any times, by the polynomials of the elements.

@param[in]  t [n_t] between start and end, in any order
@param[out] x [n_x] n_t * nx, the states of one time together
@return SWB_OK; SWB_ERR_RANGE if a time is outside; SWB_ERR_STATE if the trajectory is empty
"""
swb_trajectory_state_at(trajectory, t, n_t, x, n_x) =
    ccall(address(100), swb_status, (Ptr{swb_trajectory}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), trajectory, t,
        n_t, x, n_x)

"""
    swb_trajectory_free(trajectory) -> Cvoid

Free; NULL is allowed.
"""
swb_trajectory_free(trajectory) = ccall(address(101), Cvoid, (Ptr{swb_trajectory},), trajectory)

"""
    swb_simulator_create(system, settings, out) -> swb_status

Create a simulator. Time, state, controls and parameters are zero until they are set.

@param[in]  system   copied; may be freed afterwards
@param[in]  settings NULL for the defaults
@param[out] out      the new object, NULL on failure; free with swb_simulator_free
@return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if an option is outside its
        range; SWB_ERR_UNSUPPORTED if options do not go together
"""
swb_simulator_create(system, settings, out) =
    ccall(address(102), swb_status, (Ptr{swb_system}, Ptr{swb_settings}, Ptr{Ptr{swb_simulator}}), system, settings,
        out)

"""
    swb_simulator_set_state(sim, t, x, nx) -> swb_status

Set time and state, and begin a new trajectory.

@param[in] x [nx]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_simulator_set_state(sim, t, x, nx) =
    ccall(address(103), swb_status, (Ptr{swb_simulator}, Cdouble, Ptr{Cdouble}, Int64), sim, t, x, nx)

"""
    swb_simulator_set_controls(sim, u, nu) -> swb_status

Set the controls, constant from now on.

@param[in] u [nu]
@return as swb_simulator_set_state
"""
swb_simulator_set_controls(sim, u, nu) =
    ccall(address(104), swb_status, (Ptr{swb_simulator}, Ptr{Cdouble}, Int64), sim, u, nu)

"""
    swb_simulator_set_params(sim, p, np) -> swb_status

Set the parameters.

@param[in] p [np]
@return as swb_simulator_set_state
"""
swb_simulator_set_params(sim, p, np) =
    ccall(address(105), swb_status, (Ptr{swb_simulator}, Ptr{Cdouble}, Int64), sim, p, np)

"""
    swb_simulator_run(sim, duration, n_steps, outcome) -> swb_status

Simulate over a duration in equal steps of n_fe finite elements each, from where the last call ended;
the trajectory grows. It ends early where a step fails; time, state and trajectory are then those of
the last step that was done.

@param[out] outcome an enum swb_outcome: solved, or that of the step that failed; may be NULL
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_USER if a user function returned a negative code;
        SWB_ERR_NONFINITE if one has no value where it is needed
"""
swb_simulator_run(sim, duration, n_steps, outcome) =
    ccall(address(106), swb_status, (Ptr{swb_simulator}, Cdouble, Int64, Ptr{Int32}), sim, duration, n_steps,
        outcome)

"""
    swb_simulator_step(sim, h, outcome) -> swb_status

Simulate one step of n_fe finite elements over the duration h; the trajectory grows.

@param[out] outcome an enum swb_outcome; may be NULL
@return as swb_simulator_run
"""
swb_simulator_step(sim, h, outcome) =
    ccall(address(107), swb_status, (Ptr{swb_simulator}, Cdouble, Ptr{Int32}), sim, h, outcome)

"""
    swb_simulator_clear(sim) -> swb_status

Forget trajectory and statistics; time and state stay.

@return SWB_OK
"""
swb_simulator_clear(sim) = ccall(address(108), swb_status, (Ptr{swb_simulator},), sim)

"""
    swb_simulator_sizes(sim, nx, nu, np) -> swb_status

Sizes of a simulator.

@param[out] nx states; may be NULL
@param[out] nu controls; may be NULL
@param[out] np parameters; may be NULL
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_simulator_sizes(sim, nx, nu, np) =
    ccall(address(109), swb_status, (Ptr{swb_simulator}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), sim, nx, nu, np)

"""
    swb_simulator_get_time(sim, t) -> swb_status

Time reached.

@return SWB_OK
"""
swb_simulator_get_time(sim, t) = ccall(address(110), swb_status, (Ptr{swb_simulator}, Ptr{Cdouble}), sim, t)

"""
    swb_simulator_get_state(sim, x, nx) -> swb_status

State reached.

@param[out] x [nx]
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_simulator_get_state(sim, x, nx) =
    ccall(address(111), swb_status, (Ptr{swb_simulator}, Ptr{Cdouble}, Int64), sim, x, nx)

"""
    swb_simulator_get_outcome(sim, outcome) -> swb_status

How the last step ended.

@param[out] outcome an enum swb_outcome; solved before the first step
@return SWB_OK
"""
swb_simulator_get_outcome(sim, outcome) =
    ccall(address(112), swb_status, (Ptr{swb_simulator}, Ptr{Int32}), sim, outcome)

"""
    swb_simulator_get_residuals(sim, residuals, struct_size) -> swb_status

Largest residuals over the steps of the trajectory.

@param[out] residuals   every field is written
@param[in]  struct_size sizeof(swb_residuals)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_simulator_get_residuals(sim, residuals, struct_size) =
    ccall(address(113), swb_status, (Ptr{swb_simulator}, Ptr{swb_residuals}, UInt64), sim, residuals, struct_size)

"""
    swb_simulator_get_stats(sim, stats, struct_size) -> swb_status

Work and time of the steps of the trajectory.

@param[out] stats       every field is written
@param[in]  struct_size sizeof(swb_stats)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_simulator_get_stats(sim, stats, struct_size) =
    ccall(address(114), swb_status, (Ptr{swb_simulator}, Ptr{swb_stats}, UInt64), sim, stats, struct_size)

"""
    swb_simulator_get_trajectory(sim, out) -> swb_status

A copy of the trajectory since the state was set; empty before the first step.

@param[out] out the new object, NULL on failure; free with swb_trajectory_free
@return SWB_OK
"""
swb_simulator_get_trajectory(sim, out) =
    ccall(address(115), swb_status, (Ptr{swb_simulator}, Ptr{Ptr{swb_trajectory}}), sim, out)

"""
    swb_simulator_set_int(sim, name, value) -> swb_status

Set an integer or enumeration option of a simulator (or a float one, to an integer) by name.

@return as swb_settings_set_int
"""
swb_simulator_set_int(sim, name, value) =
    ccall(address(116), swb_status, (Ptr{swb_simulator}, Cstring, Int64), sim, name, value)

"""
    swb_simulator_set_double(sim, name, value) -> swb_status

Set a float option of a simulator by name.

@return as swb_settings_set_double
"""
swb_simulator_set_double(sim, name, value) =
    ccall(address(117), swb_status, (Ptr{swb_simulator}, Cstring, Cdouble), sim, name, value)

"""
    swb_simulator_set_string(sim, name, value) -> swb_status

Set any option of a simulator by name from text: a number, or the value name of an enumeration.

@return as swb_settings_set_string
"""
swb_simulator_set_string(sim, name, value) =
    ccall(address(118), swb_status, (Ptr{swb_simulator}, Cstring, Cstring), sim, name, value)

"""
    swb_simulator_set_settings(sim, settings) -> swb_status

Set all options of a simulator.

@param[in] settings NULL for the defaults
@return SWB_OK; SWB_ERR_RANGE if an option is outside its range
"""
swb_simulator_set_settings(sim, settings) =
    ccall(address(119), swb_status, (Ptr{swb_simulator}, Ptr{swb_settings}), sim, settings)

"""
    swb_simulator_get_settings(sim, settings, struct_size) -> swb_status

Options of a simulator, all of them.

@param[out] settings    every field is written
@param[in]  struct_size sizeof(swb_settings)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_simulator_get_settings(sim, settings, struct_size) =
    ccall(address(120), swb_status, (Ptr{swb_simulator}, Ptr{swb_settings}, UInt64), sim, settings, struct_size)

"""
    swb_simulator_set_iteration(sim, iteration, user_data) -> swb_status

Set who is called once per iteration; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_simulator_set_iteration(sim, iteration, user_data) =
    ccall(address(121), swb_status, (Ptr{swb_simulator}, Ptr{Cvoid}, Ptr{Cvoid}), sim, iteration, user_data)

"""
    swb_simulator_set_log(sim, log, user_data) -> swb_status

Set who gets the log, as much as the option log_level says; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_simulator_set_log(sim, log, user_data) =
    ccall(address(122), swb_status, (Ptr{swb_simulator}, Ptr{Cvoid}, Ptr{Cvoid}), sim, log, user_data)

"""
    swb_simulator_interrupt(sim) -> swb_status

Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
thread and from signal handlers; only swb_simulator_free must not run at the same time. It is heeded in every phase, before the
next evaluation of a model function and before the next factorisation: the call ends within the time of one of
these, a model function that takes long itself is waited for. What was found before stays the answer.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_simulator_interrupt(sim) = ccall(address(123), swb_status, (Ptr{swb_simulator},), sim)

"""
    swb_simulator_free(sim) -> Cvoid

Free; NULL is allowed.
"""
swb_simulator_free(sim) = ccall(address(124), Cvoid, (Ptr{swb_simulator},), sim)

"""
    swb_run_outcome_name(outcome) -> Cstring

Name of an outcome of an event-driven simulation, such as \"reached\"; NULL for any other number. Static.
"""
swb_run_outcome_name(outcome) = ccall(address(125), Cstring, (Int32,), outcome)

"""
    swb_run_get_info(run, info, struct_size) -> swb_status

Numbers of a run.

@param[out] info        every field is written
@param[in]  struct_size sizeof(swb_run_info)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_run_get_info(run, info, struct_size) =
    ccall(address(126), swb_status, (Ptr{swb_run}, Ptr{swb_run_info}, UInt64), run, info, struct_size)

"""
    swb_run_reason(run, buf, len, needed) -> swb_status

Why a run ended early, in words; if it reached its time, what is not known to the tolerances, or \"\".

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL, written in any case; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_run_reason(run, buf, len, needed) =
    ccall(address(127), swb_status, (Ptr{swb_run}, Ptr{UInt8}, Int64, Ptr{Int64}), run, buf, len, needed)

"""
    swb_run_get_stats(run, stats, struct_size) -> swb_status

Work of a run.

@param[out] stats       every field is written
@param[in]  struct_size sizeof(swb_run_stats)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_run_get_stats(run, stats, struct_size) =
    ccall(address(128), swb_status, (Ptr{swb_run}, Ptr{swb_run_stats}, UInt64), run, stats, struct_size)

"""
    swb_run_state(run, x, nx) -> swb_status

State reached.

@param[out] x [nx]
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_run_state(run, x, nx) = ccall(address(129), swb_status, (Ptr{swb_run}, Ptr{Cdouble}, Int64), run, x, nx)

"""
    swb_run_events(run, events, n, struct_size) -> swb_status

Switches in the order of time.

@param[out] events      [n] n_events
@param[in]  struct_size sizeof(swb_event)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_events(run, events, n, struct_size) =
    ccall(address(130), swb_status, (Ptr{swb_run}, Ptr{swb_event}, Int64, UInt64), run, events, n, struct_size)

"""
    swb_run_branch_points(run, points, n, struct_size) -> swb_status

Points with several continuations, in the order of time.

@param[out] points      [n] n_branch_points
@param[in]  struct_size sizeof(swb_branch_point)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_branch_points(run, points, n, struct_size) =
    ccall(address(131), swb_status, (Ptr{swb_run}, Ptr{swb_branch_point}, Int64, UInt64), run, points, n,
        struct_size)

"""
    swb_run_contacts(run, contacts, n, struct_size) -> swb_status

Surfaces only touched, in the order of time.

@param[out] contacts    [n] n_contacts
@param[in]  struct_size sizeof(swb_contact)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_contacts(run, contacts, n, struct_size) =
    ccall(address(132), swb_status, (Ptr{swb_run}, Ptr{swb_contact}, Int64, UInt64), run, contacts, n, struct_size)

"""
    swb_run_accumulations(run, points, n, struct_size) -> swb_status

Accumulating switches, in the order of time.

@param[out] points      [n] n_accumulations
@param[in]  struct_size sizeof(swb_accumulation)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_accumulations(run, points, n, struct_size) =
    ccall(address(133), swb_status, (Ptr{swb_run}, Ptr{swb_accumulation}, Int64, UInt64), run, points, n,
        struct_size)

"""
    swb_run_modes(run, n_modes, n) -> swb_status

Numbers of modes of the subsystems that can switch.

@param[out] n_modes [n] n_subsystems
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_modes(run, n_modes, n) = ccall(address(134), swb_status, (Ptr{swb_run}, Ptr{Int64}, Int64), run, n_modes, n)

"""
    swb_run_event_modes(run, index, before, after, n) -> swb_status

Active modes of its subsystem before and after a switch.

@param[in]  index  the switch, from 0
@param[out] before [n] 0 or 1 for each mode of the subsystem
@param[out] after  [n] the same
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_run_event_modes(run, index, before, after, n) =
    ccall(address(135), swb_status, (Ptr{swb_run}, Int64, Ptr{Int32}, Ptr{Int32}, Int64), run, index, before, after,
        n)

"""
    swb_run_sensitivity(run, s, n) -> swb_status

Derivatives of the state reached with respect to initial states, parameters and controls, the latter changed by the
same amount over the whole run.

With the option sensitivity at inputs those of the initial states are left out; of a model that has neither parameters nor
controls no columns remain.

@param[out] s [n] nx * n_columns, by columns: those of the initial states, then of the parameters, then of the controls
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without the option sensitivity
"""
swb_run_sensitivity(run, s, n) = ccall(address(136), swb_status, (Ptr{swb_run}, Ptr{Cdouble}, Int64), run, s, n)

"""
    swb_run_event_sensitivity(run, index, dt, n) -> swb_status

Derivatives of the time of a switch with respect to initial states, parameters and controls. NaN where the time has
none.

@param[in]  index the switch, from 0
@param[out] dt    [n] n_columns
@return as swb_run_sensitivity
"""
swb_run_event_sensitivity(run, index, dt, n) =
    ccall(address(137), swb_status, (Ptr{swb_run}, Int64, Ptr{Cdouble}, Int64), run, index, dt, n)

"""
    swb_run_times(run, t, n) -> swb_status

Times between which the dense output has a polynomial each: starts and ends of the steps.

@param[out] t [n] n_pieces + 1; none if there are no pieces
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_times(run, t, n) = ccall(address(138), swb_status, (Ptr{swb_run}, Ptr{Cdouble}, Int64), run, t, n)

"""
    swb_run_evaluate(run, t, n_t, k, x, n_x) -> swb_status

States at any times of the run, or their derivatives with respect to time. At a switch the piece before it counts.

@param[in]  t [n_t] between start and end, in any order
@param[in]  k order of the derivative, 0 for the state
@param[out] x [n_x] n_t * nx, the values of one time together
@return SWB_OK; SWB_ERR_RANGE if a time is outside or k is negative; SWB_ERR_STATE without the option dense
"""
swb_run_evaluate(run, t, n_t, k, x, n_x) =
    ccall(address(139), swb_status, (Ptr{swb_run}, Ptr{Cdouble}, Int64, Int64, Ptr{Cdouble}, Int64), run, t, n_t, k,
        x, n_x)

"""
    swb_run_free(run) -> Cvoid

Free; NULL is allowed.
"""
swb_run_free(run) = ccall(address(140), Cvoid, (Ptr{swb_run},), run)

"""
    swb_system_add_transition(system, guard, direction, from_states, n_from_states, from_values, n_from_values, reset, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a transition: where the guard passes zero in its direction while the discrete states are as `from` says, the state
becomes what reset makes of it, and the discrete states become as `to` says.

A discrete state is a state that a transition names in `from` or `to`; its derivative must be zero. Only the event-driven
simulation follows transitions. A guard that is beyond zero, or at zero and on its way, when the discrete states become as
`from` says, acts at once: at the start and after a change of controls or parameters, too. Of several at one time the first
that was added is made first, and the others if they still hold; 64 at one time end the run. A transition that leaves its
own guard beyond zero is watched again when the guard has been back.

@param[in]  guard       one output
@param[in]  direction   enum swb_direction
@param[in]  from_states [n_from_states] discrete states that must have the values
@param[in]  from_values [n_from_values] for the transition to be watched; none: always
@param[in]  reset       nx outputs, the state behind the transition; NULL: the state before it
@param[in]  to_states   [n_to_states] discrete states that get the values
@param[in]  to_values   [n_to_values] behind the reset
@param[out] index       number of the transition; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if states do not exist or repeat, or for an unknown
        direction; SWB_ERR_STATE if nothing changes
"""
swb_system_add_transition(system, guard, direction, from_states, n_from_states, from_values, n_from_values, reset,
    to_states, n_to_states, to_values, n_to_values, index) =
    ccall(address(141), swb_status, (Ptr{swb_system}, Ptr{swb_function}, Int32, Ptr{Int64}, Int64, Ptr{Cdouble},
        Int64, Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), system, guard, direction,
        from_states, n_from_states, from_values, n_from_values, reset, to_states, n_to_states, to_values,
        n_to_values, index)

"""
    swb_system_add_event(system, name, effect, trigger, guard, direction, from_states, n_from_states, from_values, n_from_values, reset, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a transition with a name, an effect and a trigger; the rest is that of swb_system_add_transition.

What notes or stops changes nothing: it has neither reset nor `to`. Where the run ends, derivatives are those of the last state with the time
of its end.

@param[in]  name        in results and reports, one line; NULL or \"\" for none
@param[in]  effect      enum swb_effect
@param[in]  trigger     enum swb_trigger
@param[in]  guard       one output
@param[in]  direction   enum swb_direction
@param[in]  from_states [n_from_states] discrete states that must have the values
@param[in]  from_values [n_from_values] for the transition to be watched; none: always
@param[in]  reset       nx outputs, the state behind the transition; NULL: the state before it
@param[in]  to_states   [n_to_states] discrete states that get the values
@param[in]  to_values   [n_to_values] behind the reset
@param[out] index       number of the transition; may be NULL
@return as swb_system_add_transition; SWB_ERR_RANGE for unknown effects and triggers and for a name that is there already; SWB_ERR_STATE if
        what notes or stops changes the state, or has the trigger level
"""
swb_system_add_event(system, name, effect, trigger, guard, direction, from_states, n_from_states, from_values,
    n_from_values, reset, to_states, n_to_states, to_values, n_to_values, index) =
    ccall(address(142), swb_status, (Ptr{swb_system}, Cstring, Int32, Int32, Ptr{swb_function}, Int32, Ptr{Int64},
        Int64, Ptr{Cdouble}, Int64, Ptr{swb_function}, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), system,
        name, effect, trigger, guard, direction, from_states, n_from_states, from_values, n_from_values, reset,
        to_states, n_to_states, to_values, n_to_values, index)

"""
    swb_system_add_known_times(system, t, n_t, jumps, n_jumps) -> swb_status

Add times at which functions of a system are not smooth, such as the knots of a table of time. Event-driven simulation ends its steps there, and
begins anew where the right-hand side jumps. Tables in models say these times themselves.

@param[in] t     [n_t] in any order
@param[in] jumps [n_jumps] as many: 1 where the right-hand side jumps, else 0
@return SWB_OK; SWB_ERR_DIMENSION if the lengths differ; SWB_ERR_RANGE for times that are not finite
"""
swb_system_add_known_times(system, t, n_t, jumps, n_jumps) =
    ccall(address(143), swb_status, (Ptr{swb_system}, Ptr{Cdouble}, Int64, Ptr{Int32}, Int64), system, t, n_t,
        jumps, n_jumps)

"""
    swb_run_notes(run, notes, n, struct_size) -> swb_status

What was noted in the order of time; the number is n_notes of swb_run_info.

@param[out] notes       [n] n_notes
@param[in]  struct_size sizeof(swb_note)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_notes(run, notes, n, struct_size) =
    ccall(address(144), swb_status, (Ptr{swb_run}, Ptr{swb_note}, Int64, UInt64), run, notes, n, struct_size)

"""
    swb_run_note_state(run, index, x, n) -> swb_status

The state at a note.

@param[in]  index its place in swb_run_notes, from 0
@param[out] x     [n] nx
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_run_note_state(run, index, x, n) =
    ccall(address(145), swb_status, (Ptr{swb_run}, Int64, Ptr{Cdouble}, Int64), run, index, x, n)

"""
    swb_run_note_sensitivity(run, index, dt, n) -> swb_status

Derivatives of the time of a note with respect to initial states, parameters and controls; NaN in an implicit step.

@param[in]  index its place in swb_run_notes, from 0
@param[out] dt    [n] n_columns
@return as swb_run_sensitivity
"""
swb_run_note_sensitivity(run, index, dt, n) =
    ccall(address(146), swb_status, (Ptr{swb_run}, Int64, Ptr{Cdouble}, Int64), run, index, dt, n)

"""
    swb_run_jumps(run, jumps, n, struct_size) -> swb_status

The transitions of a run in the order they were made; their number is n_jumps of swb_run_info.

@param[out] jumps       [n] n_jumps
@param[in]  struct_size sizeof(swb_jump)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_jumps(run, jumps, n, struct_size) =
    ccall(address(147), swb_status, (Ptr{swb_run}, Ptr{swb_jump}, Int64, UInt64), run, jumps, n, struct_size)

"""
    swb_run_jump_states(run, index, before, after, n) -> swb_status

The states just before and just behind a transition. Where a system of many units is not stopped for what happens in one, those that the
transition does not name are NaN: dense output knows them.

@param[in]  index  its place in swb_run_jumps, from 0
@param[out] before [n] nx
@param[out] after  [n] nx
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_run_jump_states(run, index, before, after, n) =
    ccall(address(148), swb_status, (Ptr{swb_run}, Int64, Ptr{Cdouble}, Ptr{Cdouble}, Int64), run, index, before,
        after, n)

"""
    swb_run_jump_sensitivity(run, index, dt, n) -> swb_status

Derivatives of the time of a transition with respect to initial states, parameters and controls.

@param[in]  index its place in swb_run_jumps, from 0
@param[out] dt    [n] n_columns
@return as swb_run_sensitivity
"""
swb_run_jump_sensitivity(run, index, dt, n) =
    ccall(address(149), swb_status, (Ptr{swb_run}, Int64, Ptr{Cdouble}, Int64), run, index, dt, n)

"""
    swb_scene_create(name, n_q, n_v, nu, np, names, out) -> swb_status

Create a scene without forces and contacts: the inertia is the unit matrix, and where there are as many coordinates as
velocities the rates of the coordinates are the velocities.

@param[in]  name  for messages
@param[in]  n_q   coordinates
@param[in]  n_v   velocities
@param[in]  nu    controls
@param[in]  np    parameters
@param[in]  names of coordinates, velocities, controls and parameters, one per line, for messages; may be NULL
@param[out] out   the new object, NULL on failure; free with swb_scene_free
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_scene_create(name, n_q, n_v, nu, np, names, out) =
    ccall(address(150), swb_status, (Cstring, Int64, Int64, Int64, Int64, Cstring, Ptr{Ptr{swb_scene}}), name, n_q,
        n_v, nu, np, names, out)

"""
    swb_scene_create_with_states(name, n_q, n_v, n_z, nu, np, names, out) -> swb_status

Create a scene that has states z beside coordinates and velocities, z' = h(q, v, z, u, p, t): currents of motors, controllers,
temperatures. Forces and the bounds of friction at joints may depend on them. They stand behind the velocities among the states.

@param[in]  name  for messages
@param[in]  n_q   coordinates
@param[in]  n_v   velocities
@param[in]  n_z   states beside these
@param[in]  nu    controls
@param[in]  np    parameters
@param[in]  names of coordinates, velocities, other states, controls and parameters, one per line, for messages; may be NULL
@param[out] out   the new object, NULL on failure; free with swb_scene_free
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_scene_create_with_states(name, n_q, n_v, n_z, nu, np, names, out) =
    ccall(address(151), swb_status, (Cstring, Int64, Int64, Int64, Int64, Int64, Cstring, Ptr{Ptr{swb_scene}}),
        name, n_q, n_v, n_z, nu, np, names, out)

"""
    swb_scene_create_projected(name, nx, nu, np, names, out) -> swb_status

Create a projected system, or first-order sweeping process, without right-hand side and constraints:
x' = f(x, u, p, t) + sum of the gradients of c_i(x, p, t) times multipliers, 0 <= multiplier, c_i >= 0, one of them zero.

It is a scene whose states are in the place of velocities: swb_scene_set_force sets f, swb_scene_add_contact adds a
constraint c_i, without tangents, friction and restitution; multipliers are the forces in the results.

@param[in]  name  for messages
@param[in]  nx    states
@param[in]  nu    controls
@param[in]  np    parameters
@param[in]  names of states, controls and parameters, one per line, for messages; may be NULL
@param[out] out   the new object, NULL on failure; free with swb_scene_free
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_scene_create_projected(name, nx, nu, np, names, out) =
    ccall(address(152), swb_status, (Cstring, Int64, Int64, Int64, Cstring, Ptr{Ptr{swb_scene}}), name, nx, nu, np,
        names, out)

"""
    swb_scene_set_rates(scene, graph, rates, n) -> swb_status

Set the rates of the coordinates, linear in the velocities: q' = N(q) v.

@param[in] graph the graph of the expressions
@param[in] rates [n] n_q expressions
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE for numbers that are no expressions
"""
swb_scene_set_rates(scene, graph, rates, n) =
    ccall(address(153), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{Int64}, Int64), scene, graph, rates, n)

"""
    swb_scene_set_inertia(scene, graph, entries, n) -> swb_status

Set the inertia matrix M: symmetric and positive definite; it may depend on coordinates, parameters and time.

@param[in] graph   the graph of the expressions
@param[in] entries [n] n_v times n_v expressions
@return as swb_scene_set_rates
"""
swb_scene_set_inertia(scene, graph, entries, n) =
    ccall(address(154), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{Int64}, Int64), scene, graph, entries, n)

"""
    swb_scene_set_force(scene, graph, force, n) -> swb_status

Set the forces f_v(q, v, u, p, t): all that stands beside M v' but contact forces. They may switch; switches are listed behind the contacts.

@param[in] graph the graph of the expressions
@param[in] force [n] n_v expressions
@return as swb_scene_set_rates
"""
swb_scene_set_force(scene, graph, force, n) =
    ccall(address(155), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{Int64}, Int64), scene, graph, force, n)

"""
    swb_scene_set_state_rates(scene, graph, rates, n) -> swb_status

Set the rates of the states beside coordinates and velocities, expressions of states, controls, parameters and time, which may switch.

@param[in] graph the graph of the expressions
@param[in] rates [n] n_z expressions
@return as swb_scene_set_rates
"""
swb_scene_set_state_rates(scene, graph, rates, n) =
    ccall(address(156), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{Int64}, Int64), scene, graph, rates, n)

"""
    swb_scene_add_contact(scene, graph, name, gap, tangents, n_tangents, friction, restitution, index) -> swb_status

Add a contact.

@param[in]  graph       the graph of the expressions
@param[in]  name        of its own, for messages and results
@param[in]  gap         expression of coordinates, parameters and time, positive where the bodies are apart; with friction a
                        length
@param[in]  tangents    [n_tangents] no, one (in the plane) or two (in space) expressions whose rates are the sliding
                        velocity, or which are its components, linear in the velocities
@param[in]  friction    expression, coefficient of friction; -1: none
@param[in]  restitution expression, coefficient of restitution between 0 and 1; -1: 0
@param[out] index       number of the contact; may be NULL
@return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or too many tangents; SWB_ERR_STATE for a name or a gap
        that is there already
"""
swb_scene_add_contact(scene, graph, name, gap, tangents, n_tangents, friction, restitution, index) =
    ccall(address(157), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Cstring, Int64, Ptr{Int64}, Int64, Int64, Int64,
        Ptr{Int64}), scene, graph, name, gap, tangents, n_tangents, friction, restitution, index)

"""
    swb_scene_set_stiction(scene, graph, contact, stiction) -> swb_status

Set the coefficient of friction by which a contact sticks, where it is larger than that by which it slides. Impacts know the
coefficient of sliding only.

@param[in] graph    the graph of the expressions
@param[in] contact  its number, one with tangents
@param[in] stiction expression of coordinates, parameters and time, not less than the friction of the contact
@return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or no contact with tangents
"""
swb_scene_set_stiction(scene, graph, contact, stiction) =
    ccall(address(158), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Int64, Int64), scene, graph, contact, stiction)

"""
    swb_scene_set_separation(scene, graph, contact, separation) -> swb_status

Give a lower bound of the gap of a contact. Contacts with the same expression are not looked at while it is positive, as those of two bodies
that are far apart: for scenes with very many contacts. Nothing checks that the gap is not less; a contact may be missed where it is.

@param[in] graph      the graph of the expressions
@param[in] contact    its number
@param[in] separation expression of coordinates, parameters and time: of two bodies the distance of spheres around them
@return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or no contact
"""
swb_scene_set_separation(scene, graph, contact, separation) =
    ccall(address(159), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Int64, Int64), scene, graph, contact,
        separation)

"""
    swb_scene_add_friction(scene, graph, name, sliding, bound, stiction, index) -> swb_status

Add dry friction at a joint: a force opposite to a sliding velocity, with a bound that is given. It is counted among the
contacts, and in results its force stands at the first tangent, behind a zero in the place of the normal force.

@param[in]  graph    the graph of the expressions
@param[in]  name     of its own, for messages and results
@param[in]  sliding  expression of coordinates, parameters and time whose rate is the sliding velocity, or which is that
                     velocity, linear in the velocities
@param[in]  bound    expression of states, controls, parameters and time, not negative: the force where it slides
@param[in]  stiction expression like bound, not less than it: what holds where it sticks; -1: the same
@param[out] index    number among the contacts; may be NULL
@return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions; SWB_ERR_STATE for a name that is there already;
        SWB_ERR_UNSUPPORTED for projected systems
"""
swb_scene_add_friction(scene, graph, name, sliding, bound, stiction, index) =
    ccall(address(160), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Cstring, Int64, Int64, Int64, Ptr{Int64}),
        scene, graph, name, sliding, bound, stiction, index)

"""
    swb_scene_add_constraint(scene, graph, name, zero, index) -> swb_status

Add a constraint: a contact that never opens, whose force has either sign. The state at the start must satisfy it, and its rate.
It is counted among the contacts.

@param[in]  graph the graph of the expressions
@param[in]  name  of its own, for messages and results
@param[in]  zero  expression of coordinates, parameters and time that is zero; or one that contains velocities, linear in them
@param[out] index number among the contacts; may be NULL
@return as swb_scene_add_friction
"""
swb_scene_add_constraint(scene, graph, name, zero, index) =
    ccall(address(161), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Cstring, Int64, Ptr{Int64}), scene, graph, name,
        zero, index)

"""
    swb_scene_set_bounds(scene, coordinate, low, high) -> swb_status

State that a coordinate stays between bounds: contacts that cannot close there are left out when the scene is built, with a
proof in the report. A simulation that leaves the bounds ends with an error if something was left out for them.

@param[in] coordinate from 0
@param[in] low        lower bound, -INFINITY if none is known
@param[in] high       upper bound, INFINITY if none is known
@return SWB_OK; SWB_ERR_RANGE if there is no such coordinate, or a bound is NaN, or no number is between the bounds
"""
swb_scene_set_bounds(scene, coordinate, low, high) =
    ccall(address(162), swb_status, (Ptr{swb_scene}, Int64, Cdouble, Cdouble), scene, coordinate, low, high)

"""
    swb_scene_set_impact_law(scene, law) -> swb_status

Set what happens where several contacts close at once.

@param[in] law enum swb_impact_law
@return SWB_OK; SWB_ERR_RANGE
"""
swb_scene_set_impact_law(scene, law) = ccall(address(163), swb_status, (Ptr{swb_scene}, Int32), scene, law)

"""
    swb_scene_build(scene, graph) -> swb_status

Build the scene: derivatives, normals, and which contacts cannot close. Any change needs another call.

@param[in] graph the graph of all expressions of the scene; it grows
@return SWB_OK; SWB_ERR_STATE if forces are missing; SWB_ERR_RANGE, SWB_ERR_UNSUPPORTED for expressions that do not fit,
        with a message that names them
"""
swb_scene_build(scene, graph) = ccall(address(164), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}), scene, graph)

"""
    swb_scene_system(scene, out) -> swb_status

The system of a scene that is built; its states are the coordinates, then the velocities. Simulate it event-driven.

@param[out] out the new object, NULL on failure; free with swb_system_free
@return SWB_OK; SWB_ERR_STATE if the scene is not built
"""
swb_scene_system(scene, out) = ccall(address(165), swb_status, (Ptr{swb_scene}, Ptr{Ptr{swb_system}}), scene, out)

"""
    swb_scene_report(scene, json, buf, len, needed) -> swb_status

Report of a scene that is built: contacts with what they cost, and which were left out and why.

@param[in]  json   0 for text, 1 for an object of JSON
@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE if the scene is not built
"""
swb_scene_report(scene, json, buf, len, needed) =
    ccall(address(166), swb_status, (Ptr{swb_scene}, Int32, Ptr{UInt8}, Int64, Ptr{Int64}), scene, json, buf, len,
        needed)

"""
    swb_scene_free(scene) -> Cvoid

Free; systems made of the scene stay. NULL is allowed.
"""
swb_scene_free(scene) = ccall(address(167), Cvoid, (Ptr{swb_scene},), scene)

"""
    swb_run_impacts(run, impacts, n, struct_size) -> swb_status

The impacts of a run in the order they happened; their number is n_impacts of swb_run_info.

@param[out] impacts     [n] n_impacts
@param[in]  struct_size sizeof(swb_impact)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_run_impacts(run, impacts, n, struct_size) =
    ccall(address(168), swb_status, (Ptr{swb_run}, Ptr{swb_impact}, Int64, UInt64), run, impacts, n, struct_size)

"""
    swb_run_impact_sensitivity(run, index, dt, n) -> swb_status

Derivatives of the time of an impact with respect to initial states, parameters and controls.

@param[in]  index its place in swb_run_impacts, from 0
@param[out] dt    [n] n_columns
@return as swb_run_sensitivity
"""
swb_run_impact_sensitivity(run, index, dt, n) =
    ccall(address(169), swb_status, (Ptr{swb_run}, Int64, Ptr{Cdouble}, Int64), run, index, dt, n)

"""
    swb_run_contact_modes(run, t, n_t, modes, n) -> swb_status

Modes of the contacts of a scene at times.

@param[in]  t     [n_t] times; at the time of an event the modes are those before it
@param[out] modes [n] n_t times n_scene_contacts, enum swb_contact_mode, those of the first time first
@return SWB_OK; SWB_ERR_STATE if the run is not that of a scene; SWB_ERR_DIMENSION
"""
swb_run_contact_modes(run, t, n_t, modes, n) =
    ccall(address(170), swb_status, (Ptr{swb_run}, Ptr{Cdouble}, Int64, Ptr{Int64}, Int64), run, t, n_t, modes, n)

"""
    swb_run_contact_forces(run, t, n_t, forces, n) -> swb_status

Forces of the contacts of a scene at times: forces, not impulses. Other times than the end need the option dense.

@param[in]  t      [n_t] times within the run
@param[out] forces [n] n_t times n_scene_contacts times 3: the normal force and those along the tangents, zero where the
                   contact is open or has no tangents; of dry friction at a joint zero and the friction; of a switch zero and
                   its weight, 1, -1 or between; the contacts of the first time first
@return SWB_OK; SWB_ERR_STATE if the run is not that of a scene, or for want of dense output; SWB_ERR_RANGE for times
        outside; SWB_ERR_DIMENSION
"""
swb_run_contact_forces(run, t, n_t, forces, n) =
    ccall(address(171), swb_status, (Ptr{swb_run}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), run, t, n_t, forces,
        n)

"""
    swb_scene_add_discrete(scene, name, initial, state) -> swb_status

Add a discrete state to a scene, behind all its states: only transitions change it. Its rate is zero, and is none of those of
swb_scene_set_state_rates. Simulations start where they are told to.

@param[in]  name    for messages; NULL or \"\" for none
@param[in]  initial what it begins with where bindings are not told otherwise
@param[out] state   its place among the states; may be NULL
@return SWB_OK; SWB_ERR_RANGE for a value that is not finite
"""
swb_scene_add_discrete(scene, name, initial, state) =
    ccall(address(172), swb_status, (Ptr{swb_scene}, Cstring, Cdouble, Ptr{Int64}), scene, name, initial, state)

"""
    swb_scene_add_event(scene, graph, name, effect, trigger, guard, direction, from_states, n_from_states, from_values, n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a transition to a scene: as swb_model_add_event, with the states of the scene. What is wrong with it is said by swb_scene_build.

A reset may move bodies. Contacts, impacts and friction follow from the new state; bodies that overlap behind it, constraints
that it leaves, and states of a projected system outside of their set end the run.

@param[in]  graph         the graph of the expressions
@param[in]  name          in results and reports, one line; NULL or \"\" for none
@param[in]  effect        enum swb_effect
@param[in]  trigger       enum swb_trigger
@param[in]  guard         an expression or a condition
@param[in]  direction     enum swb_direction
@param[in]  from_states   [n_from_states] discrete states that must have the values
@param[in]  from_values   [n_from_values] for the transition to be watched; none: always
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the transition; may be NULL
@return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions, and unknown directions, effects and triggers; SWB_ERR_DIMENSION where
        lists do not belong together; SWB_ERR_STATE for expressions of another graph
"""
swb_scene_add_event(scene, graph, name, effect, trigger, guard, direction, from_states, n_from_states, from_values,
    n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values,
    index) =
    ccall(address(173), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Cstring, Int32, Int32, Int64, Int32, Ptr{Int64},
        Int64, Ptr{Cdouble}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64,
        Ptr{Int64}), scene, graph, name, effect, trigger, guard, direction, from_states, n_from_states, from_values,
        n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values,
        n_to_values, index)

"""
    swb_scene_add_clock(scene, graph, period, offset, count, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a clock to a scene: a transition at the times offset, offset + period, and so on, as swb_model_add_clock. A run that begins later has
to begin with the number of times before it as the count.

@param[in]  graph         the graph of the expressions
@param[in]  period        from one time to the next, positive
@param[in]  offset        the first time
@param[in]  count         the discrete state that counts the times, see swb_scene_add_discrete
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump: a value that is sampled, a controller
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the transition; may be NULL
@return as swb_scene_add_event; SWB_ERR_RANGE for times that are not finite, a period that is not positive, or a reset of the count
"""
swb_scene_add_clock(scene, graph, period, offset, count, reset_states, n_reset_states, resets, n_resets, to_states,
    n_to_states, to_values, n_to_values, index) =
    ccall(address(174), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Cdouble, Cdouble, Int64, Ptr{Int64}, Int64,
        Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), scene, graph, period, offset, count,
        reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index)

"""
    swb_scene_add_times(scene, graph, times, n_times, count, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a clock with a list of times to a scene: a transition for each.

@param[in]  graph         the graph of the expressions
@param[in]  times         [n_times] which increase, one at least
@param[in]  count         the discrete state that counts the times
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say, at every time the same; they may depend on the count
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the first transition; may be NULL
@return as swb_scene_add_clock; SWB_ERR_RANGE for times that do not increase, or that there are none of
"""
swb_scene_add_times(scene, graph, times, n_times, count, reset_states, n_reset_states, resets, n_resets, to_states,
    n_to_states, to_values, n_to_values, index) =
    ccall(address(175), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{Cdouble}, Int64, Int64, Ptr{Int64}, Int64,
        Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), scene, graph, times, n_times, count,
        reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index)

"""
    swb_scene_add_pwm(scene, graph, duty, period, offset, pulse, count, index) -> swb_status

Add pulse-width modulation to a scene: a discrete state is 1 from the times offset, offset + period, and so on, until a part of the period is over,
and then 0.

@param[in]  graph   the graph of the expressions
@param[in]  duty    the part, an expression: the pulse ends where the ramp reaches it
@param[in]  period  from one time to the next, positive
@param[in]  offset  the first time
@param[in]  pulse   the discrete state that is the pulse
@param[in]  count   another one, which counts the times
@param[out] index   number of the transition that ends the pulse, before that of the clock; may be NULL
@return as swb_scene_add_clock; SWB_ERR_RANGE for a number that is not between 0 and 1 as the part
"""
swb_scene_add_pwm(scene, graph, duty, period, offset, pulse, count, index) =
    ccall(address(176), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Int64, Cdouble, Cdouble, Int64, Int64,
        Ptr{Int64}), scene, graph, duty, period, offset, pulse, count, index)

"""
    swb_model_set_discrete(model, initial, n) -> swb_status

Say that the last n states of a model are discrete, and with which values they begin where nothing else is given: only
transitions change them. Reports name them and documents keep the values; simulations start where they are told to. Names of
values (swb_model_set_value_names) are given behind this.

@param[in] initial [n]
@return SWB_OK; SWB_ERR_DIMENSION if there are more values than states; SWB_ERR_RANGE for a value that is not finite; SWB_ERR_STATE
        if such a state has a derivative
"""
swb_model_set_discrete(model, initial, n) =
    ccall(address(177), swb_status, (Ptr{swb_model}, Ptr{Cdouble}, Int64), model, initial, n)

"""
    swb_model_set_value_names(model, discrete, names) -> swb_status

Name the values 0, 1, ... of a discrete state: the states of an automaton. Reports and documents keep the names.

@param[in] discrete the discrete state, from 0: those of swb_model_set_discrete, in their order
@param[in] names    the names, each behind the first after a line break; NULL for none
@return SWB_OK; SWB_ERR_DIMENSION if there is no such discrete state; SWB_ERR_RANGE for names that are empty or repeat
"""
swb_model_set_value_names(model, discrete, names) =
    ccall(address(178), swb_status, (Ptr{swb_model}, Int64, Cstring), model, discrete, names)

"""
    swb_model_get_value_names(model, discrete, buf, len, needed) -> swb_status

Names of the values of a discrete state, as swb_model_set_value_names takes them; an empty text if there are none.

@param[in]  discrete the discrete state, from 0
@param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed   length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if there is no such discrete state, or the buffer is too short
"""
swb_model_get_value_names(model, discrete, buf, len, needed) =
    ccall(address(179), swb_status, (Ptr{swb_model}, Int64, Ptr{UInt8}, Int64, Ptr{Int64}), model, discrete, buf,
        len, needed)

"""
    swb_model_add_transition(model, graph, guard, direction, from_states, n_from_states, from_values, n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a transition to a model, and thereby to all systems made of it later; see swb_system_add_transition.

@param[in]  graph         the graph the model was made of
@param[in]  guard         an expression, or a condition: joined of comparisons, it becomes true (rising) or false (falling)
@param[in]  direction     enum swb_direction
@param[in]  from_states   [n_from_states] discrete states that must have the values
@param[in]  from_values   [n_from_values] for the transition to be watched; none: always
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say; the others stay as they are
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the transition; may be NULL
@return as swb_system_add_transition; SWB_ERR_RANGE for resets that are conditions; SWB_ERR_UNSUPPORTED for guards that switch
"""
swb_model_add_transition(model, graph, guard, direction, from_states, n_from_states, from_values, n_from_values,
    reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) =
    ccall(address(180), swb_status, (Ptr{swb_model}, Ptr{swb_expr}, Int64, Int32, Ptr{Int64}, Int64, Ptr{Cdouble},
        Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), model,
        graph, guard, direction, from_states, n_from_states, from_values, n_from_values, reset_states,
        n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index)

"""
    swb_model_add_event(model, graph, name, effect, trigger, guard, direction, from_states, n_from_states, from_values, n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a transition with a name, an effect and a trigger to a model; the rest is that of swb_model_add_transition. See swb_system_add_event.

@param[in]  graph         the graph the model was made of
@param[in]  name          in results and reports, one line; NULL or \"\" for none
@param[in]  effect        enum swb_effect
@param[in]  trigger       enum swb_trigger
@param[in]  guard         an expression or a condition
@param[in]  direction     enum swb_direction
@param[in]  from_states   [n_from_states] discrete states that must have the values
@param[in]  from_values   [n_from_values] for the transition to be watched; none: always
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the transition; may be NULL
@return as swb_system_add_event; SWB_ERR_RANGE for resets that are conditions; SWB_ERR_UNSUPPORTED for guards that switch
"""
swb_model_add_event(model, graph, name, effect, trigger, guard, direction, from_states, n_from_states, from_values,
    n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values,
    index) =
    ccall(address(181), swb_status, (Ptr{swb_model}, Ptr{swb_expr}, Cstring, Int32, Int32, Int64, Int32, Ptr{Int64},
        Int64, Ptr{Cdouble}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64,
        Ptr{Int64}), model, graph, name, effect, trigger, guard, direction, from_states, n_from_states, from_values,
        n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values,
        n_to_values, index)

"""
    swb_model_add_clock(model, graph, period, offset, count, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a clock to a model: a transition at the times offset, offset + period, and so on. The times are those of the formula to the last digit, however many there
are. A run that begins later begins with the number of times before it as the count.

@param[in]  graph         the graph the model was made of
@param[in]  period        from one time to the next, positive
@param[in]  offset        the first time
@param[in]  count         the discrete state that counts the times
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump: a value that is sampled, a controller
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the transition; may be NULL
@return as swb_model_add_transition; SWB_ERR_RANGE for times that are not finite, a period that is not positive, or a reset of the count
"""
swb_model_add_clock(model, graph, period, offset, count, reset_states, n_reset_states, resets, n_resets, to_states,
    n_to_states, to_values, n_to_values, index) =
    ccall(address(182), swb_status, (Ptr{swb_model}, Ptr{swb_expr}, Cdouble, Cdouble, Int64, Ptr{Int64}, Int64,
        Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), model, graph, period, offset, count,
        reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index)

"""
    swb_model_add_times(model, graph, times, n_times, count, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index) -> swb_status

Add a clock with a list of times to a model: a transition for each.

@param[in]  graph         the graph the model was made of
@param[in]  times         [n_times] which increase, one at least
@param[in]  count         the discrete state that counts the times
@param[in]  reset_states  [n_reset_states] states that become what
@param[in]  resets        [n_resets] these expressions of the state before say, at every time the same; they may depend on the count
@param[in]  to_states     [n_to_states] discrete states that get the values
@param[in]  to_values     [n_to_values] behind the reset
@param[out] index         number of the first transition; may be NULL
@return as swb_model_add_clock; SWB_ERR_RANGE for times that do not increase, or that there are none of
"""
swb_model_add_times(model, graph, times, n_times, count, reset_states, n_reset_states, resets, n_resets, to_states,
    n_to_states, to_values, n_to_values, index) =
    ccall(address(183), swb_status, (Ptr{swb_model}, Ptr{swb_expr}, Ptr{Cdouble}, Int64, Int64, Ptr{Int64}, Int64,
        Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), model, graph, times, n_times, count,
        reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values, index)

"""
    swb_model_add_pwm(model, graph, duty, period, offset, pulse, count, index) -> swb_status

Add pulse-width modulation to a model: a discrete state is 1 from the times offset, offset + period, and so on, until a part of the period is over, and then 0.

@param[in]  graph   the graph the model was made of
@param[in]  duty    the part, an expression: the pulse ends where the ramp reaches it
@param[in]  period  from one time to the next, positive
@param[in]  offset  the first time
@param[in]  pulse   the discrete state that is the pulse
@param[in]  count   another one, which counts the times
@param[out] index   number of the transition that ends the pulse, before that of the clock; may be NULL
@return as swb_model_add_clock; SWB_ERR_RANGE for a number that is not between 0 and 1 as the part
"""
swb_model_add_pwm(model, graph, duty, period, offset, pulse, count, index) =
    ccall(address(184), swb_status, (Ptr{swb_model}, Ptr{swb_expr}, Int64, Cdouble, Cdouble, Int64, Int64,
        Ptr{Int64}), model, graph, duty, period, offset, pulse, count, index)

"""
    swb_model_get_rule(model, index, effect, trigger, buf, len, needed) -> swb_status

Effect, trigger and name of a transition of a model.

@param[in]  index   of the transition, from 0
@param[out] effect  enum swb_effect; may be NULL
@param[out] trigger enum swb_trigger; may be NULL
@param[out] buf     [len] the name with its final NUL; NULL with len 0 to ask for the length
@param[out] needed  length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if there is no such transition, or the buffer is too short
"""
swb_model_get_rule(model, index, effect, trigger, buf, len, needed) =
    ccall(address(185), swb_status, (Ptr{swb_model}, Int64, Ptr{Int32}, Ptr{Int32}, Ptr{UInt8}, Int64, Ptr{Int64}),
        model, index, effect, trigger, buf, len, needed)

"""
    swb_model_transition_counts(model, n_discrete, n_transitions) -> swb_status

Numbers of discrete states and of transitions of a model. Any output may be NULL.

@return SWB_OK
"""
swb_model_transition_counts(model, n_discrete, n_transitions) =
    ccall(address(186), swb_status, (Ptr{swb_model}, Ptr{Int64}, Ptr{Int64}), model, n_discrete, n_transitions)

"""
    swb_model_get_discrete(model, initial, n) -> swb_status

Values with which the discrete states, the last ones, begin.

@param[out] initial [n] n_discrete of swb_model_transition_counts
@return SWB_OK; SWB_ERR_DIMENSION if n is another number
"""
swb_model_get_discrete(model, initial, n) =
    ccall(address(187), swb_status, (Ptr{swb_model}, Ptr{Cdouble}, Int64), model, initial, n)

"""
    swb_model_transition_sizes(model, index, n_from, n_reset, n_to) -> swb_status

How long the lists of a transition of a model are. Any output may be NULL.

@param[in]  index   of the transition, from 0
@param[out] n_from  discrete states it asks for
@param[out] n_reset states it resets
@param[out] n_to    discrete states it sets
@return SWB_OK; SWB_ERR_DIMENSION if there is no such transition
"""
swb_model_transition_sizes(model, index, n_from, n_reset, n_to) =
    ccall(address(188), swb_status, (Ptr{swb_model}, Int64, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), model, index,
        n_from, n_reset, n_to)

"""
    swb_model_get_transition(model, index, guard, direction, from_states, n_from_states, from_values, n_from_values, reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values) -> swb_status

A transition of a model as it was given to swb_model_add_transition, or read by swb_model_from_json; its expressions are
those of the graph it was made of or read into.

@param[in]  index        of the transition, from 0
@param[out] guard        an expression
@param[out] direction    enum swb_direction
@param[out] from_states  [n_from_states] n_from of swb_model_transition_sizes
@param[out] from_values  [n_from_values] as many
@param[out] reset_states [n_reset_states] n_reset of swb_model_transition_sizes
@param[out] resets       [n_resets] as many
@param[out] to_states    [n_to_states] n_to of swb_model_transition_sizes
@param[out] to_values    [n_to_values] as many
@return SWB_OK; SWB_ERR_DIMENSION if there is no such transition or a length is another
"""
swb_model_get_transition(model, index, guard, direction, from_states, n_from_states, from_values, n_from_values,
    reset_states, n_reset_states, resets, n_resets, to_states, n_to_states, to_values, n_to_values) =
    ccall(address(189), swb_status, (Ptr{swb_model}, Int64, Ptr{Int64}, Ptr{Int32}, Ptr{Int64}, Int64, Ptr{Cdouble},
        Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64), model, index, guard,
        direction, from_states, n_from_states, from_values, n_from_values, reset_states, n_reset_states, resets,
        n_resets, to_states, n_to_states, to_values, n_to_values)

"""
    swb_integrator_create(system, settings, out) -> swb_status

Create an integrator. Time, state, controls and parameters are zero until they are set.

@param[in]  system   copied; may be freed afterwards
@param[in]  settings NULL for the defaults
@param[out] out      the new object, NULL on failure; free with swb_integrator_free
@return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if an option is outside its range
"""
swb_integrator_create(system, settings, out) =
    ccall(address(190), swb_status, (Ptr{swb_system}, Ptr{swb_settings}, Ptr{Ptr{swb_integrator}}), system,
        settings, out)

"""
    swb_integrator_reinit(integrator, t, x, nx) -> swb_status

Set time and state, and begin anew: log, statistics, derivatives and dense output are cleared, changed options are
taken over. Controls, parameters and stop times stay.

@param[in] x [nx]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite, or tolerances are too small
"""
swb_integrator_reinit(integrator, t, x, nx) =
    ccall(address(191), swb_status, (Ptr{swb_integrator}, Cdouble, Ptr{Cdouble}, Int64), integrator, t, x, nx)

"""
    swb_integrator_set_controls(integrator, u, nu) -> swb_status

Set the controls, constant from now on. The active modes are found anew.

@param[in] u [nu]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_integrator_set_controls(integrator, u, nu) =
    ccall(address(192), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64), integrator, u, nu)

"""
    swb_integrator_set_params(integrator, p, np) -> swb_status

Set the parameters. The active modes are found anew.

@param[in] p [np]
@return as swb_integrator_set_controls
"""
swb_integrator_set_params(integrator, p, np) =
    ccall(address(193), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64), integrator, p, np)

"""
    swb_integrator_set_tolerances(integrator, rtol, n_rtol, atol, n_atol) -> swb_status

Set tolerances of the local error state by state, instead of the options rtol and atol. They are taken over by the
next swb_integrator_reinit, or at once before the first step.

@param[in] rtol [n_rtol] relative, one value or one for each state
@param[in] atol [n_atol] absolute, one value or one for each state
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is negative or not finite, or both of a state are too
        small
"""
swb_integrator_set_tolerances(integrator, rtol, n_rtol, atol, n_atol) =
    ccall(address(194), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), integrator,
        rtol, n_rtol, atol, n_atol)

"""
    swb_integrator_set_stop_times(integrator, t, n) -> swb_status

Set times at which steps end, for functions of time that are not smooth there and for output.

@param[in] t [n] in any order; those behind the present time are passed over; none: no stop times
@return SWB_OK; SWB_ERR_RANGE if a time is not finite
"""
swb_integrator_set_stop_times(integrator, t, n) =
    ccall(address(195), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64), integrator, t, n)

"""
    swb_integrator_set_preferred(integrator, subsystem, modes, n) -> swb_status

Set the modes a subsystem should take where the continuation is not unique, the preferred first, for the option
ambiguity = prefer. Taken over by the next swb_integrator_reinit, or at once before the first step.

@param[in] subsystem counted among those with more than one mode
@param[in] modes     [n] those that are not named come last
@return SWB_OK; SWB_ERR_DIMENSION if there is no such subsystem; SWB_ERR_RANGE if there is no such mode
"""
swb_integrator_set_preferred(integrator, subsystem, modes, n) =
    ccall(address(196), swb_status, (Ptr{swb_integrator}, Int64, Ptr{Int64}, Int64), integrator, subsystem, modes,
        n)

"""
    swb_integrator_set_decider(integrator, decide, user_data) -> swb_status

Set who decides where the continuation is not unique, before the option ambiguity does; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_integrator_set_decider(integrator, decide, user_data) =
    ccall(address(197), swb_status, (Ptr{swb_integrator}, Ptr{Cvoid}, Ptr{Cvoid}), integrator, decide, user_data)

"""
    swb_integrator_step(integrator, t_stop, kind) -> swb_status

Do one step, not beyond t_stop nor a stop time.

@param[out] kind an enum swb_progress_kind; may be NULL
@return SWB_OK; SWB_ERR_RANGE if t_stop is behind the present time; SWB_ERR_USER if a user function returned a
        negative code; SWB_ERR_STATE after a call that failed so, until swb_integrator_reinit
"""
swb_integrator_step(integrator, t_stop, kind) =
    ccall(address(198), swb_status, (Ptr{swb_integrator}, Cdouble, Ptr{Int32}), integrator, t_stop, kind)

"""
    swb_integrator_advance(integrator, t, outcome) -> swb_status

Integrate to the time t, exactly. Time and state are those at the end, or where the simulation ended before.

@param[out] outcome an enum swb_run_outcome; may be NULL
@return as swb_integrator_step
"""
swb_integrator_advance(integrator, t, outcome) =
    ccall(address(199), swb_status, (Ptr{swb_integrator}, Cdouble, Ptr{Int32}), integrator, t, outcome)

"""
    swb_integrator_sample(integrator, t, n, x, n_x, outcome) -> swb_status

Integrate to the last of the times, and write the states at all of them, which are on the dense output of the steps: no step ends for
them, and the dense output of the run need not be kept. At a switch the state before it counts.

@param[in]  t       [n] increasing, none behind the present time; none: nothing is done
@param[out] x       [n * nx] states, those of a time together; NaN at times that the simulation did not reach
@param[in]  n_x     n * nx
@param[out] outcome an enum swb_run_outcome; may be NULL
@return as swb_integrator_step; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a time is not finite or the times do not increase
"""
swb_integrator_sample(integrator, t, n, x, n_x, outcome) =
    ccall(address(200), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Int32}),
        integrator, t, n, x, n_x, outcome)

"""
    swb_integrator_get_dky(integrator, t, k, dky, nx) -> swb_status

Derivatives of the dense output with respect to time at a time in the last step.

@param[in]  k   order of the derivative, 0 for the state
@param[out] dky [nx]
@return SWB_OK; SWB_ERR_RANGE if t is outside of the last step or k is negative; SWB_ERR_STATE before the first step
"""
swb_integrator_get_dky(integrator, t, k, dky, nx) =
    ccall(address(201), swb_status, (Ptr{swb_integrator}, Cdouble, Int64, Ptr{Cdouble}, Int64), integrator, t, k,
        dky, nx)

"""
    swb_integrator_get_time(integrator, t) -> swb_status

Time reached.

@return SWB_OK
"""
swb_integrator_get_time(integrator, t) =
    ccall(address(202), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}), integrator, t)

"""
    swb_integrator_get_state(integrator, x, nx) -> swb_status

State reached.

@param[out] x [nx]
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_integrator_get_state(integrator, x, nx) =
    ccall(address(203), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64), integrator, x, nx)

"""
    swb_integrator_get_derivative(integrator, f, nx) -> swb_status

Derivative of the state with respect to time under the present active modes; 0 before the first step.

@param[out] f [nx]
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_integrator_get_derivative(integrator, f, nx) =
    ccall(address(204), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64), integrator, f, nx)

"""
    swb_integrator_get_active(integrator, subsystem, active, n) -> swb_status

Active modes of a subsystem: one alone, or several in a sliding mode; none before the first step.

@param[in]  subsystem counted among those with more than one mode
@param[out] active    [n] 0 or 1 for each mode of the subsystem
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_integrator_get_active(integrator, subsystem, active, n) =
    ccall(address(205), swb_status, (Ptr{swb_integrator}, Int64, Ptr{Int32}, Int64), integrator, subsystem, active,
        n)

"""
    swb_integrator_get_outcome(integrator, outcome) -> swb_status

How the simulation stands.

@param[out] outcome an enum swb_run_outcome
@return SWB_OK
"""
swb_integrator_get_outcome(integrator, outcome) =
    ccall(address(206), swb_status, (Ptr{swb_integrator}, Ptr{Int32}), integrator, outcome)

"""
    swb_integrator_get_reason(integrator, buf, len, needed) -> swb_status

Why the simulation ended early, in words; if it did not, what is not known to the tolerances, or \"\".

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL, written in any case; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_integrator_get_reason(integrator, buf, len, needed) =
    ccall(address(207), swb_status, (Ptr{swb_integrator}, Ptr{UInt8}, Int64, Ptr{Int64}), integrator, buf, len,
        needed)

"""
    swb_integrator_get_stats(integrator, stats, struct_size) -> swb_status

Work since the last swb_integrator_reinit.

@param[out] stats       every field is written
@param[in]  struct_size sizeof(swb_run_stats)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_integrator_get_stats(integrator, stats, struct_size) =
    ccall(address(208), swb_status, (Ptr{swb_integrator}, Ptr{swb_run_stats}, UInt64), integrator, stats,
        struct_size)

"""
    swb_integrator_get_run(integrator, out) -> swb_status

A copy of the result since the last swb_integrator_reinit: switches, derivatives, dense output.

@param[out] out the new object, NULL on failure; free with swb_run_free
@return SWB_OK
"""
swb_integrator_get_run(integrator, out) =
    ccall(address(209), swb_status, (Ptr{swb_integrator}, Ptr{Ptr{swb_run}}), integrator, out)

"""
    swb_integrator_adjoint(integrator, v, nx, t, n_t, v_t, n_v_t, events, n_events, weight, n_weight, dx0, nx0, dp, np, du, nu) -> swb_status

Gradient of a function of the run with respect to initial state, parameters and controls, by the transpose of the
forward derivatives in reverse order. It costs about as much as the run, whatever the number of parameters, and needs
the option adjoint.

@param[in]  v      [nx] its derivative with respect to the state reached
@param[in]  t      [n_t] times at whose states the function depends on, too, where the run had stopped: ends of
                   swb_integrator_advance and stop times
@param[in]  v_t    [n_v_t] n_t * nx, its derivatives with respect to these states, those of one time together
@param[in]  events [n_events] switches on whose times it depends, by their place in the log
@param[in]  weight [n_weight] n_events, its derivatives with respect to these times
@param[out] dx0    [nx0] nx, gradient with respect to the initial state
@param[out] dp     [np] gradient with respect to the parameters
@param[out] du     [nu] gradient with respect to the controls
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a time or a switch is none of the run; SWB_ERR_STATE without the
        option adjoint; SWB_ERR_INTERRUPTED
"""
swb_integrator_adjoint(integrator, v, nx, t, n_t, v_t, n_v_t, events, n_events, weight, n_weight, dx0, nx0, dp, np, du,
    nu) =
    ccall(address(210), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble},
        Int64, Ptr{Int64}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble},
        Int64), integrator, v, nx, t, n_t, v_t, n_v_t, events, n_events, weight, n_weight, dx0, nx0, dp, np, du, nu)

"""
    swb_integrator_adjoint_along(integrator, v, nx, x0, nx0, p, np, u, nu, ddx0, nddx0, ddp, nddp, ddu, nddu, dx, ndx) -> swb_status

Derivative of a gradient by swb_integrator_adjoint in a direction: the product of the Hessian with it, where v does not change. What v changes by adds a
gradient of its own. Needs the option adjoint; the derivative has about half of the digits, and costs about ten gradients.

@param[in]  v       [nx] the derivative of the function with respect to the state reached
@param[in]  x0      [nx0] nx, direction of the initial state
@param[in]  p       [np] direction of the parameters
@param[in]  u       [nu] direction of the controls
@param[out] ddx0    [nddx0] nx, derivative of the gradient with respect to the initial state
@param[out] ddp     [nddp] np, derivative of the gradient with respect to the parameters
@param[out] ddu     [nddu] nu, derivative of the gradient with respect to the controls
@param[out] dx      [ndx] nx, derivative of the state reached in the direction
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE for numbers that are not finite; SWB_ERR_STATE without the option adjoint; SWB_ERR_UNSUPPORTED where the run
        has implicit steps, contacts, zeros of higher order, or transitions that follow another event at the same time; SWB_ERR_INTERRUPTED
"""
swb_integrator_adjoint_along(integrator, v, nx, x0, nx0, p, np, u, nu, ddx0, nddx0, ddp, nddp, ddu, nddu, dx, ndx) =
    ccall(address(211), swb_status, (Ptr{swb_integrator}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble},
        Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble},
        Int64), integrator, v, nx, x0, nx0, p, np, u, nu, ddx0, nddx0, ddp, nddp, ddu, nddu, dx, ndx)

"""
    swb_integrator_set_int(integrator, name, value) -> swb_status

Set an integer or enumeration option of an integrator (or a float one, to an integer) by name. Options of the
integration are taken over by the next swb_integrator_reinit, or at once before the first step.

@return as swb_settings_set_int
"""
swb_integrator_set_int(integrator, name, value) =
    ccall(address(212), swb_status, (Ptr{swb_integrator}, Cstring, Int64), integrator, name, value)

"""
    swb_integrator_set_double(integrator, name, value) -> swb_status

Set a float option of an integrator by name, as swb_integrator_set_int.

@return as swb_settings_set_double
"""
swb_integrator_set_double(integrator, name, value) =
    ccall(address(213), swb_status, (Ptr{swb_integrator}, Cstring, Cdouble), integrator, name, value)

"""
    swb_integrator_set_string(integrator, name, value) -> swb_status

Set any option of an integrator by name from text, as swb_integrator_set_int.

@return as swb_settings_set_string
"""
swb_integrator_set_string(integrator, name, value) =
    ccall(address(214), swb_status, (Ptr{swb_integrator}, Cstring, Cstring), integrator, name, value)

"""
    swb_integrator_set_settings(integrator, settings) -> swb_status

Set all options of an integrator, as swb_integrator_set_int.

@param[in] settings NULL for the defaults
@return SWB_OK; SWB_ERR_RANGE if an option is outside its range
"""
swb_integrator_set_settings(integrator, settings) =
    ccall(address(215), swb_status, (Ptr{swb_integrator}, Ptr{swb_settings}), integrator, settings)

"""
    swb_integrator_get_settings(integrator, settings, struct_size) -> swb_status

Options of an integrator, all of them.

@param[out] settings    every field is written
@param[in]  struct_size sizeof(swb_settings)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_integrator_get_settings(integrator, settings, struct_size) =
    ccall(address(216), swb_status, (Ptr{swb_integrator}, Ptr{swb_settings}, UInt64), integrator, settings,
        struct_size)

"""
    swb_integrator_set_progress(integrator, progress, user_data) -> swb_status

Set who is called once per accepted step; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_integrator_set_progress(integrator, progress, user_data) =
    ccall(address(217), swb_status, (Ptr{swb_integrator}, Ptr{Cvoid}, Ptr{Cvoid}), integrator, progress, user_data)

"""
    swb_integrator_set_poll(integrator, poll, user_data) -> swb_status

Set who is asked now and then whether to go on; NULL for nobody. For interpreters that look for signals only where their own
code runs: swb_integrator_set_progress calls at every step, which for a small system may cost as much as the step.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_integrator_set_poll(integrator, poll, user_data) =
    ccall(address(218), swb_status, (Ptr{swb_integrator}, Ptr{Cvoid}, Ptr{Cvoid}), integrator, poll, user_data)

"""
    swb_integrator_set_log(integrator, log, user_data) -> swb_status

Set who gets the log, as much as the option log_level says; NULL for nobody. A line for each call at level info, one
for each switch at level debug, one for each step at level trace.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_integrator_set_log(integrator, log, user_data) =
    ccall(address(219), swb_status, (Ptr{swb_integrator}, Ptr{Cvoid}, Ptr{Cvoid}), integrator, log, user_data)

"""
    swb_integrator_interrupt(integrator) -> swb_status

Stop the call that runs now with the outcome SWB_RUN_OUTCOME_STOPPED, or the next one if none runs; the one after it
goes on. From any thread and from signal handlers; only swb_integrator_free must not run at the same time. It is heeded
between steps: a call ends within the time of one step, which takes some tens of evaluations of the model.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_integrator_interrupt(integrator) = ccall(address(220), swb_status, (Ptr{swb_integrator},), integrator)

"""
    swb_integrator_free(integrator) -> Cvoid

Free; NULL is allowed.
"""
swb_integrator_free(integrator) = ccall(address(221), Cvoid, (Ptr{swb_integrator},), integrator)

"""
    swb_step_options_init(options, struct_size) -> swb_status

Set the defaults of the options of a stepper.

@param[out] options     every word is written
@param[in]  struct_size sizeof(swb_step_options)
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
"""
swb_step_options_init(options, struct_size) =
    ccall(address(222), swb_status, (Ptr{swb_step_options}, UInt64), options, struct_size)

"""
    swb_stepper_create(system, options, out) -> swb_status

Create a stepper of a scene. It has no state yet; controls and parameters are zero until they are set.

@param[in]  system  of swb_scene_system; copied, may be freed afterwards
@param[in]  options NULL for the defaults
@param[out] out     the new object, NULL on failure; free with swb_stepper_free
@return SWB_OK; SWB_ERR_STATE if the system is no scene; SWB_ERR_UNSUPPORTED for projected systems; SWB_ERR_RANGE if an
        option is outside its range; SWB_ERR_NUMERIC if a constant inertia is not positive definite
"""
swb_stepper_create(system, options, out) =
    ccall(address(223), swb_status, (Ptr{swb_system}, Ptr{swb_step_options}, Ptr{Ptr{swb_stepper}}), system,
        options, out)

"""
    swb_stepper_set_state(stepper, t, x, nx) -> swb_status

Set time and state (coordinates, then velocities), and forget impulses and statistics. Set the parameters first.

@param[in] x [nx]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite or a gap is negative by more than a thousandth
        of the coordinates in it and more than two steps make; SWB_ERR_NONFINITE if a function is not defined there;
        SWB_ERR_NUMERIC if the inertia is not positive definite
"""
swb_stepper_set_state(stepper, t, x, nx) =
    ccall(address(224), swb_status, (Ptr{swb_stepper}, Cdouble, Ptr{Cdouble}, Int64), stepper, t, x, nx)

"""
    swb_stepper_set_controls(stepper, u, nu) -> swb_status

Set the controls, constant from now on.

@param[in] u [nu]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_stepper_set_controls(stepper, u, nu) =
    ccall(address(225), swb_status, (Ptr{swb_stepper}, Ptr{Cdouble}, Int64), stepper, u, nu)

"""
    swb_stepper_set_params(stepper, p, np) -> swb_status

Set the parameters, constant from now on.

@param[in] p [np]
@return as swb_stepper_set_controls
"""
swb_stepper_set_params(stepper, p, np) =
    ccall(address(226), swb_status, (Ptr{swb_stepper}, Ptr{Cdouble}, Int64), stepper, p, np)

"""
    swb_stepper_step(stepper) -> swb_status

Make one step of the length h of the options.

@return SWB_OK; SWB_ERR_STATE before swb_stepper_set_state, and after a step that failed; SWB_ERR_USER if a user function
        returned a negative code; SWB_ERR_NONFINITE if one has no value where it is needed, or the state grows without
        end; SWB_ERR_RANGE if friction or restitution is out of range; SWB_ERR_NUMERIC if the inertia is not positive
        definite; SWB_ERR_INTERRUPTED
"""
swb_stepper_step(stepper) = ccall(address(227), swb_status, (Ptr{swb_stepper},), stepper)

"""
    swb_stepper_advance(stepper, t) -> swb_status

Make equal steps, not longer than h, that end at a time.

@param[in] t not before the time reached
@return as swb_stepper_step; where it fails, time and state are those of the last step that was made
"""
swb_stepper_advance(stepper, t) = ccall(address(228), swb_status, (Ptr{swb_stepper}, Cdouble), stepper, t)

"""
    swb_stepper_count(stepper, t, every, n) -> swb_status

How many states swb_stepper_run keeps.

@param[in]  t     end
@param[in]  every states are kept after so many steps, 1 or more
@param[out] n     states, the present one included
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_NULL
"""
swb_stepper_count(stepper, t, every, n) =
    ccall(address(229), swb_status, (Ptr{swb_stepper}, Cdouble, Int64, Ptr{Int64}), stepper, t, every, n)

"""
    swb_stepper_run(stepper, t, every, times, n_times, states, n_states, impulses, n_impulses) -> swb_status

Make equal steps, not longer than h, that end at a time, and keep states.

@param[in]  t          not before the time reached
@param[in]  every      the state is kept after so many steps, and the last
@param[out] times      [n_times] as swb_stepper_count says: the present time, then those of the states that are kept
@param[out] states     [n_states] n_times times nx, those of the first time first
@param[out] impulses   [n_impulses] n_times times n_contacts times 3, those of the steps that end at these times; NULL
                       with 0 if they are not wanted
@return as swb_stepper_step, and SWB_ERR_DIMENSION
"""
swb_stepper_run(stepper, t, every, times, n_times, states, n_states, impulses, n_impulses) =
    ccall(address(230), swb_status, (Ptr{swb_stepper}, Cdouble, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Ptr{Cdouble}, Int64), stepper, t, every, times, n_times, states, n_states, impulses, n_impulses)

"""
    swb_stepper_sizes(stepper, nx, nu, np, n_contacts) -> swb_status

Sizes of a stepper.

@param[out] nx         states: coordinates and velocities; may be NULL
@param[out] nu         controls; may be NULL
@param[out] np         parameters; may be NULL
@param[out] n_contacts contacts, those that were left out do not count; may be NULL
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_stepper_sizes(stepper, nx, nu, np, n_contacts) =
    ccall(address(231), swb_status, (Ptr{swb_stepper}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), stepper, nx,
        nu, np, n_contacts)

"""
    swb_stepper_get_time(stepper, t) -> swb_status

Time reached.

@return SWB_OK
"""
swb_stepper_get_time(stepper, t) = ccall(address(232), swb_status, (Ptr{swb_stepper}, Ptr{Cdouble}), stepper, t)

"""
    swb_stepper_get_state(stepper, x, nx) -> swb_status

State reached.

@param[out] x [nx] coordinates, then velocities
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_stepper_get_state(stepper, x, nx) =
    ccall(address(233), swb_status, (Ptr{swb_stepper}, Ptr{Cdouble}, Int64), stepper, x, nx)

"""
    swb_stepper_get_impulses(stepper, impulses, n) -> swb_status

Impulses of the last step: impulses, not forces.

@param[out] impulses [n] 3 n_contacts: normal, then along the tangents there are, zero for others
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_stepper_get_impulses(stepper, impulses, n) =
    ccall(address(234), swb_status, (Ptr{swb_stepper}, Ptr{Cdouble}, Int64), stepper, impulses, n)

"""
    swb_stepper_get_stats(stepper, stats, struct_size) -> swb_status

Counts of the steps since the state was set, and how they went.

@param[out] stats
@param[in]  struct_size sizeof(swb_step_stats)
@return SWB_OK; SWB_ERR_DIMENSION if the size is no size of such a struct
"""
swb_stepper_get_stats(stepper, stats, struct_size) =
    ccall(address(235), swb_status, (Ptr{swb_stepper}, Ptr{swb_step_stats}, UInt64), stepper, stats, struct_size)

"""
    swb_stepper_interrupt(stepper) -> swb_status

End the call that runs, from another thread or a signal handler, after the step it is at; state and time are those of
that step, and the object can be used again.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_stepper_interrupt(stepper) = ccall(address(236), swb_status, (Ptr{swb_stepper},), stepper)

"""
    swb_stepper_free(stepper) -> Cvoid

Free; NULL is allowed.
"""
swb_stepper_free(stepper) = ccall(address(237), Cvoid, (Ptr{swb_stepper},), stepper)

"""
    swb_batch_create(system, settings, out) -> swb_status

Create a batch.

@param[in]  system   copied; may be freed afterwards. Its functions are called by several threads at once, unless one
                     of them carries the flag SWB_SERIAL
@param[in]  settings NULL for the defaults
@param[out] out      the new object, NULL on failure; free with swb_batch_free
@return as swb_integrator_create
"""
swb_batch_create(system, settings, out) =
    ccall(address(238), swb_status, (Ptr{swb_system}, Ptr{swb_settings}, Ptr{Ptr{swb_batch}}), system, settings,
        out)

"""
    swb_batch_run(batch, t0, t1, x0, n_x0, u, n_u, p, n_p, n_threads) -> swb_status

Simulate from t0 to t1, from every initial state. A run that fails does not keep the others from running. The results
are those of single runs to the last bit, whatever the number of threads.

@param[in] x0        [n_x0] the initial states, those of one run together
@param[in] u         [n_u] controls: none (zeros), nu for all runs, or nu for each
@param[in] p         [n_p] parameters, the same
@param[in] n_threads threads at most; 0: one for each processor. With a function that carries the flag SWB_SERIAL the
                     thread of the caller does it all. Log and progress callbacks do not exist here
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if n_threads is negative
"""
swb_batch_run(batch, t0, t1, x0, n_x0, u, n_u, p, n_p, n_threads) =
    ccall(address(239), swb_status, (Ptr{swb_batch}, Cdouble, Cdouble, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Ptr{Cdouble}, Int64, Int64), batch, t0, t1, x0, n_x0, u, n_u, p, n_p, n_threads)

"""
    swb_batch_size(batch, n_runs) -> swb_status

Number of runs of the last swb_batch_run; 0 before.

@return SWB_OK
"""
swb_batch_size(batch, n_runs) = ccall(address(240), swb_status, (Ptr{swb_batch}, Ptr{Int64}), batch, n_runs)

"""
    swb_batch_states(batch, x, n) -> swb_status

Final states of all runs.

@param[out] x [n] n_runs * nx, those of one run together; NaN for runs that failed
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_batch_states(batch, x, n) = ccall(address(241), swb_status, (Ptr{swb_batch}, Ptr{Cdouble}, Int64), batch, x, n)

"""
    swb_batch_outcomes(batch, outcome, n) -> swb_status

How all runs ended.

@param[out] outcome [n] n_runs, an enum swb_run_outcome each, or the negative swb_status of a run that failed
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_batch_outcomes(batch, outcome, n) =
    ccall(address(242), swb_status, (Ptr{swb_batch}, Ptr{Int32}, Int64), batch, outcome, n)

"""
    swb_batch_get_run(batch, index, out) -> swb_status

A copy of the result of one run.

@param[in]  index the run, from 0
@param[out] out   the new object, NULL on failure; free with swb_run_free
@return SWB_OK; SWB_ERR_DIMENSION; the status of the run if it failed, with its message
"""
swb_batch_get_run(batch, index, out) =
    ccall(address(243), swb_status, (Ptr{swb_batch}, Int64, Ptr{Ptr{swb_run}}), batch, index, out)

"""
    swb_batch_interrupt(batch) -> swb_status

Stop the runs that are at work, with the outcome SWB_RUN_OUTCOME_STOPPED, or those of the next call if none are. From
any thread and from signal handlers; only swb_batch_free must not run at the same time. The call ends when every run has
finished its step.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_batch_interrupt(batch) = ccall(address(244), swb_status, (Ptr{swb_batch},), batch)

"""
    swb_batch_free(batch) -> Cvoid

Free; NULL is allowed.
"""
swb_batch_free(batch) = ccall(address(245), Cvoid, (Ptr{swb_batch},), batch)

"""
    swb_mhe_options_init(options, struct_size) -> swb_status

Set the defaults of the options of an estimator.

@param[out] options     every word is written
@param[in]  struct_size sizeof(swb_mhe_options)
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
"""
swb_mhe_options_init(options, struct_size) =
    ccall(address(246), swb_status, (Ptr{swb_mhe_options}, UInt64), options, struct_size)

"""
    swb_mhe_create(ocp, measured, initial, n_initial, process, n_process, measurement, n_measurement, options, out) -> swb_status

Create a moving horizon estimator for the system, the stages, the parameters and the bounds of states of a problem, which has no costs and no other
constraints. Its stages are the samples of the window and have the same length; its initial state is the mean before the first measurement. All memory
is taken here, but what contacts and transitions need. Constant parameters are estimated as states with a zero derivative.

@param[in]  ocp         copied as it is stated now
@param[in]  measured    y by state, control of the stage before, parameters and time; dimensions of the system
@param[in]  initial     [n_initial] nx standard deviations of the state before the first measurement, positive
@param[in]  process     [n_process] nx standard deviations of what is added to the states in every stage, zero for none
@param[in]  measurement [n_measurement] ny standard deviations of the measurements, positive
@param[in]  options     NULL for the defaults
@param[out] out         the new object, NULL on failure; free with swb_mhe_free
@return SWB_OK; SWB_ERR_UNSUPPORTED for what estimators do not know: costs, other constraints, discrete states, choices, algebraic states;
        SWB_ERR_DIMENSION; SWB_ERR_RANGE if an option or a deviation is outside its range; SWB_ERR_STATE without an initial state or
        parameters; SWB_ERR_USER
"""
swb_mhe_create(ocp, measured, initial, n_initial, process, n_process, measurement, n_measurement, options, out) =
    ccall(address(247), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Ptr{Cdouble}, Int64, Ptr{swb_mhe_options}, Ptr{Ptr{swb_mhe}}), ocp, measured, initial, n_initial, process,
        n_process, measurement, n_measurement, options, out)

"""
    swb_mhe_sizes(c, n, nx, nu, ny, nw) -> swb_status

Sizes of an estimator.

@param[out] n  stages of the window
@param[out] nx states
@param[out] nu controls
@param[out] ny measurements of a sample
@param[out] nw states that have noise
@return SWB_OK; SWB_ERR_NULL
"""
swb_mhe_sizes(c, n, nx, nu, ny, nw) =
    ccall(address(248), swb_status, (Ptr{swb_mhe}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), c,
        n, nx, nu, ny, nw)

"""
    swb_mhe_prepare(c, u, nu, info, struct_size) -> swb_status

Go to the next sample under a control, and do everything for it that needs no measurement: arrival cost, prediction, linearisation, factors.

@param[in]  u           [nu] control from the last sample to this one; NULL with 0 for a system without
@param[out] info        NULL if not wanted
@param[in]  struct_size sizeof(swb_nmpc_info)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER if a function returned a negative
        code; SWB_ERR_INTERRUPTED
"""
swb_mhe_prepare(c, u, nu, info, struct_size) =
    ccall(address(249), swb_status, (Ptr{swb_mhe}, Ptr{Cdouble}, Int64, Ptr{swb_nmpc_info}, UInt64), c, u, nu, info,
        struct_size)

"""
    swb_mhe_estimate(c, y, ny, x, nx, info, struct_size) -> swb_status

The state at the sample of the last preparation, or at the start, from its measurements. It is a prediction where info says
SWB_NMPC_SOURCE_PLAN: functions have no value at the estimate.

@param[in]  y           [ny] NaN for what was not measured
@param[out] x           [nx]
@param[out] info        NULL if not wanted
@param[in]  struct_size sizeof(swb_nmpc_info)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a measurement is infinite; SWB_ERR_STATE where the sample has an estimate: call
        swb_mhe_prepare; SWB_ERR_USER; SWB_ERR_INTERRUPTED
"""
swb_mhe_estimate(c, y, ny, x, nx, info, struct_size) =
    ccall(address(250), swb_status, (Ptr{swb_mhe}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{swb_nmpc_info},
        UInt64), c, y, ny, x, nx, info, struct_size)

"""
    swb_mhe_set_params(c, p, np) -> swb_status

Set the parameters from the next preparation on; samples that were keep theirs.

@param[in] p [np]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_mhe_set_params(c, p, np) = ccall(address(251), swb_status, (Ptr{swb_mhe}, Ptr{Cdouble}, Int64), c, p, np)

"""
    swb_mhe_reset(c, x0, nx) -> swb_status

Back to the start with another mean: nothing was measured.

@param[in] x0 [nx]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER; SWB_ERR_INTERRUPTED
"""
swb_mhe_reset(c, x0, nx) = ccall(address(252), swb_status, (Ptr{swb_mhe}, Ptr{Cdouble}, Int64), c, x0, nx)

"""
    swb_mhe_write_c(c, folder, prefix, precision) -> swb_status

Write the estimator as C files (C99) to a folder, which is made if it is not there: prefix.h, prefix.c, prefix_main.c, prefix_record.h and
Makefile. There is no heap, no thread and no clock; all memory is one static object of prefix_arena_bytes bytes.

The functions are prefix_prepare, prefix_estimate, prefix_set_params, prefix_reset, prefix_states and prefix_filled, described in prefix.h. The estimator in
C begins with the initial state and the present parameters. The main program repeats estimates that are recorded here, from simulated measurements; this
estimator is afterwards as after swb_mhe_reset with the initial state.

@param[in] folder    path, UTF-8
@param[in] prefix    what names begin with, a C identifier
@param[in] precision an enum swb_c_real
@return SWB_OK; SWB_ERR_UNSUPPORTED with a message for systems that switch, implicit methods, deadlines, functions that are no expressions;
        SWB_ERR_RANGE for the prefix, the precision, or if a file cannot be written
"""
swb_mhe_write_c(c, folder, prefix, precision) =
    ccall(address(253), swb_status, (Ptr{swb_mhe}, Cstring, Cstring, Int64), c, folder, prefix, precision)

"""
    swb_mhe_get_window(c, x, n_x, w, n_w, filled) -> swb_status

The window: states of its nodes, the last sample at the end, and noise of its stages.

@param[out] x      [(n + 1) nx]
@param[out] w      [n nw]; NULL with 0 if not wanted
@param[out] filled stages that were; those in front of them do nothing; NULL if not wanted
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION
"""
swb_mhe_get_window(c, x, n_x, w, n_w, filled) =
    ccall(address(254), swb_status, (Ptr{swb_mhe}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Int64}), c, x, n_x,
        w, n_w, filled)

"""
    swb_mhe_get_covariance(c, p, n) -> swb_status

The covariance of the last state by the linearisation of the last program, without regard of bounds.

@param[out] p [nx nx]
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION; SWB_ERR_STATE where there is no program
"""
swb_mhe_get_covariance(c, p, n) = ccall(address(255), swb_status, (Ptr{swb_mhe}, Ptr{Cdouble}, Int64), c, p, n)

"""
    swb_mhe_interrupt(c) -> swb_status

End the call that runs: from any thread or signal handler.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if the object has been freed
"""
swb_mhe_interrupt(c) = ccall(address(256), swb_status, (Ptr{swb_mhe},), c)

"""
    swb_mhe_free(c) -> Cvoid

Free; NULL is allowed.
"""
swb_mhe_free(c) = ccall(address(257), Cvoid, (Ptr{swb_mhe},), c)

"""
    swb_nmpc_options_init(options, struct_size) -> swb_status

Set the defaults of the options of a controller.

@param[out] options     every word is written
@param[in]  struct_size sizeof(swb_nmpc_options)
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
"""
swb_nmpc_options_init(options, struct_size) =
    ccall(address(258), swb_status, (Ptr{swb_nmpc_options}, UInt64), options, struct_size)

"""
    swb_nmpc_create(ocp, options, out) -> swb_status

Create a controller for a problem as it is stated now. All memory is taken here, but what contacts, transitions and choices need. The problem is copied;
the first iterate is its guess. Costs along the horizon are summed over the starts of the stages (10.1), path constraints hold
there. Systems that switch are simulated by events in every stage, with the tolerances of the settings; they take level D0 and
every scheme but SWB_NMPC_SCHEME_MLI.

@param[in]  ocp     may be changed, solved and freed afterwards
@param[in]  options NULL for the defaults
@param[out] out     the new object, NULL on failure; free with swb_nmpc_free
@return SWB_OK; SWB_ERR_UNSUPPORTED for what controllers do not know: transitions, contacts, free times and parameters, linear controls,
        periodicity, complementarity, penalties of the largest violation; SWB_ERR_RANGE if an option is outside its range
"""
swb_nmpc_create(ocp, options, out) =
    ccall(address(259), swb_status, (Ptr{swb_ocp}, Ptr{swb_nmpc_options}, Ptr{Ptr{swb_nmpc}}), ocp, options, out)

"""
    swb_nmpc_sizes(c, n, nx, nu) -> swb_status

Sizes of a controller.

@param[out] n  control stages
@param[out] nx states that are measured: those with a derivative
@param[out] nu controls
@return SWB_OK; SWB_ERR_NULL
"""
swb_nmpc_sizes(c, n, nx, nu) =
    ccall(address(260), swb_status, (Ptr{swb_nmpc}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), c, n, nx, nu)

"""
    swb_nmpc_initialise(c, x0, nx, max_iter, iterations) -> swb_status

Solve the problem for an initial state to convergence, from the present iterate: the start of a closed loop.

@param[in]  x0         [nx]
@param[in]  max_iter   steps at most
@param[out] iterations steps made; NULL if not wanted
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_NUMERIC if it does not converge, the iterate being the last point;
        SWB_ERR_USER; SWB_ERR_INTERRUPTED
"""
swb_nmpc_initialise(c, x0, nx, max_iter, iterations) =
    ccall(address(261), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Int64, Ptr{Int64}), c, x0, nx, max_iter,
        iterations)

"""
    swb_nmpc_prepare(c, x_predicted, nx, info, struct_size) -> swb_status

Do everything for the next sample that needs no measurement. Where functions have no value the quadratic program of the
sample before is used further, which is no failure.

@param[in]  x_predicted [nx] the state that will be found; NULL with 0: one step of the model from the last state
@param[out] info        NULL if not wanted
@param[in]  struct_size sizeof(swb_nmpc_info)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER if a function returned a negative
        code; SWB_ERR_INTERRUPTED
"""
swb_nmpc_prepare(c, x_predicted, nx, info, struct_size) =
    ccall(address(262), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Ptr{swb_nmpc_info}, UInt64), c,
        x_predicted, nx, info, struct_size)

"""
    swb_nmpc_prepare_async(c, x_predicted, nx, started) -> swb_status

Begin a preparation on a thread of the controller and return at once. swb_nmpc_feedback takes what was prepared; all other calls wait
until the preparation is over, and nothing else may be freed or changed by them before. The thread is started by the first call and
calls the functions of the model; where these may be called by one thread only (SWB_FUNCTION_FLAG_SERIAL), the preparation is
made before the call returns.

@param[in]  x_predicted [nx] the state that will be found; NULL with 0: one step of the model from the last state
@param[out] started     1; 0 if a preparation is running already, which goes on; NULL if not wanted
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite. How the preparation ends is said by swb_nmpc_wait.
"""
swb_nmpc_prepare_async(c, x_predicted, nx, started) =
    ccall(address(263), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Ptr{Int64}), c, x_predicted, nx, started)

"""
    swb_nmpc_wait(c, info, struct_size) -> swb_status

Wait for the preparation that swb_nmpc_prepare_async has begun.

@param[out] info        as of swb_nmpc_prepare; NULL if not wanted
@param[in]  struct_size sizeof(swb_nmpc_info)
@return SWB_OK; as swb_nmpc_prepare, how the preparation ended; SWB_ERR_STATE where there was none
"""
swb_nmpc_wait(c, info, struct_size) =
    ccall(address(264), swb_status, (Ptr{swb_nmpc}, Ptr{swb_nmpc_info}, UInt64), c, info, struct_size)

"""
    swb_nmpc_feedback(c, x, nx, u0, nu, info, struct_size) -> swb_status

The control for a measured state. No model function is evaluated and nothing is allocated. There always is a control; info says
where it comes from, also for a state that is not finite. A preparation that runs on the controller's thread is waited for, for at
most half of the deadline; then the control is that of the last plan and its feedback law, cut off at its bounds.

@param[in]  x           [nx]
@param[out] u0          [nu]
@param[out] info        NULL if not wanted
@param[in]  struct_size sizeof(swb_nmpc_info)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
"""
swb_nmpc_feedback(c, x, nx, u0, nu, info, struct_size) =
    ccall(address(265), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{swb_nmpc_info},
        UInt64), c, x, nx, u0, nu, info, struct_size)

"""
    swb_nmpc_finish(c) -> swb_status

Do what belongs to the last sample and can wait until its control is out: the plan, and the prediction of the next state. Every
other call does it where it is needed.

@return SWB_OK
"""
swb_nmpc_finish(c) = ccall(address(266), swb_status, (Ptr{swb_nmpc},), c)

"""
    swb_nmpc_set_params(c, p, n) -> swb_status

Set the parameters. Between a preparation and its feedback they enter the prepared program by one evaluation of the model; for systems
that switch they count from the next preparation on.

@param[in] p [n] np values for the whole horizon, n_stages np for its stages, or (n_stages + 1) np for its nodes
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_INTERRUPTED; SWB_ERR_USER for a negative code of a
        callback
"""
swb_nmpc_set_params(c, p, n) = ccall(address(267), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64), c, p, n)

"""
    swb_nmpc_set_references(c, term, y, n) -> swb_status

Set the references of a least-squares term. Between a preparation and its feedback they enter the prepared program.

@param[in] term its number, in the order they were added to the problem
@param[in] y    [n] one reference for all nodes of the term, or one for each
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no such term or a value is not finite; SWB_ERR_INTERRUPTED;
        SWB_ERR_USER for a negative code of a callback
"""
swb_nmpc_set_references(c, term, y, n) =
    ccall(address(268), swb_status, (Ptr{swb_nmpc}, Int64, Ptr{Cdouble}, Int64), c, term, y, n)

"""
    swb_nmpc_set_time(c, t0) -> swb_status

Set the time of the first node, from the next preparation on.

@return SWB_OK; SWB_ERR_RANGE
"""
swb_nmpc_set_time(c, t0) = ccall(address(269), swb_status, (Ptr{swb_nmpc}, Cdouble), c, t0)

"""
    swb_nmpc_set_weights(c, term, w, n_w) -> swb_status

Set the weights of a least-squares term, in the order they were added to the problem: from the next preparation on.

@param[in] w [n_w] the diagonal, or the matrix row by row
@return SWB_OK; SWB_ERR_RANGE for a term there is not, or a weight that is not finite; SWB_ERR_DIMENSION
"""
swb_nmpc_set_weights(c, term, w, n_w) =
    ccall(address(270), swb_status, (Ptr{swb_nmpc}, Int64, Ptr{Cdouble}, Int64), c, term, w, n_w)

"""
    swb_nmpc_set_control_bounds(c, lower, upper, nu) -> swb_status

Set the bounds of the controls, infinite for none. Between a preparation and its feedback they count at once.

@param[in] lower [nu]
@param[in] upper [nu]
@return SWB_OK; SWB_ERR_RANGE if a lower bound is above the upper one or NaN; SWB_ERR_DIMENSION
"""
swb_nmpc_set_control_bounds(c, lower, upper, nu) =
    ccall(address(271), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Ptr{Cdouble}, Int64), c, lower, upper, nu)

"""
    swb_nmpc_set_state_bounds(c, lower, upper, nx) -> swb_status

Set the bounds of the states that have a derivative, infinite for none. Between a preparation and its feedback they count at once.

@param[in] lower [nx]
@param[in] upper [nx]
@return SWB_OK; SWB_ERR_RANGE if a lower bound is above the upper one or NaN, or for a state that has no bound in the problem;
        SWB_ERR_DIMENSION
"""
swb_nmpc_set_state_bounds(c, lower, upper, nx) =
    ccall(address(272), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Ptr{Cdouble}, Int64), c, lower, upper, nx)

"""
    swb_nmpc_get_objective(c, value) -> swb_status

The cost of the plan with the prices of its violations, summed over the nodes as in (10.1).

@param[out] value
@return SWB_OK; SWB_ERR_NUMERIC if functions have no value at the plan; SWB_ERR_STATE without values of the parameters; SWB_ERR_NULL
"""
swb_nmpc_get_objective(c, value) = ccall(address(273), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}), c, value)

"""
    swb_nmpc_get_gain(c, k, n) -> swb_status

The feedback gain of the first stage where no constraint is active: u = u_0 + K (x - x_0).

@param[out] k [nu nx] row by row
@return SWB_OK; SWB_ERR_STATE if nothing is prepared; SWB_ERR_DIMENSION; SWB_ERR_NULL
"""
swb_nmpc_get_gain(c, k, n) = ccall(address(274), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64), c, k, n)

"""
    swb_nmpc_count_rows(c, rows) -> swb_status

Rows of constraints of the program: bounds of states and constraints, node by node.

@param[out] rows
@return SWB_OK; SWB_ERR_NULL
"""
swb_nmpc_count_rows(c, rows) = ccall(address(275), swb_status, (Ptr{swb_nmpc}, Ptr{Int64}), c, rows)

"""
    swb_nmpc_get_multipliers(c, lambda, n_lambda, mu, n_mu, row_mu, n_row_mu, nodes, n_nodes) -> swb_status

Multipliers of the plan: positive at upper, negative at lower bounds.

@param[out] lambda [(n + 1) nx] of the dynamics, the first of the initial value
@param[out] mu     [n nu] of the bounds of the controls
@param[out] row_mu [rows] of the rows of constraints, see swb_nmpc_count_rows
@param[out] nodes  [rows] the nodes of these
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
"""
swb_nmpc_get_multipliers(c, lambda, n_lambda, mu, n_mu, row_mu, n_row_mu, nodes, n_nodes) =
    ccall(address(276), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Ptr{Int64}, Int64), c, lambda, n_lambda, mu, n_mu, row_mu, n_row_mu, nodes, n_nodes)

"""
    swb_nmpc_set_deadline(c, seconds) -> swb_status

Set the seconds a feedback may take.

@return SWB_OK; SWB_ERR_RANGE if they are not positive
"""
swb_nmpc_set_deadline(c, seconds) = ccall(address(277), swb_status, (Ptr{swb_nmpc}, Cdouble), c, seconds)

"""
    swb_nmpc_set_iterate(c, x, n_x, u, n_u) -> swb_status

Set the iterate; its multipliers are zero.

@param[in] x [(n + 1) nx], those of the first node first
@param[in] u [n nu]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_nmpc_set_iterate(c, x, n_x, u, n_u) =
    ccall(address(278), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), c, x, n_x, u, n_u)

"""
    swb_nmpc_write_c(c, folder, prefix, precision) -> swb_status

Write the controller as C files (C99) to a folder, which is made if it is not there: prefix.h, prefix.c, prefix_main.c, prefix_record.h,
prefix_fmu.c, modelDescription.xml, modelDescription_fmi3.xml, buildDescription.xml and Makefile. There is no heap, no thread and no clock; all
memory is one static object of prefix_arena_bytes bytes. \"make fmu\" makes a unit for co-simulation of them (FMI 2.0), \"make fmu3\" one of FMI 3.0.

The functions are prefix_prepare, prefix_feedback, prefix_set_reference, prefix_set_params, prefix_reset, prefix_plan_x and prefix_plan_u, described
in prefix.h. The controller in C begins with the present plan, parameters and references. The main program repeats a closed loop that is
recorded here; this controller is afterwards as after swb_nmpc_set_iterate with its plan.

@param[in] folder    path, UTF-8
@param[in] prefix    what names begin with, a C identifier
@param[in] precision an enum swb_c_real
@return SWB_OK; SWB_ERR_UNSUPPORTED with a message for systems that switch, implicit methods, algebraic states, costs that are no least
        squares, functions that are no expressions, schemes other than rti and as_rti, levels other than d0; SWB_ERR_STATE if qp_solver is not
        stagewise; SWB_ERR_RANGE for the prefix, the precision, or if a file cannot be written
"""
swb_nmpc_write_c(c, folder, prefix, precision) =
    ccall(address(279), swb_status, (Ptr{swb_nmpc}, Cstring, Cstring, Int64), c, folder, prefix, precision)

"""
    swb_nmpc_reset(c) -> swb_status

Back to the start: the guess of the problem, no multipliers, nothing measured, monitor at zero.

@return SWB_OK
"""
swb_nmpc_reset(c) = ccall(address(280), swb_status, (Ptr{swb_nmpc},), c)

"""
    swb_nmpc_get_plan(c, x, n_x, u, n_u) -> swb_status

The plan from the last sample on.

@param[out] x [(n + 1) nx], those of the first node first
@param[out] u [n nu]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
"""
swb_nmpc_get_plan(c, x, n_x, u, n_u) =
    ccall(address(281), swb_status, (Ptr{swb_nmpc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), c, x, n_x, u, n_u)

"""
    swb_nmpc_get_monitor(c, monitor, struct_size) -> swb_status

How the controller is doing.

@param[out] monitor     every word is written
@param[in]  struct_size sizeof(swb_nmpc_monitor)
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
"""
swb_nmpc_get_monitor(c, monitor, struct_size) =
    ccall(address(282), swb_status, (Ptr{swb_nmpc}, Ptr{swb_nmpc_monitor}, UInt64), c, monitor, struct_size)

"""
    swb_nmpc_interrupt(c) -> swb_status

End the call that runs: from any thread or signal handler. A preparation that is ended leaves the quadratic program before.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if the object has been freed
"""
swb_nmpc_interrupt(c) = ccall(address(283), swb_status, (Ptr{swb_nmpc},), c)

"""
    swb_nmpc_free(c) -> Cvoid

Free; NULL is allowed.
"""
swb_nmpc_free(c) = ccall(address(284), Cvoid, (Ptr{swb_nmpc},), c)

"""
    swb_ocp_create(system, horizon, n_stages, settings, out) -> swb_status

Create an optimal control problem. Bounds are infinite, the initial state is free, the initial time is zero,
parameters have no values, and there is no cost, until they are set. A problem whose parameters have no values is not solved:
SWB_ERR_STATE.

@param[in]  system   copied; may be freed afterwards
@param[in]  horizon  duration
@param[in]  n_stages control intervals of equal length
@param[in]  settings NULL for the defaults
@param[out] out      the new object, NULL on failure; free with swb_ocp_free
@return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if the horizon is not
        positive or an option is outside its range; SWB_ERR_DIMENSION without stages
"""
swb_ocp_create(system, horizon, n_stages, settings, out) =
    ccall(address(285), swb_status, (Ptr{swb_system}, Cdouble, Int64, Ptr{swb_settings}, Ptr{Ptr{swb_ocp}}), system,
        horizon, n_stages, settings, out)

"""
    swb_ocp_set_lagrange(ocp, f) -> swb_status

Set the cost rate, one output: its integral over the horizon is minimised. Expressions (swb_expr_function) may have abs, min and max in
them where these point down, as a sum of smooth terms and of maxima with positive factors does: their arguments may be
controls that are constant by stage, and parameters. A program has a variable in every stage for each.

@return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit; SWB_ERR_UNSUPPORTED for abs, min and max of what moves within a
        stage: make such a cost the derivative of a further state of the model, and its value at the end the terminal cost
"""
swb_ocp_set_lagrange(ocp, f) = ccall(address(286), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}), ocp, f)

"""
    swb_ocp_set_mayer(ocp, f) -> swb_status

Set the terminal cost, one output; its control is that of the last stage. It may have abs, min and max in it as the cost rate, of
states, too.

@return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit
"""
swb_ocp_set_mayer(ocp, f) = ccall(address(287), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}), ocp, f)

"""
    swb_ocp_add_path(ocp, f, lower, n_lower, upper, n_upper, at) -> swb_status

Add the constraint lower <= f(x,u,p,t) <= upper along the horizon.

@param[in] lower [n_lower] one for each output
@param[in] upper [n_upper] one for each output
@param[in] at    an enum swb_path_at
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a lower bound is above the upper one or NaN
"""
swb_ocp_add_path(ocp, f, lower, n_lower, upper, n_upper, at) =
    ccall(address(288), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Int32), ocp, f, lower, n_lower, upper, n_upper, at)

"""
    swb_ocp_add_terminal(ocp, f, lower, n_lower, upper, n_upper) -> swb_status

Add the constraint lower <= f(x,u,p,t) <= upper at the end of the horizon; its control is that of the
last stage.

@param[in] lower [n_lower] one for each output
@param[in] upper [n_upper] one for each output
@return as swb_ocp_add_path
"""
swb_ocp_add_terminal(ocp, f, lower, n_lower, upper, n_upper) =
    ccall(address(289), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64),
        ocp, f, lower, n_lower, upper, n_upper)

"""
    swb_ocp_set_state_bounds(ocp, lower, n_lower, upper, n_upper) -> swb_status

Set bounds of the states at all stage points and element ends after the initial time.

@param[in] lower [n_lower] nx
@param[in] upper [n_upper] nx
@return as swb_ocp_add_path
"""
swb_ocp_set_state_bounds(ocp, lower, n_lower, upper, n_upper) =
    ccall(address(290), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, lower, n_lower,
        upper, n_upper)

"""
    swb_ocp_set_initial_bounds(ocp, lower, n_lower, upper, n_upper) -> swb_status

Set bounds of the initial state; equal bounds fix it.

@param[in] lower [n_lower] nx
@param[in] upper [n_upper] nx
@return as swb_ocp_add_path
"""
swb_ocp_set_initial_bounds(ocp, lower, n_lower, upper, n_upper) =
    ccall(address(291), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, lower, n_lower,
        upper, n_upper)

"""
    swb_ocp_set_initial_state(ocp, x0, nx) -> swb_status

Fix the initial state.

@param[in] x0 [nx]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is NaN
"""
swb_ocp_set_initial_state(ocp, x0, nx) =
    ccall(address(292), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, x0, nx)

"""
    swb_ocp_set_control_bounds(ocp, lower, n_lower, upper, n_upper) -> swb_status

Set bounds of the controls.

@param[in] lower [n_lower] nu
@param[in] upper [n_upper] nu
@return as swb_ocp_add_path
"""
swb_ocp_set_control_bounds(ocp, lower, n_lower, upper, n_upper) =
    ccall(address(293), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, lower, n_lower,
        upper, n_upper)

"""
    swb_ocp_set_nominal(ocp, x, n_x, u, n_u, p, n_p) -> swb_status

Say how large quantities usually are, in their own units: the solver measures variables by that. What is not given it takes from
bounds, initial values, guesses and simulations; units then do not matter either, but a state that begins at zero and has no
bounds is better known to you.

@param[in] x [n_x] nx, positive; NaN where nothing is known; or NULL and 0
@param[in] u [n_u] nu, as x
@param[in] p [n_p] np, as x
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not positive and finite
"""
swb_ocp_set_nominal(ocp, x, n_x, u, n_u, p, n_p) =
    ccall(address(294), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64),
        ocp, x, n_x, u, n_u, p, n_p)

"""
    swb_ocp_set_params(ocp, p, np) -> swb_status

Set the parameters.

@param[in] p [np]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_ocp_set_params(ocp, p, np) = ccall(address(295), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, p, np)

"""
    swb_ocp_set_initial_time(ocp, t0) -> swb_status

Set the initial time.

@return SWB_OK; SWB_ERR_RANGE if it is not finite
"""
swb_ocp_set_initial_time(ocp, t0) = ccall(address(296), swb_status, (Ptr{swb_ocp}, Cdouble), ocp, t0)

"""
    swb_ocp_set_state_guess(ocp, times, n_times, x, n_x) -> swb_status

Give states to start from, linear in between.

@param[in] times [n_times] rising, from the start of the horizon
@param[in] x     [n_x] n_times * nx, the states of one time together
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if times do not rise or a value is not finite
"""
swb_ocp_set_state_guess(ocp, times, n_times, x, n_x) =
    ccall(address(297), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, times, n_times,
        x, n_x)

"""
    swb_ocp_set_control_guess(ocp, u, n_u) -> swb_status

Give controls to start from.

@param[in] u [n_u] n_stages * nu, the controls of one stage together
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_ocp_set_control_guess(ocp, u, n_u) =
    ccall(address(298), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, u, n_u)

"""
    swb_ocp_solve(ocp, outcome) -> swb_status

Solve. The problem is discretised at the first solve, and again only when its structure changed.

@param[out] outcome an enum swb_outcome; may be NULL
@return SWB_OK, however the solver ended; SWB_ERR_USER if a user function returned a negative code;
        SWB_ERR_NONFINITE if one has no value at the start; SWB_ERR_NUMERIC; SWB_ERR_RANGE,
        SWB_ERR_UNSUPPORTED if options do not go together
"""
swb_ocp_solve(ocp, outcome) = ccall(address(299), swb_status, (Ptr{swb_ocp}, Ptr{Int32}), ocp, outcome)

"""
    swb_ocp_get_outcome(ocp, outcome) -> swb_status

How the last solve ended.

@param[out] outcome an enum swb_outcome
@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_outcome(ocp, outcome) = ccall(address(300), swb_status, (Ptr{swb_ocp}, Ptr{Int32}), ocp, outcome)

"""
    swb_ocp_get_polished(ocp, polished) -> swb_status

Outcome of the polish, which identifies the active set and solves the problem with it.

@param[out] polished an enum swb_polished
@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_polished(ocp, polished) = ccall(address(301), swb_status, (Ptr{swb_ocp}, Ptr{Int32}), ocp, polished)

"""
    swb_ocp_get_cost(ocp, cost) -> swb_status

Cost of the solution, without terms that only guide the solver; NaN where there is none (unless the outcome is
SWB_OUTCOME_SOLVED, or SWB_OUTCOME_STOPPED after a round of an adaptation that was solved): what
another point costs says nothing about the problem (swb_ocp_get_cost_reached).

@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_cost(ocp, cost) = ccall(address(302), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}), ocp, cost)

"""
    swb_ocp_get_cost_reached(ocp, cost) -> swb_status

Cost of the point at which the last solve ended, however it ended. Unless the outcome is SWB_OUTCOME_SOLVED the point
need not satisfy dynamics and constraints, and its cost may lie on either side of that of a solution. NaN where the
solve was stopped before it was known.

@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_cost_reached(ocp, cost) = ccall(address(303), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}), ocp, cost)

"""
    swb_ocp_get_controls(ocp, u, n_u) -> swb_status

Controls.

@param[out] u [n_u] n_stages * nu, the controls of one stage together
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_controls(ocp, u, n_u) = ccall(address(304), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, u, n_u)

"""
    swb_ocp_get_sensitivity(ocp, cost, n_cost, u, n_u, one_sided) -> swb_status

Derivatives of the last solution with respect to its data: the initial state `[nx]`, then the parameters `[np]`. The
order of modes is held; the solution must be exact (SWB_POLISHED_DONE). A component of the initial state that is free is
no datum: its derivatives are zero. Where the order of modes cannot be held in either direction, the derivatives with
respect to that datum are NaN and one_sided is 1. One factorisation for all of them; parameters cost four evaluations of the model
each.

@param[out] cost      [n_cost] nx + np, derivatives of the cost; NULL with n_cost 0 if not wanted
@param[out] u         [n_u] (nx + np) * n_stages * nu, derivatives of the controls, those of one datum together; NULL
                      with n_u 0 if not wanted
@param[out] one_sided 1 if a bound is active without a multiplier: on the other side the derivatives are others; NULL
                      if not wanted
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution; SWB_ERR_NUMERIC if it is no isolated
        minimiser; SWB_ERR_USER, SWB_ERR_NONFINITE if the model fails next to the given parameters
"""
swb_ocp_get_sensitivity(ocp, cost, n_cost, u, n_u, one_sided) =
    ccall(address(305), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Int32}), ocp, cost,
        n_cost, u, n_u, one_sided)

"""
    swb_ocp_get_residuals(ocp, residuals, struct_size) -> swb_status

Residuals of the last solve.

@param[out] residuals   every field is written
@param[in]  struct_size sizeof(swb_residuals)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_residuals(ocp, residuals, struct_size) =
    ccall(address(306), swb_status, (Ptr{swb_ocp}, Ptr{swb_residuals}, UInt64), ocp, residuals, struct_size)

"""
    swb_ocp_get_stats(ocp, stats, struct_size) -> swb_status

Work and time of the last solve.

@param[out] stats       every field is written
@param[in]  struct_size sizeof(swb_stats)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_stats(ocp, stats, struct_size) =
    ccall(address(307), swb_status, (Ptr{swb_ocp}, Ptr{swb_stats}, UInt64), ocp, stats, struct_size)

"""
    swb_ocp_get_trajectory(ocp, out) -> swb_status

A copy of the trajectory of the last solve.

@param[out] out the new object, NULL on failure; free with swb_trajectory_free
@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_trajectory(ocp, out) = ccall(address(308), swb_status, (Ptr{swb_ocp}, Ptr{Ptr{swb_trajectory}}), ocp, out)

"""
    swb_ocp_set_int(ocp, name, value) -> swb_status

Set an integer or enumeration option of an optimal control problem (or a float one, to an integer) by name.

@return as swb_settings_set_int
"""
swb_ocp_set_int(ocp, name, value) = ccall(address(309), swb_status, (Ptr{swb_ocp}, Cstring, Int64), ocp, name, value)

"""
    swb_ocp_set_double(ocp, name, value) -> swb_status

Set a float option of an optimal control problem by name.

@return as swb_settings_set_double
"""
swb_ocp_set_double(ocp, name, value) =
    ccall(address(310), swb_status, (Ptr{swb_ocp}, Cstring, Cdouble), ocp, name, value)

"""
    swb_ocp_set_string(ocp, name, value) -> swb_status

Set any option of an optimal control problem by name from text: a number, or the value name of an enumeration.

@return as swb_settings_set_string
"""
swb_ocp_set_string(ocp, name, value) =
    ccall(address(311), swb_status, (Ptr{swb_ocp}, Cstring, Cstring), ocp, name, value)

"""
    swb_ocp_set_settings(ocp, settings) -> swb_status

Set all options of an optimal control problem.

@param[in] settings NULL for the defaults
@return SWB_OK; SWB_ERR_RANGE if an option is outside its range
"""
swb_ocp_set_settings(ocp, settings) = ccall(address(312), swb_status, (Ptr{swb_ocp}, Ptr{swb_settings}), ocp, settings)

"""
    swb_ocp_get_settings(ocp, settings, struct_size) -> swb_status

Options of an optimal control problem, all of them.

@param[out] settings    every field is written
@param[in]  struct_size sizeof(swb_settings)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_ocp_get_settings(ocp, settings, struct_size) =
    ccall(address(313), swb_status, (Ptr{swb_ocp}, Ptr{swb_settings}, UInt64), ocp, settings, struct_size)

"""
    swb_ocp_set_iteration(ocp, iteration, user_data) -> swb_status

Set who is called once per iteration; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_ocp_set_iteration(ocp, iteration, user_data) =
    ccall(address(314), swb_status, (Ptr{swb_ocp}, Ptr{Cvoid}, Ptr{Cvoid}), ocp, iteration, user_data)

"""
    swb_ocp_set_log(ocp, log, user_data) -> swb_status

Set who gets the log, as much as the option log_level says; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_ocp_set_log(ocp, log, user_data) =
    ccall(address(315), swb_status, (Ptr{swb_ocp}, Ptr{Cvoid}, Ptr{Cvoid}), ocp, log, user_data)

"""
    swb_ocp_interrupt(ocp) -> swb_status

Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
thread and from signal handlers; only swb_ocp_free must not run at the same time. It is heeded in every phase, before the
next evaluation of a model function and before the next factorisation: the call ends within the time of one of
these, a model function that takes long itself is waited for. What was found before stays the answer: an interrupt
during the comparison accuracy leaves the solution, with an accuracy that is NaN and a message. Where nothing was found
yet, while the problem is built or in swb_ocp_get_sensitivity, the call returns SWB_ERR_INTERRUPTED; max_time ends
calls in the same places.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_ocp_interrupt(ocp) = ccall(address(316), swb_status, (Ptr{swb_ocp},), ocp)

"""
    swb_ocp_free(ocp) -> Cvoid

Free; NULL is allowed.
"""
swb_ocp_free(ocp) = ccall(address(317), Cvoid, (Ptr{swb_ocp},), ocp)

"""
    swb_ocp_sizes(ocp, nx, nu, np, n_stages) -> swb_status

Sizes of an optimal control problem.

@param[out] nx       states; may be NULL
@param[out] nu       controls; may be NULL
@param[out] np       parameters; may be NULL
@param[out] n_stages control stages; may be NULL
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_ocp_sizes(ocp, nx, nu, np, n_stages) =
    ccall(address(318), swb_status, (Ptr{swb_ocp}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), ocp, nx, nu, np,
        n_stages)

"""
    swb_ocp_get_accuracy(ocp, accuracy, struct_size) -> swb_status

How far the last solution is from the system: its controls are simulated again, by other means and at the tolerance
accuracy_tol.

@param[out] accuracy    every field is written
@param[in]  struct_size sizeof(swb_accuracy)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve, and where the option accuracy is off
"""
swb_ocp_get_accuracy(ocp, accuracy, struct_size) =
    ccall(address(319), swb_status, (Ptr{swb_ocp}, Ptr{swb_accuracy}, UInt64), ocp, accuracy, struct_size)

"""
    swb_ocp_get_certificate(ocp, certificate, struct_size) -> swb_status

Knowledge of the last solution as a point of the discretised program: type of stationarity, B-stationarity; unknown
unless it is exact (SWB_POLISHED_DONE) and the option certify is on.

@param[out] certificate every field is written
@param[in]  struct_size sizeof(swb_certificate)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_certificate(ocp, certificate, struct_size) =
    ccall(address(320), swb_status, (Ptr{swb_ocp}, Ptr{swb_certificate}, UInt64), ocp, certificate, struct_size)

"""
    swb_ocp_get_mismatch(ocp, stages, n_stages) -> swb_status

Largest difference between a state of the last solution and of the simulation at the end of every control stage.

@param[out] stages [n_stages] one for each control stage
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_accuracy
"""
swb_ocp_get_mismatch(ocp, stages, n_stages) =
    ccall(address(321), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, stages, n_stages)

"""
    swb_ocp_get_message(ocp, buf, len, needed) -> swb_status

Why the last solve did not end with an exact solution, in the words of the model: which constraint cannot be met and by
how much, which function has no value where, which stage needs more elements. Of a solution, why the comparison accuracy
says nothing, or which state of the simulation is far off and what helps. Stages, elements, rows and states are
counted from zero. Empty where there is nothing to say. After a solve that returned an error it is there too.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_message(ocp, buf, len, needed) =
    ccall(address(322), swb_status, (Ptr{swb_ocp}, Ptr{UInt8}, Int64, Ptr{Int64}), ocp, buf, len, needed)

"""
    swb_ocp_count_multipliers(ocp, of, n) -> swb_status

Constraints of a kind that multipliers belong to; 1 for what is no list.

@param[in]  of enum swb_multipliers_of
@param[out] n  constraints, in the order in which they were added
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_NULL
"""
swb_ocp_count_multipliers(ocp, of, n) = ccall(address(323), swb_status, (Ptr{swb_ocp}, Int32, Ptr{Int64}), ocp, of, n)

"""
    swb_ocp_multiplier_sizes(ocp, of, index, n_times, width) -> swb_status

Sizes of the multipliers of the last solution.

@param[in]  of      enum swb_multipliers_of
@param[in]  index   which constraint, below swb_ocp_count_multipliers; does not count for what is no list
@param[out] n_times points of time
@param[out] width   numbers at each of them
@return SWB_OK; SWB_ERR_NULL; otherwise as swb_ocp_get_multipliers
"""
swb_ocp_multiplier_sizes(ocp, of, index, n_times, width) =
    ccall(address(324), swb_status, (Ptr{swb_ocp}, Int32, Int64, Ptr{Int64}, Ptr{Int64}), ocp, of, index, n_times,
        width)

"""
    swb_ocp_get_multipliers(ocp, of, index, times, n_times, values, n_values) -> swb_status

Multipliers of the last solution, which must be exact: polished, or of a problem without switches. Not known of several phases.

@param[in]  of     enum swb_multipliers_of
@param[in]  index  which constraint, in the order in which they were added; does not count for what is no list
@param[out] times  [n_times] the points of time; those at the start of the horizon for initial state and parameters
@param[out] values [n_values] n_times times the width, those of one point together
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution; SWB_ERR_USER, SWB_ERR_NONFINITE if
        the model fails
"""
swb_ocp_get_multipliers(ocp, of, index, times, n_times, values, n_values) =
    ccall(address(325), swb_status, (Ptr{swb_ocp}, Int32, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, of,
        index, times, n_times, values, n_values)

"""
    swb_verdict_name(verdict) -> Cstring

Name of an enum swb_verdict, such as \"kink\"; NULL for any other number. Static.
"""
swb_verdict_name(verdict) = ccall(address(326), Cstring, (Int32,), verdict)

"""
    swb_ocp_get_optimality(ocp, optimality, struct_size) -> swb_status

Verdict on the last solution as an optimum of the control problem. Derivatives of event-driven simulations of its controls and the
multipliers of its constraints decide, independently of the discretisation.

@param[out] optimality  every field is written
@param[in]  struct_size sizeof(swb_optimality)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve, and where the option accuracy is off
"""
swb_ocp_get_optimality(ocp, optimality, struct_size) =
    ccall(address(327), swb_status, (Ptr{swb_ocp}, Ptr{swb_optimality}, UInt64), ocp, optimality, struct_size)

"""
    swb_ocp_get_kink(ocp, index, kink, struct_size) -> swb_status

A switch of the last solution that lies between two control stages.

@param[in]  index       below n_kinks of swb_optimality
@param[out] kink        every field is written
@param[in]  struct_size sizeof(swb_kink)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_STATE as swb_ocp_get_optimality
"""
swb_ocp_get_kink(ocp, index, kink, struct_size) =
    ccall(address(328), swb_status, (Ptr{swb_ocp}, Int64, Ptr{swb_kink}, UInt64), ocp, index, kink, struct_size)

"""
    swb_ocp_get_reduced_gradient(ocp, gradient, n) -> swb_status

Derivatives of the cost with respect to the controls of the last solution, with the multipliers of its constraints; of
controls that are linear, with respect to their slopes. Those of controls at their bounds need not vanish. NaN where the
verdict is SWB_VERDICT_UNKNOWN for want of a simulation.

@param[out] gradient [n_stages * nu] the controls of the first stage first
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_optimality
"""
swb_ocp_get_reduced_gradient(ocp, gradient, n) =
    ccall(address(329), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, gradient, n)

"""
    swb_ocp_get_descent(ocp, direction, n) -> swb_status

Changes of the controls that lower the cost of the last solution to first order, where its verdict is
SWB_VERDICT_NOT_OPTIMAL: the largest of them is as large as that control usually is. All zero for any other verdict, and
where controls are linear.

@param[out] direction [n_stages * nu] the controls of the first stage first
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_optimality
"""
swb_ocp_get_descent(ocp, direction, n) =
    ccall(address(330), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, direction, n)

"""
    swb_ocp_get_optimality_reason(ocp, buf, len, needed) -> swb_status

Why it is not known whether the last solution is optimal; empty where it is.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE as swb_ocp_get_optimality
"""
swb_ocp_get_optimality_reason(ocp, buf, len, needed) =
    ccall(address(331), swb_status, (Ptr{swb_ocp}, Ptr{UInt8}, Int64, Ptr{Int64}), ocp, buf, len, needed)

"""
    swb_ocp_create_scene(scene, horizon, n_stages, settings, out) -> swb_status

Create an optimal control problem of a scene that is built; as swb_ocp_create with the system of the scene. Its states are
coordinates, then velocities, then what else it has; horizon, control grid and costs are in physical time.

@param[in]  scene    copied; may be freed afterwards
@param[in]  horizon  duration
@param[in]  n_stages control intervals of equal length
@param[in]  settings NULL for the defaults
@param[out] out      the new object, NULL on failure; free with swb_ocp_free
@return as swb_ocp_create; SWB_ERR_STATE if the scene is not built
"""
swb_ocp_create_scene(scene, horizon, n_stages, settings, out) =
    ccall(address(332), swb_status, (Ptr{swb_scene}, Cdouble, Int64, Ptr{swb_settings}, Ptr{Ptr{swb_ocp}}), scene,
        horizon, n_stages, settings, out)

"""
    swb_ocp_set_jumps(ocp, jumps) -> swb_status

Set how contact modes and impacts of a scene are found. Other systems do not look at it.

@param[in] jumps an enum swb_jumps
@return SWB_OK; SWB_ERR_RANGE
"""
swb_ocp_set_jumps(ocp, jumps) = ccall(address(333), swb_status, (Ptr{swb_ocp}, Int32), ocp, jumps)

"""
    swb_ocp_get_contacts(ocp, n_contacts, n_impacts) -> swb_status

Sizes of what the contacts of an answer do.

@param[out] n_contacts contacts of the scene, those that were left out not counted
@param[out] n_impacts  impacts, one for every contact with an impulse
@return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene
"""
swb_ocp_get_contacts(ocp, n_contacts, n_impacts) =
    ccall(address(334), swb_status, (Ptr{swb_ocp}, Ptr{Int64}, Ptr{Int64}), ocp, n_contacts, n_impacts)

"""
    swb_ocp_impacts(ocp, impacts, n, struct_size) -> swb_status

The impacts of an answer in the order they happen. Their depth is NaN: it is not computed.

@param[out] impacts     [n] n_impacts of swb_ocp_get_contacts
@param[in]  struct_size sizeof(swb_impact)
@return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_DIMENSION if n is another number
"""
swb_ocp_impacts(ocp, impacts, n, struct_size) =
    ccall(address(335), swb_status, (Ptr{swb_ocp}, Ptr{swb_impact}, Int64, UInt64), ocp, impacts, n, struct_size)

"""
    swb_ocp_contact_modes(ocp, t, n_t, modes, n) -> swb_status

Modes of the contacts of an answer at times.

@param[in]  t     [n_t] times within the horizon; at the time of an event the modes are those before it
@param[out] modes [n] n_t times n_contacts, enum swb_contact_mode, those of the first time first
@return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_RANGE for times outside;
        SWB_ERR_DIMENSION
"""
swb_ocp_contact_modes(ocp, t, n_t, modes, n) =
    ccall(address(336), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Int64}, Int64), ocp, t, n_t, modes, n)

"""
    swb_ocp_contact_forces(ocp, t, n_t, forces, n) -> swb_status

Forces of the contacts of an answer at times: forces, not impulses.

@param[in]  t      [n_t] times within the horizon
@param[out] forces [n] n_t times n_contacts times 3: the normal force and those along the tangents, zero where the contact
                   is open or has no tangents; the contacts of the first time first
@return as swb_ocp_contact_modes
"""
swb_ocp_contact_forces(ocp, t, n_t, forces, n) =
    ccall(address(337), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, t, n_t, forces,
        n)

"""
    swb_ocp_freezing_report(ocp, buf, len, needed) -> swb_status

Report on the contacts in numerical time when the search was by time-freezing: the strength a_n of the push or the stiffness k of
every contact, the recommended one, how long a jump takes, warnings.

@param[out] buf    [len] the text with its final NUL, empty for other searches; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_DIMENSION if the buffer is too short
"""
swb_ocp_freezing_report(ocp, buf, len, needed) =
    ccall(address(338), swb_status, (Ptr{swb_ocp}, Ptr{UInt8}, Int64, Ptr{Int64}), ocp, buf, len, needed)

"""
    swb_ocp_mode_sizes(ocp, n_phases, n_modes, n_cells) -> swb_status

Sizes of the mode sequence of the last solution: a phase for every finite element that has a length.

@param[out] n_phases phases
@param[out] n_modes  modes, over all subsystems; may be NULL
@param[out] n_cells  sign patterns the modes consist of; may be NULL
@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_mode_sizes(ocp, n_phases, n_modes, n_cells) =
    ccall(address(339), swb_status, (Ptr{swb_ocp}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), ocp, n_phases, n_modes,
        n_cells)

"""
    swb_ocp_get_modes(ocp, times, n_times, modes, n_modes, cells, n_cells) -> swb_status

Mode sequence of the last solution.

@param[out] times  [n_times] n_phases, when the phases start, from the start of the horizon
@param[out] modes  [n_modes] n_phases times the number of modes: 1 where the mode is active; several modes of a subsystem
                   are while it slides
@param[out] cells  [n_cells] the same for the sign patterns modes consist of; NULL if not wanted
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_modes(ocp, times, n_times, modes, n_modes, cells, n_cells) =
    ccall(address(340), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Int32}, Int64, Ptr{Int32}, Int64), ocp,
        times, n_times, modes, n_modes, cells, n_cells)

"""
    swb_ocp_set_modes(ocp, times, n_times, modes, n_modes, cells, n_cells) -> swb_status

Give the order of modes: the next solves start with it, from the guesses of states and controls, and follow the
homotopy only where it has no solution. Every phase of a control stage needs a finite element there, which a solve
checks. Orders next to it are tried within the budget of the option mode_search only. Where simulations alone follow the system, only
motions with this order count, and the times say nothing.

@param[in] times [n_times] when the phases start, from the start of the horizon: the first at 0, not falling; n_times = 0
                 forgets the order
@param[in] modes [n_modes] n_times times the number of modes: not 0 where the mode is active
@param[in] cells [n_cells] the same for the sign patterns modes consist of; none where the modes say all
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if the times fall or do not start at 0
"""
swb_ocp_set_modes(ocp, times, n_times, modes, n_modes, cells, n_cells) =
    ccall(address(341), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Int32}, Int64, Ptr{Int32}, Int64), ocp,
        times, n_times, modes, n_modes, cells, n_cells)

"""
    swb_ocp_get_mode_transitions(ocp, t, transition, stage, at_once, n) -> swb_status

Transitions of the last solution as a part of its mode sequence: see swb_ocp_set_mode_transitions.

@param[out] t          [n] swb_ocp_jump_count, times from the start of the horizon
@param[out] transition [n] which ones, in the order they were added to the system
@param[out] stage      [n] the control stages they are made in
@param[out] at_once    [n] 1 where the guard does not pass zero: it is beyond zero where its discrete state begins, or where the
                       control changes
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_mode_transitions(ocp, t, transition, stage, at_once, n) =
    ccall(address(342), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Ptr{Int64}, Ptr{Int64}, Ptr{Int32}, Int64), ocp, t,
        transition, stage, at_once, n)

"""
    swb_ocp_set_mode_transitions(ocp, t, transition, stage, at_once, n) -> swb_status

Give the transitions of the mode sequence, which swb_ocp_set_modes was given before: in the next solves only motions with these, in this order,
count. Without this call after swb_ocp_set_modes it is motions with none.

@param[in] t          [n] times from the start of the horizon; they say nothing, as swb_ocp_get_mode_transitions has them
@param[in] transition [n] which ones, in the order they were added to the system
@param[in] stage      [n] control stages, not falling; they say nothing else
@param[in] at_once    [n] not 0 where the guard is beyond zero without passing it; it says nothing
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE if no modes are given; SWB_ERR_RANGE for transitions or stages that do not exist, or
        stages that fall
"""
swb_ocp_set_mode_transitions(ocp, t, transition, stage, at_once, n) =
    ccall(address(343), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Ptr{Int64}, Ptr{Int64}, Ptr{Int32}, Int64), ocp, t,
        transition, stage, at_once, n)

"""
    swb_ocp_random_starts(ocp, seed, u, n_u) -> swb_status

Random controls to start from, the same for the same seed: first the guess a solve starts from, then random ones within
the bounds of the controls.

@param[out] u [n_u] n_stages * nu for every start
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_ocp_random_starts(ocp, seed, u, n_u) =
    ccall(address(344), swb_status, (Ptr{swb_ocp}, UInt64, Ptr{Cdouble}, Int64), ocp, seed, u, n_u)

"""
    swb_ocp_solve_starts(ocp, u, n_u, n_threads, best) -> swb_status

Solve from several guesses of the controls and keep the best solution, which is then the result of the problem. The
results are those of single solves to the last bit, whatever the number of threads. A start that fails does not keep
the others from being solved.

The iteration callback is called on the thread of the caller only, for the starts that are solved there, and stops all
starts; so does swb_ocp_interrupt.

@param[in]  u         [n_u] n_stages * nu for every start
@param[in]  n_threads threads at most, of which one is that of the caller; 0: one for each processor. With more than 1,
                      functions of the model are called by several threads at once; if one of them carries the flag
                      SWB_SERIAL, the thread of the caller does it all
@param[out] best      the start that was kept; may be NULL
@return SWB_OK, however the solves ended; SWB_ERR_DIMENSION; SWB_ERR_RANGE if n_threads is negative; that of the
        first start if all fail
"""
swb_ocp_solve_starts(ocp, u, n_u, n_threads, best) =
    ccall(address(345), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Int64, Ptr{Int64}), ocp, u, n_u, n_threads,
        best)

"""
    swb_ocp_get_start(ocp, start, outcome, polished, cost, u, n_u) -> swb_status

Results of the starts of the last swb_ocp_solve_starts.

@param[in]  start    from 0
@param[out] outcome  an enum swb_outcome; may be NULL
@param[out] polished an enum swb_polished; may be NULL
@param[out] cost     NaN unless the start was solved; may be NULL
@param[out] u        [n_u] n_stages * nu controls; NULL if not wanted
@return SWB_OK; SWB_ERR_DIMENSION if there is no such start; the status of the start if it failed, with its message
"""
swb_ocp_get_start(ocp, start, outcome, polished, cost, u, n_u) =
    ccall(address(346), swb_status, (Ptr{swb_ocp}, Int64, Ptr{Int32}, Ptr{Int32}, Ptr{Cdouble}, Ptr{Cdouble},
        Int64), ocp, start, outcome, polished, cost, u, n_u)

"""
    swb_ocp_get_adaptation(ocp, n_rounds, kept, reached) -> swb_status

How the grid of the last solve was adapted (option adapt_tol).

@param[out] n_rounds solves on the way, the first on the grid that was given
@param[out] kept     the one whose solution was kept; may be NULL
@param[out] reached  1 if its error is as small as asked for; may be NULL
@return SWB_OK; SWB_ERR_STATE before the first solve, and where the option adapt_tol is 0
"""
swb_ocp_get_adaptation(ocp, n_rounds, kept, reached) =
    ccall(address(347), swb_status, (Ptr{swb_ocp}, Ptr{Int64}, Ptr{Int64}, Ptr{Int32}), ocp, n_rounds, kept,
        reached)

"""
    swb_ocp_get_round(ocp, round, elements, n_elements, n_variables, iterations, error, cost) -> swb_status

One solve on the way to an adapted grid.

@param[in]  round       from 0
@param[out] elements    [n_elements] n_stages, the finite elements of every control stage; NULL if not wanted
@param[out] n_variables of the discretised problem; may be NULL
@param[out] iterations  may be NULL
@param[out] error       largest difference of a state from the simulation at the ends of the control stages, NaN where
                        the simulation got stuck; may be NULL
@param[out] cost        NaN unless the round was solved; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if there is no such round; SWB_ERR_STATE as swb_ocp_get_adaptation
"""
swb_ocp_get_round(ocp, round, elements, n_elements, n_variables, iterations, error, cost) =
    ccall(address(348), swb_status, (Ptr{swb_ocp}, Int64, Ptr{Int64}, Int64, Ptr{Int64}, Ptr{Int64}, Ptr{Cdouble},
        Ptr{Cdouble}), ocp, round, elements, n_elements, n_variables, iterations, error, cost)

"""
    swb_ocp_add_boundary(ocp, f, lower, n_lower, upper, n_upper) -> swb_status

Add the constraint lower <= f([x(0); x(T)], u, p, t) <= upper between both ends of the horizon: f has 2 nx states, and sees
control and time of the end.

@param[in] lower [n_lower] one for each output
@param[in] upper [n_upper] one for each output
@return as swb_ocp_add_path
"""
swb_ocp_add_boundary(ocp, f, lower, n_lower, upper, n_upper) =
    ccall(address(349), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64),
        ocp, f, lower, n_lower, upper, n_upper)

"""
    swb_ocp_add_periodic(ocp, states, n_states) -> swb_status

Require that states have the same values at both ends of the horizon.

@param[in] states [n_states] indices of states
@return SWB_OK; SWB_ERR_RANGE if there is no such state
"""
swb_ocp_add_periodic(ocp, states, n_states) =
    ccall(address(350), swb_status, (Ptr{swb_ocp}, Ptr{Int64}, Int64), ocp, states, n_states)

"""
    swb_ocp_add_least_squares(ocp, f, weights, n_weights, references, n_references, at) -> swb_status

Add (f - y)' W (f - y) to the cost, integrated, summed over the ends of the control stages, or at the end.

@param[in] weights    [n_weights] the diagonal of W, one for each output, or all of W
@param[in] references [n_references] y, or one y for every control stage
@param[in] at         an enum swb_cost_at
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
"""
swb_ocp_add_least_squares(ocp, f, weights, n_weights, references, n_references, at) =
    ccall(address(351), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Int32), ocp, f, weights, n_weights, references, n_references, at)

"""
    swb_ocp_set_references(ocp, term, references, n_references) -> swb_status

Change the references of a least-squares term.

@param[in] term       in the order they were added, from 0
@param[in] references [n_references] as swb_ocp_add_least_squares
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no such term
"""
swb_ocp_set_references(ocp, term, references, n_references) =
    ccall(address(352), swb_status, (Ptr{swb_ocp}, Int64, Ptr{Cdouble}, Int64), ocp, term, references, n_references)

"""
    swb_ocp_add_relaxed(ocp, f, lower, n_lower, upper, n_upper, at, norm, weight) -> swb_status

Add a constraint that may be violated at a price: weight times the norm of the violation. The cost that is reported is
without it; see swb_ocp_get_violation.

@param[in] lower [n_lower] one for each output
@param[in] upper [n_upper] one for each output
@param[in] at    an enum swb_path_at, or -1: at the end of the horizon
@param[in] norm  an enum swb_norm
@return as swb_ocp_add_path; SWB_ERR_RANGE if the weight is not positive
"""
swb_ocp_add_relaxed(ocp, f, lower, n_lower, upper, n_upper, at, norm, weight) =
    ccall(address(353), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64,
        Int32, Int32, Cdouble), ocp, f, lower, n_lower, upper, n_upper, at, norm, weight)

"""
    swb_ocp_add_complementarity(ocp, a, b, at) -> swb_status

Add 0 <= a(x,u,p,t) _|_ b(x,u,p,t) >= 0 along the horizon, component by component: both are not negative, and one of them
is zero. Pairs of controls alone belong to the control grid; elsewhere they would be said several times.

@param[in] a  n outputs
@param[in] b  as many
@param[in] at an enum swb_path_at; the starts of stages are left out
@return as swb_ocp_add_path
"""
swb_ocp_add_complementarity(ocp, a, b, at) =
    ccall(address(354), swb_status, (Ptr{swb_ocp}, Ptr{swb_function}, Ptr{swb_function}, Int32), ocp, a, b, at)

"""
    swb_ocp_set_elements(ocp, n_fe, n) -> swb_status

Set the number of finite elements of every control stage; without it all have as many as the option n_fe says.

@param[in] n_fe [n] one for every stage, at least 1
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
"""
swb_ocp_set_elements(ocp, n_fe, n) = ccall(address(355), swb_status, (Ptr{swb_ocp}, Ptr{Int64}, Int64), ocp, n_fe, n)

"""
    swb_ocp_set_durations(ocp, durations, n) -> swb_status

Set the lengths of the control stages; where they are free, those to start from.

@param[in] durations [n] one for every stage, positive
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
"""
swb_ocp_set_durations(ocp, durations, n) =
    ccall(address(356), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, durations, n)

"""
    swb_ocp_set_free_time(ocp, what, lower, upper) -> swb_status

Let the optimiser choose lengths.

@param[in] what  an enum swb_free_time
@param[in] lower of the horizon, or of a stage
@param[in] upper of the horizon, or of a stage
@return SWB_OK; SWB_ERR_RANGE
"""
swb_ocp_set_free_time(ocp, what, lower, upper) =
    ccall(address(357), swb_status, (Ptr{swb_ocp}, Int32, Cdouble, Cdouble), ocp, what, lower, upper)

"""
    swb_ocp_add_horizon(ocp, lower, upper) -> swb_status

Bound the length of the horizon where those of the stages are free; after swb_ocp_set_initial_time.

@return SWB_OK; SWB_ERR_RANGE
"""
swb_ocp_add_horizon(ocp, lower, upper) =
    ccall(address(358), swb_status, (Ptr{swb_ocp}, Cdouble, Cdouble), ocp, lower, upper)

"""
    swb_ocp_set_linear_controls(ocp, linear, nu) -> swb_status

Make controls continuous and linear on every stage; the others stay constant.

@param[in] linear [nu] 1 or 0 for every control
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_ocp_set_linear_controls(ocp, linear, nu) =
    ccall(address(359), swb_status, (Ptr{swb_ocp}, Ptr{Int32}, Int64), ocp, linear, nu)

"""
    swb_ocp_set_param_bounds(ocp, lower, n_lower, upper, n_upper) -> swb_status

Make parameters with a lower bound below the upper one variables, which start at the values of swb_ocp_set_params;
the others keep those values.

@param[in] lower [n_lower] np
@param[in] upper [n_upper] np
@return as swb_ocp_add_path
"""
swb_ocp_set_param_bounds(ocp, lower, n_lower, upper, n_upper) =
    ccall(address(360), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), ocp, lower, n_lower,
        upper, n_upper)

"""
    swb_ocp_set_stage_params(ocp, p, n_p) -> swb_status

Set parameters that change from control stage to control stage.

@param[in] p [n_p] n_stages * np, the parameters of one stage together
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
"""
swb_ocp_set_stage_params(ocp, p, n_p) =
    ccall(address(361), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, p, n_p)

"""
    swb_ocp_solve_warm(ocp, outcome) -> swb_status

Solve from the last solution: after small changes its active set is tried first.

@param[out] outcome as swb_ocp_solve
@return as swb_ocp_solve
"""
swb_ocp_solve_warm(ocp, outcome) = ccall(address(362), swb_status, (Ptr{swb_ocp}, Ptr{Int32}), ocp, outcome)

"""
    swb_ocp_shift(ocp) -> swb_status

Make the last solution, one control stage later, the guess of the next solve. swb_ocp_solve_warm then simulates it from the
initial state that is set by then, and starts from its modes and switching times.

@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_shift(ocp) = ccall(address(363), swb_status, (Ptr{swb_ocp},), ocp)

"""
    swb_ocp_get_durations(ocp, durations, n) -> swb_status

Lengths of the control stages of the last solution.

@param[out] durations [n] n_stages
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_durations(ocp, durations, n) =
    ccall(address(364), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, durations, n)

"""
    swb_ocp_get_params(ocp, p, n_p) -> swb_status

Parameters of the last solution, those that were free as they were found.

@param[out] p [n_p] np
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_params(ocp, p, n_p) = ccall(address(365), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, p, n_p)

"""
    swb_ocp_get_control_ends(ocp, u, n_u) -> swb_status

Controls at the end of every stage: others than at its start where they are linear.

@param[out] u [n_u] n_stages * nu, the controls of one stage together
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_control_ends(ocp, u, n_u) =
    ccall(address(366), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}, Int64), ocp, u, n_u)

"""
    swb_ocp_get_violation(ocp, violation) -> swb_status

Largest violation of a relaxed constraint.

@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_ocp_get_violation(ocp, violation) = ccall(address(367), swb_status, (Ptr{swb_ocp}, Ptr{Cdouble}), ocp, violation)

"""
    swb_ocp_jump_count(ocp, n_jumps) -> swb_status

Number of transitions of the last answer.

@param[out] n_jumps transitions; 0 for systems without
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE before the first solve
"""
swb_ocp_jump_count(ocp, n_jumps) = ccall(address(368), swb_status, (Ptr{swb_ocp}, Ptr{Int64}), ocp, n_jumps)

"""
    swb_ocp_jumps(ocp, jumps, n, struct_size) -> swb_status

The transitions of the last answer in the order of time.

@param[out] jumps       [n] swb_ocp_jump_count
@param[in]  struct_size sizeof(swb_ocp_jump)
@return SWB_OK; SWB_ERR_DIMENSION if n is another number; SWB_ERR_STATE before the first solve
"""
swb_ocp_jumps(ocp, jumps, n, struct_size) =
    ccall(address(369), swb_status, (Ptr{swb_ocp}, Ptr{swb_ocp_jump}, Int64, UInt64), ocp, jumps, n, struct_size)

"""
    swb_ocp_jump_states(ocp, index, before, after, n) -> swb_status

The states just before and just behind a transition of the last answer.

@param[in]  index  its place in swb_ocp_jumps, from 0
@param[out] before [n] nx
@param[out] after  [n] nx
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_ocp_jump_states(ocp, index, before, after, n) =
    ccall(address(370), swb_status, (Ptr{swb_ocp}, Int64, Ptr{Cdouble}, Ptr{Cdouble}, Int64), ocp, index, before,
        after, n)

"""
    swb_multiphase_create(phases, n_phases, settings, out) -> swb_status

Create a problem of phases, one after the other. The initial state of a phase is free unless its problem bounds it;
links tie it to the end of the phase before. A function of time sees the time from the start of the first phase on.

@param[in]  phases   [n_phases] copied as they are stated; may be freed afterwards
@param[in]  settings of the solver; NULL for those of the first phase
@param[out] out      the new object, NULL on failure; free with swb_multiphase_free
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION without phases; SWB_ERR_RANGE if an option is outside its range
"""
swb_multiphase_create(phases, n_phases, settings, out) =
    ccall(address(371), swb_status, (Ptr{Ptr{swb_ocp}}, Int64, Ptr{swb_settings}, Ptr{Ptr{swb_multiphase}}), phases,
        n_phases, settings, out)

"""
    swb_multiphase_link(m, phase, f, lower, n_lower, upper, n_upper) -> swb_status

Require lower <= f([x(T) of the phase; x(0) of the next]) <= upper: f has as many states as both phases together, no
controls and no parameters.

@param[in] phase the first of the two, counted from 0
@param[in] lower [n_lower] one for each output
@param[in] upper [n_upper] one for each output
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no phase behind, or a lower bound is above the upper one
"""
swb_multiphase_link(m, phase, f, lower, n_lower, upper, n_upper) =
    ccall(address(372), swb_status, (Ptr{swb_multiphase}, Int64, Ptr{swb_function}, Ptr{Cdouble}, Int64,
        Ptr{Cdouble}, Int64), m, phase, f, lower, n_lower, upper, n_upper)

"""
    swb_multiphase_link_continuous(m, phase) -> swb_status

Require that the next phase begins where this one ends, in all states.

@param[in] phase counted from 0
@return as swb_multiphase_link
"""
swb_multiphase_link_continuous(m, phase) = ccall(address(373), swb_status, (Ptr{swb_multiphase}, Int64), m, phase)

"""
    swb_multiphase_link_reset(m, phase, r) -> swb_status

Require that the next phase begins at r(x(T)): what a stage that drops off, a docking or a planned impact does to the states.

@param[in] phase counted from 0
@param[in] r     the states at the end of the phase as they are at the start of the next: as many states as the phase, no controls
                 and no parameters, one output for each state of the next phase
@return as swb_multiphase_link
"""
swb_multiphase_link_reset(m, phase, r) =
    ccall(address(374), swb_status, (Ptr{swb_multiphase}, Int64, Ptr{swb_function}), m, phase, r)

"""
    swb_multiphase_solve(m, outcome) -> swb_status

Solve.

@param[out] outcome an enum swb_outcome; may be NULL
@return as swb_ocp_solve
"""
swb_multiphase_solve(m, outcome) = ccall(address(375), swb_status, (Ptr{swb_multiphase}, Ptr{Int32}), m, outcome)

"""
    swb_multiphase_get_info(m, info, struct_size) -> swb_status

Result of the last solve.

@param[out] info        every field is written
@param[in]  struct_size sizeof(swb_multiphase_info)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_multiphase_get_info(m, info, struct_size) =
    ccall(address(376), swb_status, (Ptr{swb_multiphase}, Ptr{swb_multiphase_info}, UInt64), m, info, struct_size)

"""
    swb_multiphase_get_message(m, buf, len, needed) -> swb_status

Why the last solve did not end with an exact solution; empty where there is nothing to say.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
"""
swb_multiphase_get_message(m, buf, len, needed) =
    ccall(address(377), swb_status, (Ptr{swb_multiphase}, Ptr{UInt8}, Int64, Ptr{Int64}), m, buf, len, needed)

"""
    swb_multiphase_get_phase(m, phase, out) -> swb_status

A copy of a phase with its part of the last solution: swb_ocp_get_controls and its like read it. Its outcome, residuals
and statistics are those of all phases.

@param[in]  phase counted from 0
@param[out] out   the new object, NULL on failure; free with swb_ocp_free
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_STATE before the first solve
"""
swb_multiphase_get_phase(m, phase, out) =
    ccall(address(378), swb_status, (Ptr{swb_multiphase}, Int64, Ptr{Ptr{swb_ocp}}), m, phase, out)

"""
    swb_multiphase_set_iteration(m, iteration, user_data) -> swb_status

Set who is called once per iteration; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_multiphase_set_iteration(m, iteration, user_data) =
    ccall(address(379), swb_status, (Ptr{swb_multiphase}, Ptr{Cvoid}, Ptr{Cvoid}), m, iteration, user_data)

"""
    swb_multiphase_interrupt(m) -> swb_status

Stop the call that runs now, or the next one if none runs; see swb_ocp_interrupt.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_multiphase_interrupt(m) = ccall(address(380), swb_status, (Ptr{swb_multiphase},), m)

"""
    swb_multiphase_free(m) -> Cvoid

Free; NULL is allowed.
"""
swb_multiphase_free(m) = ccall(address(381), Cvoid, (Ptr{swb_multiphase},), m)

"""
    swb_model_to_json(model, buf, len, needed) -> swb_status

A model as a document in JSON, for bug reports and to pass it on: its expressions, names and trial point, its discrete
states with the values they begin with, and its transitions. Functions that are called are named.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if the buffer is
        too short
"""
swb_model_to_json(model, buf, len, needed) =
    ccall(address(382), swb_status, (Ptr{swb_model}, Ptr{UInt8}, Int64, Ptr{Int64}), model, buf, len, needed)

"""
    swb_model_from_json(graph, text, functions, n_functions, rhs, n_rhs, out) -> swb_status

Build a model from a document; its expressions become expressions of the graph.

@param[in]  graph     may hold other expressions, which stay
@param[in]  text      of swb_model_to_json
@param[in]  functions [n_functions] those that the document calls by name
@param[out] rhs       [n_rhs] the derivatives of the states; NULL with n_rhs 0 if not wanted
@param[out] out       the new object, NULL on failure; free with swb_model_free
@return SWB_OK; SWB_ERR_RANGE if the text is no such document, with the place; SWB_ERR_UNSUPPORTED for other versions;
        SWB_ERR_STATE if a function is missing; SWB_ERR_DIMENSION; else as swb_model_create
"""
swb_model_from_json(graph, text, functions, n_functions, rhs, n_rhs, out) =
    ccall(address(383), swb_status, (Ptr{swb_expr}, Cstring, Ptr{Ptr{swb_function}}, Int64, Ptr{Int64}, Int64,
        Ptr{Ptr{swb_model}}), graph, text, functions, n_functions, rhs, n_rhs, out)

"""
    swb_scene_to_json(scene, graph, buf, len, needed) -> swb_status

A scene, or a projected system, as a document in JSON: its sizes, names and expressions, contacts, friction, constraints, discrete states
and transitions. Functions that are called are named.

@param[in]  graph  the graph of its expressions
@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_STATE for another graph; SWB_ERR_UNSUPPORTED if two functions that are called have one name;
        SWB_ERR_DIMENSION if the buffer is too short
"""
swb_scene_to_json(scene, graph, buf, len, needed) =
    ccall(address(384), swb_status, (Ptr{swb_scene}, Ptr{swb_expr}, Ptr{UInt8}, Int64, Ptr{Int64}), scene, graph,
        buf, len, needed)

"""
    swb_scene_from_json(graph, text, functions, n_functions, roots, n_roots, out) -> swb_status

Create a scene, or a projected system, from a document; its expressions become expressions of the graph. It is not built yet.

@param[in]  graph     may hold other expressions, which stay
@param[in]  text      of swb_scene_to_json
@param[in]  functions [n_functions] those that the document calls by name
@param[out] roots     [n_roots] expressions: of every contact the gap, then the tangents, of friction what slides, of a constraint what is
                      zero; then of every transition the guard, and what its reset makes of states; NULL with n_roots 0 if not wanted
@param[out] out       the new object, NULL on failure; free with swb_scene_free
@return SWB_OK; SWB_ERR_RANGE if the text is no such document, with the place; SWB_ERR_UNSUPPORTED for other versions;
        SWB_ERR_STATE if a function is missing; SWB_ERR_DIMENSION; else as the functions that make a scene
"""
swb_scene_from_json(graph, text, functions, n_functions, roots, n_roots, out) =
    ccall(address(385), swb_status, (Ptr{swb_expr}, Cstring, Ptr{Ptr{swb_function}}, Int64, Ptr{Int64}, Int64,
        Ptr{Ptr{swb_scene}}), graph, text, functions, n_functions, roots, n_roots, out)

"""
    swb_model_sizes(model, nx, nu, np) -> swb_status

Numbers of states, controls and parameters of a model. Any output may be NULL.

@return SWB_OK
"""
swb_model_sizes(model, nx, nu, np) =
    ccall(address(386), swb_status, (Ptr{swb_model}, Ptr{Int64}, Ptr{Int64}, Ptr{Int64}), model, nx, nu, np)

"""
    swb_simulator_to_json(sim, duration, n_steps, buf, len, needed) -> swb_status

A simulation as a document in JSON: system, options, and time, state, controls and parameters where the simulator stands.
Functions that are not made of expressions are named only.

@param[in]  duration of the run that is to be repeated
@param[in]  n_steps  of that run
@param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed   length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_RANGE; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if
        the buffer is too short
"""
swb_simulator_to_json(sim, duration, n_steps, buf, len, needed) =
    ccall(address(387), swb_status, (Ptr{swb_simulator}, Cdouble, Int64, Ptr{UInt8}, Int64, Ptr{Int64}), sim,
        duration, n_steps, buf, len, needed)

"""
    swb_simulator_from_json(text, functions, n_functions, duration, n_steps, out) -> swb_status

Create a simulator from a document; it stands where the simulation begins.

@param[in]  text      of swb_simulator_to_json
@param[in]  functions [n_functions] those that the document names
@param[out] duration  of the run; may be NULL
@param[out] n_steps   of the run; may be NULL
@param[out] out       the new object, NULL on failure; free with swb_simulator_free
@return as swb_model_from_json
"""
swb_simulator_from_json(text, functions, n_functions, duration, n_steps, out) =
    ccall(address(388), swb_status, (Cstring, Ptr{Ptr{swb_function}}, Int64, Ptr{Cdouble}, Ptr{Int64},
        Ptr{Ptr{swb_simulator}}), text, functions, n_functions, duration, n_steps, out)

"""
    swb_ocp_to_json(ocp, buf, len, needed) -> swb_status

An optimal control problem as a document in JSON: system, costs, constraints, bounds, parameters, options, and what is
given to start from. Functions that are not made of expressions are named only.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if the buffer is
        too short
"""
swb_ocp_to_json(ocp, buf, len, needed) =
    ccall(address(389), swb_status, (Ptr{swb_ocp}, Ptr{UInt8}, Int64, Ptr{Int64}), ocp, buf, len, needed)

"""
    swb_ocp_from_json(text, functions, n_functions, out) -> swb_status

Create an optimal control problem from a document.

@param[in]  text      of swb_ocp_to_json
@param[in]  functions [n_functions] those that the document names
@param[out] out       the new object, NULL on failure; free with swb_ocp_free
@return as swb_model_from_json
"""
swb_ocp_from_json(text, functions, n_functions, out) =
    ccall(address(390), swb_status, (Cstring, Ptr{Ptr{swb_function}}, Int64, Ptr{Ptr{swb_ocp}}), text, functions,
        n_functions, out)

"""
    swb_mpcc_create(n, np, objective, constraints, settings, out) -> swb_status

Create a program without pairs and bounds, parameters and start zero.

@param[in]  n           variables, the block x of the functions
@param[in]  np          parameters, the block p of the functions
@param[in]  objective   one output
@param[in]  constraints the rows c; NULL if there are none
@param[in]  settings    NULL for the defaults
@param[out] out         the new object, NULL on failure; free with swb_mpcc_free
@return SWB_OK; SWB_ERR_DIMENSION if the sizes of a function are not (n, 0, np)
"""
swb_mpcc_create(n, np, objective, constraints, settings, out) =
    ccall(address(391), swb_status, (Int64, Int64, Ptr{swb_function}, Ptr{swb_function}, Ptr{swb_settings},
        Ptr{Ptr{swb_mpcc}}), n, np, objective, constraints, settings, out)

"""
    swb_mpcc_add_pair(mpcc, kind_g, index_g, kind_h, index_h) -> swb_status

Add the pair 0 <= G _|_ H >= 0.

A constraint may be in one pair only; a variable in several.

@param[in] kind_g  an enum swb_member: what G is
@param[in] index_g its index
@param[in] kind_h  an enum swb_member: what H is
@param[in] index_h its index
@return SWB_OK; SWB_ERR_RANGE if there is no such kind or a member cannot be used; SWB_ERR_DIMENSION if
        there is no such index
"""
swb_mpcc_add_pair(mpcc, kind_g, index_g, kind_h, index_h) =
    ccall(address(392), swb_status, (Ptr{swb_mpcc}, Int32, Int64, Int32, Int64), mpcc, kind_g, index_g, kind_h,
        index_h)

"""
    swb_mpcc_add_box(mpcc, variable, constraint) -> swb_status

Add the box lower <= w_i <= upper _|_ c_j: the constraint is not negative where the variable is at its lower bound, not positive
at its upper bound, and zero between them. The bounds are those of the variable (swb_mpcc_set_bounds) at the time of a solve;
infinite ones take no part. Where both are equal any value of the constraint will do. A mixed complementarity
problem (MCP) is a box for every variable with an objective that is zero; lower bounds zero and upper bounds infinite make a
nonlinear complementarity problem.

@param[in] variable   its index; it may be in several boxes and pairs
@param[in] constraint its index; its own bounds are not used, and it may be in one box or pair only
@return SWB_OK; SWB_ERR_RANGE if the constraint is in a pair or box; SWB_ERR_DIMENSION if there is no such index
"""
swb_mpcc_add_box(mpcc, variable, constraint) =
    ccall(address(393), swb_status, (Ptr{swb_mpcc}, Int64, Int64), mpcc, variable, constraint)

"""
    swb_mpcc_set_hessian(mpcc, col_ptr, n_col_ptr, row_idx, nnz, hessian, user_data) -> swb_status

Give second derivatives in one piece, in place of the Hessians of objective and constraints.

For functions described with swb_function_set_linear nothing else is prepared, although they are not linear.

@param[in] col_ptr   [n + 1] where the columns start; the last one is nnz
@param[in] row_idx   [nnz] rows from 0, increasing within each column, upper triangle (row <= column)
@param[in] hessian   NULL: back to the Hessians of the functions; the pattern is not read
@param[in] user_data passed on unchanged; must stay valid as long as the program has the callback
@return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION or SWB_ERR_RANGE if this is no such pattern
"""
swb_mpcc_set_hessian(mpcc, col_ptr, n_col_ptr, row_idx, nnz, hessian, user_data) =
    ccall(address(394), swb_status, (Ptr{swb_mpcc}, Ptr{Int64}, Int64, Ptr{Int64}, Int64, Ptr{Cvoid}, Ptr{Cvoid}),
        mpcc, col_ptr, n_col_ptr, row_idx, nnz, hessian, user_data)

"""
    swb_mpcc_set_bounds(mpcc, lower, n_lower, upper, n_upper) -> swb_status

Set bounds of the variables.

@param[in] lower [n_lower] n
@param[in] upper [n_upper] n
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a lower bound is above the upper one or NaN
"""
swb_mpcc_set_bounds(mpcc, lower, n_lower, upper, n_upper) =
    ccall(address(395), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), mpcc, lower, n_lower,
        upper, n_upper)

"""
    swb_mpcc_set_constraint_bounds(mpcc, lower, n_lower, upper, n_upper) -> swb_status

Set bounds of the constraints; equal bounds make an equation. Those of rows in pairs are not used.

@param[in] lower [n_lower] rows
@param[in] upper [n_upper] rows
@return as swb_mpcc_set_bounds
"""
swb_mpcc_set_constraint_bounds(mpcc, lower, n_lower, upper, n_upper) =
    ccall(address(396), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), mpcc, lower, n_lower,
        upper, n_upper)

"""
    swb_mpcc_set_params(mpcc, values, np) -> swb_status

Set the parameters.

@param[in] values [np]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_mpcc_set_params(mpcc, values, np) =
    ccall(address(397), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64), mpcc, values, np)

"""
    swb_mpcc_set_start(mpcc, w, n) -> swb_status

Set the point to start from.

@param[in] w [n]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_mpcc_set_start(mpcc, w, n) = ccall(address(398), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64), mpcc, w, n)

"""
    swb_mpcc_set_warm_start(mpcc, w, n, y, m, z, n_z) -> swb_status

Start the next solves from a point with multipliers, as a solution of a program nearby has them; swb_mpcc_set_start
goes back to starting from a point alone.

@param[in] w [n]
@param[in] y [m] multipliers of the constraints; NULL with m = 0 for none
@param[in] z [n_z] n multipliers of the bounds, both as swb_mpcc_get_multipliers has them; NULL with n_z = 0 for
                 none
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
"""
swb_mpcc_set_warm_start(mpcc, w, n, y, m, z, n_z) =
    ccall(address(399), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64),
        mpcc, w, n, y, m, z, n_z)

"""
    swb_mpcc_solve(mpcc, outcome) -> swb_status

Solve.

@param[out] outcome an enum swb_outcome; may be NULL
@return SWB_OK, however the solver ended; SWB_ERR_USER if a user function returned a negative code;
        SWB_ERR_NONFINITE if one has no value at the start; SWB_ERR_NUMERIC; SWB_ERR_RANGE,
        SWB_ERR_UNSUPPORTED if bounds and pairs do not go together
"""
swb_mpcc_solve(mpcc, outcome) = ccall(address(400), swb_status, (Ptr{swb_mpcc}, Ptr{Int32}), mpcc, outcome)

"""
    swb_mpcc_resolve(mpcc, outcome) -> swb_status

Solve from the last solution and its multipliers, as after a change of parameters or bounds. After a solve that
failed, diverged or ended infeasible this is swb_mpcc_solve.

@param[out] outcome an enum swb_outcome; may be NULL
@return as swb_mpcc_solve; SWB_ERR_STATE before the first solve
"""
swb_mpcc_resolve(mpcc, outcome) = ccall(address(401), swb_status, (Ptr{swb_mpcc}, Ptr{Int32}), mpcc, outcome)

"""
    swb_mpcc_get_outcome(mpcc, outcome) -> swb_status

How the last solve ended.

@param[out] outcome an enum swb_outcome
@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_outcome(mpcc, outcome) = ccall(address(402), swb_status, (Ptr{swb_mpcc}, Ptr{Int32}), mpcc, outcome)

"""
    swb_mpcc_get_polished(mpcc, polished) -> swb_status

Outcome of the polish, which identifies the active set and solves the smooth program that remains.

@param[out] polished an enum swb_polished
@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_polished(mpcc, polished) = ccall(address(403), swb_status, (Ptr{swb_mpcc}, Ptr{Int32}), mpcc, polished)

"""
    swb_mpcc_get_objective(mpcc, objective) -> swb_status

Objective.

@return SWB_OK; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_objective(mpcc, objective) =
    ccall(address(404), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}), mpcc, objective)

"""
    swb_mpcc_get_solution(mpcc, w, n) -> swb_status

The point.

@param[out] w [n]
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_solution(mpcc, w, n) = ccall(address(405), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64), mpcc, w, n)

"""
    swb_mpcc_get_constraints(mpcc, c, m) -> swb_status

Constraints at the point.

@param[out] c [m] rows; NaN where the solve failed
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_constraints(mpcc, c, m) = ccall(address(406), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64), mpcc, c, m)

"""
    swb_mpcc_get_multipliers(mpcc, y, m, z, n) -> swb_status

Multipliers: grad f + J' y - z = 0, with J the Jacobian of the constraints.

@param[out] y [m] of the constraints
@param[out] z [n] of the bounds, lower minus upper; for variables in pairs the multiplier of the pair, and
                  the sum of them for a variable in several
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_multipliers(mpcc, y, m, z, n) =
    ccall(address(407), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64), mpcc, y, m, z, n)

"""
    swb_mpcc_get_pairs(mpcc, g, h, nu, xi, n_pairs) -> swb_status

Values of the members of the pairs, and their multipliers (nu of G, xi of H) at the point, in the order
the pairs were added.

@param[out] g  [n_pairs] may be NULL
@param[out] h  [n_pairs] may be NULL
@param[out] nu [n_pairs] may be NULL
@param[out] xi [n_pairs] may be NULL
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_pairs(mpcc, g, h, nu, xi, n_pairs) =
    ccall(address(408), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Ptr{Cdouble}, Ptr{Cdouble}, Ptr{Cdouble}, Int64),
        mpcc, g, h, nu, xi, n_pairs)

"""
    swb_mpcc_get_residuals(mpcc, residuals, struct_size) -> swb_status

Residuals of the last solve.

@param[out] residuals   every field is written
@param[in]  struct_size sizeof(swb_residuals)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_residuals(mpcc, residuals, struct_size) =
    ccall(address(409), swb_status, (Ptr{swb_mpcc}, Ptr{swb_residuals}, UInt64), mpcc, residuals, struct_size)

"""
    swb_mpcc_get_stats(mpcc, stats, struct_size) -> swb_status

Work and time of the last solve.

@param[out] stats       every field is written
@param[in]  struct_size sizeof(swb_stats)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_stats(mpcc, stats, struct_size) =
    ccall(address(410), swb_status, (Ptr{swb_mpcc}, Ptr{swb_stats}, UInt64), mpcc, stats, struct_size)

"""
    swb_mpcc_set_int(mpcc, name, value) -> swb_status

Set an integer or enumeration option of a program (or a float one, to an integer) by name.

@return as swb_settings_set_int
"""
swb_mpcc_set_int(mpcc, name, value) =
    ccall(address(411), swb_status, (Ptr{swb_mpcc}, Cstring, Int64), mpcc, name, value)

"""
    swb_mpcc_set_double(mpcc, name, value) -> swb_status

Set a float option of a program by name.

@return as swb_settings_set_double
"""
swb_mpcc_set_double(mpcc, name, value) =
    ccall(address(412), swb_status, (Ptr{swb_mpcc}, Cstring, Cdouble), mpcc, name, value)

"""
    swb_mpcc_set_string(mpcc, name, value) -> swb_status

Set any option of a program by name from text: a number, or the value name of an enumeration.

@return as swb_settings_set_string
"""
swb_mpcc_set_string(mpcc, name, value) =
    ccall(address(413), swb_status, (Ptr{swb_mpcc}, Cstring, Cstring), mpcc, name, value)

"""
    swb_mpcc_set_settings(mpcc, settings) -> swb_status

Set all options of a program.

@param[in] settings NULL for the defaults
@return SWB_OK; SWB_ERR_RANGE if an option is outside its range
"""
swb_mpcc_set_settings(mpcc, settings) =
    ccall(address(414), swb_status, (Ptr{swb_mpcc}, Ptr{swb_settings}), mpcc, settings)

"""
    swb_mpcc_get_settings(mpcc, settings, struct_size) -> swb_status

Options of a program, all of them.

@param[out] settings    every field is written
@param[in]  struct_size sizeof(swb_settings)
@return SWB_OK; SWB_ERR_DIMENSION
"""
swb_mpcc_get_settings(mpcc, settings, struct_size) =
    ccall(address(415), swb_status, (Ptr{swb_mpcc}, Ptr{swb_settings}, UInt64), mpcc, settings, struct_size)

"""
    swb_mpcc_set_iteration(mpcc, iteration, user_data) -> swb_status

Set who is called once per iteration; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_mpcc_set_iteration(mpcc, iteration, user_data) =
    ccall(address(416), swb_status, (Ptr{swb_mpcc}, Ptr{Cvoid}, Ptr{Cvoid}), mpcc, iteration, user_data)

"""
    swb_mpcc_set_log(mpcc, log, user_data) -> swb_status

Set who gets the log, as much as the option log_level says; NULL for nobody.

@param[in] user_data passed on unchanged
@return SWB_OK
"""
swb_mpcc_set_log(mpcc, log, user_data) =
    ccall(address(417), swb_status, (Ptr{swb_mpcc}, Ptr{Cvoid}, Ptr{Cvoid}), mpcc, log, user_data)

"""
    swb_mpcc_interrupt(mpcc) -> swb_status

Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
thread and from signal handlers; only swb_mpcc_free must not run at the same time. It is heeded in every phase, before the
next evaluation of a model function and before the next factorisation: the call ends within the time of one of
these, a model function that takes long itself is waited for. What was found before stays the answer.

@return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
"""
swb_mpcc_interrupt(mpcc) = ccall(address(418), swb_status, (Ptr{swb_mpcc},), mpcc)

"""
    swb_mpcc_free(mpcc) -> Cvoid

Free; NULL is allowed.
"""
swb_mpcc_free(mpcc) = ccall(address(419), Cvoid, (Ptr{swb_mpcc},), mpcc)

"""
    swb_mpcc_get_tangents(mpcc, x, n_x, objective, n_objective, sides, n_sides) -> swb_status

Derivatives of the last solution with respect to all parameters, with the active bounds and sides of pairs as they are. The
solution must be exact (SWB_POLISHED_DONE, or solved if there are no pairs). Functions need derivatives by the parameters as well. One
factorisation, and a solve for every parameter; swb_mpcc_vjp is faster where one number depends on many parameters.

A derivative that is returned holds on the sides that are returned with it. Where it is not known it is NaN. Bounds and parameters
that were set since the solve are not used.

@param[out] x         [n_x] np * n, derivatives of the point, those by one parameter together; NULL with n_x 0 if not wanted
@param[out] objective [n_objective] np, derivatives of the objective; NULL with n_objective 0 if not wanted
@param[out] sides     [n_sides] np, an enum swb_sides each; NULL with n_sides 0 if not wanted
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution, or after pairs or options that are fixed when a program
        is made have changed; SWB_ERR_NUMERIC if the solution is no isolated minimiser, or if derivatives by the parameters are
        not those of the functions; SWB_ERR_NONFINITE if a function has no value next to the parameters; SWB_ERR_USER
"""
swb_mpcc_get_tangents(mpcc, x, n_x, objective, n_objective, sides, n_sides) =
    ccall(address(420), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64, Ptr{Cdouble}, Int64, Ptr{Int32}, Int64),
        mpcc, x, n_x, objective, n_objective, sides, n_sides)

"""
    swb_mpcc_vjp(mpcc, x, n_x, objective, p, n_p, sides, n_sides) -> swb_status

The derivative of the last solution with respect to its parameters from the left: the weights p of the parameters for weights x of
the point and objective of the objective, which are derivatives of a number that depends on both (a vector-Jacobian product).
Conditions are those of swb_mpcc_get_tangents. One solve with the factorised matrix for all parameters where the solution is
differentiable, and one for each where it is not.

@param[in]  x         [n_x] n, weights of the point; NULL with n_x 0 for zeros
@param[in]  objective weight of the objective
@param[out] p         [n_p] np; NaN where the derivative is not known
@param[out] sides     [n_sides] np, an enum swb_sides each; NULL with n_sides 0 if not wanted
@return as swb_mpcc_get_tangents; SWB_ERR_RANGE if a weight is not finite
"""
swb_mpcc_vjp(mpcc, x, n_x, objective, p, n_p, sides, n_sides) =
    ccall(address(421), swb_status, (Ptr{swb_mpcc}, Ptr{Cdouble}, Int64, Cdouble, Ptr{Cdouble}, Int64, Ptr{Int32},
        Int64), mpcc, x, n_x, objective, p, n_p, sides, n_sides)

"""
    swb_stationarity_name(stationarity) -> Cstring

Name of an enum swb_stationarity, such as \"M\"; NULL for any other number. Static.
"""
swb_stationarity_name(stationarity) = ccall(address(422), Cstring, (Int32,), stationarity)

"""
    swb_doubt_name(doubt) -> Cstring

Name of an enum swb_doubt, such as \"nodes\"; NULL for any other number. Static.
"""
swb_doubt_name(doubt) = ccall(address(423), Cstring, (Int32,), doubt)

"""
    swb_second_order_name(second_order) -> Cstring

Name of an enum swb_second_order, such as \"saddle\"; NULL for any other number. Static.
"""
swb_second_order_name(second_order) = ccall(address(424), Cstring, (Int32,), second_order)

"""
    swb_mpcc_set_name(mpcc, kind, index, name) -> swb_status

Name a variable, a constraint, a pair or a box: reports and messages of the log use it.

@param[in] kind  an enum swb_item
@param[in] index its number; pairs and boxes count in the order they were added
@param[in] name  copied; NULL or \"\" takes a name away
@return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if there is no such index
"""
swb_mpcc_set_name(mpcc, kind, index, name) =
    ccall(address(425), swb_status, (Ptr{swb_mpcc}, Int32, Int64, Cstring), mpcc, kind, index, name)

"""
    swb_mpcc_set_names(mpcc, kind, names, n) -> swb_status

Name all variables, constraints, pairs or boxes.

@param[in] kind  an enum swb_item
@param[in] names [n] copied; NULL or \"\" for no name
@param[in] n     number of variables, constraints, pairs or boxes
@return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if n is not their number
"""
swb_mpcc_set_names(mpcc, kind, names, n) =
    ccall(address(426), swb_status, (Ptr{swb_mpcc}, Int32, Ptr{Cstring}, Int64), mpcc, kind, names, n)

"""
    swb_mpcc_get_name(mpcc, kind, index, buf, len, needed) -> swb_status

Name of a variable, constraint or pair, such as \"T_out\"; \"variable 3\" without one.

@param[in]  kind   an enum swb_item
@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if there is no such index or the
        buffer is too short
"""
swb_mpcc_get_name(mpcc, kind, index, buf, len, needed) =
    ccall(address(427), swb_status, (Ptr{swb_mpcc}, Int32, Int64, Ptr{UInt8}, Int64, Ptr{Int64}), mpcc, kind, index,
        buf, len, needed)

"""
    swb_mpcc_get_worst(mpcc, kinds, indices, violations, k, found) -> swb_status

Violations at the point of the last solve, the worst first: bounds by how much they are exceeded, pairs by
min(G, H).

@param[out] kinds      [k] enum swb_item
@param[out] indices    [k]
@param[out] violations [k] positive
@param[in]  k          how many are wanted at most; 0 with NULL arrays to ask for their number
@param[out] found      how many there are, also beyond k; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_worst(mpcc, kinds, indices, violations, k, found) =
    ccall(address(428), swb_status, (Ptr{swb_mpcc}, Ptr{Int32}, Ptr{Int64}, Ptr{Cdouble}, Int64, Ptr{Int64}), mpcc,
        kinds, indices, violations, k, found)

"""
    swb_mpcc_get_conflict(mpcc, kinds, indices, weights, k, found, gap, residual) -> swb_status

Constraints, bounds and pairs that contradict each other, after the outcome SWB_OUTCOME_INFEASIBLE; the heaviest
first. Weights of constraints are positive where the upper bound takes part, negative where the lower one does;
those of variables the other way round.

The weighted sum of the constraints exceeds what their bounds allow by `gap`, and its gradient is held by the bounds
of the variables up to `residual`: with linear constraints a proof that there is no point, with others one to first
order.

@param[out] kinds    [k] enum swb_item
@param[out] indices  [k]
@param[out] weights  [k] the largest modulus of a constraint is 1
@param[in]  k        how many are wanted at most; 0 with NULL arrays to ask for their number
@param[out] found    how many there are, also beyond k; 0 without a conflict; may be NULL
@param[out] gap      may be NULL
@param[out] residual may be NULL
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_conflict(mpcc, kinds, indices, weights, k, found, gap, residual) =
    ccall(address(429), swb_status, (Ptr{swb_mpcc}, Ptr{Int32}, Ptr{Int64}, Ptr{Cdouble}, Int64, Ptr{Int64},
        Ptr{Cdouble}, Ptr{Cdouble}), mpcc, kinds, indices, weights, k, found, gap, residual)

"""
    swb_mpcc_get_certificate(mpcc, certificate, struct_size) -> swb_status

Knowledge of the point of the last solve: type of stationarity, B-stationarity.

@param[out] certificate every field is written
@param[in]  struct_size sizeof(swb_certificate)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_certificate(mpcc, certificate, struct_size) =
    ccall(address(430), swb_status, (Ptr{swb_mpcc}, Ptr{swb_certificate}, UInt64), mpcc, certificate, struct_size)

"""
    swb_mpcc_get_scaled_residuals(mpcc, residuals, struct_size) -> swb_status

Residuals of the last solve with objective and constraints scaled as the solver scaled them, which are those
that the option tol is compared with.

@param[out] residuals   every field is written
@param[in]  struct_size sizeof(swb_residuals)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_scaled_residuals(mpcc, residuals, struct_size) =
    ccall(address(431), swb_status, (Ptr{swb_mpcc}, Ptr{swb_residuals}, UInt64), mpcc, residuals, struct_size)

"""
    swb_mpcc_get_linear_stats(mpcc, stats, struct_size) -> swb_status

Sizes, pivots and work of the linear systems, since the program was built.

@param[out] stats       every field is written
@param[in]  struct_size sizeof(swb_linear_stats)
@return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
"""
swb_mpcc_get_linear_stats(mpcc, stats, struct_size) =
    ccall(address(432), swb_status, (Ptr{swb_mpcc}, Ptr{swb_linear_stats}, UInt64), mpcc, stats, struct_size)

"""
    swb_mpcc_statistics_json(mpcc, buf, len, needed) -> swb_status

Everything about the last solve but the point, as one JSON object: see docs/mpcc.md.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
"""
swb_mpcc_statistics_json(mpcc, buf, len, needed) =
    ccall(address(433), swb_status, (Ptr{swb_mpcc}, Ptr{UInt8}, Int64, Ptr{Int64}), mpcc, buf, len, needed)

"""
    swb_mpcc_report_text(mpcc, buf, len, needed) -> swb_status

Report on the last solve for people: a table with the worst violations and what looks wrong about the program.

@param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
@param[out] needed length with the final NUL; may be NULL
@return as swb_mpcc_statistics_json
"""
swb_mpcc_report_text(mpcc, buf, len, needed) =
    ccall(address(434), swb_status, (Ptr{swb_mpcc}, Ptr{UInt8}, Int64, Ptr{Int64}), mpcc, buf, len, needed)

end # module
