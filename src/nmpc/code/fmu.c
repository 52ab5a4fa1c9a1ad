/* The controller as a unit for co-simulation (FMI 2.0, or 3.0 with FMI_VERSION 3), written by switchback. The control of a sample is there after
   the step that begins with it. */
#include "@prefix@.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifndef FMI_VERSION
#define FMI_VERSION 2
#endif

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

@data@
enum {
    NX = @prefix@_nx,
    NU = @prefix@_nu,
    NP = @prefix@_np,
    FIRST_U = NX,
    FIRST_REFERENCE = FIRST_U + NU,
    FIRST_P = FIRST_REFERENCE + N_REFERENCES,
    N_REALS = FIRST_P + NP
};

/* There is one controller, and one object of it. */
static struct {
    int used, source, told;
    long samples;
    double start;
    double values[N_REALS];
} m;

static void begin(void) {
    @prefix@_reset();
    memcpy(m.values, START, sizeof START);
    m.source = @prefix@_plan;
    m.samples = 0;
    m.told = 0;
    m.start = 0.0;
}

/* References and parameters that were set; 0 where they are no numbers. */
static int tell(void) {
    @prefix@_real y[N_REALS];
    int i, k, good = 1, at = FIRST_REFERENCE;
    for (i = 0; i < N_REALS; i++) {
        y[i] = (@prefix@_real)m.values[i];
    }
    for (k = 0; k < N_TERMS; k++) {
        good &= @prefix@_set_reference(TERMS[k], y + at);
        at += SIZES[k];
    }
    return (NP == 0 || @prefix@_set_params(y + FIRST_P)) && good;
}

static int sample(void) {
    @prefix@_real x[NX], u[NU];
    int i, good = 1;
    if (m.told) {
        good = tell();
        m.told = 0;
    }
    @prefix@_prepare();
    for (i = 0; i < NX; i++) {
        x[i] = (@prefix@_real)m.values[i];
    }
    m.source = @prefix@_feedback(x, u);
    for (i = 0; i < NU; i++) {
        m.values[FIRST_U + i] = u[i];
    }
    m.samples++;
    return good;
}

/* What is wrong, or NULL. */
static const char *read_values(const unsigned int vr[], size_t n, double value[]) {
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= N_REALS) {
            return "there is no such variable";
        }
        value[i] = m.values[vr[i]];
    }
    return NULL;
}

static const char *write_values(const unsigned int vr[], size_t n, const double value[]) {
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= N_REALS || (vr[i] >= FIRST_U && vr[i] < FIRST_REFERENCE)) {
            return "this variable cannot be set";
        }
        if (vr[i] >= FIRST_REFERENCE && m.values[vr[i]] != value[i]) {
            m.told = 1;
        }
        m.values[vr[i]] = value[i];
    }
    return NULL;
}

static const char *step(double t, double h) {
    if (!(h >= 0.0)) {
        return "the length of a step is negative";
    }
    /* samples that begin before the end of the step, by a clock whose rounding grows with the time */
    while (m.start + SAMPLE * (double)m.samples < t + h - 1e-9 * SAMPLE) {
        if (!sample()) {
            return "a reference or a parameter is no number";
        }
    }
    return NULL;
}

#if FMI_VERSION == 2

/* Types of the standard. */
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

static const fmi2CallbackFunctions *given;
static char own_name[64];

static fmi2Status complain(const char *text) {
    if (text == NULL) {
        return fmi2OK;
    }
    if (given && given->logger) {
        given->logger(given->componentEnvironment, own_name, fmi2Error, "error", "%s", text);
    }
    return fmi2Error;
}

EXPORT const char *fmi2GetTypesPlatform(void) {
    return "default";
}

