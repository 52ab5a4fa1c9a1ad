/* switchback: simulation and optimal control of systems that switch. C interface.
 *
 * Generated from crates/switchback-capi; do not edit. BSD-2-Clause, see LICENSE.
 *
 * Calls return a swb_status: SWB_OK, or a negative code that says why the call could not do its work;
 * swb_last_error() of the same thread has the message. On failure no output is written, except NULL to
 * the new object of a constructor and the needed length of a text.
 *
 * Arrays are followed by their length, given as [n] in the descriptions; NULL with length 0 is an empty
 * array. Inputs are copied. Matrices are compressed by columns with indices from 0, rows increasing;
 * dense matrices are stored by columns. Numbers of modulus 1e20 and more are infinite. Texts are UTF-8.
 *
 * An object for which a call that sets or adds something failed is incomplete: it refuses to run, with the
 * first error, until swb_error_handled says that the failure was dealt with.
 *
 * Objects are opaque and independent of each other. A const pointer to an object may be used by several
 * threads at once, any other by one; calling back into the same object from a callback is SWB_ERR_STATE.
 * A pointer to an object is a handle, of the size of a pointer, that is looked up in a table and never
 * read: a handle that has been freed (also if new objects were made since), one of another type and any
 * other pointer are SWB_ERR_STATE. Freeing NULL does nothing; freeing any of these, or an object that is
 * in use, does nothing either, and swb_last_error() says so.
 *
 * Where there is not enough memory a call is SWB_ERR_LIBRARY, or SWB_ERR_DIMENSION for sizes that cannot be meant; the
 * object can be used again, or says with SWB_ERR_STATE that it can only be freed. Large arrays are asked for so that they can
 * be refused, and estimated first; small requests that fail are served from a reserve of 8 MB until the call has ended. The
 * process is ended only where a single step of a call, between two places at which it looks, needs more than that reserve in
 * arrays that could not be foreseen. Memory of callbacks and of linked libraries is theirs. The option max_memory bounds
 * what a call takes.
 *
 * Callbacks return 0, a positive code if they are not defined at the point (the solver tries another
 * one), a negative code to stop. They must return: an exception of C++ or another language, pthread_exit
 * and the cancellation of the thread end the process where they reach the library, which cannot catch
 * them. A longjmp over the library leaves the object of the call, and those it uses, in use for ever:
 * they cannot even be freed, and what the call allocated is lost; other objects are not touched. Catch
 * inside of the callback and return a negative code (switchback.hpp does so, and throws again when the
 * call is back).
 *
 * A thread that calls the library needs stack: 200 kB were measured for solves, 180 kB for reading
 * documents, 130 kB for simulations by finite elements. Give it 512 kB, and what the callbacks need;
 * threads of the library have 2 MB. */


#ifndef SWITCHBACK_H
#define SWITCHBACK_H

#include <stdint.h>

/* Version of this header; see swb_check_version. */
#define SWB_VERSION_MAJOR 0
#define SWB_VERSION_MINOR 2
#define SWB_VERSION_PATCH 0
#define SWB_VERSION "0.2.0"

#ifndef SWB_API
#define SWB_API
#endif

/* Marks calls whose result must be looked at: those that make objects, and those that compute. */
#ifndef SWB_NODISCARD
#if defined(__cplusplus) && __cplusplus >= 201703L
#define SWB_NODISCARD [[nodiscard]]
#elif defined(__GNUC__) || defined(__clang__)
#define SWB_NODISCARD __attribute__((warn_unused_result))
#else
#define SWB_NODISCARD
#endif
#endif

