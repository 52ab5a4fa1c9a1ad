/* The controller as a unit for co-simulation (FMI 2.0), written by switchback. The control of a sample is there after the step that begins with it. */
#include "@prefix@.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

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
    const fmi2CallbackFunctions *callbacks;
    char name[64];
} m;

static fmi2Status complain(const char *text) {
    if (m.callbacks && m.callbacks->logger) {
        m.callbacks->logger(m.callbacks->componentEnvironment, m.name, fmi2Error, "error", text);
    }
    return fmi2Error;
}

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
    m.callbacks = callbacks;
    m.name[0] = '\0';
    strncat(m.name, name ? name : "", sizeof m.name - 1);
    begin();
    return &m;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    if (c) {
        m.used = 0;
        m.callbacks = NULL;
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
    size_t i;
    (void)c;
    for (i = 0; i < n; i++) {
        if (vr[i] >= N_REALS) {
            return complain("there is no such variable");
        }
        value[i] = m.values[vr[i]];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    size_t i;
    (void)c;
    for (i = 0; i < n; i++) {
        if (vr[i] >= N_REALS || (vr[i] >= FIRST_U && vr[i] < FIRST_REFERENCE)) {
            return complain("this variable cannot be set");
        }
        if (vr[i] >= FIRST_REFERENCE && m.values[vr[i]] != value[i]) {
            m.told = 1;
        }
        m.values[vr[i]] = value[i];
    }
    return fmi2OK;
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
    if (!(h >= 0.0)) {
        return complain("the length of a step is negative");
    }
    /* samples that begin before the end of the step, by a clock whose rounding grows with the time */
    while (m.start + SAMPLE * (double)m.samples < t + h - 1e-9 * SAMPLE) {
        if (!sample()) {
            return complain("a reference or a parameter is no number");
        }
    }
    return fmi2OK;
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