EXPORT const char *fmi2GetVersion(void) {
    return "2.0";
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources;
    (void)visible;
    (void)logging;
    if (m.used || type != fmi2CoSimulation || !guid || strcmp(guid, GUID) != 0) {
        return NULL;
    }
    m.used = 1;
    given = callbacks;
    own_name[0] = '\0';
    strncat(own_name, name ? name : "", sizeof own_name - 1);
    begin();
    return &m;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    if (c) {
        m.used = 0;
        given = NULL;
    }
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
                                      fmi2Real stop) {
    (void)c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop;
    m.start = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    (void)c;
    begin();
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    (void)c;
    return complain(read_values(vr, n, value));
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    (void)c;
    return complain(write_values(vr, n, value));
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    size_t i;
    (void)c;
    for (i = 0; i < n; i++) {
        if (vr[i] != 0) {
            return complain("there is no such variable");
        }
        value[i] = m.source;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) {
    (void)c;
    (void)no_return;
    return complain(step(t, h));
}

/* What this unit has none of. */
#define NOTHING(name, kind)                                                                                      \
    EXPORT fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t n, kind) { \
        (void)c;                                                                                                 \
        (void)vr;                                                                                                \
        (void)value;                                                                                             \
        return n == 0 ? fmi2OK : complain(#name ": there is no such variable");                                  \
    }
NOTHING(fmi2GetBoolean, fmi2Boolean value[])
NOTHING(fmi2GetString, fmi2String value[])
NOTHING(fmi2SetInteger, const fmi2Integer value[])
NOTHING(fmi2SetBoolean, const fmi2Boolean value[])
NOTHING(fmi2SetString, const fmi2String value[])

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    (void)state;
    return complain("fmi2GetFMUstate is not known");
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    (void)c;
    (void)state;
    return complain("fmi2SetFMUstate is not known");
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    (void)state;
    return complain("fmi2FreeFMUstate is not known");
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c;
    (void)state;
    (void)size;
    return complain("fmi2SerializedFMUstateSize is not known");
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    (void)c;
    (void)state;
    (void)bytes;
    (void)size;
    return complain("fmi2SerializeFMUstate is not known");
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    (void)c;
    (void)bytes;
    (void)size;
    (void)state;
    return complain("fmi2DeSerializeFMUstate is not known");
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference of[], size_t n, const fmi2ValueReference by[], size_t k, const fmi2Real dv[], fmi2Real out[]) {
    (void)c;
    (void)of;
    (void)n;
    (void)by;
    (void)k;
    (void)dv;
    (void)out;
    return complain("fmi2GetDirectionalDerivative is not known");
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], const fmi2Real value[]) {
    (void)c;
    (void)vr;
    (void)n;
    (void)order;
    (void)value;
    return complain("fmi2SetRealInputDerivatives is not known");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], fmi2Real value[]) {
    (void)c;
    (void)vr;
    (void)n;
    (void)order;
    (void)value;
    return complain("fmi2GetRealOutputDerivatives is not known");
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) {
    (void)c;
    return complain("fmi2CancelStep is not known");
}

EXPORT fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)c;
    (void)kind;
    (void)value;
    return complain("fmi2GetStatus is not known");
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    (void)c;
    (void)kind;
    (void)value;
    return complain("fmi2GetRealStatus is not known");
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c;
    (void)kind;
    (void)value;
    return complain("fmi2GetIntegerStatus is not known");
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    (void)c;
    (void)kind;
    (void)value;
    return complain("fmi2GetBooleanStatus is not known");
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c;
    (void)kind;
    (void)value;
    return complain("fmi2GetStringStatus is not known");
}

#else

/* Types of the standard. */
typedef void *fmi3Instance;
typedef void *fmi3Environment;
typedef void *fmi3State;
typedef uint32_t fmi3ValueReference;
typedef const char *fmi3String;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*fmi3Logger)(fmi3Environment, fmi3Status, fmi3String, fmi3String);

static fmi3Logger logger;
static fmi3Environment environment;

static fmi3Status complain(const char *text) {
    if (text == NULL) {
        return fmi3OK;
    }
    if (logger) {
        logger(environment, fmi3Error, "error", text);
    }
    return fmi3Error;
}

