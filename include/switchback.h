/* switchback: simulation and optimal control of systems that switch. C interface.
 *
 * Generated from src/capi; do not edit. BSD-2-Clause, see LICENSE.
 *
 * Calls return a swb_status: SWB_OK, or a negative code that says why the call could not do its work;
 * swb_last_error() of the same thread has the message. On failure no output is written, except NULL to
 * the new object of a constructor and the needed length of a text.
 *
 * Arrays are followed by their length, given as [n] in the descriptions; NULL with length 0 is an empty
 * array. Inputs are copied. Matrices are compressed by columns with indices from 0, rows increasing;
 * dense matrices are stored by columns. Numbers of modulus 1e20 and more are infinite. Texts are UTF-8.
 *
 * Objects are opaque and independent of each other. A const pointer to an object may be used by several
 * threads at once, any other by one; calling back into the same object from a callback is SWB_ERR_STATE.
 * Freeing NULL does nothing. Callbacks return 0, a positive code if they are not defined at the point
 * (the solver tries another one), a negative code to stop; they must not unwind. */


#ifndef SWITCHBACK_H
#define SWITCHBACK_H

#include <stdint.h>

/* Version of this header; see swb_check_version. */
#define SWB_VERSION_MAJOR 0
#define SWB_VERSION_MINOR 1
#define SWB_VERSION_PATCH 0
#define SWB_VERSION "0.1.0"

#ifndef SWB_API
#define SWB_API
#endif


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
 * Runge-Kutta family (rk_family).
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
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_rk_family swb_rk_family;
#else
typedef int64_t swb_rk_family;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Treatment of switches by the discretisation (discretisation).
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
 * Unknowns at the stage points (stage_form).
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
 * Granularity of the cross complementarity (cross).
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
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_cross swb_cross;
#else
typedef int64_t swb_cross;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Step equilibration during the homotopy (step_equilibration).
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
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_step_equilibration swb_step_equilibration;
#else
typedef int64_t swb_step_equilibration;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Polishing after the homotopy (polish).
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
 * Initial guess of the discretised problem (initial_guess).
 */
enum swb_initial_guess
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int64_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The initial value at every node.
     */
    SWB_INITIAL_GUESS_CONSTANT = 0,
    /**
     * A simulation with the guessed controls.
     */
    SWB_INITIAL_GUESS_SIMULATION = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum swb_initial_guess swb_initial_guess;
#else
typedef int64_t swb_initial_guess;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Verbosity of the log sink (log_level); each level contains the ones before it.
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
     * Results that deserve a second look.
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
     * Weight of the soft step equilibration.
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
     * Limit on the wall time of one solve, in seconds.
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
     * Barrier parameter that belongs to a relaxation, as a multiple of it.
     */
    double mu_over_sigma;
    /**
     * Barrier parameter at which the first problem, at sigma_init, counts as solved.
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
     * Tolerance of the polished solution.
     */
    double polish_tol;
    /**
     * Initial guess where none is given (enum initial_guess).
     */
    int64_t initial_guess;
    /**
     * Verbosity of the log sink (enum log_level).
     */
    int64_t log_level;
} swb_settings;

/**
 * Receives one log line, without line break. `level` is an enum swb_log_level, `line` is valid during
 * the call only. May be called by the thread that runs the solver, never after the call that was given
 * the sink, or the object that holds it, has ended. Must not unwind (no exception, no longjmp).
 */
typedef void (*swb_log_fn)(int64_t level, const char *line, void *user_data);

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
 * @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short. The last error is unchanged.
 */
SWB_API swb_status swb_last_error_copy(char *buf, int64_t len, int64_t *needed);

/**
 * General message of a status code; "unknown status" for any other number. Never NULL, static.
 */
SWB_API const char *swb_status_string(int32_t status);

/**
 * Name of a status code, such as "SWB_ERR_NULL"; NULL for any other number. Static.
 */
SWB_API const char *swb_status_name(int32_t status);

/**
 * Version of the library, such as "0.1.0". Static.
 */
SWB_API const char *swb_version(void);

/**
 * Number of the ABI: libraries of the same number replace each other. The number in the SONAME:
 * before 1.0 the minor version, from then on 1000 times the major version.
 */
SWB_API int32_t swb_abi_version(void);

/**
 * Does this library serve a program compiled with the header of the given version?
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
 * Is an option fixed once an object is built with it?
 *
 * @param[out] setup_only 1 if it is fixed, 0 if it may change between solves
 * @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
 */
SWB_API swb_status swb_option_setup_only(int64_t index, int32_t *setup_only);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SWITCHBACK_H */