/* A swb_casadi of the function f that CasADi generated, whose declarations are visible. */
#define SWB_CASADI(f)                                                                              \
    {sizeof(swb_casadi), (swb_code)(f), (swb_code)(f##_n_in), (swb_code)(f##_n_out),               \
     (swb_code)(f##_name_in), (swb_code)(f##_sparsity_in), (swb_code)(f##_sparsity_out),           \
     (swb_code)(f##_work), (swb_code)(f##_checkout), (swb_code)(f##_release),                      \
     (swb_code)(f##_incref), (swb_code)(f##_decref), 0, 0}


/**
 * Status of a call: 0 or a negative code that says why the call could not do its work.
 *
 * How an algorithm ended (solved, infeasible, out of iterations, ...) is not a status but an outcome.
 * Numbers are only ever added. -1 to -19: arguments; -20 to -29: user functions; -30 to -49: numerics;
 * -50 to -59: resources.
 *
 */
enum swb_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The call did its work.
     */
    SWB_OK = 0,
    /**
     * A required pointer is NULL.
     */
    SWB_ERR_NULL = -1,
    /**
     * A size or an index does not fit.
     */
    SWB_ERR_DIMENSION = -2,
    /**
     * A value is outside its range.
     */
    SWB_ERR_RANGE = -3,
    /**
     * The call does not fit the state of the object.
     */
    SWB_ERR_STATE = -4,
    /**
     * The combination is not supported.
     */
    SWB_ERR_UNSUPPORTED = -5,
    /**
     * Unknown option, or a value of the wrong type.
     */
    SWB_ERR_OPTION = -6,
    /**
     * A user function returned a negative code; see swb_last_user_code.
     */
    SWB_ERR_USER = -20,
    /**
     * A user function has no finite value where one is needed.
     */
    SWB_ERR_NONFINITE = -21,
    /**
     * Interrupted; the object can be used again.
     */
    SWB_ERR_INTERRUPTED = -23,
    /**
     * The numerical method cannot go on and there is no usable result.
     */
    SWB_ERR_NUMERIC = -30,
    /**
     * A foreign library failed, or a resource is missing.
     */
    SWB_ERR_LIBRARY = -50,
    /**
     * A defect of the library; the object can only be freed.
     */
    SWB_ERR_INTERNAL = -99,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_status swb_status;
#else
typedef int32_t swb_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Runge-Kutta family (option rk_family).
 */
enum swb_rk_family
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Radau IIA: stiffly accurate, order 2 n_s - 1.
     */
    SWB_RK_FAMILY_RADAU_IIA = 0,
    /**
     * Gauss-Legendre: order 2 n_s, no stage at the end of the element.
     */
    SWB_RK_FAMILY_GAUSS_LEGENDRE = 1,
    /**
     * Explicit methods, for modes that are not stiff.
     */
    SWB_RK_FAMILY_EXPLICIT = 2,
    /**
     * Radau IA: order 2 n_s - 1, a stage near the start instead of the end.
     */
    SWB_RK_FAMILY_RADAU_IA = 3,
    /**
     * Lobatto IIIA: order 2 n_s - 2, stages at both ends; not for sliding modes.
     */
    SWB_RK_FAMILY_LOBATTO_IIIA = 4,
    /**
     * Lobatto IIIB: order 2 n_s - 2; not for sliding modes.
     */
    SWB_RK_FAMILY_LOBATTO_IIIB = 5,
    /**
     * Lobatto IIIC: order 2 n_s - 2, stiffly accurate.
     */
    SWB_RK_FAMILY_LOBATTO_IIIC = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_rk_family swb_rk_family;
#else
typedef int64_t swb_rk_family;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Complementarity form of switching terms (option dcs_form).
 */
enum swb_dcs_form
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Chosen for each subsystem. Stewart's form, unless the Heaviside form has fewer pairs and no more variables, or controls alone decide some of its switching functions and not the others.
     */
    SWB_DCS_FORM_AUTO = 0,
    /**
     * One pair for each region.
     */
    SWB_DCS_FORM_STEWART = 1,
    /**
     * Two pairs for each switching function; subsystems given by indicators stay in Stewart's form.
     */
    SWB_DCS_FORM_HEAVISIDE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_dcs_form swb_dcs_form;
#else
typedef int64_t swb_dcs_form;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Treatment of switches by the discretisation (option discretisation).
 */
enum swb_discretisation
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Finite elements with switch detection: element boundaries move onto the switches.
     */
    SWB_DISCRETISATION_FESD = 0,
    /**
     * Fixed step sizes; switches lie inside the elements and the order drops to one.
     */
    SWB_DISCRETISATION_STANDARD = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_discretisation swb_discretisation;
#else
typedef int64_t swb_discretisation;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Unknowns at the stage points (option stage_form).
 */
enum swb_stage_form
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The library chooses.
     */
    SWB_STAGE_FORM_AUTO = 0,
    /**
     * States at the stage points (integral form).
     */
    SWB_STAGE_FORM_VALUES = 1,
    /**
     * State derivatives at the stage points (differential form).
     */
    SWB_STAGE_FORM_DERIVATIVES = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_stage_form swb_stage_form;
#else
typedef int64_t swb_stage_form;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Granularity of the cross complementarity (option cross).
 */
enum swb_cross
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * One pair for each finite element and component, between two sums over the stage points.
     */
    SWB_CROSS_ELEMENT = 0,
    /**
     * One pair for each stage point and component, against the sum over the element.
     */
    SWB_CROSS_STAGE = 1,
    /**
     * One pair for each pair of stage points and component.
     */
    SWB_CROSS_FULL = 2,
    /**
     * One pair for each point and component, between the multiplier there and the sum of the weights over the element.
     */
    SWB_CROSS_POINT = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_cross swb_cross;
#else
typedef int64_t swb_cross;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Step equilibration during the homotopy (option step_equilibration).
 */
enum swb_step_equilibration
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * No term: step sizes without a switch between them are not determined.
     */
    SWB_STEP_EQUILIBRATION_NONE = 0,
    /**
     * Penalty on the deviation from the mean step size.
     */
    SWB_STEP_EQUILIBRATION_MEAN = 1,
    /**
     * Penalty on the difference of neighbouring step sizes.
     */
    SWB_STEP_EQUILIBRATION_DIFFERENCE = 2,
    /**
     * Difference of neighbouring step sizes weighted by the switch indicator eta.
     */
    SWB_STEP_EQUILIBRATION_ETA_PRODUCT = 3,
    /**
     * Difference of neighbouring step sizes weighted by the square of the switch indicator eta.
     */
    SWB_STEP_EQUILIBRATION_ETA_SQUARED = 4,
    /**
     * Products of switch indicator and difference of step sizes equal to zero.
     */
    SWB_STEP_EQUILIBRATION_ETA_EQUATION = 5,
    /**
     * Difference of neighbouring step sizes weighted by the hyperbolic tangent of the switch indicator eta, whose size then counts only where it is small.
     */
    SWB_STEP_EQUILIBRATION_ETA_SATURATED = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_step_equilibration swb_step_equilibration;
#else
typedef int64_t swb_step_equilibration;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Polishing after the homotopy (option polish).
 */
enum swb_polish
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The interior point solution is final.
     */
    SWB_POLISH_OFF = 0,
    /**
     * Fix the active set and solve the smooth problem to polish_tol.
     */
    SWB_POLISH_ON = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_polish swb_polish;
#else
typedef int64_t swb_polish;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Initial guess of the discretised problem (option initial_guess).
 */
enum swb_initial_guess
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Initial value of the states at every node.
     */
    SWB_INITIAL_GUESS_CONSTANT = 0,
    /**
     * A simulation with the guessed controls.
     */
    SWB_INITIAL_GUESS_SIMULATION = 1,
    /**
     * A simulation of the system smoothed as at the start of the homotopy, with weights and multipliers that fit.
     */
    SWB_INITIAL_GUESS_SMOOTHED = 2,
    /**
     * The solution of the problem with fixed steps, early in its homotopy.
     */
    SWB_INITIAL_GUESS_TIME_STEPPING = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_initial_guess swb_initial_guess;
#else
typedef int64_t swb_initial_guess;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Search for the solution of an optimal control problem (option ocp_start).
 */
enum swb_ocp_start
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * All ways in one race: the guess, smoothed problems, descents on simulations from random controls, and the homotopy. Each has its share of the work, and what gains has more. The cheapest solution that a simulation confirms is kept.
     */
    SWB_OCP_START_PORTFOLIO = 0,
    /**
     * The homotopy from the guess alone.
     */
    SWB_OCP_START_HOMOTOPY = 1,
    /**
     * Smoothed problems and sequences next to their solutions; the homotopy only where they lead to no solution.
     */
    SWB_OCP_START_SMOOTHING = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_ocp_start swb_ocp_start;
#else
typedef int64_t swb_ocp_start;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Strategies for a program with complementarity constraints (option portfolio).
 */
enum swb_portfolio
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Only the homotopy that the other options describe.
     */
    SWB_PORTFOLIO_OFF = 0,
    /**
     * The homotopy, and where it ends without a solution other strategies, until one has a solution.
     */
    SWB_PORTFOLIO_RESCUE = 1,
    /**
     * All strategies; the best solution is kept.
     */
    SWB_PORTFOLIO_ALL = 2,
    /**
     * The strategies of rescue, then homotopies with heavier objectives until two have the same objective, then branches next to the best solution. The best solution is kept.
     */
    SWB_PORTFOLIO_AGREE = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_portfolio swb_portfolio;
#else
typedef int64_t swb_portfolio;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Factorisation of the Newton matrices (option linear_solver).
 */
enum swb_linear_solver
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Chosen by the fill of the factors: columns where they are sparse, dense blocks where they are not.
     */
    SWB_LINEAR_SOLVER_AUTO = 0,
    /**
     * SuiteSparse LDL, column by column; only in a library linked with it.
     */
    SWB_LINEAR_SOLVER_SUITESPARSE = 1,
    /**
     * Dense blocks of columns, by faer; only in a library built with it.
     */
    SWB_LINEAR_SOLVER_FAER = 2,
    /**
     * SuiteSparse's column-by-column algorithm, built into this library.
     */
    SWB_LINEAR_SOLVER_NATIVE = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_linear_solver swb_linear_solver;
#else
typedef int64_t swb_linear_solver;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Order of elimination in the Newton matrices (option ordering).
 */
enum swb_ordering
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Approximate minimum degree.
     */
    SWB_ORDERING_AMD = 0,
    /**
     * Variables as they are numbered (for a horizon: along time), every row behind its last variable.
     */
    SWB_ORDERING_NATURAL = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_ordering swb_ordering;
#else
typedef int64_t swb_ordering;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Inputs with respect to which a simulation is differentiated (option sensitivity).
 */
enum swb_sensitivity
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing.
     */
    SWB_SENSITIVITY_OFF = 0,
    /**
     * Initial states, parameters and controls.
     */
    SWB_SENSITIVITY_ON = 1,
    /**
     * Parameters and controls, without initial states.
     */
    SWB_SENSITIVITY_INPUTS = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_sensitivity swb_sensitivity;
#else
typedef int64_t swb_sensitivity;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * An ingredient of a method that can be left out.
 */
enum swb_toggle
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The ingredient is left out.
     */
    SWB_TOGGLE_OFF = 0,
    /**
     * The ingredient is used.
     */
    SWB_TOGGLE_ON = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_toggle swb_toggle;
#else
typedef int64_t swb_toggle;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Relaxation or penalty in the place of the complementarity constraints until the active set is identified (option relaxation).
 */
enum swb_relaxation
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Products at most sigma.
     */
    SWB_RELAXATION_SCHOLTES = 0,
    /**
     * Products equal to sigma.
     */
    SWB_RELAXATION_SCHOLTES_EQ = 1,
    /**
     * Sums of products at most sigma: one row per group, or one in all where pairs form no groups.
     */
    SWB_RELAXATION_SCHOLTES_LUMPED = 2,
    /**
     * Products at most sigma, and products of the members shifted by sqrt(sigma) at least sigma.
     */
    SWB_RELAXATION_LIN_FUKUSHIMA = 3,
    /**
     * Members at least -sqrt(sigma), products of the members less sqrt(sigma) not positive.
     */
    SWB_RELAXATION_KADRANI = 4,
    /**
     * The corner of the feasible set rounded by a sine.
     */
    SWB_RELAXATION_STEFFENSEN_ULBRICH = 5,
    /**
     * The corner of the feasible set rounded by a polynomial.
     */
    SWB_RELAXATION_STEFFENSEN_ULBRICH_POLY = 6,
    /**
     * One of the members at most sqrt(sigma).
     */
    SWB_RELAXATION_KANZOW_SCHWARTZ = 7,
    /**
     * Smoothed function of Fischer and Burmeister equal to zero.
     */
    SWB_RELAXATION_FISCHER_BURMEISTER = 8,
    /**
     * Smoothed minimum of the members equal to zero.
     */
    SWB_RELAXATION_NATURAL_RESIDUAL = 9,
    /**
     * Smoothed function of Chen, Chen and Kanzow equal to zero.
     */
    SWB_RELAXATION_CHEN_CHEN_KANZOW = 10,
    /**
     * Bounds and products relaxed pair by pair, tightened by the signs of the multipliers.
     */
    SWB_RELAXATION_TWO_SIDED = 11,
    /**
     * Products at most the barrier parameter.
     */
    SWB_RELAXATION_RAGHUNATHAN_BIEGLER = 12,
    /**
     * Sum of the products in the objective.
     */
    SWB_RELAXATION_L1_PENALTY = 13,
    /**
     * Largest product in the objective.
     */
    SWB_RELAXATION_LINF_PENALTY = 14,
    /**
     * Products at most an elastic variable each, whose sum is in the objective.
     */
    SWB_RELAXATION_L1_ELASTIC = 15,
    /**
     * Products in the objective, ordinary rows relaxed by one elastic variable.
     */
    SWB_RELAXATION_ELASTIC = 16,
    /**
     * Products at most zero.
     */
    SWB_RELAXATION_DIRECT = 17,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_relaxation swb_relaxation;
#else
typedef int64_t swb_relaxation;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Changes of relaxation or penalty and barrier parameter (option homotopy).
 */
enum swb_homotopy
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Relaxation and barrier parameter fall together, and every problem is solved loosely.
     */
    SWB_HOMOTOPY_COUPLED = 0,
    /**
     * Every problem is solved to the tolerance, from a larger barrier parameter again.
     */
    SWB_HOMOTOPY_OUTER = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_homotopy swb_homotopy;
#else
typedef int64_t swb_homotopy;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Integration method of the modes in event-driven simulation (option integration).
 */
enum swb_integration
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * An explicit pair chosen by the tolerance, that of order 5 where switches cut one step after the other short; Radau IIA in modes that turn out to be stiff.
     */
    SWB_INTEGRATION_AUTO = 0,
    /**
     * Dormand and Prince 5(4).
     */
    SWB_INTEGRATION_DP5 = 1,
    /**
     * Dormand and Prince 8(5,3).
     */
    SWB_INTEGRATION_DOP853 = 2,
    /**
     * Radau IIA of order 5.
     */
    SWB_INTEGRATION_RADAU5 = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_integration swb_integration;
#else
typedef int64_t swb_integration;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Continuation of an event-driven simulation where switches accumulate (option zeno).
 */
enum swb_zeno_policy
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Go on in the sliding mode on the surfaces where the switches accumulate, also in one of order two, whose indicators have no rate either. Without such a mode go on by steps with a stated error. Derivatives are NaN behind a mode of order two.
     */
    SWB_ZENO_POLICY_CONTINUE = 0,
    /**
     * End the run with the outcome zeno.
     */
    SWB_ZENO_POLICY_STOP = 1,
    /**
     * Pass the accumulation by steps of a method that needs no switches, which also finds a sliding mode that begins there. Slower and less accurate than continue. Derivatives are NaN behind it.
     */
    SWB_ZENO_POLICY_TIME_STEPPING = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_zeno_policy swb_zeno_policy;
#else
typedef int64_t swb_zeno_policy;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Continuation of an event-driven simulation where it is not unique (option ambiguity).
 */
enum swb_ambiguity_policy
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Keep the present active set if it may continue, else take the fewest active cells, else the lowest indices.
     */
    SWB_AMBIGUITY_POLICY_FIRST = 0,
    /**
     * End the run with the outcome ambiguous.
     */
    SWB_AMBIGUITY_POLICY_STOP = 1,
    /**
     * Take the continuation whose active modes come first in the list of preferred modes; among equals as first.
     */
    SWB_AMBIGUITY_POLICY_PREFER = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_ambiguity_policy swb_ambiguity_policy;
#else
typedef int64_t swb_ambiguity_policy;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Velocity of a sliding mode where surfaces meet and their effects multiply (option selection).
 */
enum swb_selection
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Every surface has a weight, and weights of modes are their products, as independent smoothings of the surfaces lead to.
     */
    SWB_SELECTION_BILINEAR = 0,
    /**
     * Moments method for two surfaces: modes are balanced by the norms of their rates. Where more surfaces meet the simulation stops.
     */
    SWB_SELECTION_MOMENTS = 1,
    /**
     * Weights of the least Euclidean norm, as long as none of them vanishes.
     */
    SWB_SELECTION_NORM = 2,
    /**
     * Fewest active cells that keep the surfaces: an extreme velocity.
     */
    SWB_SELECTION_FEWEST = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_selection swb_selection;
#else
typedef int64_t swb_selection;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Verbosity of the log sink; each level contains the ones before it (option log_level).
 */
enum swb_log_level
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing.
     */
    SWB_LOG_LEVEL_SILENT = 0,
    /**
     * Failures.
     */
    SWB_LOG_LEVEL_ERROR = 1,
    /**
     * Results that need attention.
     */
    SWB_LOG_LEVEL_WARNING = 2,
    /**
     * One summary per solve.
     */
    SWB_LOG_LEVEL_INFO = 3,
    /**
     * One line per iteration.
     */
    SWB_LOG_LEVEL_DEBUG = 4,
    /**
     * Inner steps: line search, factorisations, active-set changes.
     */
    SWB_LOG_LEVEL_TRACE = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_log_level swb_log_level;
#else
typedef int64_t swb_log_level;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Kind of an option.
 */
enum swb_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Integer.
     */
    SWB_KIND_INT = 0,
    /**
     * Floating-point number.
     */
    SWB_KIND_FLOAT = 1,
    /**
     * Integer with value names; see swb_option_value_name.
     */
    SWB_KIND_ENUM = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_kind swb_kind;
#else
typedef int32_t swb_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How a solve ended. Numbers are only ever added.
 */
enum swb_outcome
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * All residuals are below the tolerance.
     */
    SWB_OUTCOME_SOLVED = 0,
    /**
     * Out of iterations; the point is the last iterate.
     */
    SWB_OUTCOME_MAX_ITER = 1,
    /**
     * Out of time; the point is the last iterate.
     */
    SWB_OUTCOME_MAX_TIME = 2,
    /**
     * A callback or an interrupt asked to stop; the point is the last iterate.
     */
    SWB_OUTCOME_STOPPED = 3,
    /**
     * There is no point: all branches show it, or the linear rows of a program without pairs, or a point minimises the violation of the constraints.
     */
    SWB_OUTCOME_INFEASIBLE = 4,
    /**
     * No progress is possible although the tolerance is not reached.
     */
    SWB_OUTCOME_STALLED = 5,
    /**
     * The iterates diverge.
     */
    SWB_OUTCOME_DIVERGING = 6,
    /**
     * There is no usable point; the call returned an error that says why.
     */
    SWB_OUTCOME_FAILED = 7,
    /**
     * Only for an optimal control problem: its discretised problem is solved, but simulations of the controls, single stages included, are
     * another motion.
     */
    SWB_OUTCOME_NOT_FOLLOWED = 8,
    /**
     * Converged to a point that minimises the violation of the constraints locally; whether there is a point elsewhere is not known.
     */
    SWB_OUTCOME_LOCALLY_INFEASIBLE = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_outcome swb_outcome;
#else
typedef int32_t swb_outcome;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Outcomes of the polish, which identifies the active set and solves the smooth problem that remains.
 */
enum swb_polished
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Not asked for, or not reached.
     */
    SWB_POLISHED_NONE = 0,
    /**
     * Yes: the pairs are exactly complementary.
     */
    SWB_POLISHED_DONE = 1,
    /**
     * The identified branch has no solution; the point is that of the relaxation.
     */
    SWB_POLISHED_REJECTED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_polished swb_polished;
#else
typedef int32_t swb_polished;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Input blocks of a function, to be added up.
 */
enum swb_input
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * States, or variables.
     */
    SWB_INPUT_X = 1,
    /**
     * Controls.
     */
    SWB_INPUT_U = 2,
    /**
     * Parameters.
     */
    SWB_INPUT_P = 4,
    /**
     * Time.
     */
    SWB_INPUT_T = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_input swb_input;
#else
typedef int32_t swb_input;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Properties of a function, to be added up; see swb_function_set_flags.
 *
 */
enum swb_function_flag
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The callbacks are called by the thread that calls the library only, and one at a time: calls that would work on
     * several threads use one. For functions in languages whose run time does not know the threads of the library, and
     * for functions that keep something between calls.
     */
    SWB_SERIAL = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_function_flag swb_function_flag;
#else
typedef int32_t swb_function_flag;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Kinds of switches.
 */
enum swb_switch_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Modes leave the active set and others enter it.
     */
    SWB_SWITCH_KIND_CROSS = 0,
    /**
     * Modes enter: a sliding mode begins, or gets another mode.
     */
    SWB_SWITCH_KIND_ENTER = 1,
    /**
     * Modes leave: a sliding mode ends, or loses a mode.
     */
    SWB_SWITCH_KIND_LEAVE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_switch_kind swb_switch_kind;
#else
typedef int32_t swb_switch_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Places at which a path constraint holds.
 */
enum swb_path_at
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * At both ends of every control stage, with the control of that stage.
     */
    SWB_PATH_AT_CONTROL_GRID = 0,
    /**
     * At the start of every control stage and the end of every finite element.
     */
    SWB_PATH_AT_ELEMENTS = 1,
    /**
     * At the start of every control stage and at every stage point.
     */
    SWB_PATH_AT_STAGE_POINTS = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_path_at swb_path_at;
#else
typedef int32_t swb_path_at;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Freedom of the optimiser in the lengths of the control stages.
 */
enum swb_free_time
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing.
     */
    SWB_FREE_TIME_NONE = 0,
    /**
     * The horizon; the stages keep their shares of it.
     */
    SWB_FREE_TIME_HORIZON = 1,
    /**
     * Every stage.
     */
    SWB_FREE_TIME_STAGES = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_free_time swb_free_time;
#else
typedef int32_t swb_free_time;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Places at which a least-squares term counts.
 */
enum swb_cost_at
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Integrated along the horizon.
     */
    SWB_COST_AT_RUNNING = 0,
    /**
     * Summed over the ends of the control stages.
     */
    SWB_COST_AT_CONTROL_GRID = 1,
    /**
     * At the end of the horizon.
     */
    SWB_COST_AT_TERMINAL = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_cost_at swb_cost_at;
#else
typedef int32_t swb_cost_at;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How the violation of a relaxed constraint is penalised.
 */
enum swb_norm
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Sum of the violations, integrated along the horizon.
     */
    SWB_NORM_L1 = 0,
    /**
     * Sum of their squares, integrated along the horizon.
     */
    SWB_NORM_L2 = 1,
    /**
     * The largest violation.
     */
    SWB_NORM_LINF = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_norm swb_norm;
#else
typedef int32_t swb_norm;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Operators of expressions. Operands are called a, b and c; conditions are operands of Not, And, Or, and the first
 * of Where.
 */
enum swb_operator
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * -a
     */
    SWB_OPERATOR_NEG = 0,
    /**
     * Square root.
     */
    SWB_OPERATOR_SQRT = 1,
    /**
     * Exponential.
     */
    SWB_OPERATOR_EXP = 2,
    /**
     * Natural logarithm.
     */
    SWB_OPERATOR_LOG = 3,
    /**
     * Sine.
     */
    SWB_OPERATOR_SIN = 4,
    /**
     * Cosine.
     */
    SWB_OPERATOR_COS = 5,
    /**
     * Tangent.
     */
    SWB_OPERATOR_TAN = 6,
    /**
     * Inverse sine.
     */
    SWB_OPERATOR_ASIN = 7,
    /**
     * Inverse cosine.
     */
    SWB_OPERATOR_ACOS = 8,
    /**
     * Inverse tangent.
     */
    SWB_OPERATOR_ATAN = 9,
    /**
     * Hyperbolic sine.
     */
    SWB_OPERATOR_SINH = 10,
    /**
     * Hyperbolic cosine.
     */
    SWB_OPERATOR_COSH = 11,
    /**
     * Hyperbolic tangent.
     */
    SWB_OPERATOR_TANH = 12,
    /**
     * Error function.
     */
    SWB_OPERATOR_ERF = 13,
    /**
     * The largest whole number that is not larger: in resets of transitions, and nowhere else.
     */
    SWB_OPERATOR_FLOOR = 14,
    /**
     * a + b
     */
    SWB_OPERATOR_ADD = 20,
    /**
     * a - b
     */
    SWB_OPERATOR_SUB = 21,
    /**
     * a b
     */
    SWB_OPERATOR_MUL = 22,
    /**
     * a / b
     */
    SWB_OPERATOR_DIV = 23,
    /**
     * a to the power of b; for a constant integer b any a is allowed.
     */
    SWB_OPERATOR_POW = 24,
    /**
     * Angle of the point (b, a).
     */
    SWB_OPERATOR_ATAN2 = 25,
    /**
     * Condition a > 0; the same as a >= 0, the solution is Filippov's.
     */
    SWB_OPERATOR_POSITIVE = 40,
    /**
     * Condition: not a.
     */
    SWB_OPERATOR_NOT = 41,
    /**
     * Condition: a and b.
     */
    SWB_OPERATOR_AND = 42,
    /**
     * Condition: a or b.
     */
    SWB_OPERATOR_OR = 43,
    /**
     * b where the condition a holds, else c.
     */
    SWB_OPERATOR_WHERE = 44,
    /**
     * Sign of a. This one and those below switch: they are for the derivatives of models only.
     */
    SWB_OPERATOR_SIGN = 45,
    /**
     * Modulus of a.
     */
    SWB_OPERATOR_ABS = 46,
    /**
     * The smaller of a and b.
     */
    SWB_OPERATOR_MIN = 47,
    /**
     * The larger of a and b.
     */
    SWB_OPERATOR_MAX = 48,
    /**
     * a limited to the interval from b to c.
     */
    SWB_OPERATOR_CLIP = 49,
    /**
     * b where a > 0, else c.
     */
    SWB_OPERATOR_RELAY = 50,
    /**
     * Distance of a from the interval from -b to b, with sign.
     */
    SWB_OPERATOR_DEAD_ZONE = 51,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_operator swb_operator;
#else
typedef int32_t swb_operator;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Kinds of tables.
 */
enum swb_table
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Constant pieces between breaks, one value more than breaks; jumps without switching functions: for functions of
     * time with breaks on the grid.
     */
    SWB_TABLE_STEPS = 0,
    /**
     * Straight lines through points, constant outside.
     */
    SWB_TABLE_LINES = 1,
    /**
     * Cubic spline through points with two continuous derivatives.
     */
    SWB_TABLE_SPLINE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_table swb_table;
#else
typedef int32_t swb_table;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How an event-driven simulation stands. Numbers are only ever added.
 */
enum swb_run_outcome
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The time asked for is reached.
     */
    SWB_RUN_OUTCOME_REACHED = 0,
    /**
     * More steps than the option max_steps allows.
     */
    SWB_RUN_OUTCOME_MAX_STEPS = 1,
    /**
     * The step became too short: a solution that grows without bound, a function that is not defined, tolerances
     * below rounding.
     */
    SWB_RUN_OUTCOME_STEP_TOO_SMALL = 2,
    /**
     * Switches accumulate, and there is no sliding mode beyond, or the option zeno says stop.
     */
    SWB_RUN_OUTCOME_ZENO = 3,
    /**
     * The continuation is not unique and the option ambiguity says stop.
     */
    SWB_RUN_OUTCOME_AMBIGUOUS = 4,
    /**
     * No active set continues the solution.
     */
    SWB_RUN_OUTCOME_NO_CONTINUATION = 5,
    /**
     * A transition of the effect SWB_EFFECT_STOP happened: the run has ended where it was to.
     */
    SWB_RUN_OUTCOME_EVENT = 6,
    /**
     * A callback or an interrupt asked to stop; the next call goes on.
     */
    SWB_RUN_OUTCOME_STOPPED = 100,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_run_outcome swb_run_outcome;
#else
typedef int32_t swb_run_outcome;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Kinds of switches of an event-driven simulation.
 */
enum swb_event_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Modes leave the active set and others enter it.
     */
    SWB_EVENT_KIND_CROSS = 0,
    /**
     * Modes enter: a sliding mode begins, or gets another mode.
     */
    SWB_EVENT_KIND_ENTER = 1,
    /**
     * Modes leave: a sliding mode ends, or loses a mode.
     */
    SWB_EVENT_KIND_LEAVE = 2,
    /**
     * Modes leave although they could stay: the solution is not unique.
     */
    SWB_EVENT_KIND_SPONTANEOUS = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_event_kind swb_event_kind;
#else
typedef int32_t swb_event_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The direction in which the guard of a transition passes zero.
 */
enum swb_direction
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * From below: the transition happens where the guard becomes positive.
     */
    SWB_DIRECTION_RISING = 0,
    /**
     * From above: the transition happens where the guard becomes negative.
     */
    SWB_DIRECTION_FALLING = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_direction swb_direction;
#else
typedef int32_t swb_direction;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What happens where the condition of a transition becomes true.
 */
enum swb_effect
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The state jumps.
     */
    SWB_EFFECT_JUMP = 0,
    /**
     * Time and state are written down; no step ends for that.
     */
    SWB_EFFECT_NOTE = 1,
    /**
     * The run ends there.
     */
    SWB_EFFECT_STOP = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_effect swb_effect;
#else
typedef int32_t swb_effect;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Does a transition happen where its condition is true, or where it becomes true?
 */
enum swb_trigger
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Where it is true: at once when its discrete states begin, if it is true then.
     */
    SWB_TRIGGER_LEVEL = 0,
    /**
     * Where it becomes true: what is true when its discrete states begin has to be false before. All that note or stop have this one.
     */
    SWB_TRIGGER_EDGE = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_trigger swb_trigger;
#else
typedef int32_t swb_trigger;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Laws for several contacts that close at once.
 */
enum swb_impact_law
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Newton's law for all contacts in one complementarity problem (Moreau).
     */
    SWB_IMPACT_LAW_NEWTON = 0,
    /**
     * Newton's law for one contact after the other, the one that closes fastest first.
     */
    SWB_IMPACT_LAW_SEQUENTIAL = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_impact_law swb_impact_law;
#else
typedef int32_t swb_impact_law;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Causes of impacts.
 */
enum swb_impact_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A contact closed.
     */
    SWB_IMPACT_KIND_COLLISION = 0,
    /**
     * No forces continue the motion (Painleve): sliding stops by an impact without collision.
     */
    SWB_IMPACT_KIND_PAINLEVE = 1,
    /**
     * Impacts accumulate: this is the last, the contact stays closed.
     */
    SWB_IMPACT_KIND_LAST = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_impact_kind swb_impact_kind;
#else
typedef int32_t swb_impact_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Modes of a contact.
 */
enum swb_contact_mode
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Open: no force.
     */
    SWB_CONTACT_MODE_OPEN = 0,
    /**
     * Closed; with friction, sticking. Of a switch: its function stays at zero.
     */
    SWB_CONTACT_MODE_CLOSED = 1,
    /**
     * Sliding: in the plane along the tangent, in space in any direction. Of a switch: its function is positive.
     */
    SWB_CONTACT_MODE_SLIDES = 2,
    /**
     * Sliding against the tangent, in the plane. Of a switch: its function is negative.
     */
    SWB_CONTACT_MODE_SLIDES_BACK = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_contact_mode swb_contact_mode;
#else
typedef int32_t swb_contact_mode;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How an optimal control problem of a scene finds contact modes and impacts.
 */
enum swb_jumps
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * By descents on simulations and by time stepping; where descents lead to no answer, also from a simulation of the guess and by finite elements with
     * jumps.
     */
    SWB_JUMPS_AUTO = 0,
    /**
     * From a simulation of the guess and the orders of modes next to it.
     */
    SWB_JUMPS_MODES = 1,
    /**
     * By finite elements with jumps: complementarity between gaps and forces in every element.
     */
    SWB_JUMPS_FESD_J = 2,
    /**
     * By time stepping: complementarity at the ends of equal steps of implicit Euler.
     */
    SWB_JUMPS_STEPS = 3,
    /**
     * By descents on simulations, from the guess and from controls that are drawn at random, always the same ones.
     */
    SWB_JUMPS_SHOTS = 4,
    /**
     * By time-freezing: finite elements in a numerical time in which nothing jumps; without friction where there is restitution.
     */
    SWB_JUMPS_FREEZING = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_jumps swb_jumps;
#else
typedef int32_t swb_jumps;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Results of a step.
 */
enum swb_progress_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A step inside of a mode.
     */
    SWB_PROGRESS_KIND_STEPPED = 0,
    /**
     * A step that ends at a switch.
     */
    SWB_PROGRESS_KIND_SWITCHED = 1,
    /**
     * Nothing, or no more: the time asked for is reached, or the simulation ended; see swb_integrator_get_outcome.
     */
    SWB_PROGRESS_KIND_DONE = 2,
    /**
     * A step that ends at a stop time.
     */
    SWB_PROGRESS_KIND_STOP_TIME = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_progress_kind swb_progress_kind;
#else
typedef int32_t swb_progress_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Work done between two samples.
 */
enum swb_nmpc_scheme
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * One linearisation at the last iterate per sample.
     */
    SWB_NMPC_SCHEME_RTI = 0,
    /**
     * One iteration of a level per sample; levels A, B, C keep the matrices of the first linearisation.
     */
    SWB_NMPC_SCHEME_MLI = 1,
    /**
     * Iterations of a level on the problem with the predicted state, then a linearisation.
     */
    SWB_NMPC_SCHEME_AS_RTI = 2,
    /**
     * The problem with the predicted state is solved until it converges, then linearised.
     */
    SWB_NMPC_SCHEME_ASC = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_nmpc_scheme swb_nmpc_scheme;
#else
typedef int32_t swb_nmpc_scheme;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Levels of an iteration by what it evaluates.
 */
enum swb_nmpc_level
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing: another initial value in the same quadratic program.
     */
    SWB_NMPC_LEVEL_A = 0,
    /**
     * Values of the constraints; the gradient from the frozen Hessian.
     */
    SWB_NMPC_LEVEL_B = 1,
    /**
     * Besides, the gradient of the Lagrangian by an adjoint sweep.
     */
    SWB_NMPC_LEVEL_C = 2,
    /**
     * All Jacobians; the Hessian is that of Gauss and Newton.
     */
    SWB_NMPC_LEVEL_D0 = 3,
    /**
     * All Jacobians; the Hessian is updated from gradients.
     */
    SWB_NMPC_LEVEL_D1 = 4,
    /**
     * All Jacobians and the exact Hessian, made convex.
     */
    SWB_NMPC_LEVEL_D2 = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_nmpc_level swb_nmpc_level;
#else
typedef int32_t swb_nmpc_level;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How quadratic programs are solved.
 */
enum swb_nmpc_qp
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * States eliminated, dual active set on the prepared inverse of the Hessian.
     */
    SWB_NMPC_QP_CONDENSING = 0,
    /**
     * States kept: active sets by a Riccati recursion, and an interior point where these do not settle. Work is linear in the number of
     * stages.
     */
    SWB_NMPC_QP_STAGEWISE = 1,
    /**
     * The one of both that needs fewer operations at the size of the problem.
     */
    SWB_NMPC_QP_AUTO = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_nmpc_qp swb_nmpc_qp;
#else
typedef int32_t swb_nmpc_qp;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Sources of a control.
 */
enum swb_nmpc_source
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The quadratic program.
     */
    SWB_NMPC_SOURCE_QP = 0,
    /**
     * The quadratic program with constraints at a price, since they cannot all be met.
     */
    SWB_NMPC_SOURCE_SOFT_QP = 1,
    /**
     * The affine law, an unfinished quadratic program or the plan, cut off at the bounds of the controls: what costs least.
     */
    SWB_NMPC_SOURCE_TANGENT = 2,
    /**
     * The last plan.
     */
    SWB_NMPC_SOURCE_PLAN = 3,
    /**
     * The last control again.
     */
    SWB_NMPC_SOURCE_HOLD = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_nmpc_source swb_nmpc_source;
#else
typedef int32_t swb_nmpc_source;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How a quadratic program ended.
 */
enum swb_nmpc_qp_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Solved.
     */
    SWB_NMPC_QP_STATUS_SOLVED = 0,
    /**
     * Constraints contradict each other.
     */
    SWB_NMPC_QP_STATUS_INFEASIBLE = 1,
    /**
     * The deadline or the bound on changes came first.
     */
    SWB_NMPC_QP_STATUS_OUT_OF_TIME = 2,
    /**
     * Not convex on the controls, or not finite.
     */
    SWB_NMPC_QP_STATUS_FAILED = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_nmpc_qp_status swb_nmpc_qp_status;
#else
typedef int32_t swb_nmpc_qp_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Numbers of C code.
 */
enum swb_c_real
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * double
     */
    SWB_C_REAL_DOUBLE = 0,
    /**
     * float
     */
    SWB_C_REAL_FLOAT = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_c_real swb_c_real;
#else
typedef int32_t swb_c_real;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Kinds of members of complementarity pairs.
 */
enum swb_member
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A variable; its lower bound becomes zero.
     */
    SWB_MEMBER_VARIABLE = 0,
    /**
     * A row of the constraints; its own bounds are not used.
     */
    SWB_MEMBER_CONSTRAINT = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_member swb_member;
#else
typedef int32_t swb_member;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Parts of a program that have names and can be violated. The first two are those of enum swb_member.
 */
enum swb_item
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A variable, by its bounds.
     */
    SWB_ITEM_VARIABLE = 0,
    /**
     * A row of the constraints, by its bounds.
     */
    SWB_ITEM_CONSTRAINT = 1,
    /**
     * A complementarity pair, in the order they were added, by min(G, H).
     */
    SWB_ITEM_PAIR = 2,
    /**
     * A box, in the order they were added, by the distance of its variable and constraint from complementarity.
     */
    SWB_ITEM_BOX = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_item swb_item;
#else
typedef int32_t swb_item;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * On which sides of a parameter a derivative of a solution holds.
 */
enum swb_sides
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * On both: the solution is differentiable.
     */
    SWB_SIDES_BOTH = 0,
    /**
     * Where the parameter rises: a bound or pair is active without a multiplier, and on the other side the derivative is another.
     */
    SWB_SIDES_RISING = 1,
    /**
     * Where it falls, likewise.
     */
    SWB_SIDES_FALLING = 2,
    /**
     * On neither: the derivative is not known and is NaN. Active gradients are dependent, or several bounds or pairs are active without
     * multipliers and do not stay so together.
     */
    SWB_SIDES_NEITHER = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_sides swb_sides;
#else
typedef int32_t swb_sides;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The strongest type of stationarity for which multipliers of the pairs are known; nu of G, xi of H, at pairs of which
 * both members are zero.
 */
enum swb_stationarity
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Strong: both not negative.
     */
    SWB_STATIONARITY_S = 0,
    /**
     * Mordukhovich: both positive, or one of them zero.
     */
    SWB_STATIONARITY_M = 1,
    /**
     * Clarke: the product not negative.
     */
    SWB_STATIONARITY_C = 2,
    /**
     * Abadie: one of them not negative.
     */
    SWB_STATIONARITY_A = 3,
    /**
     * Weak: any signs.
     */
    SWB_STATIONARITY_W = 4,
    /**
     * There are no multipliers at all.
     */
    SWB_STATIONARITY_NONE = 5,
    /**
     * Not known: the point is no exact one, or certificates are off.
     */
    SWB_STATIONARITY_UNKNOWN = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_stationarity swb_stationarity;
#else
typedef int32_t swb_stationarity;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Answers to whether no step to first order leads to a better point.
 */
enum swb_b_stationarity
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * None does: a B-stationary point, which has no descent.
     */
    SWB_B_STATIONARITY_YES = 0,
    /**
     * There is a descent.
     */
    SWB_B_STATIONARITY_NO = 1,
    /**
     * Not decided; the doubt says why.
     */
    SWB_B_STATIONARITY_UNDECIDED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_b_stationarity swb_b_stationarity;
#else
typedef int32_t swb_b_stationarity;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Reasons why a certificate does not say more.
 */
enum swb_doubt
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing.
     */
    SWB_DOUBT_NONE = 0,
    /**
     * Values that are not finite.
     */
    SWB_DOUBT_DATA = 1,
    /**
     * The point violates constraints, bounds or pairs.
     */
    SWB_DOUBT_INFEASIBLE = 2,
    /**
     * Too many pairs of which both members are zero.
     */
    SWB_DOUBT_NODES = 3,
    /**
     * A linear program could not be solved well enough to believe it.
     */
    SWB_DOUBT_ACCURACY = 4,
    /**
     * Interrupted, or out of time.
     */
    SWB_DOUBT_STOPPED = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_doubt swb_doubt;
#else
typedef int32_t swb_doubt;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Verdicts of the conditions of second order on a point with multipliers of type S.
 */
enum swb_second_order
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Sufficient conditions hold: a local minimum, and the only one near by.
     */
    SWB_SECOND_ORDER_STRICT_MINIMUM = 0,
    /**
     * The objective falls along the active constraints, whose gradients are independent: no local minimum.
     */
    SWB_SECOND_ORDER_SADDLE = 1,
    /**
     * Neither could be shown.
     */
    SWB_SECOND_ORDER_UNDECIDED = 2,
    /**
     * Not asked, or no point with multipliers of type S.
     */
    SWB_SECOND_ORDER_UNKNOWN = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_second_order swb_second_order;
#else
typedef int32_t swb_second_order;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Verdicts on an optimal control as a point of the control problem: whether the cost is stationary under changes of controls, free
 * lengths, free parameters and free initial states, when every change is simulated by events.
 */
enum swb_verdict
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Not known; swb_ocp_get_optimality_reason says why.
     */
    SWB_VERDICT_UNKNOWN = 0,
    /**
     * No change lowers the cost to first order, or a descent on simulations gains nothing.
     */
    SWB_VERDICT_LOCAL_OPTIMUM = 1,
    /**
     * Local optimum at a kink: switches lie exactly between control stages, surfaces are touched, or modes change, and the cost rises
     * towards either side.
     */
    SWB_VERDICT_KINK = 2,
    /**
     * Some change lowers the cost to first order.
     */
    SWB_VERDICT_NOT_OPTIMAL = 3,
    /**
     * An exact search over all choices (swb_system_add_choice) found no answer that costs less by more than the gap of swb_optimality.
     */
    SWB_VERDICT_GLOBAL = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_verdict swb_verdict;
#else
typedef int32_t swb_verdict;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Owners of multipliers. Those of constraints and bounds are positive where an upper bound is active and negative where a
 * lower one is: raising that bound by d changes the optimal cost by -d times the multiplier, to first order.
 */
enum swb_multipliers_of
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Costates, nx at the start of every control stage and at the end of the horizon: derivatives of the cost that is still to
     * come, constraints behind that time included, with respect to the state; at the end, of terminal cost and constraints.
     */
    SWB_MULTIPLIERS_OF_COSTATES = 0,
    /**
     * Bounds of the initial state, nx: where it is fixed, the negative derivative of the optimal cost with respect to it.
     */
    SWB_MULTIPLIERS_OF_INITIAL_STATE = 1,
    /**
     * Bounds of the states, nx at the stage points and ends of all finite elements.
     */
    SWB_MULTIPLIERS_OF_STATES = 2,
    /**
     * Bounds of the controls, nu at the start of every control stage; zero for controls that are linear, whose values are bounded
     * as states are.
     */
    SWB_MULTIPLIERS_OF_CONTROLS = 3,
    /**
     * Bounds of the parameters, np; zero for those that are given.
     */
    SWB_MULTIPLIERS_OF_PARAMS = 4,
    /**
     * A path constraint, at all points at which it holds; those of all points together are the effect of its bound.
     */
    SWB_MULTIPLIERS_OF_PATH = 5,
    /**
     * A terminal constraint.
     */
    SWB_MULTIPLIERS_OF_TERMINAL = 6,
    /**
     * A constraint between both ends of the horizon.
     */
    SWB_MULTIPLIERS_OF_BOUNDARY = 7,
    /**
     * A constraint that may be violated at a price.
     */
    SWB_MULTIPLIERS_OF_RELAXED = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_multipliers_of swb_multipliers_of;
#else
typedef int32_t swb_multipliers_of;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Event-driven simulations of one system from several initial states, with controls and parameters of their own.
 */
typedef struct swb_batch swb_batch;

/**
 * Graph of expressions. Every expression is a number in its graph and exists once: equal expressions have equal
 * numbers. Expressions live as long as the graph; functions and models made of them are independent of it.
 */
typedef struct swb_expr swb_expr;

/**
 * Function with first and second derivatives: reference counted inside, so the handle may be freed as
 * soon as the function was handed to a model.
 */
typedef struct swb_function swb_function;

/**
 * Event-driven integrator of a system: explicit or implicit steps inside of modes, sliding modes as
 * differential-algebraic equations, every switch located to rounding. swb_simulator solves the equations of FESD
 * instead.
 */
typedef struct swb_integrator swb_integrator;

/**
 * Estimator: states and constant parameters from the measurements of the last samples.
 */
typedef struct swb_mhe swb_mhe;

/**
 * Model made of expressions: a piecewise smooth system with a report of what it consists of.
 */
typedef struct swb_model swb_model;

/**
 * Nonlinear program with complementarity constraints: minimise f(w,p) subject to bounds on w and c(w,p),
 * 0 <= G _|_ H >= 0 for pairs of variables or rows of c, and boxes lower <= w_i <= upper _|_ c_j. Without pairs and boxes, a
 * nonlinear program.
 */
typedef struct swb_mpcc swb_mpcc;

/**
 * Optimal control problem of phases, each with its own system, horizon, costs and constraints, linked by constraints
 * between the end of one and the start of the next.
 */
typedef struct swb_multiphase swb_multiphase;

/**
 * Controller: feedback for measured states by a few iterations per sample on an optimal control problem.
 */
typedef struct swb_nmpc swb_nmpc;

/**
 * Optimal control problem of a system: piecewise constant controls on an equidistant grid of stages.
 */
typedef struct swb_ocp swb_ocp;

/**
 * Result of an event-driven simulation: state, switches, derivatives, dense output. Owned by the caller, independent
 * of the object it comes from.
 */
typedef struct swb_run swb_run;

/**
 * Scene: coordinates q, velocities v, inertia, forces and contacts, made of expressions in which the states are q, then v, then what is
 * beside them.
 */
typedef struct swb_scene swb_scene;

/**
 * Simulator of a system: time, state, and the trajectory since the state was set.
 */
typedef struct swb_simulator swb_simulator;

/**
 * Stepper: makes steps of a scene by the theta-method of Moreau and Jean, in which impacts need not be located. For
 * scenes with many contacts; of order 1 in the step.
 */
typedef struct swb_stepper swb_stepper;

/**
 * Piecewise smooth system: x' = f0(x,u,p,t) plus, for each subsystem, a convex combination of its modes.
 */
typedef struct swb_system swb_system;

/**
 * Trajectory of a simulation or of an optimal control problem: finite elements, each a polynomial, that
 * end where the system switches. Owned by the caller, independent of the object it comes from.
 */
typedef struct swb_trajectory swb_trajectory;

/**
 * Settings of discretisation and solver.
 *
 * Fill with `swb_settings_init` in C, `Settings::default()` in Rust, then change what differs. Fields
 * are only ever appended; every field is 8 bytes wide, so there are no holes. An integer field that is
 * an enumeration takes the values of the enumeration named in its description. Ranges: see the option
 * table (`swb_option_range`).
 */
typedef struct swb_settings {
    /**
     * Size of this struct in bytes, written by the init function: tells the library how much to read.
     */
    uint64_t struct_size;
    /**
     * Runge-Kutta family (enum rk_family).
     */
    int64_t rk_family;
    /**
     * Stage points of the Runge-Kutta method.
     */
    int64_t n_s;
    /**
     * Finite elements of a control stage or a simulation step.
     */
    int64_t n_fe;
    /**
     * Treatment of switches: moving element boundaries or fixed steps (enum discretisation).
     */
    int64_t discretisation;
    /**
     * Unknowns at the stage points (enum stage_form).
     */
    int64_t stage_form;
    /**
     * Granularity of the cross complementarity (enum cross).
     */
    int64_t cross;
    /**
     * Step equilibration during the homotopy (enum step_equilibration).
     */
    int64_t step_equilibration;
    /**
     * Weight of the soft step equilibration, in optimal control in multiples of the steepest change of the cost.
     */
    double rho_h;
    /**
     * Step sizes stay between (1 - gamma_h) and (1 + gamma_h) times the nominal one.
     */
    double gamma_h;
    /**
     * Convergence tolerance of the interior point at sigma = 0, before polishing.
     */
    double tol;
    /**
     * Limit on the interior point iterations of one solve, over all homotopy steps.
     */
    int64_t max_iter;
    /**
     * Limit on the wall time of one solve in seconds, with guesses, certificate, comparison and further rounds. The solve ends at most one factorisation or 16 model evaluations later, and returns the best point so far. A model function that runs is not interrupted.
     */
    double max_time;
    /**
     * Initial barrier parameter.
     */
    double mu_init;
    /**
     * Initial relaxation of the complementarity.
     */
    double sigma_init;
    /**
     * Smallest relaxation of the complementarity.
     */
    double sigma_min;
    /**
     * Linear reduction of the relaxation: sigma becomes at most sigma_factor sigma.
     */
    double sigma_factor;
    /**
     * Superlinear reduction of the relaxation: sigma becomes at most sigma^sigma_exponent.
     */
    double sigma_exponent;
    /**
     * Barrier parameter of a relaxed problem as a multiple of its relaxation.
     */
    double mu_over_sigma;
    /**
     * Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses.
     */
    double plateau_mu;
    /**
     * Constraint violation at which the first problem, at sigma_init, counts as solved.
     */
    double plateau_viol;
    /**
     * Identify the active set and solve the smooth problem that remains (enum polish).
     */
    int64_t polish;
    /**
     * Tolerance of the solution after the option polish.
     */
    double polish_tol;
    /**
     * Initial guess of a solve without a guess of the states (enum initial_guess).
     */
    int64_t initial_guess;
    /**
     * Verbosity of the log sink (enum log_level).
     */
    int64_t log_level;
    /**
     * Factorisation of the Newton matrices (enum linear_solver).
     */
    int64_t linear_solver;
    /**
     * Order of elimination in the Newton matrices (enum ordering).
     */
    int64_t ordering;
    /**
     * Scale objective and rows by their gradients at the starting point (enum toggle).
     */
    int64_t scaling;
    /**
     * Start the pairs of a program on the central path instead of at the starting point (enum toggle).
     */
    int64_t centre_pairs;
    /**
     * Limit the multipliers of products pair by pair before the whole Hessian is perturbed (enum toggle).
     */
    int64_t convexify_pairs;
    /**
     * Polish with a clear active set before the relaxation is small (enum toggle).
     */
    int64_t early_polish;
    /**
     * Solve the square system of the active set by Newton's method (enum toggle).
     */
    int64_t square_newton;
    /**
     * Certify exact points, and follow descent directions from points that are not B-stationary (enum toggle).
     */
    int64_t certify;
    /**
     * Number of homotopy steps that may be repeated from the last relaxation with a smaller reduction, when steps at the next one stay short.
     */
    int64_t sigma_retries;
    /**
     * Limit on the second-order corrections of an interior-point step.
     */
    int64_t max_soc;
    /**
     * Restore feasibility after several tiny interior-point steps in a row (enum toggle).
     */
    int64_t restore_tiny;
    /**
     * Relaxation or penalty in the place of the complementarity constraints until the active set is identified (enum relaxation).
     */
    int64_t relaxation;
    /**
     * Changes of relaxation or penalty and barrier parameter: together, or one problem after the other (enum homotopy).
     */
    int64_t homotopy;
    /**
     * First penalty parameter of the penalties among the relaxations; sigma is its inverse.
     */
    double penalty_init;
    /**
     * Compare a solution of optimal control with an event-driven simulation of its controls (enum toggle).
     */
    int64_t accuracy;
    /**
     * Relative and absolute tolerance of the simulation that the option accuracy compares a solution of optimal control with.
     */
    double accuracy_tol;
    /**
     * Mode sequences that a search tries before it ends of itself; 0: as many as its effort says.
     */
    int64_t mode_search;
    /**
     * Complementarity form of switching terms (enum dcs_form).
     */
    int64_t dcs_form;
    /**
     * Largest number of factors in a product of the Heaviside form; longer products are lifted.
     */
    int64_t lift_depth;
    /**
     * Integration method of the modes in event-driven simulation (enum integration).
     */
    int64_t integration;
    /**
     * Relative tolerance of the local error in event-driven simulation.
     */
    double rtol;
    /**
     * Absolute tolerance of the local error in event-driven simulation.
     */
    double atol;
    /**
     * First step of an event-driven simulation; 0: the library chooses.
     */
    double h_init;
    /**
     * Longest step of an event-driven simulation.
     */
    double h_max;
    /**
     * Limit on the steps of an event-driven simulation, accepted and rejected.
     */
    int64_t max_steps;
    /**
     * Limit on the switches in the log of an event-driven simulation; further ones are only counted.
     */
    int64_t max_switches;
    /**
     * Continuation of an event-driven simulation where switches accumulate (enum zeno_policy).
     */
    int64_t zeno;
    /**
     * Continuation of an event-driven simulation where it is not unique (enum ambiguity_policy).
     */
    int64_t ambiguity;
    /**
     * Keep the dense output of an event-driven simulation (enum toggle).
     */
    int64_t dense;
    /**
     * Compute the derivatives of an event-driven simulation and of its switching times (enum sensitivity).
     */
    int64_t sensitivity;
    /**
     * Record an event-driven simulation for adjoint derivatives (enum toggle).
     */
    int64_t adjoint;
    /**
     * Compute by another solve the least violation of constraints that cannot be met (enum toggle).
     */
    int64_t explain;
    /**
     * Error at the ends of the control stages down to which the grid of an optimal control problem is refined; 0: the grid stays.
     */
    double adapt_tol;
    /**
     * Limit on the number of refined grids of an optimal control problem, when adapt_tol is positive.
     */
    int64_t adapt_rounds;
    /**
     * Limit on the finite elements of a refined grid over all control stages, when adapt_tol is positive.
     */
    int64_t adapt_elements;
    /**
     * Limit on the bytes that building, solving or simulating may take; 0: no limit.
     */
    int64_t max_memory;
    /**
     * Search for the solution of an optimal control problem (enum ocp_start).
     */
    int64_t ocp_start;
    /**
     * Strategies for a program with complementarity constraints within its iterations (enum portfolio).
     */
    int64_t portfolio;
    /**
     * Velocity of a sliding mode where surfaces meet and their effects multiply. Where the chosen rule has no weights between 0 and 1, an extreme velocity is taken (enum selection).
     */
    int64_t selection;
    /**
     * Work of a search after its last gain as a multiple of that until it: more finds better optima, less ends sooner.
     */
    double search_effort;
    /**
     * Share of the cost by which a solution has to be better for a search to go on for it: smaller gains are taken, but not worked for.
     */
    double search_gain;
    /**
     * Random controls that a search draws and simulates at a time; 0: none.
     */
    int64_t search_samples;
    /**
     * Seed of the random controls of a search.
     */
    int64_t search_seed;
    /**
     * Work of an exact search over choices at most, in variables of a program times iterations, or states times steps of simulations; 0: none.
     */
    double search_exact;
    /**
     * Dense output keeps at least so many of the last steps, and at most a quarter more: older ones are dropped; 0: all.
     */
    int64_t dense_steps;
    /**
     * Work of a branch and bound over the branches of a program with linear rows and a convex quadratic objective at most, in entries of tableaus; 0: none. Where it is enough the solution is global, with proof, or the program is shown to be infeasible. Other programs get a tenth of it for every model of them that is searched for better branches.
     */
    double branch_work;
} swb_settings;

/**
 * Receives one log line, without line break. `level` is an enum swb_log_level, `line` is valid during
 * the call only. May be called by the thread that runs the solver, never after the call that was given
 * the sink, or the object that holds it, has ended. Must not unwind (no exception, no longjmp).
 */
typedef void (*swb_log_fn)(int64_t level, const char *line, void *user_data);

/**
 * How a scene is made a piecewise smooth system in numerical time; swb_freeze_options_init sets the defaults.
 */
typedef struct swb_freeze_options {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Numerical time that a jump should take: the length of a step or of a finite element.
     */
    double step;
    /**
     * Rate at which gaps usually close.
     */
    double speed;
    /**
     * Strength a_n of the push of contacts without restitution; 0 for the recommended one.
     */
    double a_n;
    /**
     * Stiffness of contacts with restitution; 0 for the recommended one.
     */
    double stiffness;
    /**
     * Sliding speed below which a contact in space creeps; 0 for a thousandth of speed.
     */
    double creep;
    /**
     * 1: a control behind the others multiplies all rates, the speed of time.
     */
    int64_t speed_of_time;
} swb_freeze_options;

/**
 * Places of states and controls in a model in numerical time: the states of the scene come first and keep their numbers.
 */
typedef struct swb_freeze_layout {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * First state that is the depth of a contact with restitution.
     */
    int64_t first_depth;
    /**
     * Number of those states.
     */
    int64_t n_depths;
    /**
     * The state that is the physical time.
     */
    int64_t clock;
    /**
     * First state that is the integral of a cost over physical time.
     */
    int64_t first_cost;
    /**
     * Number of those states.
     */
    int64_t n_costs;
    /**
     * The control that is the speed of time, or -1.
     */
    int64_t speed;
} swb_freeze_layout;

/**
 * Inputs of a function that is evaluated. Derivatives number the inputs in this order: x, u, p, then t.
 */
typedef struct swb_point {
    /**
     * Time; NAN during a solve for functions that do not say that they depend on it.
     */
    double t;
    /**
     * [nx] states, or the variables of a program; NULL if nx is 0.
     */
    const double *x;
    /**
     * [nu] controls; NULL if nu is 0.
     */
    const double *u;
    /**
     * [np] parameters; NULL if np is 0.
     */
    const double *p;
} swb_point;

/**
 * Value: writes out [n_out], which comes filled with zeros.
 *
 * Returns 0; a positive number if the function is not defined at the point, which makes the solver try
 * another one (so do values that are not finite); a negative number to end the call with SWB_ERR_USER.
 * May be called by every thread that uses an object with this function, and by threads of the library where several
 * simulations or solves run at once (swb_batch_run, swb_ocp_solve_starts), unless swb_function_set_flags says SWB_SERIAL.
 */
typedef int32_t (*swb_value_fn)(const struct swb_point *at, double *out, void *user_data);

/**
 * Called once when the last user of a function is gone.
 */
typedef void (*swb_destroy_fn)(void *user_data);

/**
 * Jacobian: writes out [nnz], the values of the entries of the pattern; comes filled with zeros. Returns
 * as swb_value_fn.
 */
typedef int32_t (*swb_jacobian_fn)(const struct swb_point *at, double *out, void *user_data);

/**
 * Hessian of the sum of the outputs weighted with weights [n_out]: writes out [nnz], the values of the
 * entries of the pattern; comes filled with zeros. Returns as swb_value_fn.
 */
typedef int32_t (*swb_hessian_fn)(const struct swb_point *at,
                                  const double *weights,
                                  double *out,
                                  void *user_data);

/**
 * Address of code of any kind.
 */
typedef void (*swb_code)(void);

/**
 * Addresses of what CasADi generates for a function f; NULL where there is nothing. SWB_CASADI(f) makes one of code
 * that is linked.
 */
typedef struct swb_casadi {
    /**
     * sizeof(swb_casadi)
     */
    uint64_t struct_size;
    /**
     * f
     */
    swb_code eval;
    /**
     * f_n_in
     */
    swb_code n_in;
    /**
     * f_n_out
     */
    swb_code n_out;
    /**
     * f_name_in
     */
    swb_code name_in;
    /**
     * f_sparsity_in
     */
    swb_code sparsity_in;
    /**
     * f_sparsity_out
     */
    swb_code sparsity_out;
    /**
     * f_work
     */
    swb_code work;
    /**
     * f_checkout
     */
    swb_code checkout;
    /**
     * f_release
     */
    swb_code release;
    /**
     * f_incref
     */
    swb_code incref;
    /**
     * f_decref
     */
    swb_code decref;
    /**
     * Size of an integer in the generated file, since CasADi 3.8.
     */
    swb_code int_size;
    /**
     * Size of a number in the generated file, since CasADi 3.8.
     */
    swb_code real_size;
} swb_casadi;

/**
 * Numbers of a trajectory, the lengths of its arrays.
 */
typedef struct swb_trajectory_info {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * States.
     */
    int64_t nx;
    /**
     * Finite elements.
     */
    int64_t n_elements;
    /**
     * Stage points of each element.
     */
    int64_t n_s;
    /**
     * Subsystems that can switch: those with more than one mode, in the order they were added.
     */
    int64_t n_subsystems;
    /**
     * Modes of all these subsystems, one after the other.
     */
    int64_t n_modes;
    /**
     * Switches.
     */
    int64_t n_switches;
    /**
     * Start.
     */
    double t_start;
    /**
     * End.
     */
    double t_end;
} swb_trajectory_info;

/**
 * A change of the active set of a subsystem.
 */
typedef struct swb_switch {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * The element that begins here.
     */
    int64_t element;
    /**
     * The subsystem.
     */
    int64_t subsystem;
    /**
     * An enum swb_switch_kind.
     */
    int64_t kind;
    /**
     * Active modes before, bit i for mode i; modes from 64 on are in swb_trajectory_active only.
     */
    uint64_t before;
    /**
     * Active modes after.
     */
    uint64_t after;
} swb_switch;

/**
 * Residuals of the optimality conditions, unscaled, maximum norm.
 */
typedef struct swb_residuals {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Violation of constraints and bounds.
     */
    double primal;
    /**
     * Gradient of the Lagrangian; 0 for simulations.
     */
    double dual;
    /**
     * Products of slacks and multipliers of bounds; 0 for simulations.
     */
    double complementarity;
    /**
     * Largest product G_i H_i of a pair; 0 for simulations.
     */
    double pair_product;
    /**
     * Largest min(G_i, H_i) of a pair.
     */
    double pair_min;
} swb_residuals;

/**
 * Work and time of a solve, or of all steps of a simulation.
 */
typedef struct swb_stats {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Interior-point iterations, restoration included.
     */
    int64_t iterations;
    /**
     * Numeric factorisations.
     */
    int64_t factorisations;
    /**
     * Evaluations of objective and constraints.
     */
    int64_t evaluations;
    /**
     * Iterations inside the restoration phase.
     */
    int64_t restoration_iterations;
    /**
     * Iterations spent in the polish.
     */
    int64_t polish_iterations;
    /**
     * Largest perturbation of the Hessian.
     */
    double max_delta_w;
    /**
     * Seconds in functions and derivatives.
     */
    double time_eval;
    /**
     * Seconds in factorisations and solves.
     */
    double time_linalg;
    /**
     * Seconds in all.
     */
    double time_total;
    /**
     * Seconds to build the problem, not part of time_total; 0 when an earlier structure was used again.
     */
    double time_build;
    /**
     * Variables of the solved program; 0 for simulations.
     */
    int64_t n_variables;
    /**
     * Constraints of the solved program; 0 for simulations.
     */
    int64_t n_constraints;
    /**
     * Complementarity pairs of the solved program; 0 for simulations.
     */
    int64_t n_pairs;
    /**
     * Steps of a simulation; else 0.
     */
    int64_t n_steps;
    /**
     * Steps of a simulation that the homotopy had to decide; else 0.
     */
    int64_t n_homotopies;
    /**
     * Bounds that were moved outwards by 1e-9, relative to them or to the unit of the scaled problem, because constraints left no room
     * between them; the polish is under those given.
     */
    int64_t moved_bounds;
} swb_stats;

/**
 * One iteration of a solve.
 */
typedef struct swb_iteration_info {
    /**
     * Size of this struct in bytes, as the library knows it.
     */
    uint64_t struct_size;
    /**
     * Iteration number; starts again with every step of a simulation.
     */
    int64_t iter;
    /**
     * Objective.
     */
    double objective;
    /**
     * Primal infeasibility.
     */
    double inf_pr;
    /**
     * Dual infeasibility.
     */
    double inf_du;
    /**
     * Barrier parameter.
     */
    double mu;
    /**
     * Relaxation of the complementarity, 0 without one.
     */
    double sigma;
    /**
     * Largest product of a pair.
     */
    double inf_cc;
    /**
     * Length of the last primal step.
     */
    double step;
    /**
     * Perturbation of the Hessian.
     */
    double delta_w;
    /**
     * Dual step length.
     */
    double alpha_du;
    /**
     * Primal step length.
     */
    double alpha_pr;
    /**
     * Trial points of the line search.
     */
    int64_t trials;
    /**
     * Character: ' ' main phase, 'r' restoration, 'p' polish, 'j' relaxation raised after a jam,
     * 's' step that lowers the error as a whole, 'c' linear program of a certificate, numbered on its own.
     */
    int64_t phase;
    /**
     * Cost of the best solution that a search around this solve has verified so far; infinite where there is none.
     */
    double incumbent;
} swb_iteration_info;

/**
 * Called once per iteration by the thread that solves; a return other than 0 stops the solve with the
 * outcome SWB_OUTCOME_STOPPED. `info` is valid during the call only. Must not unwind.
 */
typedef int32_t (*swb_iteration_fn)(const struct swb_iteration_info *info, void *user_data);

/**
 * Numbers of a run, the lengths of its arrays.
 */
typedef struct swb_run_info {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * States.
     */
    int64_t nx;
    /**
     * An enum swb_run_outcome.
     */
    int64_t outcome;
    /**
     * Start.
     */
    double t_start;
    /**
     * Time reached.
     */
    double t_end;
    /**
     * Switches in the log.
     */
    int64_t n_events;
    /**
     * Subsystems that can switch: those with more than one mode, in the order they were added.
     */
    int64_t n_subsystems;
    /**
     * Steps with dense output; 0 without the option dense.
     */
    int64_t n_pieces;
    /**
     * Columns of the derivatives: initial states (none where the option sensitivity is "inputs"), parameters, controls; 0 without the option.
     */
    int64_t n_columns;
    /**
     * 1 if the derivatives hold for one side only: simultaneous switches, a continuation that is not unique, a surface
     * that is only touched, accumulating switches.
     */
    int64_t one_sided;
    /**
     * Points with several continuations.
     */
    int64_t n_branch_points;
    /**
     * Surfaces only touched.
     */
    int64_t n_contacts;
    /**
     * Points at which switches accumulate.
     */
    int64_t n_accumulations;
    /**
     * Transitions in the log.
     */
    int64_t n_jumps;
    /**
     * Impacts in the log, one for every contact with an impulse.
     */
    int64_t n_impacts;
    /**
     * Contacts of the scene.
     */
    int64_t n_scene_contacts;
    /**
     * 1 if contacts of the scene were redundant at some time: the motion is unique, the forces are those of least norm.
     */
    int64_t redundant;
    /**
     * What transitions noted, see swb_run_notes.
     */
    int64_t n_notes;
    /**
     * The transition that ended the run, from 0; -1 if none did.
     */
    int64_t stopped_by;
} swb_run_info;

/**
 * Work of an event-driven simulation.
 */
typedef struct swb_run_stats {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Accepted steps.
     */
    int64_t steps;
    /**
     * Rejected steps.
     */
    int64_t rejections;
    /**
     * Steps repeated to end at a switch.
     */
    int64_t relocations;
    /**
     * Evaluations of the right-hand side.
     */
    int64_t evaluations;
    /**
     * Evaluations of its Jacobian.
     */
    int64_t jacobians;
    /**
     * Newton iterations.
     */
    int64_t newton;
    /**
     * Factorisations.
     */
    int64_t factorisations;
    /**
     * Switches, all subsystems together, those beyond the option max_switches included.
     */
    int64_t switches;
    /**
     * Points at which switches accumulate.
     */
    int64_t accumulations;
    /**
     * Seconds.
     */
    double time_total;
    /**
     * Transitions.
     */
    int64_t jumps;
    /**
     * Impacts, each contact for itself.
     */
    int64_t impacts;
    /**
     * What transitions noted, that beyond the option max_switches included.
     */
    int64_t notes;
} swb_run_stats;

/**
 * A change of the active set of a subsystem.
 */
typedef struct swb_event {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * An enum swb_event_kind.
     */
    int64_t kind;
    /**
     * The subsystem, counted among those with more than one mode.
     */
    int64_t subsystem;
    /**
     * Active modes before, bit i for mode i; modes from 64 on are in swb_run_event_modes only.
     */
    uint64_t before;
    /**
     * Active modes after.
     */
    uint64_t after;
    /**
     * 1 if another subsystem switches at the same time.
     */
    int64_t simultaneous;
    /**
     * 1 if the continuation was unique.
     */
    int64_t unique;
    /**
     * Rate at which the quantity that vanishes (a difference of indicators g, or a weight theta) goes through zero
     * before the switch; NaN where the switch is not caused by one.
     */
    double rate;
    /**
     * Cosine between the gradient of the surface and the velocity: near zero the contact is grazing. NaN for a
     * weight.
     */
    double transversality;
} swb_event;

/**
 * A point from which several solutions go on.
 */
typedef struct swb_branch_point {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * Continuations that differ in their velocity.
     */
    int64_t n_continuations;
    /**
     * The continuation that was taken, from 0; -1 where the run stopped.
     */
    int64_t taken;
} swb_branch_point;

/**
 * A surface that is only touched.
 */
typedef struct swb_contact {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * The subsystem, counted among those with more than one mode.
     */
    int64_t subsystem;
    /**
     * Derivative of the difference of indicators along the solution.
     */
    double rate;
    /**
     * Cosine between the gradient of the surface and the velocity.
     */
    double transversality;
} swb_contact;

/**
 * Accumulating switches.
 */
typedef struct swb_accumulation {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time at which they accumulate, by the geometric series of the last intervals.
     */
    double t;
    /**
     * Time at which ordinary integration begins again.
     */
    double until;
    /**
     * Steps of the policy time_stepping, 0 with the others.
     */
    int64_t steps;
    /**
     * Error that these steps added to the state, relative to the tolerance.
     */
    double error;
} swb_accumulation;

/**
 * What a transition of the effect SWB_EFFECT_NOTE wrote down.
 */
typedef struct swb_note {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * The transition, in the order they were added to the system.
     */
    int64_t transition;
    /**
     * Rate at which the guard passes zero, positive in its direction; NaN where a jump of the state has made the condition true.
     */
    double rate;
} swb_note;

/**
 * A transition that was made.
 */
typedef struct swb_jump {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * The transition, in the order they were added to the system.
     */
    int64_t transition;
    /**
     * 1 if another transition was made at the same time.
     */
    int64_t simultaneous;
    /**
     * Rate at which the guard passes zero, positive in its direction; NaN where it held when its discrete state began.
     */
    double rate;
} swb_jump;

/**
 * The part of one contact in an impact.
 */
typedef struct swb_impact {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * The contact; those that were left out do not count.
     */
    int64_t contact;
    /**
     * An enum swb_impact_kind.
     */
    int64_t kind;
    /**
     * 1 if other contacts had impulses at the same time.
     */
    int64_t simultaneous;
    /**
     * 1 if velocities behind it and impulses are unique.
     */
    int64_t unique;
    /**
     * Rate of the gap before.
     */
    double rate_before;
    /**
     * Rate of the gap behind.
     */
    double rate_after;
    /**
     * Normal impulse.
     */
    double normal;
    /**
     * Impulse along the first tangent.
     */
    double tangential;
    /**
     * Impulse along the second tangent.
     */
    double tangential2;
    /**
     * How far the bodies would overlap without the impact: small where the contact is grazing.
     */
    double depth;
} swb_impact;

/**
 * A point from which several solutions go on.
 */
typedef struct swb_branching {
    /**
     * Size of this struct in bytes, as the library knows it.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * [nx] state.
     */
    const double *x;
    /**
     * States.
     */
    int64_t nx;
    /**
     * Continuations.
     */
    int64_t n_continuations;
    /**
     * Modes of all subsystems that can switch, one after the other.
     */
    int64_t n_modes;
    /**
     * [n_modes] active modes before, 0 or 1.
     */
    const int32_t *before;
    /**
     * [n_continuations * n_modes] active modes of the continuations, those of one together.
     */
    const int32_t *active;
    /**
     * [n_continuations * nx] derivatives of the state, those of one continuation together.
     */
    const double *velocity;
} swb_branching;

/**
 * Called where the continuation is not unique: returns the number of the continuation to take, from 0, or a negative
 * number to stop. `branching` is valid during the call only. Must not unwind.
 */
typedef int64_t (*swb_decide_fn)(const struct swb_branching *branching, void *user_data);

/**
 * A step of an event-driven simulation.
 */
typedef struct swb_progress {
    /**
     * Size of this struct in bytes, as the library knows it.
     */
    uint64_t struct_size;
    /**
     * Time reached.
     */
    double t;
    /**
     * [nx] state reached; valid during the call only.
     */
    const double *x;
    /**
     * States.
     */
    int64_t nx;
    /**
     * An enum swb_progress_kind.
     */
    int64_t kind;
    /**
     * Steps so far, rejected ones not counted.
     */
    int64_t steps;
    /**
     * Switches so far.
     */
    int64_t switches;
} swb_progress;

/**
 * Called once per accepted step by the thread that simulates; a return other than 0 stops with the outcome
 * SWB_RUN_OUTCOME_STOPPED. `info` is valid during the call only. Must not unwind.
 */
typedef int32_t (*swb_progress_fn)(const struct swb_progress *info, void *user_data);

/**
 * Called about every hundredth of a second, between steps, by the thread that simulates, in calls that take so long; a return
 * other than 0 stops with the outcome SWB_RUN_OUTCOME_STOPPED. Must not unwind.
 */
typedef int32_t (*swb_poll_fn)(void *user_data);

/**
 * Options of a stepper; swb_step_options_init sets the defaults.
 */
typedef struct swb_step_options {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Length of a step.
     */
    double h;
    /**
     * Place in a step at which functions are evaluated: 1/2 in its middle, 1 at its start.
     */
    double theta;
    /**
     * Impulses of a step are found to this share of them, measured by energy.
     */
    double tolerance;
    /**
     * Sweeps over the contacts and steps of conjugate gradients in a step at most.
     */
    int64_t max_iterations;
    /**
     * An enum swb_impact_law, or -1 for that of the scene.
     */
    int64_t law;
    /**
     * 1: what came to rest too deep is shifted back; 0: it is not.
     */
    int64_t correct;
    /**
     * 1: every step looks at all contacts, for checks: the result is the same to the last bit.
     */
    int64_t look_at_all;
} swb_step_options;

/**
 * Counts of the steps since the state was set, and how they went.
 */
typedef struct swb_step_stats {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Steps.
     */
    int64_t steps;
    /**
     * Gaps evaluated.
     */
    int64_t gaps;
    /**
     * Bounds of gaps over boxes.
     */
    int64_t bounds;
    /**
     * Closed contacts, summed over the steps.
     */
    int64_t contacts;
    /**
     * Most contacts closed at once.
     */
    int64_t most_contacts;
    /**
     * Sweeps over the contacts.
     */
    int64_t sweeps;
    /**
     * Steps of conjugate gradients.
     */
    int64_t gradients;
    /**
     * Steps whose impulses were not found to the tolerance.
     */
    int64_t unconverged;
    /**
     * The largest relative change left in such a step.
     */
    double worst_change;
    /**
     * The deepest penetration seen, in the unit of its gap.
     */
    double penetration;
    /**
     * The contact it was at, -1 if there was none.
     */
    int64_t deepest;
} swb_step_stats;

/**
 * Options of an estimator; swb_mhe_options_init sets the defaults.
 */
typedef struct swb_mhe_options {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Iterations of Gauss and Newton per sample at most, 1 to 10000; those behind the first linearise in swb_mhe_estimate.
     */
    int64_t iterations;
    /**
     * An enum swb_rk_family for the model, or -1 for that of the problem's settings.
     */
    int64_t rk_family;
    /**
     * Stages of the method, 0 for as many as the settings say.
     */
    int64_t n_s;
    /**
     * Steps in every stage, 0 for as many as the settings have finite elements.
     */
    int64_t steps;
    /**
     * Iterations end where a step is below this share of the standard deviations of the start.
     */
    double tol;
    /**
     * Seconds that swb_mhe_estimate may take; infinite for as many as it needs.
     */
    double deadline;
} swb_mhe_options;

/**
 * Result of a preparation, a feedback or an estimate.
 */
typedef struct swb_nmpc_info {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Preparation: 1 if there is a quadratic program for the next sample.
     */
    int64_t ready;
    /**
     * Preparation: inner iterations. Estimate: iterations of Gauss and Newton.
     */
    int64_t inner;
    /**
     * Feedback and estimate: where the result comes from, an enum swb_nmpc_source.
     */
    int64_t source;
    /**
     * Feedback and estimate: how the quadratic program ended, an enum swb_nmpc_qp_status.
     */
    int64_t qp_status;
    /**
     * Feedback: changes of the active set.
     */
    int64_t qp_iterations;
    /**
     * Seconds.
     */
    double time;
} swb_nmpc_info;

/**
 * Options of a controller; swb_nmpc_options_init sets the defaults.
 */
typedef struct swb_nmpc_options {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Work done between two samples, an enum swb_nmpc_scheme.
     */
    int64_t scheme;
    /**
     * Level of an iteration by what it evaluates, an enum swb_nmpc_level: that of SWB_NMPC_SCHEME_MLI, and of the inner iterations of
     * SWB_NMPC_SCHEME_AS_RTI; levels D also say where Hessians come from.
     */
    int64_t level;
    /**
     * Inner iterations of advanced steps per sample, at most 10000.
     */
    int64_t inner;
    /**
     * How quadratic programs are solved, an enum swb_nmpc_qp.
     */
    int64_t qp_solver;
    /**
     * 1: the iterate moves by one stage at every sample; 0: it does not.
     */
    int64_t shift;
    /**
     * An enum swb_rk_family for the predictions, or -1 for that of the problem's settings.
     */
    int64_t rk_family;
    /**
     * Stages of the method, 0 for as many as the settings say.
     */
    int64_t n_s;
    /**
     * Steps in every control stage, 0 for as many as the settings have finite elements.
     */
    int64_t steps;
    /**
     * SWB_NMPC_SCHEME_ASC ends its iterations where states and controls change by less than this share of their size,
     * SWB_NMPC_SCHEME_AS_RTI where they would change by less from then on, by the estimated contraction (10.18).
     */
    double tol;
    /**
     * Seconds that swb_nmpc_feedback may take; infinite for as many as it needs.
     */
    double deadline;
    /**
     * Price per unit of violation where constraints cannot all be met; 0: a thousand times the cost of meeting them one by one.
     */
    double elastic_price;
    /**
     * Systems that switch: alternatives to the plan at most, prepared where a control moves nothing since the system sticks, and
     * other sequences of controls that choose; at most 64.
     */
    int64_t flips;
    /**
     * Systems that switch: an alternative is taken where its predicted cost is lower than that of the plan by more than this share.
     */
    double hysteresis;
    /**
     * Changes of the active set in swb_nmpc_feedback at most (SWB_NMPC_QP_STAGEWISE: Newton steps), 0 for as many as it needs. What is left of
     * them is made in the next preparation.
     */
    int64_t max_changes;
} swb_nmpc_options;

/**
 * Counts and times of a controller's own work since it was made or reset. Evaluations are counted for the whole horizon at once,
 * those of dynamics at every point of a Runge-Kutta step.
 */
typedef struct swb_nmpc_monitor {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Estimate of the linear rate of contraction (10.18), the ratio of the last two inner steps; NaN without two.
     */
    double kappa;
    /**
     * Estimate of omega/2 of (10.18); NaN without three inner steps.
     */
    double omega;
    /**
     * The last inner step, relative to the size of states and controls.
     */
    double step;
    /**
     * Distance of the last measured from the predicted state, relative to the size of the states; NaN without a prediction.
     */
    double prediction;
    /**
     * Preparations, and their seconds: of the last, of all, of the longest.
     */
    int64_t preparations;
    /**
     * Seconds of the last preparation.
     */
    double preparation_last;
    /**
     * Seconds of all preparations.
     */
    double preparation_total;
    /**
     * Seconds of the longest preparation.
     */
    double preparation_worst;
    /**
     * Feedbacks, and their seconds: of the last, of all, of the longest.
     */
    int64_t feedbacks;
    /**
     * Seconds of the last feedback.
     */
    double feedback_last;
    /**
     * Seconds of all feedbacks.
     */
    double feedback_total;
    /**
     * Seconds of the longest feedback.
     */
    double feedback_worst;
    /**
     * Values of functions.
     */
    int64_t values;
    /**
     * Jacobians.
     */
    int64_t jacobians;
    /**
     * Adjoint sweeps.
     */
    int64_t adjoints;
    /**
     * Hessians.
     */
    int64_t hessians;
    /**
     * Values in the last preparation.
     */
    int64_t last_values;
    /**
     * Jacobians in the last preparation.
     */
    int64_t last_jacobians;
    /**
     * Adjoint sweeps in the last preparation.
     */
    int64_t last_adjoints;
    /**
     * Hessians in the last preparation.
     */
    int64_t last_hessians;
    /**
     * Quadratic programs solved.
     */
    int64_t qps;
    /**
     * Iterations of all of them.
     */
    int64_t qp_iterations;
    /**
     * Linearisations whose functions had no value, or whose program was not convex.
     */
    int64_t failed_linearisations;
    /**
     * Feedbacks from the quadratic program.
     */
    int64_t from_qp;
    /**
     * Feedbacks from the program with constraints at a price.
     */
    int64_t from_soft_qp;
    /**
     * Feedbacks from the affine law, cut off.
     */
    int64_t from_tangent;
    /**
     * Feedbacks from the last plan.
     */
    int64_t from_plan;
    /**
     * Feedbacks that repeat the last control.
     */
    int64_t from_hold;
    /**
     * Systems that switch: alternatives to the plan that were prepared.
     */
    int64_t alternatives;
    /**
     * Flips that were taken.
     */
    int64_t flips;
} swb_nmpc_monitor;

/**
 * Comparison of an optimal control with a simulation of its controls: by the event-driven engine, or by finite elements of
 * another order where there are inclusions or algebraic equations. NaN from where the simulation did not get.
 */
typedef struct swb_accuracy {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * 1 if the simulation reached the end of the horizon.
     */
    int64_t reached;
    /**
     * Switches of the simulation.
     */
    int64_t n_switches;
    /**
     * Largest difference of a state at the ends of the control stages.
     */
    double worst;
    /**
     * Largest difference of a state at the end of the horizon.
     */
    double terminal;
    /**
     * Largest violation of a terminal constraint by the end of the simulation.
     */
    double terminal_violation;
    /**
     * Cost of the simulation.
     */
    double cost;
    /**
     * Cost of the solution less that of the simulation.
     */
    double cost_error;
    /**
     * Largest violation of a path constraint or of a bound of a state along the simulation, also between the points at which they are
     * imposed, in their unit; 0 where there is none.
     */
    double along_violation;
    /**
     * Its time; NaN where there is none.
     */
    double along_time;
    /**
     * Number of that path constraint, in the order in which they were added; -1 for a bound of a state, -2 where there is none.
     */
    int64_t along_constraint;
    /**
     * Row of the path constraint, or the state.
     */
    int64_t along_row;
} swb_accuracy;

/**
 * Knowledge of the point of a program. Without pairs type S says that it satisfies the conditions of Karush, Kuhn and Tucker.
 */
typedef struct swb_certificate {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Type of stationarity (enum swb_stationarity).
     */
    int64_t stationarity;
    /**
     * 1 if it is shown that there are no multipliers of a stronger type.
     */
    int64_t sharp;
    /**
     * B-stationarity (enum swb_b_stationarity).
     */
    int64_t b_stationarity;
    /**
     * Reason why questions are left open (enum swb_doubt).
     */
    int64_t doubt;
    /**
     * Pairs of which both members are zero.
     */
    int64_t biactive;
    /**
     * Smallest of their multipliers, over the largest modulus there or 1; 0 without such pairs.
     */
    double min_multiplier;
    /**
     * 1 if none of their multipliers is zero.
     */
    int64_t strict;
    /**
     * Linear programs solved.
     */
    int64_t lps;
    /**
     * Iterations in them.
     */
    int64_t lp_iterations;
    /**
     * Nodes of the searches.
     */
    int64_t nodes;
    /**
     * Verdict of the conditions of second order (enum swb_second_order). Discretised problems with modes are not asked.
     */
    int64_t second_order;
    /**
     * Active constraints and bounds whose gradients depend on those of others; 0 where the conditions of second order were not
     * looked at.
     */
    int64_t dependent;
    /**
     * No point of the program has a lower objective than this, as branch and bound has shown (option branch_work); at the solution,
     * up to rounding, where that is global. Minus infinity where nothing is shown.
     */
    double bound;
} swb_certificate;

/**
 * Optimality of an optimal control.
 */
typedef struct swb_optimality {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * enum swb_verdict.
     */
    int64_t verdict;
    /**
     * Switches that lie between two control stages, see swb_ocp_get_kink.
     */
    int64_t n_kinks;
    /**
     * Largest first-order change of the cost by one quantity within its bounds, over the size of the quantity, relative to
     * what single terms of cost and constraints change; NaN where it is not known. Up to 1e-4 counts as none.
     */
    double residual;
    /**
     * Largest share of the cost by which an answer with other choices may be cheaper; NaN where that is not known.
     */
    double gap;
} swb_optimality;

/**
 * A switch that lies between two control stages, or a surface that is touched: there the cost has a kink.
 */
typedef struct swb_kink {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * The control stage behind the switch, the number of stages at the end of the horizon; or the one in which a surface is touched.
     */
    int64_t stage;
    /**
     * Time of the switch.
     */
    double t;
    /**
     * Derivative of the cost towards a switch in the stage before, relative as the residual of swb_optimality: negative
     * where that lowers the cost, NaN where there is no such switch.
     */
    double before;
    /**
     * Derivative towards a switch in the stage behind.
     */
    double after;
    /**
     * 1 where nothing switches, but a surface is touched and left to the side the state came from: `before` is then the
     * derivative away from it, `after` that of a moment behind it; where the control turns the state back at the end of a stage,
     * on both sides, that of passing it; where the controls of the stage stay on the surface, as on u = 0 of |u|, they are those towards
     * either side. 0 otherwise.
     */
    int64_t touch;
} swb_kink;

/**
 * A transition of an optimal control.
 */
typedef struct swb_ocp_jump {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Time.
     */
    double t;
    /**
     * The transition, in the order they were added to the system.
     */
    int64_t transition;
    /**
     * The control stage it is made in, from 0.
     */
    int64_t stage;
    /**
     * 1 if its guard was beyond zero where its discrete state began, or where the control changed: it does not pass zero.
     */
    int64_t at_once;
} swb_ocp_jump;

/**
 * Result of a solve of several phases; the phases are asked for theirs, see swb_multiphase_get_phase.
 */
typedef struct swb_multiphase_info {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * An enum swb_outcome.
     */
    int64_t outcome;
    /**
     * An enum swb_polished.
     */
    int64_t polished;
    /**
     * Number of phases.
     */
    int64_t n_phases;
    /**
     * Sum of the costs of the phases; NaN unless the outcome is SWB_OUTCOME_SOLVED.
     */
    double cost;
    /**
     * Largest violation of a link.
     */
    double link_violation;
    /**
     * Largest difference of a state at the end of a phase from the simulation of its controls; NaN without one.
     */
    double error;
    /**
     * Iterations.
     */
    int64_t iterations;
    /**
     * Seconds in all.
     */
    double time_total;
} swb_multiphase_info;

/**
 * Hessian of the Lagrangian, weight times the objective plus y times the constraints: writes out [nnz], the
 * values of the entries of the pattern; comes filled with zeros. y is [m], NULL if m is 0. Returns as
 * swb_value_fn.
 */
typedef int32_t (*swb_lagrangian_fn)(const struct swb_point *at,
                                     double weight,
                                     const double *y,
                                     double *out,
                                     void *user_data);

/**
 * The linear systems of a solve: sizes, and work since the program was built.
 */
typedef struct swb_linear_stats {
    /**
     * Size of this struct in bytes.
     */
    uint64_t struct_size;
    /**
     * Order of the matrix.
     */
    int64_t n;
    /**
     * Entries of its upper triangle.
     */
    int64_t nnz_k;
    /**
     * Entries of the factor below the diagonal.
     */
    int64_t nnz_l;
    /**
     * Floating-point operations of one factorisation.
     */
    double flops;
    /**
     * Smallest modulus of a pivot of the last factorisation, of the equilibrated matrix.
     */
    double min_abs_pivot;
    /**
     * Largest one.
     */
    double max_abs_pivot;
    /**
     * Shift of the diagonal in the last factorisation, of the equilibrated matrix.
     */
    double shift;
    /**
     * Numeric factorisations.
     */
    int64_t factorisations;
    /**
     * Solutions.
     */
    int64_t solves;
    /**
     * Steps of refinement in all solutions.
     */
    int64_t refinement_steps;
    /**
     * Times the scaling was computed.
     */
    int64_t equilibrations;
} swb_linear_stats;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Message of the last call that failed on this thread; "" if none did.
 *
 * The text stays valid until the next call that fails on this thread; a successful call does not
 * change it. Never NULL.
 */
SWB_API const char *swb_last_error(void);

/**
 * Code that the user function returned, if the last failed call of this thread failed by it; else 0.
 */
SWB_API
int32_t swb_last_user_code(void);

/**
 * Copy the message of the last failed call on this thread.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL, written in any case; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short. The last error is unchanged; if there was none, it is that
 *         of this call.
 */
SWB_API
swb_status swb_last_error_copy(char *buf,
                               int64_t len,
                               int64_t *needed);

/**
 * Number of objects that were created and not freed: for tests that look for leaks. Objects of the library are found
 * through a table, so tools that search the memory for lost pointers do not miss those that were not freed.
 */
SWB_API
int64_t swb_live_objects(void);

/**
 * Say that the failure of the last call of this thread that set or added something was dealt with: the object runs without
 * what failed. Else an object for which such a call failed refuses to run, with the first error.
 *
 * Bindings that throw an exception call it there, and programs that go on after a failure. Does nothing after a success.
 */
SWB_API
void swb_error_handled(void);

/**
 * General message of a status code; "unknown status" for any other number. Never NULL, static.
 */
SWB_API const char *swb_status_string(int32_t status);

/**
 * Name of a status code, such as "SWB_ERR_NULL"; NULL for any other number. Static.
 */
SWB_API const char *swb_status_name(int32_t status);

/**
 * Version of the library, such as "0.2.0". Static.
 */
SWB_API const char *swb_version(void);

/**
 * Number of the ABI: libraries of the same number replace each other. The number in the SONAME:
 * before 1.0 the minor version, from then on 1000 times the major version.
 */
SWB_API int32_t swb_abi_version(void);

/**
 * Compares this library with the header of the given version that a program was compiled with.
 *
 * Call as swb_check_version(SWB_VERSION_MAJOR, SWB_VERSION_MINOR). Before 1.0 both numbers must be
 * equal; from then on the major ones, and the library must not be older.
 *
 * @return SWB_OK; SWB_ERR_UNSUPPORTED with both versions in the message
 */
SWB_API swb_status swb_check_version(int32_t major, int32_t minor);

/**
 * Send the settings to a log sink, one option a line, those that differ from the default at level info,
 * the others at level debug.
 *
 * @param[in] settings  NULL for the defaults
 * @param[in] log       the sink
 * @param[in] user_data passed on unchanged
 * @return SWB_OK; SWB_ERR_NULL without a sink
 */
SWB_API
swb_status swb_settings_log(const struct swb_settings *settings,
                            swb_log_fn log,
                            void *user_data);

/**
 * Fill settings with the defaults.
 *
 * @param[out] settings    every word is written
 * @param[in]  struct_size sizeof(swb_settings)
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
 */
SWB_API swb_status swb_settings_init(struct swb_settings *settings, uint64_t struct_size);

/**
 * Set an integer or enumeration option (or a float one, to an integer) by name.
 *
 * @return SWB_OK; SWB_ERR_OPTION if there is no such option (the message names the nearest one);
 *         SWB_ERR_RANGE if the value is outside the range; SWB_ERR_STATE without swb_settings_init
 */
SWB_API
swb_status swb_settings_set_int(struct swb_settings *settings,
                                const char *name,
                                int64_t value);

/**
 * Set a float option by name.
 *
 * @return as swb_settings_set_int; SWB_ERR_OPTION if the option is an integer
 */
SWB_API
swb_status swb_settings_set_double(struct swb_settings *settings,
                                   const char *name,
                                   double value);

/**
 * Set any option by name from text: a number, or the value name of an enumeration.
 *
 * @return as swb_settings_set_int; SWB_ERR_OPTION if the text is no value of the option
 */
SWB_API
swb_status swb_settings_set_string(struct swb_settings *settings,
                                   const char *name,
                                   const char *value);

/**
 * Get an integer or enumeration option by name.
 *
 * @param[in] settings NULL for the defaults
 * @return SWB_OK; SWB_ERR_OPTION if there is no such option or it is a float
 */
SWB_API
swb_status swb_settings_get_int(const struct swb_settings *settings,
                                const char *name,
                                int64_t *value);

/**
 * Get an option by name as a number.
 *
 * @param[in] settings NULL for the defaults
 * @return SWB_OK; SWB_ERR_OPTION if there is no such option
 */
SWB_API
swb_status swb_settings_get_double(const struct swb_settings *settings,
                                   const char *name,
                                   double *value);

/**
 * Get an option by name as text that reads back to the same value; enumerations as value name.
 *
 * @param[in]  settings NULL for the defaults
 * @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed   length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_OPTION if there is no such option; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_settings_get_string(const struct swb_settings *settings,
                                   const char *name,
                                   char *buf,
                                   int64_t len,
                                   int64_t *needed);

/**
 * Check every option against its range, and those that belong together.
 *
 * @return SWB_OK; SWB_ERR_RANGE with option, value and range in the message
 */
SWB_API swb_status swb_settings_validate(const struct swb_settings *settings);

/**
 * Write all options as one JSON object; enumerations as value name, infinite values as "inf".
 *
 * @param[in]  settings NULL for the defaults
 * @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed   length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_settings_to_json(const struct swb_settings *settings,
                                char *buf,
                                int64_t len,
                                int64_t *needed);

/**
 * Number of options; their indices are 0 to count - 1, in the order of the fields of swb_settings.
 */
SWB_API int64_t swb_option_count(void);

/**
 * Index of an option by name.
 *
 * @return SWB_OK; SWB_ERR_OPTION if there is no such option (the message names the nearest one)
 */
SWB_API swb_status swb_option_find(const char *name, int64_t *index);

/**
 * Name of an option; NULL if there is no such index. Static.
 */
SWB_API const char *swb_option_name(int64_t index);

/**
 * Description of an option in one sentence; NULL if there is no such index. Static.
 */
SWB_API const char *swb_option_doc(int64_t index);

/**
 * Symbol of an option in the literature, or ""; NULL if there is no such index. Static.
 */
SWB_API const char *swb_option_symbol(int64_t index);

/**
 * Name of a value of an enumeration option; NULL if there is no such value. Static.
 */
SWB_API const char *swb_option_value_name(int64_t index, int64_t value);

/**
 * Kind of an option.
 *
 * @param[out] kind an enum swb_kind
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API swb_status swb_option_kind(int64_t index, int32_t *kind);

/**
 * Range of an option. Any output may be NULL.
 *
 * @param[out] min_open 1 if min itself is not allowed
 * @param[out] max_open 1 if max itself is not allowed
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API
swb_status swb_option_range(int64_t index,
                            double *min,
                            double *max,
                            int32_t *min_open,
                            int32_t *max_open);

/**
 * Default of an option, as a number.
 *
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API swb_status swb_option_default(int64_t index, double *value);

/**
 * Tells whether an option is fixed once an object is built with it.
 *
 * @param[out] setup_only 1 if it is fixed, 0 if it may change between solves
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API swb_status swb_option_setup_only(int64_t index, int32_t *setup_only);

/**
 * Name of an outcome, such as "solved"; NULL for any other number. Static.
 */
SWB_API const char *swb_outcome_name(int32_t outcome);

/**
 * Set options of time-freezing to their defaults.
 *
 * @param[out] options     written
 * @param[in]  struct_size sizeof(swb_freeze_options)
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION for a size that cannot be
 */
SWB_API
swb_status swb_freeze_options_init(struct swb_freeze_options *options,
                                   uint64_t struct_size);

/**
 * Make a scene a piecewise smooth model in numerical time: its states get a clock, which stands still while auxiliary dynamics
 * take the velocities from one side of an impact to the other. Where the clock runs the states are those of the scene.
 *
 * @param[in]  graph   the graph of all expressions of the scene; it grows
 * @param[in]  options NULL for the defaults
 * @param[in]  at      [n_at] state of the scene where a_n and stiffness are recommended; n_at = 0 for zeros
 * @param[in]  costs   [n_costs] expressions whose integrals over physical time become states
 * @param[out] layout  where things are; may be NULL
 * @param[in]  layout_size sizeof(swb_freeze_layout); any number if layout is NULL
 * @param[out] out     the new object, NULL on failure; free with swb_model_free
 * @return SWB_OK; SWB_ERR_STATE if forces are missing or the graph is another one; SWB_ERR_RANGE for options that are not
 *         positive; SWB_ERR_UNSUPPORTED for restitution that is no number, and friction beside restitution; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_scene_freeze(struct swb_scene *scene,
                            struct swb_expr *graph,
                            const struct swb_freeze_options *options,
                            const double *at,
                            int64_t n_at,
                            const int64_t *costs,
                            int64_t n_costs,
                            struct swb_freeze_layout *layout,
                            uint64_t layout_size,
                            struct swb_model **out);

/**
 * Report on the contacts in the last call of swb_scene_freeze: strengths, the recommended ones, warnings.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before swb_scene_freeze
 */
SWB_API
swb_status swb_scene_freeze_report(const struct swb_scene *scene,
                                   char *buf,
                                   int64_t len,
                                   int64_t *needed);

/**
 * Create a function given by its values.
 *
 * Derivatives are added by swb_function_set_jacobian and swb_function_set_hessian; without them they are
 * finite differences of a function of all x, u and p that does not depend on t (swb_function_set_inputs says
 * otherwise, and fewer inputs make cheaper differences).
 *
 * @param[in]  name      used in messages, such as "f0"
 * @param[in]  value     the callback
 * @param[in]  user_data passed on to all callbacks unchanged
 * @param[in]  destroy   called with user_data when handle and models are gone; may be NULL. Not called if
 *                       this call fails.
 * @param[out] out       the new object, NULL on failure; free with swb_function_free
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if a size is negative
 */
SWB_NODISCARD SWB_API
swb_status swb_function_create(const char *name,
                               int64_t nx,
                               int64_t nu,
                               int64_t np,
                               int64_t n_out,
                               swb_value_fn value,
                               void *user_data,
                               swb_destroy_fn destroy,
                               struct swb_function **out);

/**
 * Give the Jacobian, n_out rows and a column for each of x, u, p and t.
 *
 * Entries outside the pattern are zero for the library.
 *
 * @param[in] col_ptr   [nx + nu + np + 2] where the columns start; the last one is nnz
 * @param[in] row_idx   [nnz] rows from 0, increasing within each column
 * @param[in] jacobian  NULL: the pattern alone; the values are differences
 * @return SWB_OK; SWB_ERR_DIMENSION or SWB_ERR_RANGE if this is no such pattern; SWB_ERR_STATE if the
 *         function belongs to a model already
 */
SWB_API
swb_status swb_function_set_jacobian(struct swb_function *f,
                                     const int64_t *col_ptr,
                                     int64_t n_col_ptr,
                                     const int64_t *row_idx,
                                     int64_t nnz,
                                     swb_jacobian_fn jacobian);

/**
 * Give the Hessian of the weighted sum of the outputs, upper triangle (row <= column); a row and a column
 * for each of x, u, p and t.
 *
 * @param[in] col_ptr   [nx + nu + np + 2] where the columns start; the last one is nnz
 * @param[in] row_idx   [nnz] rows from 0, increasing within each column
 * @param[in] hessian   NULL: the pattern alone; the values are differences
 * @return as swb_function_set_jacobian
 */
SWB_API
swb_status swb_function_set_hessian(struct swb_function *f,
                                    const int64_t *col_ptr,
                                    int64_t n_col_ptr,
                                    const int64_t *row_idx,
                                    int64_t nnz,
                                    swb_hessian_fn hessian);

/**
 * Say that all second derivatives vanish.
 *
 * @return SWB_OK; SWB_ERR_STATE if the function belongs to a model already
 */
SWB_API swb_status swb_function_set_linear(struct swb_function *f);

/**
 * Say which inputs the function depends on; the Jacobian is dense in them and made by differences.
 *
 * @param[in] inputs sum of enum swb_input, such as SWB_INPUT_X + SWB_INPUT_T
 * @return SWB_OK; SWB_ERR_RANGE if there are no such inputs; SWB_ERR_STATE if the function belongs to a
 *         model already
 */
SWB_API
swb_status swb_function_set_inputs(struct swb_function *f,
                                   int32_t inputs);

/**
 * Set properties of a function; those that are not given are taken back.
 *
 * @param[in] flags sum of enum swb_function_flag; 0: none
 * @return SWB_OK; SWB_ERR_RANGE if there are no such flags; SWB_ERR_STATE if the function belongs to a model already, or
 *         was made by the library
 */
SWB_API
swb_status swb_function_set_flags(struct swb_function *f,
                                  int32_t flags);

/**
 * Sizes of a function. Any output may be NULL.
 *
 * @param[out] jacobian_nnz entries of the Jacobian pattern, declared or derived
 * @param[out] hessian_nnz  entries of the Hessian pattern, declared or derived
 * @return SWB_OK
 */
SWB_API
swb_status swb_function_sizes(const struct swb_function *f,
                              int64_t *nx,
                              int64_t *nu,
                              int64_t *np,
                              int64_t *n_out,
                              int64_t *jacobian_nnz,
                              int64_t *hessian_nnz);

/**
 * Name of a function.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_function_name(const struct swb_function *f,
                             char *buf,
                             int64_t len,
                             int64_t *needed);

/**
 * Pattern of the Jacobian, declared or derived.
 *
 * @param[out] col_ptr [nx + nu + np + 2]
 * @param[out] row_idx [nnz]
 * @return SWB_OK; SWB_ERR_DIMENSION if a length is not that of the pattern
 */
SWB_API
swb_status swb_function_jacobian_pattern(const struct swb_function *f,
                                         int64_t *col_ptr,
                                         int64_t n_col_ptr,
                                         int64_t *row_idx,
                                         int64_t nnz);

/**
 * Pattern of the Hessian, upper triangle, declared or derived.
 *
 * @param[out] col_ptr [nx + nu + np + 2]
 * @param[out] row_idx [nnz]
 * @return SWB_OK; SWB_ERR_DIMENSION if a length is not that of the pattern
 */
SWB_API
swb_status swb_function_hessian_pattern(const struct swb_function *f,
                                        int64_t *col_ptr,
                                        int64_t n_col_ptr,
                                        int64_t *row_idx,
                                        int64_t nnz);

/**
 * Evaluate a function.
 *
 * @param[out] out [n_out]
 * @return SWB_OK; SWB_ERR_NONFINITE if it is not defined at the point; SWB_ERR_USER if the callback
 *         returned a negative code
 */
SWB_API
swb_status swb_function_eval(const struct swb_function *f,
                             const struct swb_point *at,
                             double *out,
                             int64_t n_out);

/**
 * Evaluate the Jacobian of a function.
 *
 * @param[out] out [nnz] values of the entries of the pattern
 * @return as swb_function_eval
 */
SWB_API
swb_status swb_function_eval_jacobian(const struct swb_function *f,
                                      const struct swb_point *at,
                                      double *out,
                                      int64_t nnz);

/**
 * Evaluate the Hessian of the weighted sum of the outputs of a function.
 *
 * @param[in]  weights [n_weights] one for each output
 * @param[out] out     [nnz] values of the entries of the pattern
 * @return as swb_function_eval
 */
SWB_API
swb_status swb_function_eval_hessian(const struct swb_function *f,
                                     const struct swb_point *at,
                                     const double *weights,
                                     int64_t n_weights,
                                     double *out,
                                     int64_t nnz);

/**
 * Compare the derivatives of a function at a point with finite differences, inside and outside the
 * declared patterns. The work grows with the square of the number of inputs, and no interrupt reaches it: for functions
 * of thousands of inputs it takes minutes, and only a negative code of a callback ends it before.
 *
 * @param[out] passed    1 if nothing disagrees; may be NULL
 * @param[out] max_error largest relative error of an entry, accepted ones included; may be NULL
 * @param[out] buf       [len] the report with its final NUL; NULL with len 0 to ask for the length only
 * @param[out] needed    length with the final NUL; may be NULL
 * @return SWB_OK, also if something disagrees; SWB_ERR_RANGE if the point is not finite;
 *         SWB_ERR_DIMENSION if the buffer is too short; else as swb_function_eval
 */
SWB_API
swb_status swb_function_check_derivatives(const struct swb_function *f,
                                          const struct swb_point *at,
                                          int32_t *passed,
                                          double *max_error,
                                          char *buf,
                                          int64_t len,
                                          int64_t *needed);

/**
 * Free the handle; models that have the function keep it. NULL is allowed.
 */
SWB_API void swb_function_free(struct swb_function *f);

/**
 * Create a function from a shared library made of C code that CasADi generated.
 *
 * A function f of CasADi has inputs named x, u, p and t, those it needs, with dense entries; the value is all its
 * outputs, one after the other, by columns. Derivatives are further functions of the library: jac_f or f_jac, as
 * f.jacobian() makes it, or one matrix with a column for each entry of the inputs; hess_f or f_hess of the inputs and
 * weights, one for each output, with the Hessian of the weighted sum, any triangle; or jac_adj1_f, as
 * f.reverse(1).jacobian() makes it. Those that are missing are finite differences. Integers may have 32 or 64 bits,
 * numbers must be double. What the library says of itself is checked; it is called once with zeros. It stays open as
 * long as the function is used. A code that is not 0 counts as not defined at the point.
 *
 * The code must be smooth: what jumps or has a kink (sign, fabs, if_else, fmin, floor ...) is stated by modes and
 * switching functions. Compiled code does not show what is inside of it; simulations notice that they chatter, solves of
 * optimal control problems take many iterations. The library must be the whole file: those that end too early are
 * refused, but a file that is damaged otherwise, or changes while it is loaded, can end the process, as with dlopen.
 *
 * @param[in]  path   of the library, as for dlopen
 * @param[in]  name   f
 * @param[in]  inputs what the inputs are, such as "x u"; NULL: they have the names x, u, p, t
 * @param[out] out    the new object, NULL on failure; free with swb_function_free
 * @return SWB_OK; SWB_ERR_LIBRARY if the library cannot be loaded or has no such function, or says of itself what
 *         cannot be; SWB_ERR_DIMENSION or SWB_ERR_RANGE if sizes or names do not fit; SWB_ERR_UNSUPPORTED for numbers
 *         that are not double
 */
SWB_NODISCARD SWB_API
swb_status swb_function_from_casadi_library(const char *path,
                                            const char *name,
                                            const char *inputs,
                                            int64_t nx,
                                            int64_t nu,
                                            int64_t np,
                                            struct swb_function **out);

/**
 * Create a function from C code that CasADi generated and that is linked to the program; as
 * swb_function_from_casadi_library.
 *
 * @param[in]  name     used in messages
 * @param[in]  value    addresses of f
 * @param[in]  jacobian addresses of jac_f, of any of the forms; NULL: finite differences
 * @param[in]  hessian  addresses of hess_f or jac_adj1_f; NULL: finite differences
 * @param[in]  inputs   what the inputs are, such as "x u"; NULL: they have the names x, u, p, t
 * @param[out] out      the new object, NULL on failure; free with swb_function_free
 * @return as swb_function_from_casadi_library
 */
SWB_NODISCARD SWB_API
swb_status swb_function_from_casadi_pointers(const char *name,
                                             const struct swb_casadi *value,
                                             const struct swb_casadi *jacobian,
                                             const struct swb_casadi *hessian,
                                             const char *inputs,
                                             int64_t nx,
                                             int64_t nu,
                                             int64_t np,
                                             struct swb_function **out);

/**
 * Create a function from a file of functions that CasADi saved, evaluated by CasADi itself: no compiler is needed. Else
 * as swb_function_from_casadi_library.
 *
 * The functions of the file stay loaded until the program ends.
 *
 * @param[in]  casadi path of CasADi's library, such as ".../casadi/libcasadi.so"
 * @param[in]  file   a list of functions, f and its derivatives, written by CasADi's FileSerializer
 * @param[in]  name   f
 * @param[in]  inputs what the inputs are, such as "x u"; NULL: they have the names x, u, p, t
 * @param[out] out    the new object, NULL on failure; free with swb_function_free
 * @return as swb_function_from_casadi_library
 */
SWB_NODISCARD SWB_API
swb_status swb_function_from_casadi_file(const char *casadi,
                                         const char *file,
                                         const char *name,
                                         const char *inputs,
                                         int64_t nx,
                                         int64_t nu,
                                         int64_t np,
                                         struct swb_function **out);

/**
 * Create a system without dynamics.
 *
 * @param[in]  nx  states, at least 1
 * @param[in]  nu  controls
 * @param[in]  np  parameters
 * @param[out] out the new object, NULL on failure; free with swb_system_free
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_NODISCARD SWB_API swb_status swb_system_create(int64_t nx, int64_t nu, int64_t np, struct swb_system **out);

/**
 * Set the part of the right-hand side that does not switch: nx outputs.
 *
 * @return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit
 */
SWB_API swb_status swb_system_set_f0(struct swb_system *system, const struct swb_function *f0);

/**
 * Add a subsystem whose regions are given by switching functions and a sign matrix: mode i is valid where
 * signs[i][j] psi_j(x) > 0 for every j with signs[i][j] != 0.
 *
 * @param[in]  rows    [n_rows] the states the modes drive
 * @param[in]  modes   n_rows * n_modes outputs: the vector fields, mode after mode
 * @param[in]  psi     switching functions, one output each
 * @param[in]  signs   [n_signs] n_modes rows with an entry -1, 0 or 1 for each switching function, row
 *                     after row
 * @param[out] index   number of the subsystem; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat or regions overlap
 */
SWB_API
swb_status swb_system_add_subsystem(struct swb_system *system,
                                    const int64_t *rows,
                                    int64_t n_rows,
                                    const struct swb_function *modes,
                                    int64_t n_modes,
                                    const struct swb_function *psi,
                                    const int8_t *signs,
                                    int64_t n_signs,
                                    int64_t *index);

/**
 * Add a subsystem whose regions are given by Stewart's indicator functions: mode i is valid where g_i(x)
 * is the smallest.
 *
 * @param[in]  rows       [n_rows] the states the modes drive
 * @param[in]  modes      n_rows * n_modes outputs: the vector fields, mode after mode
 * @param[in]  indicators g: n_modes outputs
 * @param[out] index      number of the subsystem; may be NULL
 * @return as swb_system_add_subsystem
 */
SWB_API
swb_status swb_system_add_subsystem_indicators(struct swb_system *system,
                                               const int64_t *rows,
                                               int64_t n_rows,
                                               const struct swb_function *modes,
                                               int64_t n_modes,
                                               const struct swb_function *indicators,
                                               int64_t *index);

/**
 * Add an inclusion in the steps of switching functions: f(x, alpha, u, p, t) is added to the derivatives of some
 * states, where alpha_j is 1 where psi_j > 0, 0 where psi_j < 0, and anything between where psi_j = 0. There are no
 * modes: the discretisation takes such terms in the Heaviside form, and trajectories list every switching function as
 * two modes, psi_j > 0 and psi_j < 0, behind the subsystems. Event-driven simulation does the same, behind the contacts of a
 * scene. It keeps psi_j at zero by an alpha_j between 0 and 1 that solves d psi_j / dt = 0, which need not be linear in it; where
 * several ways go on, the switch is not unique, and the option ambiguity says what follows. In a scene the row of a velocity is
 * a force, and a coordinate is driven by none. Where forces of contacts push what psi_j depends on, and f is linear in every
 * alpha_j, the weight is found with these forces: the modes are those of a contact that slides either way or sticks.
 *
 * @param[in]  rows  [n_rows] the states driven
 * @param[in]  f     n_rows outputs; it is made with as many states as the system has, plus one for each switching
 *                   function: x in front, alpha behind
 * @param[in]  psi   switching functions, one output each
 * @param[out] index number of the inclusion; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat
 */
SWB_API
swb_status swb_system_add_inclusion(struct swb_system *system,
                                    const int64_t *rows,
                                    int64_t n_rows,
                                    const struct swb_function *f,
                                    const struct swb_function *psi,
                                    int64_t *index);

/**
 * Make the last n_z states algebraic: what f0 and modes add to their rows, and the outputs of g, adds up to zero
 * instead of being a derivative. Functions see them among the states. Their initial values are guesses where the
 * smooth equations determine them. Event-driven simulation takes equations of index 1: the matrix of their derivatives by
 * the algebraic states is regular. They are solved where a run begins, behind every event and at every point of a result;
 * a run that comes to a singular matrix ends there, and says so. Modes may switch inside of the equations. Where neither of
 * two modes goes on beyond the surface between them, it is held by a weight of both, as by a relay in its own loop.
 * In a scene they are the last of the states beside coordinates and velocities. Forces and friction may depend on them, gaps and
 * constraints may not.
 * States that transitions alone change, and that stand behind all others as those of a model do, are not counted: add
 * transitions before.
 *
 * @param[in] n_z fewer than nx; 0: none
 * @param[in] g   n_z outputs; may be NULL if f0 and modes hold the equations
 * @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit
 */
SWB_API
swb_status swb_system_set_algebraic(struct swb_system *system,
                                    int64_t n_z,
                                    const struct swb_function *g);

/**
 * Add complementarity conditions 0 <= a_k, b_k >= 0, a_k b_k = 0 to the equations of algebraic states: one of both is zero,
 * and the other one is not negative, as current and voltage of an ideal diode. Linear complementarity systems have the
 * algebraic states themselves as a, and b = C x + D z + F u. Each condition is a subsystem with the modes a_k = 0 and
 * b_k = 0, in this order. Call swb_system_set_algebraic before.
 *
 * @param[in]  rows  [n_rows] algebraic states, one for each condition
 * @param[in]  a     n_rows outputs; may be NULL: the states in rows
 * @param[in]  b     n_rows outputs
 * @param[out] index number of the first subsystem; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat; SWB_ERR_STATE if a row is no
 *         algebraic state
 */
SWB_API
swb_status swb_system_add_complementarity(struct swb_system *system,
                                          const int64_t *rows,
                                          int64_t n_rows,
                                          const struct swb_function *a,
                                          const struct swb_function *b,
                                          int64_t *index);

/**
 * Sizes of a system. Any output may be NULL.
 *
 * @return SWB_OK
 */
SWB_API
swb_status swb_system_sizes(const struct swb_system *system,
                            int64_t *nx,
                            int64_t *nu,
                            int64_t *np,
                            int64_t *n_subsystems);

/**
 * Values whose zeros are the switching surfaces of a subsystem: its switching functions, or the differences
 * g_i - g_j, i < j, of its indicators, NaN where both are not the smallest two.
 *
 * @param[in]  subsystem number of the subsystem
 * @param[in]  at        the point
 * @param[out] values    [n] one for each; NULL with n 0 to ask for their number
 * @param[out] needed    their number, written in any case; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NONFINITE if a function is not defined at the point
 */
SWB_API
swb_status swb_system_surfaces(const struct swb_system *system,
                               int64_t subsystem,
                               const struct swb_point *at,
                               double *values,
                               int64_t n,
                               int64_t *needed);

/**
 * Free; objects made of the system keep what they need. NULL is allowed.
 */
SWB_API void swb_system_free(struct swb_system *system);

/**
 * Create a graph without expressions.
 *
 * @param[out] out the new object, NULL on failure; free with swb_expr_free
 * @return SWB_OK; SWB_ERR_NULL
 */
SWB_NODISCARD SWB_API swb_status swb_expr_create(struct swb_expr **out);

/**
 * Constants. Values that are not finite are refused when a function is made of them.
 *
 * @param[in]  values [n]
 * @param[out] out    [n_out] the expressions, as many as values
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_expr_constants(struct swb_expr *graph,
                              const double *values,
                              int64_t n,
                              int64_t *out,
                              int64_t n_out);

/**
 * Inputs of one block.
 *
 * @param[in]  block one value of enum swb_input
 * @param[in]  first index of the first one
 * @param[out] out   [n] the expressions
 * @return SWB_OK; SWB_ERR_RANGE if there is no such block; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_expr_inputs(struct swb_expr *graph,
                           int32_t block,
                           int64_t first,
                           int64_t *out,
                           int64_t n);

/**
 * Apply an operator element by element.
 *
 * @param[in]  op  enum swb_operator
 * @param[in]  a   [n]
 * @param[in]  b   [n]; NULL for operators of one operand
 * @param[in]  c   [n]; NULL for operators of one or two operands
 * @param[out] out [n] the expressions
 * @return SWB_OK; SWB_ERR_RANGE if there is no such operator or expression, or for a condition in the place of a
 *         value; SWB_ERR_NULL; SWB_ERR_DIMENSION if an operand is too many
 */
SWB_API
swb_status swb_expr_apply(struct swb_expr *graph,
                          int32_t op,
                          const int64_t *a,
                          const int64_t *b,
                          const int64_t *c,
                          int64_t *out,
                          int64_t n);

/**
 * Product of matrices stored by columns: a is m times k, b is k times n.
 *
 * @param[in]  a   [n_a] m * k expressions
 * @param[in]  b   [n_b] k * n expressions
 * @param[out] out [n_out] m * n expressions
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
 */
SWB_API
swb_status swb_expr_matmul(struct swb_expr *graph,
                           int64_t m,
                           int64_t k,
                           int64_t n,
                           const int64_t *a,
                           int64_t n_a,
                           const int64_t *b,
                           int64_t n_b,
                           int64_t *out,
                           int64_t n_out);

/**
 * Solution of a small linear system. The matrix is decomposed numerically where the solution is evaluated, once for
 * all right-hand sides and derivatives.
 *
 * @param[in]  matrix [n_matrix] n * n expressions by columns
 * @param[in]  rhs    [n]
 * @param[out] out    [n] the expressions
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if the matrix is singular whatever its entries are
 */
SWB_API
swb_status swb_expr_solve(struct swb_expr *graph,
                          const int64_t *matrix,
                          int64_t n_matrix,
                          const int64_t *rhs,
                          int64_t *out,
                          int64_t n);

/**
 * Unknowns of an inner problem: they stand for what swb_expr_implicit, swb_expr_inner_minimum and swb_expr_signed_distance find, and occur
 * nowhere else.
 *
 * @param[out] out [n] the expressions
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_expr_unknowns(struct swb_expr *graph,
                             int64_t *out,
                             int64_t n);

/**
 * Solution of n equations G = 0 of n unknowns, found by a damped Newton method where it is evaluated. Its derivatives are exact and of any
 * order (implicit function theorem). Where none is found the expression is not defined.
 *
 * @param[in]  equations [n] what is zero
 * @param[in]  unknowns  [n] from swb_expr_unknowns, each once
 * @param[in]  start     [n] where they are looked for, without unknowns
 * @param[out] out       [n] the expressions
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
 */
SWB_API
swb_status swb_expr_implicit(struct swb_expr *graph,
                             const int64_t *equations,
                             const int64_t *unknowns,
                             const int64_t *start,
                             int64_t *out,
                             int64_t n);

/**
 * Least value of an expression over n unknowns near a start, and where it is. Newton's method descends in every step. Derivatives are exact and
 * of any order (envelope theorem), where the second derivatives of the cost are positive definite.
 *
 * @param[in]  cost     what is least
 * @param[in]  unknowns [n] from swb_expr_unknowns, each once
 * @param[in]  start    [n] where they are looked for, without unknowns
 * @param[out] least    [1] the least value
 * @param[out] out      [n] where it is
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
 */
SWB_API
swb_status swb_expr_inner_minimum(struct swb_expr *graph,
                                  int64_t cost,
                                  const int64_t *unknowns,
                                  const int64_t *start,
                                  int64_t *least,
                                  int64_t *out,
                                  int64_t n);

/**
 * Signed distance of two strictly convex bodies A and B, and the unit normal from B to A: the largest value of d . between - support over unit
 * vectors d. It is smooth through zero, and its derivatives are exact.
 *
 * @param[in]  between   [n] the way from the origin of B to that of A
 * @param[in]  support   expression of the direction d: the support function of A at -d plus that of B at d, where the support function of a body
 *                       is the largest value of d . x over its points x from its origin; of an ellipsoid sqrt(d . S d)
 * @param[in]  direction [n] from swb_expr_unknowns: the components of d
 * @param[in]  start     [n] a first guess of the normal, such as between, without unknowns
 * @param[in]  size      a length of the order of the bodies, positive: it scales the iteration
 * @param[out] gap       [1] the signed distance
 * @param[out] normal    [n] the normal
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
 */
SWB_API
swb_status swb_expr_signed_distance(struct swb_expr *graph,
                                    const int64_t *between,
                                    int64_t support,
                                    const int64_t *direction,
                                    const int64_t *start,
                                    double size,
                                    int64_t *gap,
                                    int64_t *normal,
                                    int64_t n);

/**
 * Forces of Lagrange's equations that follow from an inertia matrix M and a potential V: with T = v' M v / 2 these are
 * -dV/dq + dT/dq - d(M v)/dq v - dM/dt v, what stands beside M v' where q' = v. Add to them what else there is.
 *
 * @param[in]  inertia   [n_inertia] n times n expressions of coordinates, parameters and time, symmetric
 * @param[in]  potential expression of the same
 * @param[in]  q         [n] the coordinates, inputs
 * @param[in]  v         [n] the velocities, inputs
 * @param[out] out       [n] the forces
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_UNSUPPORTED for operators that switch
 */
SWB_API
swb_status swb_expr_lagrangian_forces(struct swb_expr *graph,
                                      const int64_t *inertia,
                                      int64_t n_inertia,
                                      int64_t potential,
                                      const int64_t *q,
                                      const int64_t *v,
                                      int64_t *out,
                                      int64_t n);

/**
 * Values of a table.
 *
 * @param[in]  kind   enum swb_table
 * @param[in]  points [n_points] increasing
 * @param[in]  values [n_values]
 * @param[in]  a      [n] arguments
 * @param[out] out    [n] the expressions
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_expr_table(struct swb_expr *graph,
                          int32_t kind,
                          const double *points,
                          int64_t n_points,
                          const double *values,
                          int64_t n_values,
                          const int64_t *a,
                          int64_t *out,
                          int64_t n);

/**
 * Outputs of a function at expressions. Derivatives are those of the function.
 *
 * @param[in]  args [n_args] one for each input: x, u, p, then t
 * @param[out] out  [n_out] the expressions, one for each output
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
 */
SWB_API
swb_status swb_expr_call(struct swb_expr *graph,
                         const struct swb_function *f,
                         const int64_t *args,
                         int64_t n_args,
                         int64_t *out,
                         int64_t n_out);

/**
 * Jacobian of expressions as expressions, by columns; entries that vanish are the constant 0.
 *
 * @param[in]  outputs [n_outputs]
 * @param[in]  wrt     [n_wrt] inputs, each once
 * @param[out] out     [n_out] n_outputs * n_wrt expressions
 * @return SWB_OK; SWB_ERR_RANGE if wrt holds what is no input; SWB_ERR_UNSUPPORTED for operators that switch
 */
SWB_API
swb_status swb_expr_jacobian(struct swb_expr *graph,
                             const int64_t *outputs,
                             int64_t n_outputs,
                             const int64_t *wrt,
                             int64_t n_wrt,
                             int64_t *out,
                             int64_t n_out);

/**
 * An expression as text, cut where it is long.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_expr_text(struct swb_expr *graph,
                         int64_t expression,
                         char *buf,
                         int64_t len,
                         int64_t *needed);

/**
 * A function with exact derivatives. It does not need the graph any more. With one output it may have abs, min and max in it as
 * swb_ocp_set_lagrange says; others than the costs of optimal control problems refuse it then.
 *
 * @param[in]  name    used in messages, such as "f0"
 * @param[in]  outputs [n_outputs]
 * @param[out] out     the new object, NULL on failure; free with swb_function_free
 * @return SWB_OK; SWB_ERR_DIMENSION if an input is outside its block; SWB_ERR_NONFINITE for constants that are not
 *         finite; SWB_ERR_UNSUPPORTED for other operators that switch
 */
SWB_API
swb_status swb_expr_function(struct swb_expr *graph,
                             const char *name,
                             int64_t nx,
                             int64_t nu,
                             int64_t np,
                             const int64_t *outputs,
                             int64_t n_outputs,
                             struct swb_function **out);

/**
 * Free the graph; functions and models made of it stay. NULL is allowed.
 */
SWB_API void swb_expr_free(struct swb_expr *graph);

/**
 * Build a model from the derivatives of its states; operators that switch become switching functions and modes.
 *
 * The time it takes grows with the number of expressions the derivatives consist of, about ten microseconds each. There
 * may be 2097152 of them.
 *
 * @param[in]  name  used in messages
 * @param[in]  rhs   [nx] the derivative of every state
 * @param[in]  names names of states, controls and parameters, one in each line, empty lines for x[0] and so on; may be
 *                   NULL
 * @param[in]  trial where all functions should be defined, which the report says if not; may be NULL
 * @param[out] out   the new object, NULL on failure; free with swb_model_free
 * @return SWB_OK; SWB_ERR_UNSUPPORTED if too many switching functions are coupled or there are too many expressions; else
 *         as swb_expr_function
 */
SWB_NODISCARD SWB_API
swb_status swb_model_create(struct swb_expr *graph,
                            const char *name,
                            int64_t nx,
                            int64_t nu,
                            int64_t np,
                            const int64_t *rhs,
                            const char *names,
                            const struct swb_point *trial,
                            struct swb_model **out);

/**
 * The system of a model.
 *
 * @param[out] out the new object, NULL on failure; free with swb_system_free
 * @return SWB_OK; SWB_ERR_NULL
 */
SWB_NODISCARD SWB_API swb_status swb_model_system(const struct swb_model *model, struct swb_system **out);

/**
 * Sizes of the parts of a model. Any output may be NULL.
 *
 * @param[out] n_subsystems          groups of terms that switch together
 * @param[out] n_switching_functions of all subsystems
 * @param[out] n_regions             of all subsystems
 * @param[out] n_algebraic           algebraic variables at each point
 * @param[out] n_pairs               complementarity pairs at each point
 * @return SWB_OK
 */
SWB_API
swb_status swb_model_counts(const struct swb_model *model,
                            int64_t *n_subsystems,
                            int64_t *n_switching_functions,
                            int64_t *n_regions,
                            int64_t *n_algebraic,
                            int64_t *n_pairs);

/**
 * Report of a model: states, switching functions, modes, algebraic variables and pairs with where they come from, what
 * was dropped or merged and why, and what looks wrong.
 *
 * @param[in]  json   0 for text, 1 for an object of JSON
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_model_report(const struct swb_model *model,
                            int32_t json,
                            char *buf,
                            int64_t len,
                            int64_t *needed);

/**
 * C code of all functions of a model with their derivatives: f0, then modes0, psi0, modes1, ..., then guard0 and, if there is
 * one, reset0, guard1, ...
 *
 * Functions g that are called (swb_expr_call) are declared as g_value, g_jacobian, g_hessian, those that are needed, to
 * be supplied where the code is linked: the arguments are (t, x, u, p, out), of the Hessian (t, x, u, p, weights, out);
 * they write all entries, of the patterns beside the declarations, and return 0, or a code to return.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE if a function that is called has no name in C, or that of another; SWB_ERR_DIMENSION if
 *         the buffer is too short
 */
SWB_API
swb_status swb_model_write_c(const struct swb_model *model,
                             char *buf,
                             int64_t len,
                             int64_t *needed);

/**
 * Write a model as a functional mock-up unit (FMI) for model exchange and co-simulation. A copy of the shared library is in it: no compiler is
 * needed.
 *
 * Variables are the states, their derivatives, the controls (inputs) and the parameters (tunable), by their names. Models with more coupled switching
 * functions than a list of modes can hold become units for co-simulation alone.
 *
 * @param[in] path     of the file, UTF-8; its name without the ending .fmu is that of the unit, a C identifier
 * @param[in] library  path of the shared library of switchback, as dlopen or the linker has found it
 * @param[in] version  2 for FMI 2.0, 3 for FMI 3.0
 * @param[in] x0       [nx] states at the start, the discrete ones too
 * @param[in] u0       [nu] controls at the start
 * @param[in] p0       [np] parameters
 * @param[in] rtol     relative tolerance of co-simulation; importers may ask for another one
 * @param[in] atol     absolute tolerance of co-simulation
 * @param[in] duration usual length of a simulation
 * @return SWB_OK; SWB_ERR_RANGE if the name is no C identifier, a value is not finite or not positive, or a file cannot be read or written;
 *         SWB_ERR_DIMENSION; SWB_ERR_STATE if the model calls functions of the caller
 */
SWB_API
swb_status swb_model_write_fmu(const struct swb_model *model,
                               const char *path,
                               const char *library,
                               int64_t version,
                               const double *x0,
                               int64_t nx,
                               const double *u0,
                               int64_t nu,
                               const double *p0,
                               int64_t np,
                               double rtol,
                               double atol,
                               double duration);

/**
 * Free; systems made of the model stay. NULL is allowed.
 */
SWB_API void swb_model_free(struct swb_model *model);

/**
 * Say that a control chooses among values: on or off, a gear, a number of machines. Optimal control problems made of the system later search the
 * best choice of every control stage; simulations take any value.
 *
 * @param[in]  control from 0
 * @param[in]  values  [n] in any order
 * @param[in]  dwell   time for which a value holds at least once it was chosen, 0 for none. The value at the start of a horizon may be left at any
 *                     time, and the end of the horizon may cut the last one short.
 * @param[out] index   number of the choice; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE for a control that does not exist or chooses already, for values that are not finite, repeat or are none,
 *         and for a dwell time that is negative or not finite
 */
SWB_API
swb_status swb_system_add_choice(struct swb_system *system,
                                 int64_t control,
                                 const double *values,
                                 int64_t n,
                                 double dwell,
                                 int64_t *index);

/**
 * Say that a control of a model, and thereby of all systems made of it later, chooses among values; see swb_system_add_choice.
 *
 * @param[in]  control from 0
 * @param[in]  values  [n] in any order
 * @param[in]  dwell   time for which a value holds at least once it was chosen, 0 for none
 * @param[out] index   number of the choice; may be NULL
 * @return as swb_system_add_choice
 */
SWB_API
swb_status swb_model_add_choice(struct swb_model *model,
                                int64_t control,
                                const double *values,
                                int64_t n,
                                double dwell,
                                int64_t *index);

/**
 * Numbers of a trajectory.
 *
 * @param[out] info        every field is written
 * @param[in]  struct_size sizeof(swb_trajectory_info)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_trajectory_get_info(const struct swb_trajectory *trajectory,
                                   struct swb_trajectory_info *info,
                                   uint64_t struct_size);

/**
 * Times of the element boundaries.
 *
 * @param[out] t [n] n_elements + 1; none if there are no elements
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_times(const struct swb_trajectory *trajectory,
                                double *t,
                                int64_t n);

/**
 * States at the element boundaries.
 *
 * @param[out] x [n] (n_elements + 1) * nx, the states of one boundary together; none if there are no
 *               elements
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_states(const struct swb_trajectory *trajectory,
                                 double *x,
                                 int64_t n);

/**
 * Lengths of the elements.
 *
 * @param[out] h [n] n_elements
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_steps(const struct swb_trajectory *trajectory,
                                double *h,
                                int64_t n);

/**
 * Control stages the elements belong to; 0 in simulations.
 *
 * @param[out] stage [n] n_elements
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_control_stages(const struct swb_trajectory *trajectory,
                                         int64_t *stage,
                                         int64_t n);

/**
 * Numbers of modes of the subsystems that can switch.
 *
 * @param[out] n_modes [n] n_subsystems
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_modes(const struct swb_trajectory *trajectory,
                                int64_t *n_modes,
                                int64_t n);

/**
 * Active modes in the elements: one alone, or several in a sliding mode.
 *
 * @param[out] active [n] n_elements * n_modes, 0 or 1, the modes of one element together
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_active(const struct swb_trajectory *trajectory,
                                 int32_t *active,
                                 int64_t n);

/**
 * Times of the stage points.
 *
 * @param[out] t [n] n_elements * n_s
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_stage_times(const struct swb_trajectory *trajectory,
                                      double *t,
                                      int64_t n);

/**
 * States at the stage points.
 *
 * @param[out] x [n] n_elements * n_s * nx, the states of one point together
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_stage_states(const struct swb_trajectory *trajectory,
                                       double *x,
                                       int64_t n);

/**
 * Convex multipliers of the modes at the stage points; NaN where the states are those of a simulation and several modes are active.
 *
 * @param[out] theta [n] n_elements * n_s * n_modes, the multipliers of one point together
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_stage_theta(const struct swb_trajectory *trajectory,
                                      double *theta,
                                      int64_t n);

/**
 * Switches in the order of time.
 *
 * @param[out] switches    [n] n_switches
 * @param[in]  struct_size sizeof(swb_switch)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_trajectory_switches(const struct swb_trajectory *trajectory,
                                   struct swb_switch *switches,
                                   int64_t n,
                                   uint64_t struct_size);

/**
 * States at any times, by the polynomials of the elements.
 *
 * @param[in]  t [n_t] between start and end, in any order
 * @param[out] x [n_x] n_t * nx, the states of one time together
 * @return SWB_OK; SWB_ERR_RANGE if a time is outside; SWB_ERR_STATE if the trajectory is empty
 */
SWB_API
swb_status swb_trajectory_state_at(const struct swb_trajectory *trajectory,
                                   const double *t,
                                   int64_t n_t,
                                   double *x,
                                   int64_t n_x);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_trajectory_free(struct swb_trajectory *trajectory);

/**
 * Create a simulator. Time, state, controls and parameters are zero until they are set.
 *
 * @param[in]  system   copied; may be freed afterwards
 * @param[in]  settings NULL for the defaults
 * @param[out] out      the new object, NULL on failure; free with swb_simulator_free
 * @return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if an option is outside its
 *         range; SWB_ERR_UNSUPPORTED if options do not go together
 */
SWB_NODISCARD SWB_API
swb_status swb_simulator_create(const struct swb_system *system,
                                const struct swb_settings *settings,
                                struct swb_simulator **out);

/**
 * Set time and state, and begin a new trajectory.
 *
 * @param[in] x [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API
swb_status swb_simulator_set_state(struct swb_simulator *sim,
                                   double t,
                                   const double *x,
                                   int64_t nx);

/**
 * Set the controls, constant from now on.
 *
 * @param[in] u [nu]
 * @return as swb_simulator_set_state
 */
SWB_API
swb_status swb_simulator_set_controls(struct swb_simulator *sim,
                                      const double *u,
                                      int64_t nu);

/**
 * Set the parameters.
 *
 * @param[in] p [np]
 * @return as swb_simulator_set_state
 */
SWB_API swb_status swb_simulator_set_params(struct swb_simulator *sim, const double *p, int64_t np);

/**
 * Simulate over a duration in equal steps of n_fe finite elements each, from where the last call ended;
 * the trajectory grows. It ends early where a step fails; time, state and trajectory are then those of
 * the last step that was done.
 *
 * @param[out] outcome an enum swb_outcome: solved, or that of the step that failed; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_USER if a user function returned a negative code;
 *         SWB_ERR_NONFINITE if one has no value where it is needed
 */
SWB_NODISCARD SWB_API
swb_status swb_simulator_run(struct swb_simulator *sim,
                             double duration,
                             int64_t n_steps,
                             int32_t *outcome);

/**
 * Simulate one step of n_fe finite elements over the duration h; the trajectory grows.
 *
 * @param[out] outcome an enum swb_outcome; may be NULL
 * @return as swb_simulator_run
 */
SWB_NODISCARD SWB_API swb_status swb_simulator_step(struct swb_simulator *sim, double h, int32_t *outcome);

/**
 * Forget trajectory and statistics; time and state stay.
 *
 * @return SWB_OK
 */
SWB_API swb_status swb_simulator_clear(struct swb_simulator *sim);

/**
 * Sizes of a simulator.
 *
 * @param[out] nx states; may be NULL
 * @param[out] nu controls; may be NULL
 * @param[out] np parameters; may be NULL
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_simulator_sizes(const struct swb_simulator *sim,
                               int64_t *nx,
                               int64_t *nu,
                               int64_t *np);

/**
 * Time reached.
 *
 * @return SWB_OK
 */
SWB_API swb_status swb_simulator_get_time(const struct swb_simulator *sim, double *t);

/**
 * State reached.
 *
 * @param[out] x [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API swb_status swb_simulator_get_state(const struct swb_simulator *sim, double *x, int64_t nx);

/**
 * How the last step ended.
 *
 * @param[out] outcome an enum swb_outcome; solved before the first step
 * @return SWB_OK
 */
SWB_API swb_status swb_simulator_get_outcome(const struct swb_simulator *sim, int32_t *outcome);

/**
 * Largest residuals over the steps of the trajectory.
 *
 * @param[out] residuals   every field is written
 * @param[in]  struct_size sizeof(swb_residuals)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_simulator_get_residuals(const struct swb_simulator *sim,
                                       struct swb_residuals *residuals,
                                       uint64_t struct_size);

/**
 * Work and time of the steps of the trajectory.
 *
 * @param[out] stats       every field is written
 * @param[in]  struct_size sizeof(swb_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_simulator_get_stats(const struct swb_simulator *sim,
                                   struct swb_stats *stats,
                                   uint64_t struct_size);

/**
 * A copy of the trajectory since the state was set; empty before the first step.
 *
 * @param[out] out the new object, NULL on failure; free with swb_trajectory_free
 * @return SWB_OK
 */
SWB_API
swb_status swb_simulator_get_trajectory(const struct swb_simulator *sim,
                                        struct swb_trajectory **out);

/**
 * Set an integer or enumeration option of a simulator (or a float one, to an integer) by name.
 *
 * @return as swb_settings_set_int
 */
SWB_API
swb_status swb_simulator_set_int(struct swb_simulator *sim,
                                 const char *name,
                                 int64_t value);

/**
 * Set a float option of a simulator by name.
 *
 * @return as swb_settings_set_double
 */
SWB_API
swb_status swb_simulator_set_double(struct swb_simulator *sim,
                                    const char *name,
                                    double value);

/**
 * Set any option of a simulator by name from text: a number, or the value name of an enumeration.
 *
 * @return as swb_settings_set_string
 */
SWB_API
swb_status swb_simulator_set_string(struct swb_simulator *sim,
                                    const char *name,
                                    const char *value);

/**
 * Set all options of a simulator.
 *
 * @param[in] settings NULL for the defaults
 * @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
 */
SWB_API
swb_status swb_simulator_set_settings(struct swb_simulator *sim,
                                      const struct swb_settings *settings);

/**
 * Options of a simulator, all of them.
 *
 * @param[out] settings    every field is written
 * @param[in]  struct_size sizeof(swb_settings)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_simulator_get_settings(const struct swb_simulator *sim,
                                      struct swb_settings *settings,
                                      uint64_t struct_size);

/**
 * Set who is called once per iteration; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_simulator_set_iteration(struct swb_simulator *sim,
                                       swb_iteration_fn iteration,
                                       void *user_data);

/**
 * Set who gets the log, as much as the option log_level says; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_simulator_set_log(struct swb_simulator *sim,
                                 swb_log_fn log,
                                 void *user_data);

/**
 * Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
 * thread and from signal handlers; only swb_simulator_free must not run at the same time. It is heeded in every phase, before the
 * next evaluation of a model function and before the next factorisation: the call ends within the time of one of
 * these, a model function that takes long itself is waited for. What was found before stays the answer.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_simulator_interrupt(const struct swb_simulator *sim);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_simulator_free(struct swb_simulator *sim);

/**
 * Name of an outcome of an event-driven simulation, such as "reached"; NULL for any other number. Static.
 */
SWB_API
const char *swb_run_outcome_name(int32_t outcome);

/**
 * Numbers of a run.
 *
 * @param[out] info        every field is written
 * @param[in]  struct_size sizeof(swb_run_info)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_get_info(const struct swb_run *run,
                            struct swb_run_info *info,
                            uint64_t struct_size);

/**
 * Why a run ended early, in words; if it reached its time, what is not known to the tolerances, or "".
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL, written in any case; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_run_reason(const struct swb_run *run,
                          char *buf,
                          int64_t len,
                          int64_t *needed);

/**
 * Work of a run.
 *
 * @param[out] stats       every field is written
 * @param[in]  struct_size sizeof(swb_run_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_get_stats(const struct swb_run *run,
                             struct swb_run_stats *stats,
                             uint64_t struct_size);

/**
 * State reached.
 *
 * @param[out] x [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API swb_status swb_run_state(const struct swb_run *run, double *x, int64_t nx);

/**
 * Switches in the order of time.
 *
 * @param[out] events      [n] n_events
 * @param[in]  struct_size sizeof(swb_event)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_events(const struct swb_run *run,
                          struct swb_event *events,
                          int64_t n,
                          uint64_t struct_size);

/**
 * Points with several continuations, in the order of time.
 *
 * @param[out] points      [n] n_branch_points
 * @param[in]  struct_size sizeof(swb_branch_point)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_branch_points(const struct swb_run *run,
                                 struct swb_branch_point *points,
                                 int64_t n,
                                 uint64_t struct_size);

/**
 * Surfaces only touched, in the order of time.
 *
 * @param[out] contacts    [n] n_contacts
 * @param[in]  struct_size sizeof(swb_contact)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_contacts(const struct swb_run *run,
                            struct swb_contact *contacts,
                            int64_t n,
                            uint64_t struct_size);

/**
 * Accumulating switches, in the order of time.
 *
 * @param[out] points      [n] n_accumulations
 * @param[in]  struct_size sizeof(swb_accumulation)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_accumulations(const struct swb_run *run,
                                 struct swb_accumulation *points,
                                 int64_t n,
                                 uint64_t struct_size);

/**
 * Numbers of modes of the subsystems that can switch.
 *
 * @param[out] n_modes [n] n_subsystems
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API swb_status swb_run_modes(const struct swb_run *run, int64_t *n_modes, int64_t n);

/**
 * Active modes of its subsystem before and after a switch.
 *
 * @param[in]  index  the switch, from 0
 * @param[out] before [n] 0 or 1 for each mode of the subsystem
 * @param[out] after  [n] the same
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_event_modes(const struct swb_run *run,
                               int64_t index,
                               int32_t *before,
                               int32_t *after,
                               int64_t n);

/**
 * Derivatives of the state reached with respect to initial states, parameters and controls, the latter changed by the
 * same amount over the whole run.
 *
 * With the option sensitivity at inputs those of the initial states are left out; of a model that has neither parameters nor
 * controls no columns remain.
 *
 * @param[out] s [n] nx * n_columns, by columns: those of the initial states, then of the parameters, then of the controls
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without the option sensitivity
 */
SWB_API
swb_status swb_run_sensitivity(const struct swb_run *run,
                               double *s,
                               int64_t n);

/**
 * Derivatives of the time of a switch with respect to initial states, parameters and controls. NaN where the time has
 * none.
 *
 * @param[in]  index the switch, from 0
 * @param[out] dt    [n] n_columns
 * @return as swb_run_sensitivity
 */
SWB_API
swb_status swb_run_event_sensitivity(const struct swb_run *run,
                                     int64_t index,
                                     double *dt,
                                     int64_t n);

/**
 * Times between which the dense output has a polynomial each: starts and ends of the steps.
 *
 * @param[out] t [n] n_pieces + 1; none if there are no pieces
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API swb_status swb_run_times(const struct swb_run *run, double *t, int64_t n);

/**
 * States at any times of the run, or their derivatives with respect to time. At a switch the piece before it counts.
 *
 * @param[in]  t [n_t] between start and end, in any order
 * @param[in]  k order of the derivative, 0 for the state
 * @param[out] x [n_x] n_t * nx, the values of one time together
 * @return SWB_OK; SWB_ERR_RANGE if a time is outside or k is negative; SWB_ERR_STATE without the option dense
 */
SWB_API
swb_status swb_run_evaluate(const struct swb_run *run,
                            const double *t,
                            int64_t n_t,
                            int64_t k,
                            double *x,
                            int64_t n_x);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_run_free(struct swb_run *run);

/**
 * Add a transition: where the guard passes zero in its direction while the discrete states are as `from` says, the state
 * becomes what reset makes of it, and the discrete states become as `to` says.
 *
 * A discrete state is a state that a transition names in `from` or `to`; its derivative must be zero. Only the event-driven
 * simulation follows transitions. A guard that is beyond zero, or at zero and on its way, when the discrete states become as
 * `from` says, acts at once: at the start and after a change of controls or parameters, too. Of several at one time the first
 * that was added is made first, and the others if they still hold; 64 at one time end the run. A transition that leaves its
 * own guard beyond zero is watched again when the guard has been back.
 *
 * @param[in]  guard       one output
 * @param[in]  direction   enum swb_direction
 * @param[in]  from_states [n_from_states] discrete states that must have the values
 * @param[in]  from_values [n_from_values] for the transition to be watched; none: always
 * @param[in]  reset       nx outputs, the state behind the transition; NULL: the state before it
 * @param[in]  to_states   [n_to_states] discrete states that get the values
 * @param[in]  to_values   [n_to_values] behind the reset
 * @param[out] index       number of the transition; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if states do not exist or repeat, or for an unknown
 *         direction; SWB_ERR_STATE if nothing changes
 */
SWB_API
swb_status swb_system_add_transition(struct swb_system *system,
                                     const struct swb_function *guard,
                                     int32_t direction,
                                     const int64_t *from_states,
                                     int64_t n_from_states,
                                     const double *from_values,
                                     int64_t n_from_values,
                                     const struct swb_function *reset,
                                     const int64_t *to_states,
                                     int64_t n_to_states,
                                     const double *to_values,
                                     int64_t n_to_values,
                                     int64_t *index);

/**
 * Add a transition with a name, an effect and a trigger; the rest is that of swb_system_add_transition.
 *
 * What notes or stops changes nothing: it has neither reset nor `to`. Where the run ends, derivatives are those of the last state with the time
 * of its end.
 *
 * @param[in]  name        in results and reports, one line; NULL or "" for none
 * @param[in]  effect      enum swb_effect
 * @param[in]  trigger     enum swb_trigger
 * @param[in]  guard       one output
 * @param[in]  direction   enum swb_direction
 * @param[in]  from_states [n_from_states] discrete states that must have the values
 * @param[in]  from_values [n_from_values] for the transition to be watched; none: always
 * @param[in]  reset       nx outputs, the state behind the transition; NULL: the state before it
 * @param[in]  to_states   [n_to_states] discrete states that get the values
 * @param[in]  to_values   [n_to_values] behind the reset
 * @param[out] index       number of the transition; may be NULL
 * @return as swb_system_add_transition; SWB_ERR_RANGE for unknown effects and triggers and for a name that is there already; SWB_ERR_STATE if
 *         what notes or stops changes the state, or has the trigger level
 */
SWB_API
swb_status swb_system_add_event(struct swb_system *system,
                                const char *name,
                                int32_t effect,
                                int32_t trigger,
                                const struct swb_function *guard,
                                int32_t direction,
                                const int64_t *from_states,
                                int64_t n_from_states,
                                const double *from_values,
                                int64_t n_from_values,
                                const struct swb_function *reset,
                                const int64_t *to_states,
                                int64_t n_to_states,
                                const double *to_values,
                                int64_t n_to_values,
                                int64_t *index);

/**
 * Add times at which functions of a system are not smooth, such as the knots of a table of time. Event-driven simulation ends its steps there, and
 * begins anew where the right-hand side jumps. Tables in models say these times themselves.
 *
 * @param[in] t     [n_t] in any order
 * @param[in] jumps [n_jumps] as many: 1 where the right-hand side jumps, else 0
 * @return SWB_OK; SWB_ERR_DIMENSION if the lengths differ; SWB_ERR_RANGE for times that are not finite
 */
SWB_API
swb_status swb_system_add_known_times(struct swb_system *system,
                                      const double *t,
                                      int64_t n_t,
                                      const int32_t *jumps,
                                      int64_t n_jumps);

/**
 * What was noted in the order of time; the number is n_notes of swb_run_info.
 *
 * @param[out] notes       [n] n_notes
 * @param[in]  struct_size sizeof(swb_note)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_notes(const struct swb_run *run,
                         struct swb_note *notes,
                         int64_t n,
                         uint64_t struct_size);

/**
 * The state at a note.
 *
 * @param[in]  index its place in swb_run_notes, from 0
 * @param[out] x     [n] nx
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_note_state(const struct swb_run *run,
                              int64_t index,
                              double *x,
                              int64_t n);

/**
 * Derivatives of the time of a note with respect to initial states, parameters and controls; NaN in an implicit step.
 *
 * @param[in]  index its place in swb_run_notes, from 0
 * @param[out] dt    [n] n_columns
 * @return as swb_run_sensitivity
 */
SWB_API
swb_status swb_run_note_sensitivity(const struct swb_run *run,
                                    int64_t index,
                                    double *dt,
                                    int64_t n);

/**
 * The transitions of a run in the order they were made; their number is n_jumps of swb_run_info.
 *
 * @param[out] jumps       [n] n_jumps
 * @param[in]  struct_size sizeof(swb_jump)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_jumps(const struct swb_run *run,
                         struct swb_jump *jumps,
                         int64_t n,
                         uint64_t struct_size);

/**
 * The states just before and just behind a transition. Where a system of many units is not stopped for what happens in one, those that the
 * transition does not name are NaN: dense output knows them.
 *
 * @param[in]  index  its place in swb_run_jumps, from 0
 * @param[out] before [n] nx
 * @param[out] after  [n] nx
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_jump_states(const struct swb_run *run,
                               int64_t index,
                               double *before,
                               double *after,
                               int64_t n);

/**
 * Derivatives of the time of a transition with respect to initial states, parameters and controls.
 *
 * @param[in]  index its place in swb_run_jumps, from 0
 * @param[out] dt    [n] n_columns
 * @return as swb_run_sensitivity
 */
SWB_API
swb_status swb_run_jump_sensitivity(const struct swb_run *run,
                                    int64_t index,
                                    double *dt,
                                    int64_t n);

/**
 * Create a scene without forces and contacts: the inertia is the unit matrix, and where there are as many coordinates as
 * velocities the rates of the coordinates are the velocities.
 *
 * @param[in]  name  for messages
 * @param[in]  n_q   coordinates
 * @param[in]  n_v   velocities
 * @param[in]  nu    controls
 * @param[in]  np    parameters
 * @param[in]  names of coordinates, velocities, controls and parameters, one per line, for messages; may be NULL
 * @param[out] out   the new object, NULL on failure; free with swb_scene_free
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_NODISCARD SWB_API
swb_status swb_scene_create(const char *name,
                            int64_t n_q,
                            int64_t n_v,
                            int64_t nu,
                            int64_t np,
                            const char *names,
                            struct swb_scene **out);

/**
 * Create a scene that has states z beside coordinates and velocities, z' = h(q, v, z, u, p, t): currents of motors, controllers,
 * temperatures. Forces and the bounds of friction at joints may depend on them. They stand behind the velocities among the states.
 *
 * @param[in]  name  for messages
 * @param[in]  n_q   coordinates
 * @param[in]  n_v   velocities
 * @param[in]  n_z   states beside these
 * @param[in]  nu    controls
 * @param[in]  np    parameters
 * @param[in]  names of coordinates, velocities, other states, controls and parameters, one per line, for messages; may be NULL
 * @param[out] out   the new object, NULL on failure; free with swb_scene_free
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_NODISCARD SWB_API
swb_status swb_scene_create_with_states(const char *name,
                                        int64_t n_q,
                                        int64_t n_v,
                                        int64_t n_z,
                                        int64_t nu,
                                        int64_t np,
                                        const char *names,
                                        struct swb_scene **out);

/**
 * Create a projected system, or first-order sweeping process, without right-hand side and constraints:
 * x' = f(x, u, p, t) + sum of the gradients of c_i(x, p, t) times multipliers, 0 <= multiplier, c_i >= 0, one of them zero.
 *
 * It is a scene whose states are in the place of velocities: swb_scene_set_force sets f, swb_scene_add_contact adds a
 * constraint c_i, without tangents, friction and restitution; multipliers are the forces in the results.
 *
 * @param[in]  name  for messages
 * @param[in]  nx    states
 * @param[in]  nu    controls
 * @param[in]  np    parameters
 * @param[in]  names of states, controls and parameters, one per line, for messages; may be NULL
 * @param[out] out   the new object, NULL on failure; free with swb_scene_free
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_NODISCARD SWB_API
swb_status swb_scene_create_projected(const char *name,
                                      int64_t nx,
                                      int64_t nu,
                                      int64_t np,
                                      const char *names,
                                      struct swb_scene **out);

/**
 * Set the rates of the coordinates, linear in the velocities: q' = N(q) v.
 *
 * @param[in] graph the graph of the expressions
 * @param[in] rates [n] n_q expressions
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE for numbers that are no expressions
 */
SWB_API
swb_status swb_scene_set_rates(struct swb_scene *scene,
                               const struct swb_expr *graph,
                               const int64_t *rates,
                               int64_t n);

/**
 * Set the inertia matrix M: symmetric and positive definite; it may depend on coordinates, parameters and time.
 *
 * @param[in] graph   the graph of the expressions
 * @param[in] entries [n] n_v times n_v expressions
 * @return as swb_scene_set_rates
 */
SWB_API
swb_status swb_scene_set_inertia(struct swb_scene *scene,
                                 const struct swb_expr *graph,
                                 const int64_t *entries,
                                 int64_t n);

/**
 * Set the forces f_v(q, v, u, p, t): all that stands beside M v' but contact forces. They may switch; switches are listed behind the contacts.
 *
 * @param[in] graph the graph of the expressions
 * @param[in] force [n] n_v expressions
 * @return as swb_scene_set_rates
 */
SWB_API
swb_status swb_scene_set_force(struct swb_scene *scene,
                               const struct swb_expr *graph,
                               const int64_t *force,
                               int64_t n);

/**
 * Set the rates of the states beside coordinates and velocities, expressions of states, controls, parameters and time, which may switch.
 *
 * @param[in] graph the graph of the expressions
 * @param[in] rates [n] n_z expressions
 * @return as swb_scene_set_rates
 */
SWB_API
swb_status swb_scene_set_state_rates(struct swb_scene *scene,
                                     const struct swb_expr *graph,
                                     const int64_t *rates,
                                     int64_t n);

/**
 * Add a contact.
 *
 * @param[in]  graph       the graph of the expressions
 * @param[in]  name        of its own, for messages and results
 * @param[in]  gap         expression of coordinates, parameters and time, positive where the bodies are apart; with friction a
 *                         length
 * @param[in]  tangents    [n_tangents] no, one (in the plane) or two (in space) expressions whose rates are the sliding
 *                         velocity, or which are its components, linear in the velocities
 * @param[in]  friction    expression, coefficient of friction; -1: none
 * @param[in]  restitution expression, coefficient of restitution between 0 and 1; -1: 0
 * @param[out] index       number of the contact; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or too many tangents; SWB_ERR_STATE for a name or a gap
 *         that is there already
 */
SWB_API
swb_status swb_scene_add_contact(struct swb_scene *scene,
                                 struct swb_expr *graph,
                                 const char *name,
                                 int64_t gap,
                                 const int64_t *tangents,
                                 int64_t n_tangents,
                                 int64_t friction,
                                 int64_t restitution,
                                 int64_t *index);

/**
 * Set the coefficient of friction by which a contact sticks, where it is larger than that by which it slides. Impacts know the
 * coefficient of sliding only.
 *
 * @param[in] graph    the graph of the expressions
 * @param[in] contact  its number, one with tangents
 * @param[in] stiction expression of coordinates, parameters and time, not less than the friction of the contact
 * @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or no contact with tangents
 */
SWB_API
swb_status swb_scene_set_stiction(struct swb_scene *scene,
                                  const struct swb_expr *graph,
                                  int64_t contact,
                                  int64_t stiction);

/**
 * Give a lower bound of the gap of a contact. Contacts with the same expression are not looked at while it is positive, as those of two bodies
 * that are far apart: for scenes with very many contacts. Nothing checks that the gap is not less; a contact may be missed where it is.
 *
 * @param[in] graph      the graph of the expressions
 * @param[in] contact    its number
 * @param[in] separation expression of coordinates, parameters and time: of two bodies the distance of spheres around them
 * @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or no contact
 */
SWB_API
swb_status swb_scene_set_separation(struct swb_scene *scene,
                                    const struct swb_expr *graph,
                                    int64_t contact,
                                    int64_t separation);

/**
 * Add dry friction at a joint: a force opposite to a sliding velocity, with a bound that is given. It is counted among the
 * contacts, and in results its force stands at the first tangent, behind a zero in the place of the normal force.
 *
 * @param[in]  graph    the graph of the expressions
 * @param[in]  name     of its own, for messages and results
 * @param[in]  sliding  expression of coordinates, parameters and time whose rate is the sliding velocity, or which is that
 *                      velocity, linear in the velocities
 * @param[in]  bound    expression of states, controls, parameters and time, not negative: the force where it slides
 * @param[in]  stiction expression like bound, not less than it: what holds where it sticks; -1: the same
 * @param[out] index    number among the contacts; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions; SWB_ERR_STATE for a name that is there already;
 *         SWB_ERR_UNSUPPORTED for projected systems
 */
SWB_API
swb_status swb_scene_add_friction(struct swb_scene *scene,
                                  const struct swb_expr *graph,
                                  const char *name,
                                  int64_t sliding,
                                  int64_t bound,
                                  int64_t stiction,
                                  int64_t *index);

/**
 * Add a constraint: a contact that never opens, whose force has either sign. The state at the start must satisfy it, and its rate.
 * It is counted among the contacts.
 *
 * @param[in]  graph the graph of the expressions
 * @param[in]  name  of its own, for messages and results
 * @param[in]  zero  expression of coordinates, parameters and time that is zero; or one that contains velocities, linear in them
 * @param[out] index number among the contacts; may be NULL
 * @return as swb_scene_add_friction
 */
SWB_API
swb_status swb_scene_add_constraint(struct swb_scene *scene,
                                    const struct swb_expr *graph,
                                    const char *name,
                                    int64_t zero,
                                    int64_t *index);

/**
 * State that a coordinate stays between bounds: contacts that cannot close there are left out when the scene is built, with a
 * proof in the report. A simulation that leaves the bounds ends with an error if something was left out for them.
 *
 * @param[in] coordinate from 0
 * @param[in] low        lower bound, -INFINITY if none is known
 * @param[in] high       upper bound, INFINITY if none is known
 * @return SWB_OK; SWB_ERR_RANGE if there is no such coordinate, or a bound is NaN, or no number is between the bounds
 */
SWB_API
swb_status swb_scene_set_bounds(struct swb_scene *scene,
                                int64_t coordinate,
                                double low,
                                double high);

/**
 * Set what happens where several contacts close at once.
 *
 * @param[in] law enum swb_impact_law
 * @return SWB_OK; SWB_ERR_RANGE
 */
SWB_API swb_status swb_scene_set_impact_law(struct swb_scene *scene, int32_t law);

/**
 * Build the scene: derivatives, normals, and which contacts cannot close. Any change needs another call.
 *
 * @param[in] graph the graph of all expressions of the scene; it grows
 * @return SWB_OK; SWB_ERR_STATE if forces are missing; SWB_ERR_RANGE, SWB_ERR_UNSUPPORTED for expressions that do not fit,
 *         with a message that names them
 */
SWB_NODISCARD SWB_API
swb_status swb_scene_build(struct swb_scene *scene,
                           struct swb_expr *graph);

/**
 * The system of a scene that is built; its states are the coordinates, then the velocities. Simulate it event-driven.
 *
 * @param[out] out the new object, NULL on failure; free with swb_system_free
 * @return SWB_OK; SWB_ERR_STATE if the scene is not built
 */
SWB_NODISCARD SWB_API
swb_status swb_scene_system(const struct swb_scene *scene,
                            struct swb_system **out);

/**
 * Report of a scene that is built: contacts with what they cost, and which were left out and why.
 *
 * @param[in]  json   0 for text, 1 for an object of JSON
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE if the scene is not built
 */
SWB_API
swb_status swb_scene_report(const struct swb_scene *scene,
                            int32_t json,
                            char *buf,
                            int64_t len,
                            int64_t *needed);

/**
 * Free; systems made of the scene stay. NULL is allowed.
 */
SWB_API void swb_scene_free(struct swb_scene *scene);

/**
 * The impacts of a run in the order they happened; their number is n_impacts of swb_run_info.
 *
 * @param[out] impacts     [n] n_impacts
 * @param[in]  struct_size sizeof(swb_impact)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_run_impacts(const struct swb_run *run,
                           struct swb_impact *impacts,
                           int64_t n,
                           uint64_t struct_size);

/**
 * Derivatives of the time of an impact with respect to initial states, parameters and controls.
 *
 * @param[in]  index its place in swb_run_impacts, from 0
 * @param[out] dt    [n] n_columns
 * @return as swb_run_sensitivity
 */
SWB_API
swb_status swb_run_impact_sensitivity(const struct swb_run *run,
                                      int64_t index,
                                      double *dt,
                                      int64_t n);

/**
 * Modes of the contacts of a scene at times.
 *
 * @param[in]  t     [n_t] times; at the time of an event the modes are those before it
 * @param[out] modes [n] n_t times n_scene_contacts, enum swb_contact_mode, those of the first time first
 * @return SWB_OK; SWB_ERR_STATE if the run is not that of a scene; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_contact_modes(const struct swb_run *run,
                                 const double *t,
                                 int64_t n_t,
                                 int64_t *modes,
                                 int64_t n);

/**
 * Forces of the contacts of a scene at times: forces, not impulses. Other times than the end need the option dense.
 *
 * @param[in]  t      [n_t] times within the run
 * @param[out] forces [n] n_t times n_scene_contacts times 3: the normal force and those along the tangents, zero where the
 *                    contact is open or has no tangents; of dry friction at a joint zero and the friction; of a switch zero and
 *                    its weight, 1, -1 or between; the contacts of the first time first
 * @return SWB_OK; SWB_ERR_STATE if the run is not that of a scene, or for want of dense output; SWB_ERR_RANGE for times
 *         outside; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_run_contact_forces(const struct swb_run *run,
                                  const double *t,
                                  int64_t n_t,
                                  double *forces,
                                  int64_t n);

/**
 * Add a discrete state to a scene, behind all its states: only transitions change it. Its rate is zero, and is none of those of
 * swb_scene_set_state_rates. Simulations start where they are told to.
 *
 * @param[in]  name    for messages; NULL or "" for none
 * @param[in]  initial what it begins with where bindings are not told otherwise
 * @param[out] state   its place among the states; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE for a value that is not finite
 */
SWB_API
swb_status swb_scene_add_discrete(struct swb_scene *scene,
                                  const char *name,
                                  double initial,
                                  int64_t *state);

/**
 * Add a transition to a scene: as swb_model_add_event, with the states of the scene. What is wrong with it is said by swb_scene_build.
 *
 * A reset may move bodies. Contacts, impacts and friction follow from the new state; bodies that overlap behind it, constraints
 * that it leaves, and states of a projected system outside of their set end the run.
 *
 * @param[in]  graph         the graph of the expressions
 * @param[in]  name          in results and reports, one line; NULL or "" for none
 * @param[in]  effect        enum swb_effect
 * @param[in]  trigger       enum swb_trigger
 * @param[in]  guard         an expression or a condition
 * @param[in]  direction     enum swb_direction
 * @param[in]  from_states   [n_from_states] discrete states that must have the values
 * @param[in]  from_values   [n_from_values] for the transition to be watched; none: always
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the transition; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions, and unknown directions, effects and triggers; SWB_ERR_DIMENSION where
 *         lists do not belong together; SWB_ERR_STATE for expressions of another graph
 */
SWB_API
swb_status swb_scene_add_event(struct swb_scene *scene,
                               const struct swb_expr *graph,
                               const char *name,
                               int32_t effect,
                               int32_t trigger,
                               int64_t guard,
                               int32_t direction,
                               const int64_t *from_states,
                               int64_t n_from_states,
                               const double *from_values,
                               int64_t n_from_values,
                               const int64_t *reset_states,
                               int64_t n_reset_states,
                               const int64_t *resets,
                               int64_t n_resets,
                               const int64_t *to_states,
                               int64_t n_to_states,
                               const double *to_values,
                               int64_t n_to_values,
                               int64_t *index);

/**
 * Add a clock to a scene: a transition at the times offset, offset + period, and so on, as swb_model_add_clock. A run that begins later has
 * to begin with the number of times before it as the count.
 *
 * @param[in]  graph         the graph of the expressions
 * @param[in]  period        from one time to the next, positive
 * @param[in]  offset        the first time
 * @param[in]  count         the discrete state that counts the times, see swb_scene_add_discrete
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump: a value that is sampled, a controller
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the transition; may be NULL
 * @return as swb_scene_add_event; SWB_ERR_RANGE for times that are not finite, a period that is not positive, or a reset of the count
 */
SWB_API
swb_status swb_scene_add_clock(struct swb_scene *scene,
                               struct swb_expr *graph,
                               double period,
                               double offset,
                               int64_t count,
                               const int64_t *reset_states,
                               int64_t n_reset_states,
                               const int64_t *resets,
                               int64_t n_resets,
                               const int64_t *to_states,
                               int64_t n_to_states,
                               const double *to_values,
                               int64_t n_to_values,
                               int64_t *index);

/**
 * Add a clock with a list of times to a scene: a transition for each.
 *
 * @param[in]  graph         the graph of the expressions
 * @param[in]  times         [n_times] which increase, one at least
 * @param[in]  count         the discrete state that counts the times
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say, at every time the same; they may depend on the count
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the first transition; may be NULL
 * @return as swb_scene_add_clock; SWB_ERR_RANGE for times that do not increase, or that there are none of
 */
SWB_API
swb_status swb_scene_add_times(struct swb_scene *scene,
                               struct swb_expr *graph,
                               const double *times,
                               int64_t n_times,
                               int64_t count,
                               const int64_t *reset_states,
                               int64_t n_reset_states,
                               const int64_t *resets,
                               int64_t n_resets,
                               const int64_t *to_states,
                               int64_t n_to_states,
                               const double *to_values,
                               int64_t n_to_values,
                               int64_t *index);

/**
 * Add pulse-width modulation to a scene: a discrete state is 1 from the times offset, offset + period, and so on, until a part of the period is over,
 * and then 0.
 *
 * @param[in]  graph   the graph of the expressions
 * @param[in]  duty    the part, an expression: the pulse ends where the ramp reaches it
 * @param[in]  period  from one time to the next, positive
 * @param[in]  offset  the first time
 * @param[in]  pulse   the discrete state that is the pulse
 * @param[in]  count   another one, which counts the times
 * @param[out] index   number of the transition that ends the pulse, before that of the clock; may be NULL
 * @return as swb_scene_add_clock; SWB_ERR_RANGE for a number that is not between 0 and 1 as the part
 */
SWB_API
swb_status swb_scene_add_pwm(struct swb_scene *scene,
                             struct swb_expr *graph,
                             int64_t duty,
                             double period,
                             double offset,
                             int64_t pulse,
                             int64_t count,
                             int64_t *index);

/**
 * Say that the last n states of a model are discrete, and with which values they begin where nothing else is given: only
 * transitions change them. Reports name them and documents keep the values; simulations start where they are told to. Names of
 * values (swb_model_set_value_names) are given behind this.
 *
 * @param[in] initial [n]
 * @return SWB_OK; SWB_ERR_DIMENSION if there are more values than states; SWB_ERR_RANGE for a value that is not finite; SWB_ERR_STATE
 *         if such a state has a derivative
 */
SWB_API
swb_status swb_model_set_discrete(struct swb_model *model,
                                  const double *initial,
                                  int64_t n);

/**
 * Name the values 0, 1, ... of a discrete state: the states of an automaton. Reports and documents keep the names.
 *
 * @param[in] discrete the discrete state, from 0: those of swb_model_set_discrete, in their order
 * @param[in] names    the names, each behind the first after a line break; NULL for none
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such discrete state; SWB_ERR_RANGE for names that are empty or repeat
 */
SWB_API
swb_status swb_model_set_value_names(struct swb_model *model,
                                     int64_t discrete,
                                     const char *names);

/**
 * Names of the values of a discrete state, as swb_model_set_value_names takes them; an empty text if there are none.
 *
 * @param[in]  discrete the discrete state, from 0
 * @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed   length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such discrete state, or the buffer is too short
 */
SWB_API
swb_status swb_model_get_value_names(const struct swb_model *model,
                                     int64_t discrete,
                                     char *buf,
                                     int64_t len,
                                     int64_t *needed);

/**
 * Add a transition to a model, and thereby to all systems made of it later; see swb_system_add_transition.
 *
 * @param[in]  graph         the graph the model was made of
 * @param[in]  guard         an expression, or a condition: joined of comparisons, it becomes true (rising) or false (falling)
 * @param[in]  direction     enum swb_direction
 * @param[in]  from_states   [n_from_states] discrete states that must have the values
 * @param[in]  from_values   [n_from_values] for the transition to be watched; none: always
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say; the others stay as they are
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the transition; may be NULL
 * @return as swb_system_add_transition; SWB_ERR_RANGE for resets that are conditions; SWB_ERR_UNSUPPORTED for guards that switch
 */
SWB_API
swb_status swb_model_add_transition(struct swb_model *model,
                                    struct swb_expr *graph,
                                    int64_t guard,
                                    int32_t direction,
                                    const int64_t *from_states,
                                    int64_t n_from_states,
                                    const double *from_values,
                                    int64_t n_from_values,
                                    const int64_t *reset_states,
                                    int64_t n_reset_states,
                                    const int64_t *resets,
                                    int64_t n_resets,
                                    const int64_t *to_states,
                                    int64_t n_to_states,
                                    const double *to_values,
                                    int64_t n_to_values,
                                    int64_t *index);

/**
 * Add a transition with a name, an effect and a trigger to a model; the rest is that of swb_model_add_transition. See swb_system_add_event.
 *
 * @param[in]  graph         the graph the model was made of
 * @param[in]  name          in results and reports, one line; NULL or "" for none
 * @param[in]  effect        enum swb_effect
 * @param[in]  trigger       enum swb_trigger
 * @param[in]  guard         an expression or a condition
 * @param[in]  direction     enum swb_direction
 * @param[in]  from_states   [n_from_states] discrete states that must have the values
 * @param[in]  from_values   [n_from_values] for the transition to be watched; none: always
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the transition; may be NULL
 * @return as swb_system_add_event; SWB_ERR_RANGE for resets that are conditions; SWB_ERR_UNSUPPORTED for guards that switch
 */
SWB_API
swb_status swb_model_add_event(struct swb_model *model,
                               struct swb_expr *graph,
                               const char *name,
                               int32_t effect,
                               int32_t trigger,
                               int64_t guard,
                               int32_t direction,
                               const int64_t *from_states,
                               int64_t n_from_states,
                               const double *from_values,
                               int64_t n_from_values,
                               const int64_t *reset_states,
                               int64_t n_reset_states,
                               const int64_t *resets,
                               int64_t n_resets,
                               const int64_t *to_states,
                               int64_t n_to_states,
                               const double *to_values,
                               int64_t n_to_values,
                               int64_t *index);

/**
 * Add a clock to a model: a transition at the times offset, offset + period, and so on. The times are those of the formula to the last digit, however many there
 * are. A run that begins later begins with the number of times before it as the count.
 *
 * @param[in]  graph         the graph the model was made of
 * @param[in]  period        from one time to the next, positive
 * @param[in]  offset        the first time
 * @param[in]  count         the discrete state that counts the times
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump: a value that is sampled, a controller
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the transition; may be NULL
 * @return as swb_model_add_transition; SWB_ERR_RANGE for times that are not finite, a period that is not positive, or a reset of the count
 */
SWB_API
swb_status swb_model_add_clock(struct swb_model *model,
                               struct swb_expr *graph,
                               double period,
                               double offset,
                               int64_t count,
                               const int64_t *reset_states,
                               int64_t n_reset_states,
                               const int64_t *resets,
                               int64_t n_resets,
                               const int64_t *to_states,
                               int64_t n_to_states,
                               const double *to_values,
                               int64_t n_to_values,
                               int64_t *index);

/**
 * Add a clock with a list of times to a model: a transition for each.
 *
 * @param[in]  graph         the graph the model was made of
 * @param[in]  times         [n_times] which increase, one at least
 * @param[in]  count         the discrete state that counts the times
 * @param[in]  reset_states  [n_reset_states] states that become what
 * @param[in]  resets        [n_resets] these expressions of the state before say, at every time the same; they may depend on the count
 * @param[in]  to_states     [n_to_states] discrete states that get the values
 * @param[in]  to_values     [n_to_values] behind the reset
 * @param[out] index         number of the first transition; may be NULL
 * @return as swb_model_add_clock; SWB_ERR_RANGE for times that do not increase, or that there are none of
 */
SWB_API
swb_status swb_model_add_times(struct swb_model *model,
                               struct swb_expr *graph,
                               const double *times,
                               int64_t n_times,
                               int64_t count,
                               const int64_t *reset_states,
                               int64_t n_reset_states,
                               const int64_t *resets,
                               int64_t n_resets,
                               const int64_t *to_states,
                               int64_t n_to_states,
                               const double *to_values,
                               int64_t n_to_values,
                               int64_t *index);

/**
 * Add pulse-width modulation to a model: a discrete state is 1 from the times offset, offset + period, and so on, until a part of the period is over, and then 0.
 *
 * @param[in]  graph   the graph the model was made of
 * @param[in]  duty    the part, an expression: the pulse ends where the ramp reaches it
 * @param[in]  period  from one time to the next, positive
 * @param[in]  offset  the first time
 * @param[in]  pulse   the discrete state that is the pulse
 * @param[in]  count   another one, which counts the times
 * @param[out] index   number of the transition that ends the pulse, before that of the clock; may be NULL
 * @return as swb_model_add_clock; SWB_ERR_RANGE for a number that is not between 0 and 1 as the part
 */
SWB_API
swb_status swb_model_add_pwm(struct swb_model *model,
                             struct swb_expr *graph,
                             int64_t duty,
                             double period,
                             double offset,
                             int64_t pulse,
                             int64_t count,
                             int64_t *index);

/**
 * Effect, trigger and name of a transition of a model.
 *
 * @param[in]  index   of the transition, from 0
 * @param[out] effect  enum swb_effect; may be NULL
 * @param[out] trigger enum swb_trigger; may be NULL
 * @param[out] buf     [len] the name with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed  length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such transition, or the buffer is too short
 */
SWB_API
swb_status swb_model_get_rule(const struct swb_model *model,
                              int64_t index,
                              int32_t *effect,
                              int32_t *trigger,
                              char *buf,
                              int64_t len,
                              int64_t *needed);

/**
 * Numbers of discrete states and of transitions of a model. Any output may be NULL.
 *
 * @return SWB_OK
 */
SWB_API
swb_status swb_model_transition_counts(const struct swb_model *model,
                                       int64_t *n_discrete,
                                       int64_t *n_transitions);

/**
 * Values with which the discrete states, the last ones, begin.
 *
 * @param[out] initial [n] n_discrete of swb_model_transition_counts
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_model_get_discrete(const struct swb_model *model,
                                  double *initial,
                                  int64_t n);

/**
 * How long the lists of a transition of a model are. Any output may be NULL.
 *
 * @param[in]  index   of the transition, from 0
 * @param[out] n_from  discrete states it asks for
 * @param[out] n_reset states it resets
 * @param[out] n_to    discrete states it sets
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such transition
 */
SWB_API
swb_status swb_model_transition_sizes(const struct swb_model *model,
                                      int64_t index,
                                      int64_t *n_from,
                                      int64_t *n_reset,
                                      int64_t *n_to);

/**
 * A transition of a model as it was given to swb_model_add_transition, or read by swb_model_from_json; its expressions are
 * those of the graph it was made of or read into.
 *
 * @param[in]  index        of the transition, from 0
 * @param[out] guard        an expression
 * @param[out] direction    enum swb_direction
 * @param[out] from_states  [n_from_states] n_from of swb_model_transition_sizes
 * @param[out] from_values  [n_from_values] as many
 * @param[out] reset_states [n_reset_states] n_reset of swb_model_transition_sizes
 * @param[out] resets       [n_resets] as many
 * @param[out] to_states    [n_to_states] n_to of swb_model_transition_sizes
 * @param[out] to_values    [n_to_values] as many
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such transition or a length is another
 */
SWB_API
swb_status swb_model_get_transition(const struct swb_model *model,
                                    int64_t index,
                                    int64_t *guard,
                                    int32_t *direction,
                                    int64_t *from_states,
                                    int64_t n_from_states,
                                    double *from_values,
                                    int64_t n_from_values,
                                    int64_t *reset_states,
                                    int64_t n_reset_states,
                                    int64_t *resets,
                                    int64_t n_resets,
                                    int64_t *to_states,
                                    int64_t n_to_states,
                                    double *to_values,
                                    int64_t n_to_values);

/**
 * Create an integrator. Time, state, controls and parameters are zero until they are set.
 *
 * @param[in]  system   copied; may be freed afterwards
 * @param[in]  settings NULL for the defaults
 * @param[out] out      the new object, NULL on failure; free with swb_integrator_free
 * @return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if an option is outside its range
 */
SWB_NODISCARD SWB_API
swb_status swb_integrator_create(const struct swb_system *system,
                                 const struct swb_settings *settings,
                                 struct swb_integrator **out);

/**
 * Set time and state, and begin anew: log, statistics, derivatives and dense output are cleared, changed options are
 * taken over. Controls, parameters and stop times stay.
 *
 * @param[in] x [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite, or tolerances are too small
 */
SWB_API
swb_status swb_integrator_reinit(struct swb_integrator *integrator,
                                 double t,
                                 const double *x,
                                 int64_t nx);

/**
 * Set the controls, constant from now on. The active modes are found anew.
 *
 * @param[in] u [nu]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API
swb_status swb_integrator_set_controls(struct swb_integrator *integrator,
                                       const double *u,
                                       int64_t nu);

/**
 * Set the parameters. The active modes are found anew.
 *
 * @param[in] p [np]
 * @return as swb_integrator_set_controls
 */
SWB_API
swb_status swb_integrator_set_params(struct swb_integrator *integrator,
                                     const double *p,
                                     int64_t np);

/**
 * Set tolerances of the local error state by state, instead of the options rtol and atol. They are taken over by the
 * next swb_integrator_reinit, or at once before the first step.
 *
 * @param[in] rtol [n_rtol] relative, one value or one for each state
 * @param[in] atol [n_atol] absolute, one value or one for each state
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is negative or not finite, or both of a state are too
 *         small
 */
SWB_API
swb_status swb_integrator_set_tolerances(struct swb_integrator *integrator,
                                         const double *rtol,
                                         int64_t n_rtol,
                                         const double *atol,
                                         int64_t n_atol);

/**
 * Set times at which steps end, for functions of time that are not smooth there and for output.
 *
 * @param[in] t [n] in any order; those behind the present time are passed over; none: no stop times
 * @return SWB_OK; SWB_ERR_RANGE if a time is not finite
 */
SWB_API
swb_status swb_integrator_set_stop_times(struct swb_integrator *integrator,
                                         const double *t,
                                         int64_t n);

/**
 * Set the modes a subsystem should take where the continuation is not unique, the preferred first, for the option
 * ambiguity = prefer. Taken over by the next swb_integrator_reinit, or at once before the first step.
 *
 * @param[in] subsystem counted among those with more than one mode
 * @param[in] modes     [n] those that are not named come last
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such subsystem; SWB_ERR_RANGE if there is no such mode
 */
SWB_API
swb_status swb_integrator_set_preferred(struct swb_integrator *integrator,
                                        int64_t subsystem,
                                        const int64_t *modes,
                                        int64_t n);

/**
 * Set who decides where the continuation is not unique, before the option ambiguity does; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_integrator_set_decider(struct swb_integrator *integrator,
                                      swb_decide_fn decide,
                                      void *user_data);

/**
 * Do one step, not beyond t_stop nor a stop time.
 *
 * @param[out] kind an enum swb_progress_kind; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE if t_stop is behind the present time; SWB_ERR_USER if a user function returned a
 *         negative code; SWB_ERR_STATE after a call that failed so, until swb_integrator_reinit
 */
SWB_NODISCARD SWB_API
swb_status swb_integrator_step(struct swb_integrator *integrator,
                               double t_stop,
                               int32_t *kind);

/**
 * Integrate to the time t, exactly. Time and state are those at the end, or where the simulation ended before.
 *
 * @param[out] outcome an enum swb_run_outcome; may be NULL
 * @return as swb_integrator_step
 */
SWB_NODISCARD SWB_API
swb_status swb_integrator_advance(struct swb_integrator *integrator,
                                  double t,
                                  int32_t *outcome);

/**
 * Integrate to the last of the times, and write the states at all of them, which are on the dense output of the steps: no step ends for
 * them, and the dense output of the run need not be kept. At a switch the state before it counts.
 *
 * @param[in]  t       [n] increasing, none behind the present time; none: nothing is done
 * @param[out] x       [n * nx] states, those of a time together; NaN at times that the simulation did not reach
 * @param[in]  n_x     n * nx
 * @param[out] outcome an enum swb_run_outcome; may be NULL
 * @return as swb_integrator_step; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a time is not finite or the times do not increase
 */
SWB_API
swb_status swb_integrator_sample(struct swb_integrator *integrator,
                                 const double *t,
                                 int64_t n,
                                 double *x,
                                 int64_t n_x,
                                 int32_t *outcome);

/**
 * Derivatives of the dense output with respect to time at a time in the last step.
 *
 * @param[in]  k   order of the derivative, 0 for the state
 * @param[out] dky [nx]
 * @return SWB_OK; SWB_ERR_RANGE if t is outside of the last step or k is negative; SWB_ERR_STATE before the first step
 */
SWB_API
swb_status swb_integrator_get_dky(struct swb_integrator *integrator,
                                  double t,
                                  int64_t k,
                                  double *dky,
                                  int64_t nx);

/**
 * Time reached.
 *
 * @return SWB_OK
 */
SWB_API swb_status swb_integrator_get_time(const struct swb_integrator *integrator, double *t);

/**
 * State reached.
 *
 * @param[out] x [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_integrator_get_state(const struct swb_integrator *integrator,
                                    double *x,
                                    int64_t nx);

/**
 * Derivative of the state with respect to time under the present active modes; 0 before the first step.
 *
 * @param[out] f [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_integrator_get_derivative(const struct swb_integrator *integrator,
                                         double *f,
                                         int64_t nx);

/**
 * Active modes of a subsystem: one alone, or several in a sliding mode; none before the first step.
 *
 * @param[in]  subsystem counted among those with more than one mode
 * @param[out] active    [n] 0 or 1 for each mode of the subsystem
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_integrator_get_active(const struct swb_integrator *integrator,
                                     int64_t subsystem,
                                     int32_t *active,
                                     int64_t n);

/**
 * How the simulation stands.
 *
 * @param[out] outcome an enum swb_run_outcome
 * @return SWB_OK
 */
SWB_API
swb_status swb_integrator_get_outcome(const struct swb_integrator *integrator,
                                      int32_t *outcome);

/**
 * Why the simulation ended early, in words; if it did not, what is not known to the tolerances, or "".
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL, written in any case; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_integrator_get_reason(const struct swb_integrator *integrator,
                                     char *buf,
                                     int64_t len,
                                     int64_t *needed);

/**
 * Work since the last swb_integrator_reinit.
 *
 * @param[out] stats       every field is written
 * @param[in]  struct_size sizeof(swb_run_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_integrator_get_stats(const struct swb_integrator *integrator,
                                    struct swb_run_stats *stats,
                                    uint64_t struct_size);

/**
 * A copy of the result since the last swb_integrator_reinit: switches, derivatives, dense output.
 *
 * @param[out] out the new object, NULL on failure; free with swb_run_free
 * @return SWB_OK
 */
SWB_API swb_status swb_integrator_get_run(struct swb_integrator *integrator, struct swb_run **out);

/**
 * Gradient of a function of the run with respect to initial state, parameters and controls, by the transpose of the
 * forward derivatives in reverse order. It costs about as much as the run, whatever the number of parameters, and needs
 * the option adjoint.
 *
 * @param[in]  v      [nx] its derivative with respect to the state reached
 * @param[in]  t      [n_t] times at whose states the function depends on, too, where the run had stopped: ends of
 *                    swb_integrator_advance and stop times
 * @param[in]  v_t    [n_v_t] n_t * nx, its derivatives with respect to these states, those of one time together
 * @param[in]  events [n_events] switches on whose times it depends, by their place in the log
 * @param[in]  weight [n_weight] n_events, its derivatives with respect to these times
 * @param[out] dx0    [nx0] nx, gradient with respect to the initial state
 * @param[out] dp     [np] gradient with respect to the parameters
 * @param[out] du     [nu] gradient with respect to the controls
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a time or a switch is none of the run; SWB_ERR_STATE without the
 *         option adjoint; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_integrator_adjoint(struct swb_integrator *integrator,
                                  const double *v,
                                  int64_t nx,
                                  const double *t,
                                  int64_t n_t,
                                  const double *v_t,
                                  int64_t n_v_t,
                                  const int64_t *events,
                                  int64_t n_events,
                                  const double *weight,
                                  int64_t n_weight,
                                  double *dx0,
                                  int64_t nx0,
                                  double *dp,
                                  int64_t np,
                                  double *du,
                                  int64_t nu);

/**
 * Derivative of a gradient by swb_integrator_adjoint in a direction: the product of the Hessian with it, where v does not change. What v changes by adds a
 * gradient of its own. Needs the option adjoint; the derivative has about half of the digits, and costs about ten gradients.
 *
 * @param[in]  v       [nx] the derivative of the function with respect to the state reached
 * @param[in]  x0      [nx0] nx, direction of the initial state
 * @param[in]  p       [np] direction of the parameters
 * @param[in]  u       [nu] direction of the controls
 * @param[out] ddx0    [nddx0] nx, derivative of the gradient with respect to the initial state
 * @param[out] ddp     [nddp] np, derivative of the gradient with respect to the parameters
 * @param[out] ddu     [nddu] nu, derivative of the gradient with respect to the controls
 * @param[out] dx      [ndx] nx, derivative of the state reached in the direction
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE for numbers that are not finite; SWB_ERR_STATE without the option adjoint; SWB_ERR_UNSUPPORTED where the run
 *         has implicit steps, contacts, zeros of higher order, or transitions that follow another event at the same time; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_integrator_adjoint_along(struct swb_integrator *integrator,
                                        const double *v,
                                        int64_t nx,
                                        const double *x0,
                                        int64_t nx0,
                                        const double *p,
                                        int64_t np,
                                        const double *u,
                                        int64_t nu,
                                        double *ddx0,
                                        int64_t nddx0,
                                        double *ddp,
                                        int64_t nddp,
                                        double *ddu,
                                        int64_t nddu,
                                        double *dx,
                                        int64_t ndx);

/**
 * Set an integer or enumeration option of an integrator (or a float one, to an integer) by name. Options of the
 * integration are taken over by the next swb_integrator_reinit, or at once before the first step.
 *
 * @return as swb_settings_set_int
 */
SWB_API
swb_status swb_integrator_set_int(struct swb_integrator *integrator,
                                  const char *name,
                                  int64_t value);

/**
 * Set a float option of an integrator by name, as swb_integrator_set_int.
 *
 * @return as swb_settings_set_double
 */
SWB_API
swb_status swb_integrator_set_double(struct swb_integrator *integrator,
                                     const char *name,
                                     double value);

/**
 * Set any option of an integrator by name from text, as swb_integrator_set_int.
 *
 * @return as swb_settings_set_string
 */
SWB_API
swb_status swb_integrator_set_string(struct swb_integrator *integrator,
                                     const char *name,
                                     const char *value);

/**
 * Set all options of an integrator, as swb_integrator_set_int.
 *
 * @param[in] settings NULL for the defaults
 * @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
 */
SWB_API
swb_status swb_integrator_set_settings(struct swb_integrator *integrator,
                                       const struct swb_settings *settings);

/**
 * Options of an integrator, all of them.
 *
 * @param[out] settings    every field is written
 * @param[in]  struct_size sizeof(swb_settings)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_integrator_get_settings(const struct swb_integrator *integrator,
                                       struct swb_settings *settings,
                                       uint64_t struct_size);

/**
 * Set who is called once per accepted step; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_integrator_set_progress(struct swb_integrator *integrator,
                                       swb_progress_fn progress,
                                       void *user_data);

/**
 * Set who is asked now and then whether to go on; NULL for nobody. For interpreters that look for signals only where their own
 * code runs: swb_integrator_set_progress calls at every step, which for a small system may cost as much as the step.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_integrator_set_poll(struct swb_integrator *integrator,
                                   swb_poll_fn poll,
                                   void *user_data);

/**
 * Set who gets the log, as much as the option log_level says; NULL for nobody. A line for each call at level info, one
 * for each switch at level debug, one for each step at level trace.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_integrator_set_log(struct swb_integrator *integrator,
                                  swb_log_fn log,
                                  void *user_data);

/**
 * Stop the call that runs now with the outcome SWB_RUN_OUTCOME_STOPPED, or the next one if none runs; the one after it
 * goes on. From any thread and from signal handlers; only swb_integrator_free must not run at the same time. It is heeded
 * between steps: a call ends within the time of one step, which takes some tens of evaluations of the model.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_integrator_interrupt(const struct swb_integrator *integrator);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_integrator_free(struct swb_integrator *integrator);

/**
 * Set the defaults of the options of a stepper.
 *
 * @param[out] options     every word is written
 * @param[in]  struct_size sizeof(swb_step_options)
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
 */
SWB_API swb_status swb_step_options_init(struct swb_step_options *options, uint64_t struct_size);

/**
 * Create a stepper of a scene. It has no state yet; controls and parameters are zero until they are set.
 *
 * @param[in]  system  of swb_scene_system; copied, may be freed afterwards
 * @param[in]  options NULL for the defaults
 * @param[out] out     the new object, NULL on failure; free with swb_stepper_free
 * @return SWB_OK; SWB_ERR_STATE if the system is no scene; SWB_ERR_UNSUPPORTED for projected systems; SWB_ERR_RANGE if an
 *         option is outside its range; SWB_ERR_NUMERIC if a constant inertia is not positive definite
 */
SWB_NODISCARD SWB_API
swb_status swb_stepper_create(const struct swb_system *system,
                              const struct swb_step_options *options,
                              struct swb_stepper **out);

/**
 * Set time and state (coordinates, then velocities), and forget impulses and statistics. Set the parameters first.
 *
 * @param[in] x [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite or a gap is negative by more than a thousandth
 *         of the coordinates in it and more than two steps make; SWB_ERR_NONFINITE if a function is not defined there;
 *         SWB_ERR_NUMERIC if the inertia is not positive definite
 */
SWB_API
swb_status swb_stepper_set_state(struct swb_stepper *stepper,
                                 double t,
                                 const double *x,
                                 int64_t nx);

/**
 * Set the controls, constant from now on.
 *
 * @param[in] u [nu]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API
swb_status swb_stepper_set_controls(struct swb_stepper *stepper,
                                    const double *u,
                                    int64_t nu);

/**
 * Set the parameters, constant from now on.
 *
 * @param[in] p [np]
 * @return as swb_stepper_set_controls
 */
SWB_API swb_status swb_stepper_set_params(struct swb_stepper *stepper, const double *p, int64_t np);

/**
 * Make one step of the length h of the options.
 *
 * @return SWB_OK; SWB_ERR_STATE before swb_stepper_set_state, and after a step that failed; SWB_ERR_USER if a user function
 *         returned a negative code; SWB_ERR_NONFINITE if one has no value where it is needed, or the state grows without
 *         end; SWB_ERR_RANGE if friction or restitution is out of range; SWB_ERR_NUMERIC if the inertia is not positive
 *         definite; SWB_ERR_INTERRUPTED
 */
SWB_NODISCARD SWB_API
swb_status swb_stepper_step(struct swb_stepper *stepper);

/**
 * Make equal steps, not longer than h, that end at a time.
 *
 * @param[in] t not before the time reached
 * @return as swb_stepper_step; where it fails, time and state are those of the last step that was made
 */
SWB_NODISCARD SWB_API
swb_status swb_stepper_advance(struct swb_stepper *stepper,
                               double t);

/**
 * How many states swb_stepper_run keeps.
 *
 * @param[in]  t     end
 * @param[in]  every states are kept after so many steps, 1 or more
 * @param[out] n     states, the present one included
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_NULL
 */
SWB_API
swb_status swb_stepper_count(const struct swb_stepper *stepper,
                             double t,
                             int64_t every,
                             int64_t *n);

/**
 * Make equal steps, not longer than h, that end at a time, and keep states.
 *
 * @param[in]  t          not before the time reached
 * @param[in]  every      the state is kept after so many steps, and the last
 * @param[out] times      [n_times] as swb_stepper_count says: the present time, then those of the states that are kept
 * @param[out] states     [n_states] n_times times nx, those of the first time first
 * @param[out] impulses   [n_impulses] n_times times n_contacts times 3, those of the steps that end at these times; NULL
 *                        with 0 if they are not wanted
 * @return as swb_stepper_step, and SWB_ERR_DIMENSION
 */
SWB_NODISCARD SWB_API
swb_status swb_stepper_run(struct swb_stepper *stepper,
                           double t,
                           int64_t every,
                           double *times,
                           int64_t n_times,
                           double *states,
                           int64_t n_states,
                           double *impulses,
                           int64_t n_impulses);

/**
 * Sizes of a stepper.
 *
 * @param[out] nx         states: coordinates and velocities; may be NULL
 * @param[out] nu         controls; may be NULL
 * @param[out] np         parameters; may be NULL
 * @param[out] n_contacts contacts, those that were left out do not count; may be NULL
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_stepper_sizes(const struct swb_stepper *stepper,
                             int64_t *nx,
                             int64_t *nu,
                             int64_t *np,
                             int64_t *n_contacts);

/**
 * Time reached.
 *
 * @return SWB_OK
 */
SWB_API swb_status swb_stepper_get_time(const struct swb_stepper *stepper, double *t);

/**
 * State reached.
 *
 * @param[out] x [nx] coordinates, then velocities
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API swb_status swb_stepper_get_state(const struct swb_stepper *stepper, double *x, int64_t nx);

/**
 * Impulses of the last step: impulses, not forces.
 *
 * @param[out] impulses [n] 3 n_contacts: normal, then along the tangents there are, zero for others
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_stepper_get_impulses(const struct swb_stepper *stepper,
                                    double *impulses,
                                    int64_t n);

/**
 * Counts of the steps since the state was set, and how they went.
 *
 * @param[out] stats
 * @param[in]  struct_size sizeof(swb_step_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION if the size is no size of such a struct
 */
SWB_API
swb_status swb_stepper_get_stats(const struct swb_stepper *stepper,
                                 struct swb_step_stats *stats,
                                 uint64_t struct_size);

/**
 * End the call that runs, from another thread or a signal handler, after the step it is at; state and time are those of
 * that step, and the object can be used again.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_stepper_interrupt(const struct swb_stepper *stepper);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_stepper_free(struct swb_stepper *stepper);

/**
 * Create a batch.
 *
 * @param[in]  system   copied; may be freed afterwards. Its functions are called by several threads at once, unless one
 *                      of them carries the flag SWB_SERIAL
 * @param[in]  settings NULL for the defaults
 * @param[out] out      the new object, NULL on failure; free with swb_batch_free
 * @return as swb_integrator_create
 */
SWB_NODISCARD SWB_API
swb_status swb_batch_create(const struct swb_system *system,
                            const struct swb_settings *settings,
                            struct swb_batch **out);

/**
 * Simulate from t0 to t1, from every initial state. A run that fails does not keep the others from running. The results
 * are those of single runs to the last bit, whatever the number of threads.
 *
 * @param[in] x0        [n_x0] the initial states, those of one run together
 * @param[in] u         [n_u] controls: none (zeros), nu for all runs, or nu for each
 * @param[in] p         [n_p] parameters, the same
 * @param[in] n_threads threads at most; 0: one for each processor. With a function that carries the flag SWB_SERIAL the
 *                      thread of the caller does it all. Log and progress callbacks do not exist here
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if n_threads is negative
 */
SWB_NODISCARD SWB_API
swb_status swb_batch_run(struct swb_batch *batch,
                         double t0,
                         double t1,
                         const double *x0,
                         int64_t n_x0,
                         const double *u,
                         int64_t n_u,
                         const double *p,
                         int64_t n_p,
                         int64_t n_threads);

/**
 * Number of runs of the last swb_batch_run; 0 before.
 *
 * @return SWB_OK
 */
SWB_API swb_status swb_batch_size(const struct swb_batch *batch, int64_t *n_runs);

/**
 * Final states of all runs.
 *
 * @param[out] x [n] n_runs * nx, those of one run together; NaN for runs that failed
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API swb_status swb_batch_states(const struct swb_batch *batch, double *x, int64_t n);

/**
 * How all runs ended.
 *
 * @param[out] outcome [n] n_runs, an enum swb_run_outcome each, or the negative swb_status of a run that failed
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_batch_outcomes(const struct swb_batch *batch,
                              int32_t *outcome,
                              int64_t n);

/**
 * A copy of the result of one run.
 *
 * @param[in]  index the run, from 0
 * @param[out] out   the new object, NULL on failure; free with swb_run_free
 * @return SWB_OK; SWB_ERR_DIMENSION; the status of the run if it failed, with its message
 */
SWB_API
swb_status swb_batch_get_run(const struct swb_batch *batch,
                             int64_t index,
                             struct swb_run **out);

/**
 * Stop the runs that are at work, with the outcome SWB_RUN_OUTCOME_STOPPED, or those of the next call if none are. From
 * any thread and from signal handlers; only swb_batch_free must not run at the same time. The call ends when every run has
 * finished its step.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_batch_interrupt(const struct swb_batch *batch);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_batch_free(struct swb_batch *batch);

/**
 * Set the defaults of the options of an estimator.
 *
 * @param[out] options     every word is written
 * @param[in]  struct_size sizeof(swb_mhe_options)
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
 */
SWB_API swb_status swb_mhe_options_init(struct swb_mhe_options *options, uint64_t struct_size);

/**
 * Create a moving horizon estimator for the system, the stages, the parameters and the bounds of states of a problem, which has no costs and no other
 * constraints. Its stages are the samples of the window and have the same length; its initial state is the mean before the first measurement. All memory
 * is taken here, but what contacts and transitions need. Constant parameters are estimated as states with a zero derivative.
 *
 * @param[in]  ocp         copied as it is stated now
 * @param[in]  measured    y by state, control of the stage before, parameters and time; dimensions of the system
 * @param[in]  initial     [n_initial] nx standard deviations of the state before the first measurement, positive
 * @param[in]  process     [n_process] nx standard deviations of what is added to the states in every stage, zero for none
 * @param[in]  measurement [n_measurement] ny standard deviations of the measurements, positive
 * @param[in]  options     NULL for the defaults
 * @param[out] out         the new object, NULL on failure; free with swb_mhe_free
 * @return SWB_OK; SWB_ERR_UNSUPPORTED for what estimators do not know: costs, other constraints, discrete states, choices, algebraic states;
 *         SWB_ERR_DIMENSION; SWB_ERR_RANGE if an option or a deviation is outside its range; SWB_ERR_STATE without an initial state or
 *         parameters; SWB_ERR_USER
 */
SWB_NODISCARD SWB_API
swb_status swb_mhe_create(struct swb_ocp *ocp,
                          const struct swb_function *measured,
                          const double *initial,
                          int64_t n_initial,
                          const double *process,
                          int64_t n_process,
                          const double *measurement,
                          int64_t n_measurement,
                          const struct swb_mhe_options *options,
                          struct swb_mhe **out);

/**
 * Sizes of an estimator.
 *
 * @param[out] n  stages of the window
 * @param[out] nx states
 * @param[out] nu controls
 * @param[out] ny measurements of a sample
 * @param[out] nw states that have noise
 * @return SWB_OK; SWB_ERR_NULL
 */
SWB_API
swb_status swb_mhe_sizes(struct swb_mhe *c,
                         int64_t *n,
                         int64_t *nx,
                         int64_t *nu,
                         int64_t *ny,
                         int64_t *nw);

/**
 * Go to the next sample under a control, and do everything for it that needs no measurement: arrival cost, prediction, linearisation, factors.
 *
 * @param[in]  u           [nu] control from the last sample to this one; NULL with 0 for a system without
 * @param[out] info        NULL if not wanted
 * @param[in]  struct_size sizeof(swb_nmpc_info)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER if a function returned a negative
 *         code; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_mhe_prepare(struct swb_mhe *c,
                           const double *u,
                           int64_t nu,
                           struct swb_nmpc_info *info,
                           uint64_t struct_size);

/**
 * The state at the sample of the last preparation, or at the start, from its measurements. It is a prediction where info says
 * SWB_NMPC_SOURCE_PLAN: functions have no value at the estimate.
 *
 * @param[in]  y           [ny] NaN for what was not measured
 * @param[out] x           [nx]
 * @param[out] info        NULL if not wanted
 * @param[in]  struct_size sizeof(swb_nmpc_info)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a measurement is infinite; SWB_ERR_STATE where the sample has an estimate: call
 *         swb_mhe_prepare; SWB_ERR_USER; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_mhe_estimate(struct swb_mhe *c,
                            const double *y,
                            int64_t ny,
                            double *x,
                            int64_t nx,
                            struct swb_nmpc_info *info,
                            uint64_t struct_size);

/**
 * Set the parameters from the next preparation on; samples that were keep theirs.
 *
 * @param[in] p [np]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API swb_status swb_mhe_set_params(struct swb_mhe *c, const double *p, int64_t np);

/**
 * Back to the start with another mean: nothing was measured.
 *
 * @param[in] x0 [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_mhe_reset(struct swb_mhe *c,
                         const double *x0,
                         int64_t nx);

/**
 * Write the estimator as C files (C99) to a folder, which is made if it is not there: prefix.h, prefix.c, prefix_main.c, prefix_record.h and
 * Makefile. There is no heap, no thread and no clock; all memory is one static object of prefix_arena_bytes bytes.
 *
 * The functions are prefix_prepare, prefix_estimate, prefix_set_params, prefix_reset, prefix_states and prefix_filled, described in prefix.h. The estimator in
 * C begins with the initial state and the present parameters. The main program repeats estimates that are recorded here, from simulated measurements; this
 * estimator is afterwards as after swb_mhe_reset with the initial state.
 *
 * @param[in] folder    path, UTF-8
 * @param[in] prefix    what names begin with, a C identifier
 * @param[in] precision an enum swb_c_real
 * @return SWB_OK; SWB_ERR_UNSUPPORTED with a message for systems that switch, implicit methods, deadlines, functions that are no expressions;
 *         SWB_ERR_RANGE for the prefix, the precision, or if a file cannot be written
 */
SWB_API
swb_status swb_mhe_write_c(struct swb_mhe *c,
                           const char *folder,
                           const char *prefix,
                           int64_t precision);

/**
 * The window: states of its nodes, the last sample at the end, and noise of its stages.
 *
 * @param[out] x      [(n + 1) nx]
 * @param[out] w      [n nw]; NULL with 0 if not wanted
 * @param[out] filled stages that were; those in front of them do nothing; NULL if not wanted
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_mhe_get_window(struct swb_mhe *c,
                              double *x,
                              int64_t n_x,
                              double *w,
                              int64_t n_w,
                              int64_t *filled);

/**
 * The covariance of the last state by the linearisation of the last program, without regard of bounds.
 *
 * @param[out] p [nx nx]
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION; SWB_ERR_STATE where there is no program
 */
SWB_API
swb_status swb_mhe_get_covariance(struct swb_mhe *c,
                                  double *p,
                                  int64_t n);

/**
 * End the call that runs: from any thread or signal handler.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if the object has been freed
 */
SWB_API swb_status swb_mhe_interrupt(const struct swb_mhe *c);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_mhe_free(struct swb_mhe *c);

/**
 * Set the defaults of the options of a controller.
 *
 * @param[out] options     every word is written
 * @param[in]  struct_size sizeof(swb_nmpc_options)
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
 */
SWB_API swb_status swb_nmpc_options_init(struct swb_nmpc_options *options, uint64_t struct_size);

/**
 * Create a controller for a problem as it is stated now. All memory is taken here, but what contacts, transitions and choices need. The problem is copied;
 * the first iterate is its guess. Costs along the horizon are summed over the starts of the stages (10.1), path constraints hold
 * there. Systems that switch are simulated by events in every stage, with the tolerances of the settings; they take level D0 and
 * every scheme but SWB_NMPC_SCHEME_MLI.
 *
 * @param[in]  ocp     may be changed, solved and freed afterwards
 * @param[in]  options NULL for the defaults
 * @param[out] out     the new object, NULL on failure; free with swb_nmpc_free
 * @return SWB_OK; SWB_ERR_UNSUPPORTED for what controllers do not know: transitions, contacts, free times and parameters, linear controls,
 *         periodicity, complementarity, penalties of the largest violation; SWB_ERR_RANGE if an option is outside its range
 */
SWB_NODISCARD SWB_API
swb_status swb_nmpc_create(struct swb_ocp *ocp,
                           const struct swb_nmpc_options *options,
                           struct swb_nmpc **out);

/**
 * Sizes of a controller.
 *
 * @param[out] n  control stages
 * @param[out] nx states that are measured: those with a derivative
 * @param[out] nu controls
 * @return SWB_OK; SWB_ERR_NULL
 */
SWB_API swb_status swb_nmpc_sizes(const struct swb_nmpc *c, int64_t *n, int64_t *nx, int64_t *nu);

/**
 * Solve the problem for an initial state to convergence, from the present iterate: the start of a closed loop.
 *
 * @param[in]  x0         [nx]
 * @param[in]  max_iter   steps at most
 * @param[out] iterations steps made; NULL if not wanted
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_NUMERIC if it does not converge, the iterate being the last point;
 *         SWB_ERR_USER; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_nmpc_initialise(struct swb_nmpc *c,
                               const double *x0,
                               int64_t nx,
                               int64_t max_iter,
                               int64_t *iterations);

/**
 * Do everything for the next sample that needs no measurement. Where functions have no value the quadratic program of the
 * sample before is used further, which is no failure.
 *
 * @param[in]  x_predicted [nx] the state that will be found; NULL with 0: one step of the model from the last state
 * @param[out] info        NULL if not wanted
 * @param[in]  struct_size sizeof(swb_nmpc_info)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER if a function returned a negative
 *         code; SWB_ERR_INTERRUPTED
 */
SWB_API
swb_status swb_nmpc_prepare(struct swb_nmpc *c,
                            const double *x_predicted,
                            int64_t nx,
                            struct swb_nmpc_info *info,
                            uint64_t struct_size);

/**
 * Begin a preparation on a thread of the controller and return at once. swb_nmpc_feedback takes what was prepared; all other calls wait
 * until the preparation is over, and nothing else may be freed or changed by them before. The thread is started by the first call and
 * calls the functions of the model; where these may be called by one thread only (SWB_FUNCTION_FLAG_SERIAL), the preparation is
 * made before the call returns.
 *
 * @param[in]  x_predicted [nx] the state that will be found; NULL with 0: one step of the model from the last state
 * @param[out] started     1; 0 if a preparation is running already, which goes on; NULL if not wanted
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite. How the preparation ends is said by swb_nmpc_wait.
 */
SWB_API
swb_status swb_nmpc_prepare_async(struct swb_nmpc *c,
                                  const double *x_predicted,
                                  int64_t nx,
                                  int64_t *started);

/**
 * Wait for the preparation that swb_nmpc_prepare_async has begun.
 *
 * @param[out] info        as of swb_nmpc_prepare; NULL if not wanted
 * @param[in]  struct_size sizeof(swb_nmpc_info)
 * @return SWB_OK; as swb_nmpc_prepare, how the preparation ended; SWB_ERR_STATE where there was none
 */
SWB_API
swb_status swb_nmpc_wait(struct swb_nmpc *c,
                         struct swb_nmpc_info *info,
                         uint64_t struct_size);

/**
 * The control for a measured state. No model function is evaluated and nothing is allocated. There always is a control; info says
 * where it comes from, also for a state that is not finite. A preparation that runs on the controller's thread is waited for, for at
 * most half of the deadline; then the control is that of the last plan and its feedback law, cut off at its bounds.
 *
 * @param[in]  x           [nx]
 * @param[out] u0          [nu]
 * @param[out] info        NULL if not wanted
 * @param[in]  struct_size sizeof(swb_nmpc_info)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
 */
SWB_API
swb_status swb_nmpc_feedback(struct swb_nmpc *c,
                             const double *x,
                             int64_t nx,
                             double *u0,
                             int64_t nu,
                             struct swb_nmpc_info *info,
                             uint64_t struct_size);

/**
 * Do what belongs to the last sample and can wait until its control is out: the plan, and the prediction of the next state. Every
 * other call does it where it is needed.
 *
 * @return SWB_OK
 */
SWB_API
swb_status swb_nmpc_finish(struct swb_nmpc *c);

/**
 * Set the parameters. Between a preparation and its feedback they enter the prepared program by one evaluation of the model; for systems
 * that switch they count from the next preparation on.
 *
 * @param[in] p [n] np values for the whole horizon, n_stages np for its stages, or (n_stages + 1) np for its nodes
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_INTERRUPTED; SWB_ERR_USER for a negative code of a
 *         callback
 */
SWB_API
swb_status swb_nmpc_set_params(struct swb_nmpc *c,
                               const double *p,
                               int64_t n);

/**
 * Set the references of a least-squares term. Between a preparation and its feedback they enter the prepared program.
 *
 * @param[in] term its number, in the order they were added to the problem
 * @param[in] y    [n] one reference for all nodes of the term, or one for each
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no such term or a value is not finite; SWB_ERR_INTERRUPTED;
 *         SWB_ERR_USER for a negative code of a callback
 */
SWB_API
swb_status swb_nmpc_set_references(struct swb_nmpc *c,
                                   int64_t term,
                                   const double *y,
                                   int64_t n);

/**
 * Set the time of the first node, from the next preparation on.
 *
 * @return SWB_OK; SWB_ERR_RANGE
 */
SWB_API swb_status swb_nmpc_set_time(struct swb_nmpc *c, double t0);

/**
 * Set the weights of a least-squares term, in the order they were added to the problem: from the next preparation on.
 *
 * @param[in] w [n_w] the diagonal, or the matrix row by row
 * @return SWB_OK; SWB_ERR_RANGE for a term there is not, or a weight that is not finite; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_nmpc_set_weights(struct swb_nmpc *c,
                                int64_t term,
                                const double *w,
                                int64_t n_w);

/**
 * Set the bounds of the controls, infinite for none. Between a preparation and its feedback they count at once.
 *
 * @param[in] lower [nu]
 * @param[in] upper [nu]
 * @return SWB_OK; SWB_ERR_RANGE if a lower bound is above the upper one or NaN; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_nmpc_set_control_bounds(struct swb_nmpc *c,
                                       const double *lower,
                                       const double *upper,
                                       int64_t nu);

/**
 * Set the bounds of the states that have a derivative, infinite for none. Between a preparation and its feedback they count at once.
 *
 * @param[in] lower [nx]
 * @param[in] upper [nx]
 * @return SWB_OK; SWB_ERR_RANGE if a lower bound is above the upper one or NaN, or for a state that has no bound in the problem;
 *         SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_nmpc_set_state_bounds(struct swb_nmpc *c,
                                     const double *lower,
                                     const double *upper,
                                     int64_t nx);

/**
 * The cost of the plan with the prices of its violations, summed over the nodes as in (10.1).
 *
 * @param[out] value
 * @return SWB_OK; SWB_ERR_NUMERIC if functions have no value at the plan; SWB_ERR_STATE without values of the parameters; SWB_ERR_NULL
 */
SWB_API
swb_status swb_nmpc_get_objective(struct swb_nmpc *c,
                                  double *value);

/**
 * The feedback gain of the first stage where no constraint is active: u = u_0 + K (x - x_0).
 *
 * @param[out] k [nu nx] row by row
 * @return SWB_OK; SWB_ERR_STATE if nothing is prepared; SWB_ERR_DIMENSION; SWB_ERR_NULL
 */
SWB_API swb_status swb_nmpc_get_gain(struct swb_nmpc *c, double *k, int64_t n);

/**
 * Rows of constraints of the program: bounds of states and constraints, node by node.
 *
 * @param[out] rows
 * @return SWB_OK; SWB_ERR_NULL
 */
SWB_API swb_status swb_nmpc_count_rows(struct swb_nmpc *c, int64_t *rows);

/**
 * Multipliers of the plan: positive at upper, negative at lower bounds.
 *
 * @param[out] lambda [(n + 1) nx] of the dynamics, the first of the initial value
 * @param[out] mu     [n nu] of the bounds of the controls
 * @param[out] row_mu [rows] of the rows of constraints, see swb_nmpc_count_rows
 * @param[out] nodes  [rows] the nodes of these
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
 */
SWB_API
swb_status swb_nmpc_get_multipliers(struct swb_nmpc *c,
                                    double *lambda,
                                    int64_t n_lambda,
                                    double *mu,
                                    int64_t n_mu,
                                    double *row_mu,
                                    int64_t n_row_mu,
                                    int64_t *nodes,
                                    int64_t n_nodes);

/**
 * Set the seconds a feedback may take.
 *
 * @return SWB_OK; SWB_ERR_RANGE if they are not positive
 */
SWB_API swb_status swb_nmpc_set_deadline(struct swb_nmpc *c, double seconds);

/**
 * Set the iterate; its multipliers are zero.
 *
 * @param[in] x [(n + 1) nx], those of the first node first
 * @param[in] u [n nu]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API
swb_status swb_nmpc_set_iterate(struct swb_nmpc *c,
                                const double *x,
                                int64_t n_x,
                                const double *u,
                                int64_t n_u);

/**
 * Write the controller as C files (C99) to a folder, which is made if it is not there: prefix.h, prefix.c, prefix_main.c, prefix_record.h,
 * prefix_fmu.c, modelDescription.xml, modelDescription_fmi3.xml, buildDescription.xml and Makefile. There is no heap, no thread and no clock; all
 * memory is one static object of prefix_arena_bytes bytes. "make fmu" makes a unit for co-simulation of them (FMI 2.0), "make fmu3" one of FMI 3.0.
 *
 * The functions are prefix_prepare, prefix_feedback, prefix_set_reference, prefix_set_params, prefix_reset, prefix_plan_x and prefix_plan_u, described
 * in prefix.h. The controller in C begins with the present plan, parameters and references. The main program repeats a closed loop that is
 * recorded here; this controller is afterwards as after swb_nmpc_set_iterate with its plan.
 *
 * @param[in] folder    path, UTF-8
 * @param[in] prefix    what names begin with, a C identifier
 * @param[in] precision an enum swb_c_real
 * @return SWB_OK; SWB_ERR_UNSUPPORTED with a message for systems that switch, implicit methods, algebraic states, costs that are no least
 *         squares, functions that are no expressions, schemes other than rti and as_rti, levels other than d0; SWB_ERR_STATE if qp_solver is not
 *         stagewise; SWB_ERR_RANGE for the prefix, the precision, or if a file cannot be written
 */
SWB_API
swb_status swb_nmpc_write_c(struct swb_nmpc *c,
                            const char *folder,
                            const char *prefix,
                            int64_t precision);

/**
 * Back to the start: the guess of the problem, no multipliers, nothing measured, monitor at zero.
 *
 * @return SWB_OK
 */
SWB_API swb_status swb_nmpc_reset(struct swb_nmpc *c);

/**
 * The plan from the last sample on.
 *
 * @param[out] x [(n + 1) nx], those of the first node first
 * @param[out] u [n nu]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
 */
SWB_API
swb_status swb_nmpc_get_plan(struct swb_nmpc *c,
                             double *x,
                             int64_t n_x,
                             double *u,
                             int64_t n_u);

/**
 * How the controller is doing.
 *
 * @param[out] monitor     every word is written
 * @param[in]  struct_size sizeof(swb_nmpc_monitor)
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
 */
SWB_API
swb_status swb_nmpc_get_monitor(struct swb_nmpc *c,
                                struct swb_nmpc_monitor *monitor,
                                uint64_t struct_size);

/**
 * End the call that runs: from any thread or signal handler. A preparation that is ended leaves the quadratic program before.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if the object has been freed
 */
SWB_API
swb_status swb_nmpc_interrupt(const struct swb_nmpc *c);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_nmpc_free(struct swb_nmpc *c);

/**
 * Create an optimal control problem. Bounds are infinite, the initial state is free, the initial time is zero,
 * parameters have no values, and there is no cost, until they are set. A problem whose parameters have no values is not solved:
 * SWB_ERR_STATE.
 *
 * @param[in]  system   copied; may be freed afterwards
 * @param[in]  horizon  duration
 * @param[in]  n_stages control intervals of equal length
 * @param[in]  settings NULL for the defaults
 * @param[out] out      the new object, NULL on failure; free with swb_ocp_free
 * @return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if the horizon is not
 *         positive or an option is outside its range; SWB_ERR_DIMENSION without stages
 */
SWB_NODISCARD SWB_API
swb_status swb_ocp_create(const struct swb_system *system,
                          double horizon,
                          int64_t n_stages,
                          const struct swb_settings *settings,
                          struct swb_ocp **out);

/**
 * Set the cost rate, one output: its integral over the horizon is minimised. Expressions (swb_expr_function) may have abs, min and max in
 * them where these point down, as a sum of smooth terms and of maxima with positive factors does: their arguments may be
 * controls that are constant by stage, and parameters. A program has a variable in every stage for each.
 *
 * @return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit; SWB_ERR_UNSUPPORTED for abs, min and max of what moves within a
 *         stage: make such a cost the derivative of a further state of the model, and its value at the end the terminal cost
 */
SWB_API
swb_status swb_ocp_set_lagrange(struct swb_ocp *ocp,
                                const struct swb_function *f);

/**
 * Set the terminal cost, one output; its control is that of the last stage. It may have abs, min and max in it as the cost rate, of
 * states, too.
 *
 * @return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit
 */
SWB_API
swb_status swb_ocp_set_mayer(struct swb_ocp *ocp,
                             const struct swb_function *f);

/**
 * Add the constraint lower <= f(x,u,p,t) <= upper along the horizon.
 *
 * @param[in] lower [n_lower] one for each output
 * @param[in] upper [n_upper] one for each output
 * @param[in] at    an enum swb_path_at
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a lower bound is above the upper one or NaN
 */
SWB_API
swb_status swb_ocp_add_path(struct swb_ocp *ocp,
                            const struct swb_function *f,
                            const double *lower,
                            int64_t n_lower,
                            const double *upper,
                            int64_t n_upper,
                            int32_t at);

/**
 * Add the constraint lower <= f(x,u,p,t) <= upper at the end of the horizon; its control is that of the
 * last stage.
 *
 * @param[in] lower [n_lower] one for each output
 * @param[in] upper [n_upper] one for each output
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_add_terminal(struct swb_ocp *ocp,
                                const struct swb_function *f,
                                const double *lower,
                                int64_t n_lower,
                                const double *upper,
                                int64_t n_upper);

/**
 * Set bounds of the states at all stage points and element ends after the initial time.
 *
 * @param[in] lower [n_lower] nx
 * @param[in] upper [n_upper] nx
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_set_state_bounds(struct swb_ocp *ocp,
                                    const double *lower,
                                    int64_t n_lower,
                                    const double *upper,
                                    int64_t n_upper);

/**
 * Set bounds of the initial state; equal bounds fix it.
 *
 * @param[in] lower [n_lower] nx
 * @param[in] upper [n_upper] nx
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_set_initial_bounds(struct swb_ocp *ocp,
                                      const double *lower,
                                      int64_t n_lower,
                                      const double *upper,
                                      int64_t n_upper);

/**
 * Fix the initial state.
 *
 * @param[in] x0 [nx]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is NaN
 */
SWB_API swb_status swb_ocp_set_initial_state(struct swb_ocp *ocp, const double *x0, int64_t nx);

/**
 * Set bounds of the controls.
 *
 * @param[in] lower [n_lower] nu
 * @param[in] upper [n_upper] nu
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_set_control_bounds(struct swb_ocp *ocp,
                                      const double *lower,
                                      int64_t n_lower,
                                      const double *upper,
                                      int64_t n_upper);

/**
 * Say how large quantities usually are, in their own units: the solver measures variables by that. What is not given it takes from
 * bounds, initial values, guesses and simulations; units then do not matter either, but a state that begins at zero and has no
 * bounds is better known to you.
 *
 * @param[in] x [n_x] nx, positive; NaN where nothing is known; or NULL and 0
 * @param[in] u [n_u] nu, as x
 * @param[in] p [n_p] np, as x
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not positive and finite
 */
SWB_API
swb_status swb_ocp_set_nominal(struct swb_ocp *ocp,
                               const double *x,
                               int64_t n_x,
                               const double *u,
                               int64_t n_u,
                               const double *p,
                               int64_t n_p);

/**
 * Set the parameters.
 *
 * @param[in] p [np]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API swb_status swb_ocp_set_params(struct swb_ocp *ocp, const double *p, int64_t np);

/**
 * Set the initial time.
 *
 * @return SWB_OK; SWB_ERR_RANGE if it is not finite
 */
SWB_API swb_status swb_ocp_set_initial_time(struct swb_ocp *ocp, double t0);

/**
 * Give states to start from, linear in between.
 *
 * @param[in] times [n_times] rising, from the start of the horizon
 * @param[in] x     [n_x] n_times * nx, the states of one time together
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if times do not rise or a value is not finite
 */
SWB_API
swb_status swb_ocp_set_state_guess(struct swb_ocp *ocp,
                                   const double *times,
                                   int64_t n_times,
                                   const double *x,
                                   int64_t n_x);

/**
 * Give controls to start from.
 *
 * @param[in] u [n_u] n_stages * nu, the controls of one stage together
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API swb_status swb_ocp_set_control_guess(struct swb_ocp *ocp, const double *u, int64_t n_u);

/**
 * Solve. The problem is discretised at the first solve, and again only when its structure changed.
 *
 * @param[out] outcome an enum swb_outcome; may be NULL
 * @return SWB_OK, however the solver ended; SWB_ERR_USER if a user function returned a negative code;
 *         SWB_ERR_NONFINITE if one has no value at the start; SWB_ERR_NUMERIC; SWB_ERR_RANGE,
 *         SWB_ERR_UNSUPPORTED if options do not go together
 */
SWB_NODISCARD SWB_API
swb_status swb_ocp_solve(struct swb_ocp *ocp,
                         int32_t *outcome);

/**
 * How the last solve ended.
 *
 * @param[out] outcome an enum swb_outcome
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_outcome(const struct swb_ocp *ocp, int32_t *outcome);

/**
 * Outcome of the polish, which identifies the active set and solves the problem with it.
 *
 * @param[out] polished an enum swb_polished
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_polished(const struct swb_ocp *ocp, int32_t *polished);

/**
 * Cost of the solution, without terms that only guide the solver; NaN where there is none (unless the outcome is
 * SWB_OUTCOME_SOLVED, or SWB_OUTCOME_STOPPED after a round of an adaptation that was solved): what
 * another point costs says nothing about the problem (swb_ocp_get_cost_reached).
 *
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_cost(const struct swb_ocp *ocp,
                            double *cost);

/**
 * Cost of the point at which the last solve ended, however it ended. Unless the outcome is SWB_OUTCOME_SOLVED the point
 * need not satisfy dynamics and constraints, and its cost may lie on either side of that of a solution. NaN where the
 * solve was stopped before it was known.
 *
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_cost_reached(const struct swb_ocp *ocp,
                                    double *cost);

/**
 * Controls.
 *
 * @param[out] u [n_u] n_stages * nu, the controls of one stage together
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_controls(const struct swb_ocp *ocp, double *u, int64_t n_u);

/**
 * Derivatives of the last solution with respect to its data: the initial state `[nx]`, then the parameters `[np]`. The
 * order of modes is held; the solution must be exact (SWB_POLISHED_DONE). A component of the initial state that is free is
 * no datum: its derivatives are zero. Where the order of modes cannot be held in either direction, the derivatives with
 * respect to that datum are NaN and one_sided is 1. One factorisation for all of them; parameters cost four evaluations of the model
 * each.
 *
 * @param[out] cost      [n_cost] nx + np, derivatives of the cost; NULL with n_cost 0 if not wanted
 * @param[out] u         [n_u] (nx + np) * n_stages * nu, derivatives of the controls, those of one datum together; NULL
 *                       with n_u 0 if not wanted
 * @param[out] one_sided 1 if a bound is active without a multiplier: on the other side the derivatives are others; NULL
 *                       if not wanted
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution; SWB_ERR_NUMERIC if it is no isolated
 *         minimiser; SWB_ERR_USER, SWB_ERR_NONFINITE if the model fails next to the given parameters
 */
SWB_API
swb_status swb_ocp_get_sensitivity(struct swb_ocp *ocp,
                                   double *cost,
                                   int64_t n_cost,
                                   double *u,
                                   int64_t n_u,
                                   int32_t *one_sided);

/**
 * Residuals of the last solve.
 *
 * @param[out] residuals   every field is written
 * @param[in]  struct_size sizeof(swb_residuals)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_residuals(const struct swb_ocp *ocp,
                                 struct swb_residuals *residuals,
                                 uint64_t struct_size);

/**
 * Work and time of the last solve.
 *
 * @param[out] stats       every field is written
 * @param[in]  struct_size sizeof(swb_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_stats(const struct swb_ocp *ocp,
                             struct swb_stats *stats,
                             uint64_t struct_size);

/**
 * A copy of the trajectory of the last solve.
 *
 * @param[out] out the new object, NULL on failure; free with swb_trajectory_free
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_trajectory(const struct swb_ocp *ocp, struct swb_trajectory **out);

/**
 * Set an integer or enumeration option of an optimal control problem (or a float one, to an integer) by name.
 *
 * @return as swb_settings_set_int
 */
SWB_API
swb_status swb_ocp_set_int(struct swb_ocp *ocp,
                           const char *name,
                           int64_t value);

/**
 * Set a float option of an optimal control problem by name.
 *
 * @return as swb_settings_set_double
 */
SWB_API swb_status swb_ocp_set_double(struct swb_ocp *ocp, const char *name, double value);

/**
 * Set any option of an optimal control problem by name from text: a number, or the value name of an enumeration.
 *
 * @return as swb_settings_set_string
 */
SWB_API
swb_status swb_ocp_set_string(struct swb_ocp *ocp,
                              const char *name,
                              const char *value);

/**
 * Set all options of an optimal control problem.
 *
 * @param[in] settings NULL for the defaults
 * @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
 */
SWB_API swb_status swb_ocp_set_settings(struct swb_ocp *ocp, const struct swb_settings *settings);

/**
 * Options of an optimal control problem, all of them.
 *
 * @param[out] settings    every field is written
 * @param[in]  struct_size sizeof(swb_settings)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_ocp_get_settings(const struct swb_ocp *ocp,
                                struct swb_settings *settings,
                                uint64_t struct_size);

/**
 * Set who is called once per iteration; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_ocp_set_iteration(struct swb_ocp *ocp,
                                 swb_iteration_fn iteration,
                                 void *user_data);

/**
 * Set who gets the log, as much as the option log_level says; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API swb_status swb_ocp_set_log(struct swb_ocp *ocp, swb_log_fn log, void *user_data);

/**
 * Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
 * thread and from signal handlers; only swb_ocp_free must not run at the same time. It is heeded in every phase, before the
 * next evaluation of a model function and before the next factorisation: the call ends within the time of one of
 * these, a model function that takes long itself is waited for. What was found before stays the answer: an interrupt
 * during the comparison accuracy leaves the solution, with an accuracy that is NaN and a message. Where nothing was found
 * yet, while the problem is built or in swb_ocp_get_sensitivity, the call returns SWB_ERR_INTERRUPTED; max_time ends
 * calls in the same places.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_ocp_interrupt(const struct swb_ocp *ocp);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_ocp_free(struct swb_ocp *ocp);

/**
 * Sizes of an optimal control problem.
 *
 * @param[out] nx       states; may be NULL
 * @param[out] nu       controls; may be NULL
 * @param[out] np       parameters; may be NULL
 * @param[out] n_stages control stages; may be NULL
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_ocp_sizes(struct swb_ocp *ocp,
                         int64_t *nx,
                         int64_t *nu,
                         int64_t *np,
                         int64_t *n_stages);

/**
 * How far the last solution is from the system: its controls are simulated again, by other means and at the tolerance
 * accuracy_tol.
 *
 * @param[out] accuracy    every field is written
 * @param[in]  struct_size sizeof(swb_accuracy)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve, and where the option accuracy is off
 */
SWB_API
swb_status swb_ocp_get_accuracy(const struct swb_ocp *ocp,
                                struct swb_accuracy *accuracy,
                                uint64_t struct_size);

/**
 * Knowledge of the last solution as a point of the discretised program: type of stationarity, B-stationarity; unknown
 * unless it is exact (SWB_POLISHED_DONE) and the option certify is on.
 *
 * @param[out] certificate every field is written
 * @param[in]  struct_size sizeof(swb_certificate)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_certificate(const struct swb_ocp *ocp,
                                   struct swb_certificate *certificate,
                                   uint64_t struct_size);

/**
 * Largest difference between a state of the last solution and of the simulation at the end of every control stage.
 *
 * @param[out] stages [n_stages] one for each control stage
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_accuracy
 */
SWB_API
swb_status swb_ocp_get_mismatch(const struct swb_ocp *ocp,
                                double *stages,
                                int64_t n_stages);

/**
 * Why the last solve did not end with an exact solution, in the words of the model: which constraint cannot be met and by
 * how much, which function has no value where, which stage needs more elements. Of a solution, why the comparison accuracy
 * says nothing, or which state of the simulation is far off and what helps. Stages, elements, rows and states are
 * counted from zero. Empty where there is nothing to say. After a solve that returned an error it is there too.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_message(const struct swb_ocp *ocp,
                               char *buf,
                               int64_t len,
                               int64_t *needed);

/**
 * Constraints of a kind that multipliers belong to; 1 for what is no list.
 *
 * @param[in]  of enum swb_multipliers_of
 * @param[out] n  constraints, in the order in which they were added
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_NULL
 */
SWB_API swb_status swb_ocp_count_multipliers(struct swb_ocp *ocp, int32_t of, int64_t *n);

/**
 * Sizes of the multipliers of the last solution.
 *
 * @param[in]  of      enum swb_multipliers_of
 * @param[in]  index   which constraint, below swb_ocp_count_multipliers; does not count for what is no list
 * @param[out] n_times points of time
 * @param[out] width   numbers at each of them
 * @return SWB_OK; SWB_ERR_NULL; otherwise as swb_ocp_get_multipliers
 */
SWB_API
swb_status swb_ocp_multiplier_sizes(struct swb_ocp *ocp,
                                    int32_t of,
                                    int64_t index,
                                    int64_t *n_times,
                                    int64_t *width);

/**
 * Multipliers of the last solution, which must be exact: polished, or of a problem without switches. Not known of several phases.
 *
 * @param[in]  of     enum swb_multipliers_of
 * @param[in]  index  which constraint, in the order in which they were added; does not count for what is no list
 * @param[out] times  [n_times] the points of time; those at the start of the horizon for initial state and parameters
 * @param[out] values [n_values] n_times times the width, those of one point together
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution; SWB_ERR_USER, SWB_ERR_NONFINITE if
 *         the model fails
 */
SWB_API
swb_status swb_ocp_get_multipliers(struct swb_ocp *ocp,
                                   int32_t of,
                                   int64_t index,
                                   double *times,
                                   int64_t n_times,
                                   double *values,
                                   int64_t n_values);

/**
 * Name of an enum swb_verdict, such as "kink"; NULL for any other number. Static.
 */
SWB_API const char *swb_verdict_name(int32_t verdict);

/**
 * Verdict on the last solution as an optimum of the control problem. Derivatives of event-driven simulations of its controls and the
 * multipliers of its constraints decide, independently of the discretisation.
 *
 * @param[out] optimality  every field is written
 * @param[in]  struct_size sizeof(swb_optimality)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve, and where the option accuracy is off
 */
SWB_API
swb_status swb_ocp_get_optimality(const struct swb_ocp *ocp,
                                  struct swb_optimality *optimality,
                                  uint64_t struct_size);

/**
 * A switch of the last solution that lies between two control stages.
 *
 * @param[in]  index       below n_kinks of swb_optimality
 * @param[out] kink        every field is written
 * @param[in]  struct_size sizeof(swb_kink)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_STATE as swb_ocp_get_optimality
 */
SWB_API
swb_status swb_ocp_get_kink(const struct swb_ocp *ocp,
                            int64_t index,
                            struct swb_kink *kink,
                            uint64_t struct_size);

/**
 * Derivatives of the cost with respect to the controls of the last solution, with the multipliers of its constraints; of
 * controls that are linear, with respect to their slopes. Those of controls at their bounds need not vanish. NaN where the
 * verdict is SWB_VERDICT_UNKNOWN for want of a simulation.
 *
 * @param[out] gradient [n_stages * nu] the controls of the first stage first
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_optimality
 */
SWB_API
swb_status swb_ocp_get_reduced_gradient(const struct swb_ocp *ocp,
                                        double *gradient,
                                        int64_t n);

/**
 * Changes of the controls that lower the cost of the last solution to first order, where its verdict is
 * SWB_VERDICT_NOT_OPTIMAL: the largest of them is as large as that control usually is. All zero for any other verdict, and
 * where controls are linear.
 *
 * @param[out] direction [n_stages * nu] the controls of the first stage first
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_optimality
 */
SWB_API
swb_status swb_ocp_get_descent(const struct swb_ocp *ocp,
                               double *direction,
                               int64_t n);

/**
 * Why it is not known whether the last solution is optimal; empty where it is.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE as swb_ocp_get_optimality
 */
SWB_API
swb_status swb_ocp_get_optimality_reason(const struct swb_ocp *ocp,
                                         char *buf,
                                         int64_t len,
                                         int64_t *needed);

/**
 * Create an optimal control problem of a scene that is built; as swb_ocp_create with the system of the scene. Its states are
 * coordinates, then velocities, then what else it has; horizon, control grid and costs are in physical time.
 *
 * @param[in]  scene    copied; may be freed afterwards
 * @param[in]  horizon  duration
 * @param[in]  n_stages control intervals of equal length
 * @param[in]  settings NULL for the defaults
 * @param[out] out      the new object, NULL on failure; free with swb_ocp_free
 * @return as swb_ocp_create; SWB_ERR_STATE if the scene is not built
 */
SWB_NODISCARD SWB_API
swb_status swb_ocp_create_scene(const struct swb_scene *scene,
                                double horizon,
                                int64_t n_stages,
                                const struct swb_settings *settings,
                                struct swb_ocp **out);

/**
 * Set how contact modes and impacts of a scene are found. Other systems do not look at it.
 *
 * @param[in] jumps an enum swb_jumps
 * @return SWB_OK; SWB_ERR_RANGE
 */
SWB_API swb_status swb_ocp_set_jumps(struct swb_ocp *ocp, int32_t jumps);

/**
 * Sizes of what the contacts of an answer do.
 *
 * @param[out] n_contacts contacts of the scene, those that were left out not counted
 * @param[out] n_impacts  impacts, one for every contact with an impulse
 * @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene
 */
SWB_API
swb_status swb_ocp_get_contacts(const struct swb_ocp *ocp,
                                int64_t *n_contacts,
                                int64_t *n_impacts);

/**
 * The impacts of an answer in the order they happen. Their depth is NaN: it is not computed.
 *
 * @param[out] impacts     [n] n_impacts of swb_ocp_get_contacts
 * @param[in]  struct_size sizeof(swb_impact)
 * @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_DIMENSION if n is another number
 */
SWB_API
swb_status swb_ocp_impacts(const struct swb_ocp *ocp,
                           struct swb_impact *impacts,
                           int64_t n,
                           uint64_t struct_size);

/**
 * Modes of the contacts of an answer at times.
 *
 * @param[in]  t     [n_t] times within the horizon; at the time of an event the modes are those before it
 * @param[out] modes [n] n_t times n_contacts, enum swb_contact_mode, those of the first time first
 * @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_RANGE for times outside;
 *         SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_ocp_contact_modes(const struct swb_ocp *ocp,
                                 const double *t,
                                 int64_t n_t,
                                 int64_t *modes,
                                 int64_t n);

/**
 * Forces of the contacts of an answer at times: forces, not impulses.
 *
 * @param[in]  t      [n_t] times within the horizon
 * @param[out] forces [n] n_t times n_contacts times 3: the normal force and those along the tangents, zero where the contact
 *                    is open or has no tangents; the contacts of the first time first
 * @return as swb_ocp_contact_modes
 */
SWB_API
swb_status swb_ocp_contact_forces(const struct swb_ocp *ocp,
                                  const double *t,
                                  int64_t n_t,
                                  double *forces,
                                  int64_t n);

/**
 * Report on the contacts in numerical time when the search was by time-freezing: the strength a_n of the push or the stiffness k of
 * every contact, the recommended one, how long a jump takes, warnings.
 *
 * @param[out] buf    [len] the text with its final NUL, empty for other searches; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_ocp_freezing_report(const struct swb_ocp *ocp,
                                   char *buf,
                                   int64_t len,
                                   int64_t *needed);

/**
 * Sizes of the mode sequence of the last solution: a phase for every finite element that has a length.
 *
 * @param[out] n_phases phases
 * @param[out] n_modes  modes, over all subsystems; may be NULL
 * @param[out] n_cells  sign patterns the modes consist of; may be NULL
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_mode_sizes(const struct swb_ocp *ocp,
                              int64_t *n_phases,
                              int64_t *n_modes,
                              int64_t *n_cells);

/**
 * Mode sequence of the last solution.
 *
 * @param[out] times  [n_times] n_phases, when the phases start, from the start of the horizon
 * @param[out] modes  [n_modes] n_phases times the number of modes: 1 where the mode is active; several modes of a subsystem
 *                    are while it slides
 * @param[out] cells  [n_cells] the same for the sign patterns modes consist of; NULL if not wanted
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_modes(const struct swb_ocp *ocp,
                             double *times,
                             int64_t n_times,
                             int32_t *modes,
                             int64_t n_modes,
                             int32_t *cells,
                             int64_t n_cells);

/**
 * Give the order of modes: the next solves start with it, from the guesses of states and controls, and follow the
 * homotopy only where it has no solution. Every phase of a control stage needs a finite element there, which a solve
 * checks. Orders next to it are tried within the budget of the option mode_search only. Where simulations alone follow the system, only
 * motions with this order count, and the times say nothing.
 *
 * @param[in] times [n_times] when the phases start, from the start of the horizon: the first at 0, not falling; n_times = 0
 *                  forgets the order
 * @param[in] modes [n_modes] n_times times the number of modes: not 0 where the mode is active
 * @param[in] cells [n_cells] the same for the sign patterns modes consist of; none where the modes say all
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if the times fall or do not start at 0
 */
SWB_API
swb_status swb_ocp_set_modes(struct swb_ocp *ocp,
                             const double *times,
                             int64_t n_times,
                             const int32_t *modes,
                             int64_t n_modes,
                             const int32_t *cells,
                             int64_t n_cells);

/**
 * Transitions of the last solution as a part of its mode sequence: see swb_ocp_set_mode_transitions.
 *
 * @param[out] t          [n] swb_ocp_jump_count, times from the start of the horizon
 * @param[out] transition [n] which ones, in the order they were added to the system
 * @param[out] stage      [n] the control stages they are made in
 * @param[out] at_once    [n] 1 where the guard does not pass zero: it is beyond zero where its discrete state begins, or where the
 *                        control changes
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_get_mode_transitions(const struct swb_ocp *ocp,
                                        double *t,
                                        int64_t *transition,
                                        int64_t *stage,
                                        int32_t *at_once,
                                        int64_t n);

/**
 * Give the transitions of the mode sequence, which swb_ocp_set_modes was given before: in the next solves only motions with these, in this order,
 * count. Without this call after swb_ocp_set_modes it is motions with none.
 *
 * @param[in] t          [n] times from the start of the horizon; they say nothing, as swb_ocp_get_mode_transitions has them
 * @param[in] transition [n] which ones, in the order they were added to the system
 * @param[in] stage      [n] control stages, not falling; they say nothing else
 * @param[in] at_once    [n] not 0 where the guard is beyond zero without passing it; it says nothing
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE if no modes are given; SWB_ERR_RANGE for transitions or stages that do not exist, or
 *         stages that fall
 */
SWB_API
swb_status swb_ocp_set_mode_transitions(struct swb_ocp *ocp,
                                        const double *t,
                                        const int64_t *transition,
                                        const int64_t *stage,
                                        const int32_t *at_once,
                                        int64_t n);

/**
 * Random controls to start from, the same for the same seed: first the guess a solve starts from, then random ones within
 * the bounds of the controls.
 *
 * @param[out] u [n_u] n_stages * nu for every start
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_ocp_random_starts(struct swb_ocp *ocp,
                                 uint64_t seed,
                                 double *u,
                                 int64_t n_u);

/**
 * Solve from several guesses of the controls and keep the best solution, which is then the result of the problem. The
 * results are those of single solves to the last bit, whatever the number of threads. A start that fails does not keep
 * the others from being solved.
 *
 * The iteration callback is called on the thread of the caller only, for the starts that are solved there, and stops all
 * starts; so does swb_ocp_interrupt.
 *
 * @param[in]  u         [n_u] n_stages * nu for every start
 * @param[in]  n_threads threads at most, of which one is that of the caller; 0: one for each processor. With more than 1,
 *                       functions of the model are called by several threads at once; if one of them carries the flag
 *                       SWB_SERIAL, the thread of the caller does it all
 * @param[out] best      the start that was kept; may be NULL
 * @return SWB_OK, however the solves ended; SWB_ERR_DIMENSION; SWB_ERR_RANGE if n_threads is negative; that of the
 *         first start if all fail
 */
SWB_NODISCARD SWB_API
swb_status swb_ocp_solve_starts(struct swb_ocp *ocp,
                                const double *u,
                                int64_t n_u,
                                int64_t n_threads,
                                int64_t *best);

/**
 * Results of the starts of the last swb_ocp_solve_starts.
 *
 * @param[in]  start    from 0
 * @param[out] outcome  an enum swb_outcome; may be NULL
 * @param[out] polished an enum swb_polished; may be NULL
 * @param[out] cost     NaN unless the start was solved; may be NULL
 * @param[out] u        [n_u] n_stages * nu controls; NULL if not wanted
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such start; the status of the start if it failed, with its message
 */
SWB_API
swb_status swb_ocp_get_start(const struct swb_ocp *ocp,
                             int64_t start,
                             int32_t *outcome,
                             int32_t *polished,
                             double *cost,
                             double *u,
                             int64_t n_u);

/**
 * How the grid of the last solve was adapted (option adapt_tol).
 *
 * @param[out] n_rounds solves on the way, the first on the grid that was given
 * @param[out] kept     the one whose solution was kept; may be NULL
 * @param[out] reached  1 if its error is as small as asked for; may be NULL
 * @return SWB_OK; SWB_ERR_STATE before the first solve, and where the option adapt_tol is 0
 */
SWB_API
swb_status swb_ocp_get_adaptation(const struct swb_ocp *ocp,
                                  int64_t *n_rounds,
                                  int64_t *kept,
                                  int32_t *reached);

/**
 * One solve on the way to an adapted grid.
 *
 * @param[in]  round       from 0
 * @param[out] elements    [n_elements] n_stages, the finite elements of every control stage; NULL if not wanted
 * @param[out] n_variables of the discretised problem; may be NULL
 * @param[out] iterations  may be NULL
 * @param[out] error       largest difference of a state from the simulation at the ends of the control stages, NaN where
 *                         the simulation got stuck; may be NULL
 * @param[out] cost        NaN unless the round was solved; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such round; SWB_ERR_STATE as swb_ocp_get_adaptation
 */
SWB_API
swb_status swb_ocp_get_round(const struct swb_ocp *ocp,
                             int64_t round,
                             int64_t *elements,
                             int64_t n_elements,
                             int64_t *n_variables,
                             int64_t *iterations,
                             double *error,
                             double *cost);

/**
 * Add the constraint lower <= f([x(0); x(T)], u, p, t) <= upper between both ends of the horizon: f has 2 nx states, and sees
 * control and time of the end.
 *
 * @param[in] lower [n_lower] one for each output
 * @param[in] upper [n_upper] one for each output
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_add_boundary(struct swb_ocp *ocp,
                                const struct swb_function *f,
                                const double *lower,
                                int64_t n_lower,
                                const double *upper,
                                int64_t n_upper);

/**
 * Require that states have the same values at both ends of the horizon.
 *
 * @param[in] states [n_states] indices of states
 * @return SWB_OK; SWB_ERR_RANGE if there is no such state
 */
SWB_API
swb_status swb_ocp_add_periodic(struct swb_ocp *ocp,
                                const int64_t *states,
                                int64_t n_states);

/**
 * Add (f - y)' W (f - y) to the cost, integrated, summed over the ends of the control stages, or at the end.
 *
 * @param[in] weights    [n_weights] the diagonal of W, one for each output, or all of W
 * @param[in] references [n_references] y, or one y for every control stage
 * @param[in] at         an enum swb_cost_at
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
 */
SWB_API
swb_status swb_ocp_add_least_squares(struct swb_ocp *ocp,
                                     const struct swb_function *f,
                                     const double *weights,
                                     int64_t n_weights,
                                     const double *references,
                                     int64_t n_references,
                                     int32_t at);

/**
 * Change the references of a least-squares term.
 *
 * @param[in] term       in the order they were added, from 0
 * @param[in] references [n_references] as swb_ocp_add_least_squares
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no such term
 */
SWB_API
swb_status swb_ocp_set_references(struct swb_ocp *ocp,
                                  int64_t term,
                                  const double *references,
                                  int64_t n_references);

/**
 * Add a constraint that may be violated at a price: weight times the norm of the violation. The cost that is reported is
 * without it; see swb_ocp_get_violation.
 *
 * @param[in] lower [n_lower] one for each output
 * @param[in] upper [n_upper] one for each output
 * @param[in] at    an enum swb_path_at, or -1: at the end of the horizon
 * @param[in] norm  an enum swb_norm
 * @return as swb_ocp_add_path; SWB_ERR_RANGE if the weight is not positive
 */
SWB_API
swb_status swb_ocp_add_relaxed(struct swb_ocp *ocp,
                               const struct swb_function *f,
                               const double *lower,
                               int64_t n_lower,
                               const double *upper,
                               int64_t n_upper,
                               int32_t at,
                               int32_t norm,
                               double weight);

/**
 * Add 0 <= a(x,u,p,t) _|_ b(x,u,p,t) >= 0 along the horizon, component by component: both are not negative, and one of them
 * is zero. Pairs of controls alone belong to the control grid; elsewhere they would be said several times.
 *
 * @param[in] a  n outputs
 * @param[in] b  as many
 * @param[in] at an enum swb_path_at; the starts of stages are left out
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_add_complementarity(struct swb_ocp *ocp,
                                       const struct swb_function *a,
                                       const struct swb_function *b,
                                       int32_t at);

/**
 * Set the number of finite elements of every control stage; without it all have as many as the option n_fe says.
 *
 * @param[in] n_fe [n] one for every stage, at least 1
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
 */
SWB_API
swb_status swb_ocp_set_elements(struct swb_ocp *ocp,
                                const int64_t *n_fe,
                                int64_t n);

/**
 * Set the lengths of the control stages; where they are free, those to start from.
 *
 * @param[in] durations [n] one for every stage, positive
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
 */
SWB_API swb_status swb_ocp_set_durations(struct swb_ocp *ocp, const double *durations, int64_t n);

/**
 * Let the optimiser choose lengths.
 *
 * @param[in] what  an enum swb_free_time
 * @param[in] lower of the horizon, or of a stage
 * @param[in] upper of the horizon, or of a stage
 * @return SWB_OK; SWB_ERR_RANGE
 */
SWB_API
swb_status swb_ocp_set_free_time(struct swb_ocp *ocp,
                                 int32_t what,
                                 double lower,
                                 double upper);

/**
 * Bound the length of the horizon where those of the stages are free; after swb_ocp_set_initial_time.
 *
 * @return SWB_OK; SWB_ERR_RANGE
 */
SWB_API
swb_status swb_ocp_add_horizon(struct swb_ocp *ocp,
                               double lower,
                               double upper);

/**
 * Make controls continuous and linear on every stage; the others stay constant.
 *
 * @param[in] linear [nu] 1 or 0 for every control
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_ocp_set_linear_controls(struct swb_ocp *ocp,
                                       const int32_t *linear,
                                       int64_t nu);

/**
 * Make parameters with a lower bound below the upper one variables, which start at the values of swb_ocp_set_params;
 * the others keep those values.
 *
 * @param[in] lower [n_lower] np
 * @param[in] upper [n_upper] np
 * @return as swb_ocp_add_path
 */
SWB_API
swb_status swb_ocp_set_param_bounds(struct swb_ocp *ocp,
                                    const double *lower,
                                    int64_t n_lower,
                                    const double *upper,
                                    int64_t n_upper);

/**
 * Set parameters that change from control stage to control stage.
 *
 * @param[in] p [n_p] n_stages * np, the parameters of one stage together
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
 */
SWB_API swb_status swb_ocp_set_stage_params(struct swb_ocp *ocp, const double *p, int64_t n_p);

/**
 * Solve from the last solution: after small changes its active set is tried first.
 *
 * @param[out] outcome as swb_ocp_solve
 * @return as swb_ocp_solve
 */
SWB_NODISCARD SWB_API swb_status swb_ocp_solve_warm(struct swb_ocp *ocp, int32_t *outcome);

/**
 * Make the last solution, one control stage later, the guess of the next solve. swb_ocp_solve_warm then simulates it from the
 * initial state that is set by then, and starts from its modes and switching times.
 *
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_shift(struct swb_ocp *ocp);

/**
 * Lengths of the control stages of the last solution.
 *
 * @param[out] durations [n] n_stages
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_durations(const struct swb_ocp *ocp, double *durations, int64_t n);

/**
 * Parameters of the last solution, those that were free as they were found.
 *
 * @param[out] p [n_p] np
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_params(const struct swb_ocp *ocp, double *p, int64_t n_p);

/**
 * Controls at the end of every stage: others than at its start where they are linear.
 *
 * @param[out] u [n_u] n_stages * nu, the controls of one stage together
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_control_ends(const struct swb_ocp *ocp, double *u, int64_t n_u);

/**
 * Largest violation of a relaxed constraint.
 *
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_get_violation(const struct swb_ocp *ocp, double *violation);

/**
 * Number of transitions of the last answer.
 *
 * @param[out] n_jumps transitions; 0 for systems without
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_ocp_jump_count(const struct swb_ocp *ocp, int64_t *n_jumps);

/**
 * The transitions of the last answer in the order of time.
 *
 * @param[out] jumps       [n] swb_ocp_jump_count
 * @param[in]  struct_size sizeof(swb_ocp_jump)
 * @return SWB_OK; SWB_ERR_DIMENSION if n is another number; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_jumps(const struct swb_ocp *ocp,
                         struct swb_ocp_jump *jumps,
                         int64_t n,
                         uint64_t struct_size);

/**
 * The states just before and just behind a transition of the last answer.
 *
 * @param[in]  index  its place in swb_ocp_jumps, from 0
 * @param[out] before [n] nx
 * @param[out] after  [n] nx
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_ocp_jump_states(const struct swb_ocp *ocp,
                               int64_t index,
                               double *before,
                               double *after,
                               int64_t n);

/**
 * Create a problem of phases, one after the other. The initial state of a phase is free unless its problem bounds it;
 * links tie it to the end of the phase before. A function of time sees the time from the start of the first phase on.
 *
 * @param[in]  phases   [n_phases] copied as they are stated; may be freed afterwards
 * @param[in]  settings of the solver; NULL for those of the first phase
 * @param[out] out      the new object, NULL on failure; free with swb_multiphase_free
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION without phases; SWB_ERR_RANGE if an option is outside its range
 */
SWB_NODISCARD SWB_API
swb_status swb_multiphase_create(struct swb_ocp *const *phases,
                                 int64_t n_phases,
                                 const struct swb_settings *settings,
                                 struct swb_multiphase **out);

/**
 * Require lower <= f([x(T) of the phase; x(0) of the next]) <= upper: f has as many states as both phases together, no
 * controls and no parameters.
 *
 * @param[in] phase the first of the two, counted from 0
 * @param[in] lower [n_lower] one for each output
 * @param[in] upper [n_upper] one for each output
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no phase behind, or a lower bound is above the upper one
 */
SWB_API
swb_status swb_multiphase_link(struct swb_multiphase *m,
                               int64_t phase,
                               const struct swb_function *f,
                               const double *lower,
                               int64_t n_lower,
                               const double *upper,
                               int64_t n_upper);

/**
 * Require that the next phase begins where this one ends, in all states.
 *
 * @param[in] phase counted from 0
 * @return as swb_multiphase_link
 */
SWB_API swb_status swb_multiphase_link_continuous(struct swb_multiphase *m, int64_t phase);

/**
 * Require that the next phase begins at r(x(T)): what a stage that drops off, a docking or a planned impact does to the states.
 *
 * @param[in] phase counted from 0
 * @param[in] r     the states at the end of the phase as they are at the start of the next: as many states as the phase, no controls
 *                  and no parameters, one output for each state of the next phase
 * @return as swb_multiphase_link
 */
SWB_API
swb_status swb_multiphase_link_reset(struct swb_multiphase *m,
                                     int64_t phase,
                                     const struct swb_function *r);

/**
 * Solve.
 *
 * @param[out] outcome an enum swb_outcome; may be NULL
 * @return as swb_ocp_solve
 */
SWB_NODISCARD SWB_API swb_status swb_multiphase_solve(struct swb_multiphase *m, int32_t *outcome);

/**
 * Result of the last solve.
 *
 * @param[out] info        every field is written
 * @param[in]  struct_size sizeof(swb_multiphase_info)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_multiphase_get_info(const struct swb_multiphase *m,
                                   struct swb_multiphase_info *info,
                                   uint64_t struct_size);

/**
 * Why the last solve did not end with an exact solution; empty where there is nothing to say.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_multiphase_get_message(const struct swb_multiphase *m,
                                      char *buf,
                                      int64_t len,
                                      int64_t *needed);

/**
 * A copy of a phase with its part of the last solution: swb_ocp_get_controls and its like read it. Its outcome, residuals
 * and statistics are those of all phases.
 *
 * @param[in]  phase counted from 0
 * @param[out] out   the new object, NULL on failure; free with swb_ocp_free
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_multiphase_get_phase(struct swb_multiphase *m,
                                    int64_t phase,
                                    struct swb_ocp **out);

/**
 * Set who is called once per iteration; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_multiphase_set_iteration(struct swb_multiphase *m,
                                        swb_iteration_fn iteration,
                                        void *user_data);

/**
 * Stop the call that runs now, or the next one if none runs; see swb_ocp_interrupt.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API swb_status swb_multiphase_interrupt(const struct swb_multiphase *m);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_multiphase_free(struct swb_multiphase *m);

/**
 * A model as a document in JSON, for bug reports and to pass it on: its expressions, names and trial point, its discrete
 * states with the values they begin with, and its transitions. Functions that are called are named.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if the buffer is
 *         too short
 */
SWB_API
swb_status swb_model_to_json(const struct swb_model *model,
                             char *buf,
                             int64_t len,
                             int64_t *needed);

/**
 * Build a model from a document; its expressions become expressions of the graph.
 *
 * @param[in]  graph     may hold other expressions, which stay
 * @param[in]  text      of swb_model_to_json
 * @param[in]  functions [n_functions] those that the document calls by name
 * @param[out] rhs       [n_rhs] the derivatives of the states; NULL with n_rhs 0 if not wanted
 * @param[out] out       the new object, NULL on failure; free with swb_model_free
 * @return SWB_OK; SWB_ERR_RANGE if the text is no such document, with the place; SWB_ERR_UNSUPPORTED for other versions;
 *         SWB_ERR_STATE if a function is missing; SWB_ERR_DIMENSION; else as swb_model_create
 */
SWB_NODISCARD SWB_API
swb_status swb_model_from_json(struct swb_expr *graph,
                               const char *text,
                               const struct swb_function *const *functions,
                               int64_t n_functions,
                               int64_t *rhs,
                               int64_t n_rhs,
                               struct swb_model **out);

/**
 * A scene, or a projected system, as a document in JSON: its sizes, names and expressions, contacts, friction, constraints, discrete states
 * and transitions. Functions that are called are named.
 *
 * @param[in]  graph  the graph of its expressions
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_STATE for another graph; SWB_ERR_UNSUPPORTED if two functions that are called have one name;
 *         SWB_ERR_DIMENSION if the buffer is too short
 */
SWB_API
swb_status swb_scene_to_json(struct swb_scene *scene,
                             const struct swb_expr *graph,
                             char *buf,
                             int64_t len,
                             int64_t *needed);

/**
 * Create a scene, or a projected system, from a document; its expressions become expressions of the graph. It is not built yet.
 *
 * @param[in]  graph     may hold other expressions, which stay
 * @param[in]  text      of swb_scene_to_json
 * @param[in]  functions [n_functions] those that the document calls by name
 * @param[out] roots     [n_roots] expressions: of every contact the gap, then the tangents, of friction what slides, of a constraint what is
 *                       zero; then of every transition the guard, and what its reset makes of states; NULL with n_roots 0 if not wanted
 * @param[out] out       the new object, NULL on failure; free with swb_scene_free
 * @return SWB_OK; SWB_ERR_RANGE if the text is no such document, with the place; SWB_ERR_UNSUPPORTED for other versions;
 *         SWB_ERR_STATE if a function is missing; SWB_ERR_DIMENSION; else as the functions that make a scene
 */
SWB_NODISCARD SWB_API
swb_status swb_scene_from_json(struct swb_expr *graph,
                               const char *text,
                               const struct swb_function *const *functions,
                               int64_t n_functions,
                               int64_t *roots,
                               int64_t n_roots,
                               struct swb_scene **out);

/**
 * Numbers of states, controls and parameters of a model. Any output may be NULL.
 *
 * @return SWB_OK
 */
SWB_API
swb_status swb_model_sizes(const struct swb_model *model,
                           int64_t *nx,
                           int64_t *nu,
                           int64_t *np);

/**
 * A simulation as a document in JSON: system, options, and time, state, controls and parameters where the simulator stands.
 * Functions that are not made of expressions are named only.
 *
 * @param[in]  duration of the run that is to be repeated
 * @param[in]  n_steps  of that run
 * @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed   length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if
 *         the buffer is too short
 */
SWB_API
swb_status swb_simulator_to_json(const struct swb_simulator *sim,
                                 double duration,
                                 int64_t n_steps,
                                 char *buf,
                                 int64_t len,
                                 int64_t *needed);

/**
 * Create a simulator from a document; it stands where the simulation begins.
 *
 * @param[in]  text      of swb_simulator_to_json
 * @param[in]  functions [n_functions] those that the document names
 * @param[out] duration  of the run; may be NULL
 * @param[out] n_steps   of the run; may be NULL
 * @param[out] out       the new object, NULL on failure; free with swb_simulator_free
 * @return as swb_model_from_json
 */
SWB_NODISCARD SWB_API
swb_status swb_simulator_from_json(const char *text,
                                   const struct swb_function *const *functions,
                                   int64_t n_functions,
                                   double *duration,
                                   int64_t *n_steps,
                                   struct swb_simulator **out);

/**
 * An optimal control problem as a document in JSON: system, costs, constraints, bounds, parameters, options, and what is
 * given to start from. Functions that are not made of expressions are named only.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if the buffer is
 *         too short
 */
SWB_API
swb_status swb_ocp_to_json(struct swb_ocp *ocp,
                           char *buf,
                           int64_t len,
                           int64_t *needed);

/**
 * Create an optimal control problem from a document.
 *
 * @param[in]  text      of swb_ocp_to_json
 * @param[in]  functions [n_functions] those that the document names
 * @param[out] out       the new object, NULL on failure; free with swb_ocp_free
 * @return as swb_model_from_json
 */
SWB_NODISCARD SWB_API
swb_status swb_ocp_from_json(const char *text,
                             const struct swb_function *const *functions,
                             int64_t n_functions,
                             struct swb_ocp **out);

/**
 * Create a program without pairs and bounds, parameters and start zero.
 *
 * @param[in]  n           variables, the block x of the functions
 * @param[in]  np          parameters, the block p of the functions
 * @param[in]  objective   one output
 * @param[in]  constraints the rows c; NULL if there are none
 * @param[in]  settings    NULL for the defaults
 * @param[out] out         the new object, NULL on failure; free with swb_mpcc_free
 * @return SWB_OK; SWB_ERR_DIMENSION if the sizes of a function are not (n, 0, np)
 */
SWB_NODISCARD SWB_API
swb_status swb_mpcc_create(int64_t n,
                           int64_t np,
                           const struct swb_function *objective,
                           const struct swb_function *constraints,
                           const struct swb_settings *settings,
                           struct swb_mpcc **out);

/**
 * Add the pair 0 <= G _|_ H >= 0.
 *
 * A constraint may be in one pair only; a variable in several.
 *
 * @param[in] kind_g  an enum swb_member: what G is
 * @param[in] index_g its index
 * @param[in] kind_h  an enum swb_member: what H is
 * @param[in] index_h its index
 * @return SWB_OK; SWB_ERR_RANGE if there is no such kind or a member cannot be used; SWB_ERR_DIMENSION if
 *         there is no such index
 */
SWB_API
swb_status swb_mpcc_add_pair(struct swb_mpcc *mpcc,
                             int32_t kind_g,
                             int64_t index_g,
                             int32_t kind_h,
                             int64_t index_h);

/**
 * Add the box lower <= w_i <= upper _|_ c_j: the constraint is not negative where the variable is at its lower bound, not positive
 * at its upper bound, and zero between them. The bounds are those of the variable (swb_mpcc_set_bounds) at the time of a solve;
 * infinite ones take no part. Where both are equal any value of the constraint will do. A mixed complementarity
 * problem (MCP) is a box for every variable with an objective that is zero; lower bounds zero and upper bounds infinite make a
 * nonlinear complementarity problem.
 *
 * @param[in] variable   its index; it may be in several boxes and pairs
 * @param[in] constraint its index; its own bounds are not used, and it may be in one box or pair only
 * @return SWB_OK; SWB_ERR_RANGE if the constraint is in a pair or box; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API
swb_status swb_mpcc_add_box(struct swb_mpcc *mpcc,
                            int64_t variable,
                            int64_t constraint);

/**
 * Give second derivatives in one piece, in place of the Hessians of objective and constraints.
 *
 * For functions described with swb_function_set_linear nothing else is prepared, although they are not linear.
 *
 * @param[in] col_ptr   [n + 1] where the columns start; the last one is nnz
 * @param[in] row_idx   [nnz] rows from 0, increasing within each column, upper triangle (row <= column)
 * @param[in] hessian   NULL: back to the Hessians of the functions; the pattern is not read
 * @param[in] user_data passed on unchanged; must stay valid as long as the program has the callback
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION or SWB_ERR_RANGE if this is no such pattern
 */
SWB_API
swb_status swb_mpcc_set_hessian(struct swb_mpcc *mpcc,
                                const int64_t *col_ptr,
                                int64_t n_col_ptr,
                                const int64_t *row_idx,
                                int64_t nnz,
                                swb_lagrangian_fn hessian,
                                void *user_data);

/**
 * Set bounds of the variables.
 *
 * @param[in] lower [n_lower] n
 * @param[in] upper [n_upper] n
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a lower bound is above the upper one or NaN
 */
SWB_API
swb_status swb_mpcc_set_bounds(struct swb_mpcc *mpcc,
                               const double *lower,
                               int64_t n_lower,
                               const double *upper,
                               int64_t n_upper);

/**
 * Set bounds of the constraints; equal bounds make an equation. Those of rows in pairs are not used.
 *
 * @param[in] lower [n_lower] rows
 * @param[in] upper [n_upper] rows
 * @return as swb_mpcc_set_bounds
 */
SWB_API
swb_status swb_mpcc_set_constraint_bounds(struct swb_mpcc *mpcc,
                                          const double *lower,
                                          int64_t n_lower,
                                          const double *upper,
                                          int64_t n_upper);

/**
 * Set the parameters.
 *
 * @param[in] values [np]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API swb_status swb_mpcc_set_params(struct swb_mpcc *mpcc, const double *values, int64_t np);

/**
 * Set the point to start from.
 *
 * @param[in] w [n]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API swb_status swb_mpcc_set_start(struct swb_mpcc *mpcc, const double *w, int64_t n);

/**
 * Start the next solves from a point with multipliers, as a solution of a program nearby has them; swb_mpcc_set_start
 * goes back to starting from a point alone.
 *
 * @param[in] w [n]
 * @param[in] y [m] multipliers of the constraints; NULL with m = 0 for none
 * @param[in] z [n_z] n multipliers of the bounds, both as swb_mpcc_get_multipliers has them; NULL with n_z = 0 for
 *                  none
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
 */
SWB_API
swb_status swb_mpcc_set_warm_start(struct swb_mpcc *mpcc,
                                   const double *w,
                                   int64_t n,
                                   const double *y,
                                   int64_t m,
                                   const double *z,
                                   int64_t n_z);

/**
 * Solve.
 *
 * @param[out] outcome an enum swb_outcome; may be NULL
 * @return SWB_OK, however the solver ended; SWB_ERR_USER if a user function returned a negative code;
 *         SWB_ERR_NONFINITE if one has no value at the start; SWB_ERR_NUMERIC; SWB_ERR_RANGE,
 *         SWB_ERR_UNSUPPORTED if bounds and pairs do not go together
 */
SWB_NODISCARD SWB_API
swb_status swb_mpcc_solve(struct swb_mpcc *mpcc,
                          int32_t *outcome);

/**
 * Solve from the last solution and its multipliers, as after a change of parameters or bounds. After a solve that
 * failed, diverged or ended infeasible this is swb_mpcc_solve.
 *
 * @param[out] outcome an enum swb_outcome; may be NULL
 * @return as swb_mpcc_solve; SWB_ERR_STATE before the first solve
 */
SWB_NODISCARD SWB_API
swb_status swb_mpcc_resolve(struct swb_mpcc *mpcc,
                            int32_t *outcome);

/**
 * How the last solve ended.
 *
 * @param[out] outcome an enum swb_outcome
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_mpcc_get_outcome(const struct swb_mpcc *mpcc, int32_t *outcome);

/**
 * Outcome of the polish, which identifies the active set and solves the smooth program that remains.
 *
 * @param[out] polished an enum swb_polished
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_polished(const struct swb_mpcc *mpcc,
                                 int32_t *polished);

/**
 * Objective.
 *
 * @return SWB_OK; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_mpcc_get_objective(const struct swb_mpcc *mpcc, double *objective);

/**
 * The point.
 *
 * @param[out] w [n]
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_mpcc_get_solution(const struct swb_mpcc *mpcc, double *w, int64_t n);

/**
 * Constraints at the point.
 *
 * @param[out] c [m] rows; NaN where the solve failed
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API swb_status swb_mpcc_get_constraints(const struct swb_mpcc *mpcc, double *c, int64_t m);

/**
 * Multipliers: grad f + J' y - z = 0, with J the Jacobian of the constraints.
 *
 * @param[out] y [m] of the constraints
 * @param[out] z [n] of the bounds, lower minus upper; for variables in pairs the multiplier of the pair, and
 *                   the sum of them for a variable in several
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_multipliers(const struct swb_mpcc *mpcc,
                                    double *y,
                                    int64_t m,
                                    double *z,
                                    int64_t n);

/**
 * Values of the members of the pairs, and their multipliers (nu of G, xi of H) at the point, in the order
 * the pairs were added.
 *
 * @param[out] g  [n_pairs] may be NULL
 * @param[out] h  [n_pairs] may be NULL
 * @param[out] nu [n_pairs] may be NULL
 * @param[out] xi [n_pairs] may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_pairs(const struct swb_mpcc *mpcc,
                              double *g,
                              double *h,
                              double *nu,
                              double *xi,
                              int64_t n_pairs);

/**
 * Residuals of the last solve.
 *
 * @param[out] residuals   every field is written
 * @param[in]  struct_size sizeof(swb_residuals)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_residuals(const struct swb_mpcc *mpcc,
                                  struct swb_residuals *residuals,
                                  uint64_t struct_size);

/**
 * Work and time of the last solve.
 *
 * @param[out] stats       every field is written
 * @param[in]  struct_size sizeof(swb_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_stats(const struct swb_mpcc *mpcc,
                              struct swb_stats *stats,
                              uint64_t struct_size);

/**
 * Set an integer or enumeration option of a program (or a float one, to an integer) by name.
 *
 * @return as swb_settings_set_int
 */
SWB_API swb_status swb_mpcc_set_int(struct swb_mpcc *mpcc, const char *name, int64_t value);

/**
 * Set a float option of a program by name.
 *
 * @return as swb_settings_set_double
 */
SWB_API swb_status swb_mpcc_set_double(struct swb_mpcc *mpcc, const char *name, double value);

/**
 * Set any option of a program by name from text: a number, or the value name of an enumeration.
 *
 * @return as swb_settings_set_string
 */
SWB_API swb_status swb_mpcc_set_string(struct swb_mpcc *mpcc, const char *name, const char *value);

/**
 * Set all options of a program.
 *
 * @param[in] settings NULL for the defaults
 * @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
 */
SWB_API
swb_status swb_mpcc_set_settings(struct swb_mpcc *mpcc,
                                 const struct swb_settings *settings);

/**
 * Options of a program, all of them.
 *
 * @param[out] settings    every field is written
 * @param[in]  struct_size sizeof(swb_settings)
 * @return SWB_OK; SWB_ERR_DIMENSION
 */
SWB_API
swb_status swb_mpcc_get_settings(const struct swb_mpcc *mpcc,
                                 struct swb_settings *settings,
                                 uint64_t struct_size);

/**
 * Set who is called once per iteration; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API
swb_status swb_mpcc_set_iteration(struct swb_mpcc *mpcc,
                                  swb_iteration_fn iteration,
                                  void *user_data);

/**
 * Set who gets the log, as much as the option log_level says; NULL for nobody.
 *
 * @param[in] user_data passed on unchanged
 * @return SWB_OK
 */
SWB_API swb_status swb_mpcc_set_log(struct swb_mpcc *mpcc, swb_log_fn log, void *user_data);

/**
 * Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
 * thread and from signal handlers; only swb_mpcc_free must not run at the same time. It is heeded in every phase, before the
 * next evaluation of a model function and before the next factorisation: the call ends within the time of one of
 * these, a model function that takes long itself is waited for. What was found before stays the answer.
 *
 * @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
 */
SWB_API
swb_status swb_mpcc_interrupt(const struct swb_mpcc *mpcc);

/**
 * Free; NULL is allowed.
 */
SWB_API void swb_mpcc_free(struct swb_mpcc *mpcc);

/**
 * Derivatives of the last solution with respect to all parameters, with the active bounds and sides of pairs as they are. The
 * solution must be exact (SWB_POLISHED_DONE, or solved if there are no pairs). Functions need derivatives by the parameters as well. One
 * factorisation, and a solve for every parameter; swb_mpcc_vjp is faster where one number depends on many parameters.
 *
 * A derivative that is returned holds on the sides that are returned with it. Where it is not known it is NaN. Bounds and parameters
 * that were set since the solve are not used.
 *
 * @param[out] x         [n_x] np * n, derivatives of the point, those by one parameter together; NULL with n_x 0 if not wanted
 * @param[out] objective [n_objective] np, derivatives of the objective; NULL with n_objective 0 if not wanted
 * @param[out] sides     [n_sides] np, an enum swb_sides each; NULL with n_sides 0 if not wanted
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution, or after pairs or options that are fixed when a program
 *         is made have changed; SWB_ERR_NUMERIC if the solution is no isolated minimiser, or if derivatives by the parameters are
 *         not those of the functions; SWB_ERR_NONFINITE if a function has no value next to the parameters; SWB_ERR_USER
 */
SWB_API
swb_status swb_mpcc_get_tangents(struct swb_mpcc *mpcc,
                                 double *x,
                                 int64_t n_x,
                                 double *objective,
                                 int64_t n_objective,
                                 int32_t *sides,
                                 int64_t n_sides);

/**
 * The derivative of the last solution with respect to its parameters from the left: the weights p of the parameters for weights x of
 * the point and objective of the objective, which are derivatives of a number that depends on both (a vector-Jacobian product).
 * Conditions are those of swb_mpcc_get_tangents. One solve with the factorised matrix for all parameters where the solution is
 * differentiable, and one for each where it is not.
 *
 * @param[in]  x         [n_x] n, weights of the point; NULL with n_x 0 for zeros
 * @param[in]  objective weight of the objective
 * @param[out] p         [n_p] np; NaN where the derivative is not known
 * @param[out] sides     [n_sides] np, an enum swb_sides each; NULL with n_sides 0 if not wanted
 * @return as swb_mpcc_get_tangents; SWB_ERR_RANGE if a weight is not finite
 */
SWB_API
swb_status swb_mpcc_vjp(struct swb_mpcc *mpcc,
                        const double *x,
                        int64_t n_x,
                        double objective,
                        double *p,
                        int64_t n_p,
                        int32_t *sides,
                        int64_t n_sides);

/**
 * Name of an enum swb_stationarity, such as "M"; NULL for any other number. Static.
 */
SWB_API const char *swb_stationarity_name(int32_t stationarity);

/**
 * Name of an enum swb_doubt, such as "nodes"; NULL for any other number. Static.
 */
SWB_API const char *swb_doubt_name(int32_t doubt);

/**
 * Name of an enum swb_second_order, such as "saddle"; NULL for any other number. Static.
 */
SWB_API const char *swb_second_order_name(int32_t second_order);

/**
 * Name a variable, a constraint, a pair or a box: reports and messages of the log use it.
 *
 * @param[in] kind  an enum swb_item
 * @param[in] index its number; pairs and boxes count in the order they were added
 * @param[in] name  copied; NULL or "" takes a name away
 * @return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API
swb_status swb_mpcc_set_name(struct swb_mpcc *mpcc,
                             int32_t kind,
                             int64_t index,
                             const char *name);

/**
 * Name all variables, constraints, pairs or boxes.
 *
 * @param[in] kind  an enum swb_item
 * @param[in] names [n] copied; NULL or "" for no name
 * @param[in] n     number of variables, constraints, pairs or boxes
 * @return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if n is not their number
 */
SWB_API
swb_status swb_mpcc_set_names(struct swb_mpcc *mpcc,
                              int32_t kind,
                              const char *const *names,
                              int64_t n);

/**
 * Name of a variable, constraint or pair, such as "T_out"; "variable 3" without one.
 *
 * @param[in]  kind   an enum swb_item
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if there is no such index or the
 *         buffer is too short
 */
SWB_API
swb_status swb_mpcc_get_name(const struct swb_mpcc *mpcc,
                             int32_t kind,
                             int64_t index,
                             char *buf,
                             int64_t len,
                             int64_t *needed);

/**
 * Violations at the point of the last solve, the worst first: bounds by how much they are exceeded, pairs by
 * min(G, H).
 *
 * @param[out] kinds      [k] enum swb_item
 * @param[out] indices    [k]
 * @param[out] violations [k] positive
 * @param[in]  k          how many are wanted at most; 0 with NULL arrays to ask for their number
 * @param[out] found      how many there are, also beyond k; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_worst(const struct swb_mpcc *mpcc,
                              int32_t *kinds,
                              int64_t *indices,
                              double *violations,
                              int64_t k,
                              int64_t *found);

/**
 * Constraints, bounds and pairs that contradict each other, after the outcome SWB_OUTCOME_INFEASIBLE; the heaviest
 * first. Weights of constraints are positive where the upper bound takes part, negative where the lower one does;
 * those of variables the other way round.
 *
 * The weighted sum of the constraints exceeds what their bounds allow by `gap`, and its gradient is held by the bounds
 * of the variables up to `residual`: with linear constraints a proof that there is no point, with others one to first
 * order.
 *
 * @param[out] kinds    [k] enum swb_item
 * @param[out] indices  [k]
 * @param[out] weights  [k] the largest modulus of a constraint is 1
 * @param[in]  k        how many are wanted at most; 0 with NULL arrays to ask for their number
 * @param[out] found    how many there are, also beyond k; 0 without a conflict; may be NULL
 * @param[out] gap      may be NULL
 * @param[out] residual may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_conflict(const struct swb_mpcc *mpcc,
                                 int32_t *kinds,
                                 int64_t *indices,
                                 double *weights,
                                 int64_t k,
                                 int64_t *found,
                                 double *gap,
                                 double *residual);

/**
 * Knowledge of the point of the last solve: type of stationarity, B-stationarity.
 *
 * @param[out] certificate every field is written
 * @param[in]  struct_size sizeof(swb_certificate)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_certificate(const struct swb_mpcc *mpcc,
                                    struct swb_certificate *certificate,
                                    uint64_t struct_size);

/**
 * Residuals of the last solve with objective and constraints scaled as the solver scaled them, which are those
 * that the option tol is compared with.
 *
 * @param[out] residuals   every field is written
 * @param[in]  struct_size sizeof(swb_residuals)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_scaled_residuals(const struct swb_mpcc *mpcc,
                                         struct swb_residuals *residuals,
                                         uint64_t struct_size);

/**
 * Sizes, pivots and work of the linear systems, since the program was built.
 *
 * @param[out] stats       every field is written
 * @param[in]  struct_size sizeof(swb_linear_stats)
 * @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_get_linear_stats(const struct swb_mpcc *mpcc,
                                     struct swb_linear_stats *stats,
                                     uint64_t struct_size);

/**
 * Everything about the last solve but the point, as one JSON object: see docs/mpcc.md.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
 */
SWB_API
swb_status swb_mpcc_statistics_json(const struct swb_mpcc *mpcc,
                                    char *buf,
                                    int64_t len,
                                    int64_t *needed);

/**
 * Report on the last solve for people: a table with the worst violations and what looks wrong about the program.
 *
 * @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
 * @param[out] needed length with the final NUL; may be NULL
 * @return as swb_mpcc_statistics_json
 */
SWB_API
swb_status swb_mpcc_report_text(const struct swb_mpcc *mpcc,
                                char *buf,
                                int64_t len,
                                int64_t *needed);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SWITCHBACK_H */