EXPORT const char *fmi3GetVersion(void) {
    return "3.0";
}

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, bool on, size_t n, const fmi3String categories[]) {
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return fmi3OK;
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible, bool logging,
                                                bool event_mode, bool early_return, const fmi3ValueReference intermediate[], size_t n,
                                                fmi3Environment env, fmi3Logger log, void (*update)(void)) {
    (void)name;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)event_mode;
    (void)early_return;
    (void)intermediate;
    (void)n;
    (void)update;
    if (m.used || !token || strcmp(token, GUID) != 0) {
        if (log) {
            log(env, fmi3Error, "error", m.used ? "a process has one unit of this controller" : "the description is that of another unit");
        }
        return NULL;
    }
    m.used = 1;
    logger = log;
    environment = env;
    begin();
    return &m;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, bool visible, bool logging,
                                                 fmi3Environment env, fmi3Logger log) {
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    if (log) {
        log(env, fmi3Error, "error", "this unit is one for co-simulation");
    }
    return NULL;
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, bool visible, bool logging,
                                                      fmi3Environment env, fmi3Logger log, void (*clock)(void), void (*lock)(void),
                                                      void (*unlock)(void)) {
    (void)clock;
    (void)lock;
    (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, env, log);
}

EXPORT void fmi3FreeInstance(fmi3Instance c) {
    if (c) {
        m.used = 0;
        logger = NULL;
    }
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    (void)c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop;
    m.start = start;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Reset(fmi3Instance c) {
    (void)c;
    begin();
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, double value[], size_t n_values) {
    (void)c;
    (void)n_values;
    return complain(read_values(vr, n, value));
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const double value[], size_t n_values) {
    (void)c;
    (void)n_values;
    return complain(write_values(vr, n, value));
}

EXPORT fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, int32_t value[], size_t n_values) {
    size_t i;
    (void)c;
    (void)n_values;
    for (i = 0; i < n; i++) {
        if (vr[i] != N_REALS) {
            return complain("there is no such variable");
        }
        value[i] = m.source;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, double t, double h, bool no_return, bool *event, bool *terminate, bool *early, double *last) {
    const char *wrong = step(t, h);
    (void)c;
    (void)no_return;
    *event = *terminate = *early = false;
    *last = wrong ? t : t + h;
    return complain(wrong);
}

#define DONE(name)                            \
    EXPORT fmi3Status name(fmi3Instance c) { \
        (void)c;                              \
        return fmi3OK;                        \
    }
DONE(fmi3ExitInitializationMode)
DONE(fmi3Terminate)
DONE(fmi3EnterConfigurationMode)
DONE(fmi3ExitConfigurationMode)
DONE(fmi3EnterStepMode)
DONE(fmi3EnterEventMode)
DONE(fmi3EvaluateDiscreteStates)

/* Variables of other types, of which this unit has none. */
#define NOTHING(name, kind)                                                                                            \
    EXPORT fmi3Status name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, kind value[], size_t n_values) { \
        (void)c;                                                                                                       \
        (void)vr;                                                                                                      \
        (void)value;                                                                                                   \
        (void)n_values;                                                                                                \
        return complain(n == 0 ? NULL : #name ": there is no such variable");                                         \
    }
NOTHING(fmi3GetFloat32, float)
NOTHING(fmi3SetFloat32, const float)
NOTHING(fmi3GetInt8, int8_t)
NOTHING(fmi3SetInt8, const int8_t)
NOTHING(fmi3GetUInt8, uint8_t)
NOTHING(fmi3SetUInt8, const uint8_t)
NOTHING(fmi3GetInt16, int16_t)
NOTHING(fmi3SetInt16, const int16_t)
NOTHING(fmi3GetUInt16, uint16_t)
NOTHING(fmi3SetUInt16, const uint16_t)
NOTHING(fmi3GetUInt32, uint32_t)
NOTHING(fmi3SetUInt32, const uint32_t)
NOTHING(fmi3GetInt64, int64_t)
NOTHING(fmi3SetInt64, const int64_t)
NOTHING(fmi3GetUInt64, uint64_t)
NOTHING(fmi3SetUInt64, const uint64_t)
NOTHING(fmi3GetBoolean, bool)
NOTHING(fmi3SetBoolean, const bool)
NOTHING(fmi3GetString, fmi3String)
NOTHING(fmi3SetString, const fmi3String)
NOTHING(fmi3SetInt32, const int32_t)

/* What this unit does not know. */
#define UNKNOWN(name, ...)                      \
    EXPORT fmi3Status name(__VA_ARGS__) {      \
        return complain(#name " is not known"); \
    }
UNKNOWN(fmi3GetBinary, fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], const uint8_t *value[], size_t n_values)
UNKNOWN(fmi3SetBinary, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[], const uint8_t *const value[], size_t n_values)
UNKNOWN(fmi3GetClock, fmi3Instance c, const fmi3ValueReference vr[], size_t n, bool value[])
UNKNOWN(fmi3SetClock, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const bool value[])
UNKNOWN(fmi3GetNumberOfVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t *n)
UNKNOWN(fmi3GetVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t of[], fmi3ValueReference by[], size_t places[], int kinds[], size_t n)
UNKNOWN(fmi3GetFMUState, fmi3Instance c, fmi3State *state)
UNKNOWN(fmi3SetFMUState, fmi3Instance c, fmi3State state)
UNKNOWN(fmi3FreeFMUState, fmi3Instance c, fmi3State *state)
UNKNOWN(fmi3SerializedFMUStateSize, fmi3Instance c, fmi3State state, size_t *size)
UNKNOWN(fmi3SerializeFMUState, fmi3Instance c, fmi3State state, uint8_t bytes[], size_t size)
UNKNOWN(fmi3DeserializeFMUState, fmi3Instance c, const uint8_t bytes[], size_t size, fmi3State *state)
UNKNOWN(fmi3GetDirectionalDerivative, fmi3Instance c, const fmi3ValueReference of[], size_t n, const fmi3ValueReference by[], size_t k, const double seed[], size_t n_seed, double out[], size_t n_out)
UNKNOWN(fmi3GetAdjointDerivative, fmi3Instance c, const fmi3ValueReference of[], size_t n, const fmi3ValueReference by[], size_t k, const double seed[], size_t n_seed, double out[], size_t n_out)
UNKNOWN(fmi3GetOutputDerivatives, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const int32_t orders[], double out[], size_t n_out)
UNKNOWN(fmi3ActivateModelPartition, fmi3Instance c, fmi3ValueReference clock, double t)
UNKNOWN(fmi3GetIntervalDecimal, fmi3Instance c, const fmi3ValueReference vr[], size_t n, double intervals[], int qualifiers[])
UNKNOWN(fmi3GetIntervalFraction, fmi3Instance c, const fmi3ValueReference vr[], size_t n, uint64_t counters[], uint64_t resolutions[], int qualifiers[])
UNKNOWN(fmi3GetShiftDecimal, fmi3Instance c, const fmi3ValueReference vr[], size_t n, double shifts[])
UNKNOWN(fmi3GetShiftFraction, fmi3Instance c, const fmi3ValueReference vr[], size_t n, uint64_t counters[], uint64_t resolutions[])
UNKNOWN(fmi3SetIntervalDecimal, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const double intervals[])
UNKNOWN(fmi3SetIntervalFraction, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const uint64_t counters[], const uint64_t resolutions[])
UNKNOWN(fmi3SetShiftDecimal, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const double shifts[])
UNKNOWN(fmi3SetShiftFraction, fmi3Instance c, const fmi3ValueReference vr[], size_t n, const uint64_t counters[], const uint64_t resolutions[])
UNKNOWN(fmi3UpdateDiscreteStates, fmi3Instance c, bool *again, bool *terminate, bool *nominals, bool *states, bool *next_defined, double *next)
UNKNOWN(fmi3EnterContinuousTimeMode, fmi3Instance c)
UNKNOWN(fmi3CompletedIntegratorStep, fmi3Instance c, bool no_return, bool *event, bool *terminate)
UNKNOWN(fmi3SetTime, fmi3Instance c, double t)
UNKNOWN(fmi3SetContinuousStates, fmi3Instance c, const double x[], size_t n)
UNKNOWN(fmi3GetContinuousStates, fmi3Instance c, double x[], size_t n)
UNKNOWN(fmi3GetNominalsOfContinuousStates, fmi3Instance c, double x[], size_t n)
UNKNOWN(fmi3GetContinuousStateDerivatives, fmi3Instance c, double out[], size_t n)
UNKNOWN(fmi3GetEventIndicators, fmi3Instance c, double out[], size_t n)
UNKNOWN(fmi3GetNumberOfEventIndicators, fmi3Instance c, size_t *n)
UNKNOWN(fmi3GetNumberOfContinuousStates, fmi3Instance c, size_t *n)
#endif
