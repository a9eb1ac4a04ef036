/* One half of two coupled oscillators as an FMU for co-simulation, FMI 2.0 and 3.0 from one source.
 *
 * -DFMI=2|3 the standard, -DSIDE=0|1 left (force in) or right (motion in). One classical Runge-Kutta step of order 4 a
 * communication step. The parameter "fault" makes it misbehave from "fault_time" on:
 * 1 error, 2 hang, 3 NaN, 4 ends its process, 5 discard, 6 fatal, 7 asks to end the simulation (FMI 3.0); built with
 * -DHOSTILE also what hostile_fmu.c has.
 */
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MASS, STIFFNESS, DAMPING, POSITION, SPEED, KC, DC, FAULT, FAULT_TIME, X_IN, V_IN, FORCE_IN, X, V, FORCE, TIME, COUNT };

typedef struct {
    double value[COUNT];
    double slope[COUNT];
} State;

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Status Status;
#define CALL(name) Status fmi2##name
#define INSTANCE fmi2Component
typedef struct {
    State s;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
} Model;
static void say(Model *m, int status, const char *text) {
    if (m->logger) m->logger(m->environment, "oscillator", status, "fault", "%s", text);
}
#else
#include "fmi3Functions.h"
typedef fmi3Status Status;
#define CALL(name) Status fmi3##name
#define INSTANCE fmi3Instance
typedef struct {
    State s;
    fmi3LogMessageCallback logger;
    fmi3InstanceEnvironment environment;
} Model;
static void say(Model *m, int status, const char *text) {
    if (m->logger) m->logger(m->environment, status, "fault", text);
}
#endif

#ifdef HOSTILE
#include "hostile_fmu.c"
#endif

static Model *create(void) {
    Model *m = calloc(1, sizeof(Model));
    double *v = m->s.value;
    v[MASS] = 1, v[STIFFNESS] = 10, v[KC] = 3, v[FAULT_TIME] = INFINITY;
    v[POSITION] = SIDE == 0;
    return m;
}

static void derivative(const State *s, double t, const double z[2], double d[2]) {
    const double *v = s->value, *g = s->slope;
    double k = v[STIFFNESS], c = v[DAMPING], f;
    if (SIDE == 0) {
        f = v[FORCE_IN] + g[FORCE_IN] * t;
    } else {
        f = v[KC] * (v[X_IN] + g[X_IN] * t - z[0]) + v[DC] * (v[V_IN] + g[V_IN] * t - z[1]);
    }
    d[0] = z[1];
    d[1] = (f - k * z[0] - c * z[1]) / v[MASS];
}

static void runge_kutta(State *s, double h) {
    double z[2] = {s->value[X], s->value[V]}, y[2], a[2], b[2], c[2], d[2];
    derivative(s, 0, z, a);
    for (int i = 0; i < 2; i++) y[i] = z[i] + h / 2 * a[i];
    derivative(s, h / 2, y, b);
    for (int i = 0; i < 2; i++) y[i] = z[i] + h / 2 * b[i];
    derivative(s, h / 2, y, c);
    for (int i = 0; i < 2; i++) y[i] = z[i] + h * c[i];
    derivative(s, h, y, d);
    for (int i = 0; i < 2; i++) z[i] += h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
    s->value[X] = z[0], s->value[V] = z[1];
    for (int i = 0; i < COUNT; i++) s->value[i] += s->slope[i] * h, s->slope[i] = 0;
}

static int advance(Model *m, double t, double h) {
    double *v = m->s.value;
    if (v[FAULT] && t + h > v[FAULT_TIME]) {
        switch ((int)v[FAULT]) {
            case 1: say(m, 3, "the spring has snapped"); return 3;
            case 2: for (;;) sleep(1);
            case 3: v[X] = NAN; return 0;
            case 4: raise(SIGKILL);
            case 5: return 2;
            case 6: say(m, 4, "the model is lost"); return 4;
        }
#ifdef HOSTILE
        int status = misbehave((int)v[FAULT], &v[X]);
        if (status >= 0) return status;
#endif
    }
    runge_kutta(&m->s, h);
    v[TIME] = t + h;
    return 0;
}

static double shown(const Model *m, unsigned r) {
    const double *v = m->s.value;
    if (SIDE == 1 && r == FORCE) return v[KC] * (v[X] - v[X_IN]) + v[DC] * (v[V] - v[V_IN]);
    return v[r];
}

static Status get(Model *m, const unsigned *r, size_t n, double *out) {
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= COUNT) return 3;
        out[i] = shown(m, r[i]);
    }
    return 0;
}

static Status set(Model *m, const unsigned *r, size_t n, const double *in) {
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= COUNT) return 3;
        m->s.value[r[i]] = in[i];
        m->s.slope[r[i]] = 0;
    }
    return 0;
}

static Status start(Model *m) {
    m->s.value[X] = m->s.value[POSITION], m->s.value[V] = m->s.value[SPEED];
#ifdef HOSTILE
    at_start((int)m->s.value[FAULT], &m->s.value[X]);
#endif
    return 0;
}

static Status end(Model *m) {
#ifdef HOSTILE
    at_end((int)m->s.value[FAULT]);
#endif
    return 0;
}

static Status keep(Model *m, void **state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &m->s, sizeof(State));
    return 0;
}

static Status back(Model *m, void *state) {
    memcpy(&m->s, state, sizeof(State));
    return 0;
}

static Status drop(void **state) {
    free(*state);
    *state = NULL;
    return 0;
}

#if FMI == 2
#define REFUSE { return fmi2Error; }
#define VR const fmi2ValueReference r[], size_t n
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
CALL(SetDebugLogging)(INSTANCE c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
INSTANCE fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                         const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m = create();
    if (f) m->logger = f->logger, m->environment = f->componentEnvironment;
    return m;
}
void fmi2FreeInstance(INSTANCE c) { free(c); }
CALL(SetupExperiment)(INSTANCE c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e) { return fmi2OK; }
CALL(EnterInitializationMode)(INSTANCE c) { return start(c); }
CALL(ExitInitializationMode)(INSTANCE c) { return start(c); }
CALL(Terminate)(INSTANCE c) { return end(c); }
CALL(Reset)(INSTANCE c) { return start(c); }
CALL(GetReal)(INSTANCE c, VR, fmi2Real v[]) { return get(c, r, n, v); }
CALL(SetReal)(INSTANCE c, VR, const fmi2Real v[]) { return set(c, r, n, v); }
CALL(GetInteger)(INSTANCE c, VR, fmi2Integer v[]) { return n ? fmi2Error : fmi2OK; }
CALL(GetBoolean)(INSTANCE c, VR, fmi2Boolean v[]) { return n ? fmi2Error : fmi2OK; }
CALL(GetString)(INSTANCE c, VR, fmi2String v[]) { return n ? fmi2Error : fmi2OK; }
CALL(SetInteger)(INSTANCE c, VR, const fmi2Integer v[]) { return n ? fmi2Error : fmi2OK; }
CALL(SetBoolean)(INSTANCE c, VR, const fmi2Boolean v[]) { return n ? fmi2Error : fmi2OK; }
CALL(SetString)(INSTANCE c, VR, const fmi2String v[]) { return n ? fmi2Error : fmi2OK; }
CALL(GetFMUstate)(INSTANCE c, fmi2FMUstate *s) { return keep(c, s); }
CALL(SetFMUstate)(INSTANCE c, fmi2FMUstate s) { return back(c, s); }
CALL(FreeFMUstate)(INSTANCE c, fmi2FMUstate *s) { return drop(s); }
CALL(SerializedFMUstateSize)(INSTANCE c, fmi2FMUstate s, size_t *n) { *n = sizeof(State); return fmi2OK; }
CALL(SerializeFMUstate)(INSTANCE c, fmi2FMUstate s, fmi2Byte b[], size_t n) { memcpy(b, s, n); return fmi2OK; }
CALL(DeSerializeFMUstate)(INSTANCE c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) {
    *s = malloc(n);
    memcpy(*s, b, n);
    return fmi2OK;
}
CALL(GetDirectionalDerivative)(INSTANCE c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[],
                               size_t nk, const fmi2Real dk[], fmi2Real du[]) REFUSE
CALL(SetRealInputDerivatives)(INSTANCE c, VR, const fmi2Integer order[], const fmi2Real v[]) {
    for (size_t i = 0; i < n; i++) {
        if (order[i] != 1 || r[i] >= COUNT) return fmi2Error;
        ((Model *)c)->s.slope[r[i]] = v[i];
    }
    return fmi2OK;
}
CALL(GetRealOutputDerivatives)(INSTANCE c, VR, const fmi2Integer order[], fmi2Real v[]) REFUSE
CALL(DoStep)(INSTANCE c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) { return advance(c, t, h); }
CALL(CancelStep)(INSTANCE c) REFUSE
CALL(GetStatus)(INSTANCE c, const fmi2StatusKind k, fmi2Status *v) REFUSE
CALL(GetRealStatus)(INSTANCE c, const fmi2StatusKind k, fmi2Real *v) REFUSE
CALL(GetIntegerStatus)(INSTANCE c, const fmi2StatusKind k, fmi2Integer *v) REFUSE
CALL(GetBooleanStatus)(INSTANCE c, const fmi2StatusKind k, fmi2Boolean *v) { *v = 0; return fmi2OK; }
CALL(GetStringStatus)(INSTANCE c, const fmi2StatusKind k, fmi2String *v) REFUSE
#else
#define REFUSE { return fmi3Error; }
#define VR const fmi3ValueReference r[], size_t n
const char *fmi3GetVersion(void) { return "3.0"; }
CALL(SetDebugLogging)(INSTANCE c, fmi3Boolean on, size_t n, const fmi3String k[]) { return fmi3OK; }
INSTANCE fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String place, fmi3Boolean visible,
                                     fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                     const fmi3ValueReference r[], size_t n, fmi3InstanceEnvironment environment,
                                     fmi3LogMessageCallback logger, fmi3IntermediateUpdateCallback update) {
    Model *m = create();
    m->logger = logger, m->environment = environment;
    return m;
}
INSTANCE fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
                                      fmi3InstanceEnvironment f, fmi3LogMessageCallback g) { return NULL; }
INSTANCE fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
                                           fmi3InstanceEnvironment f, fmi3LogMessageCallback g,
                                           fmi3ClockUpdateCallback h, fmi3LockPreemptionCallback i,
                                           fmi3UnlockPreemptionCallback j) { return NULL; }
void fmi3FreeInstance(INSTANCE c) { free(c); }
CALL(EnterInitializationMode)(INSTANCE c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 t, fmi3Boolean d, fmi3Float64 e) {
    return start(c);
}
CALL(ExitInitializationMode)(INSTANCE c) { return start(c); }
CALL(EnterEventMode)(INSTANCE c) REFUSE
CALL(Terminate)(INSTANCE c) { return end(c); }
CALL(Reset)(INSTANCE c) { return start(c); }
CALL(GetFloat64)(INSTANCE c, VR, fmi3Float64 v[], size_t k) { return get(c, r, n, v); }
CALL(SetFloat64)(INSTANCE c, VR, const fmi3Float64 v[], size_t k) { return set(c, r, n, v); }
#define NONE(T) \
    CALL(Get##T)(INSTANCE c, VR, fmi3##T v[], size_t k) REFUSE \
    CALL(Set##T)(INSTANCE c, VR, const fmi3##T v[], size_t k) REFUSE
NONE(Float32) NONE(Int8) NONE(UInt8) NONE(Int16) NONE(UInt16) NONE(Int32) NONE(UInt32) NONE(Int64) NONE(UInt64)
NONE(Boolean) NONE(String)
CALL(GetBinary)(INSTANCE c, VR, size_t s[], fmi3Binary v[], size_t k) REFUSE
CALL(SetBinary)(INSTANCE c, VR, const size_t s[], const fmi3Binary v[], size_t k) REFUSE
CALL(GetClock)(INSTANCE c, VR, fmi3Clock v[]) REFUSE
CALL(SetClock)(INSTANCE c, VR, const fmi3Clock v[]) REFUSE
CALL(GetNumberOfVariableDependencies)(INSTANCE c, fmi3ValueReference r, size_t *n) REFUSE
CALL(GetVariableDependencies)(INSTANCE c, fmi3ValueReference r, size_t a[], fmi3ValueReference b[], size_t d[],
                              fmi3DependencyKind e[], size_t n) REFUSE
CALL(GetFMUState)(INSTANCE c, fmi3FMUState *s) { return keep(c, s); }
CALL(SetFMUState)(INSTANCE c, fmi3FMUState s) { return back(c, s); }
CALL(FreeFMUState)(INSTANCE c, fmi3FMUState *s) { return drop(s); }
CALL(SerializedFMUStateSize)(INSTANCE c, fmi3FMUState s, size_t *n) { *n = sizeof(State); return fmi3OK; }
CALL(SerializeFMUState)(INSTANCE c, fmi3FMUState s, fmi3Byte b[], size_t n) { memcpy(b, s, n); return fmi3OK; }
CALL(DeserializeFMUState)(INSTANCE c, const fmi3Byte b[], size_t n, fmi3FMUState *s) {
    *s = malloc(n);
    memcpy(*s, b, n);
    return fmi3OK;
}
#define UK const fmi3ValueReference u[], size_t nu, const fmi3ValueReference k[], size_t nk
CALL(GetDirectionalDerivative)(INSTANCE c, UK, const fmi3Float64 a[], size_t na, fmi3Float64 b[], size_t nb) REFUSE
CALL(GetAdjointDerivative)(INSTANCE c, UK, const fmi3Float64 a[], size_t na, fmi3Float64 b[], size_t nb) REFUSE
CALL(EnterConfigurationMode)(INSTANCE c) REFUSE
CALL(ExitConfigurationMode)(INSTANCE c) REFUSE
CALL(GetIntervalDecimal)(INSTANCE c, VR, fmi3Float64 v[], fmi3IntervalQualifier q[]) REFUSE
CALL(GetIntervalFraction)(INSTANCE c, VR, fmi3UInt64 v[], fmi3UInt64 w[], fmi3IntervalQualifier q[]) REFUSE
CALL(GetShiftDecimal)(INSTANCE c, VR, fmi3Float64 v[]) REFUSE
CALL(GetShiftFraction)(INSTANCE c, VR, fmi3UInt64 v[], fmi3UInt64 w[]) REFUSE
CALL(SetIntervalDecimal)(INSTANCE c, VR, const fmi3Float64 v[]) REFUSE
CALL(SetIntervalFraction)(INSTANCE c, VR, const fmi3UInt64 v[], const fmi3UInt64 w[]) REFUSE
CALL(SetShiftDecimal)(INSTANCE c, VR, const fmi3Float64 v[]) REFUSE
CALL(SetShiftFraction)(INSTANCE c, VR, const fmi3UInt64 v[], const fmi3UInt64 w[]) REFUSE
CALL(EvaluateDiscreteStates)(INSTANCE c) REFUSE
CALL(UpdateDiscreteStates)(INSTANCE c, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Boolean *f,
                           fmi3Float64 *g) REFUSE
CALL(EnterContinuousTimeMode)(INSTANCE c) REFUSE
CALL(CompletedIntegratorStep)(INSTANCE c, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d) REFUSE
CALL(SetTime)(INSTANCE c, fmi3Float64 t) REFUSE
CALL(SetContinuousStates)(INSTANCE c, const fmi3Float64 x[], size_t n) REFUSE
CALL(GetContinuousStateDerivatives)(INSTANCE c, fmi3Float64 x[], size_t n) REFUSE
CALL(GetEventIndicators)(INSTANCE c, fmi3Float64 x[], size_t n) REFUSE
CALL(GetContinuousStates)(INSTANCE c, fmi3Float64 x[], size_t n) REFUSE
CALL(GetNominalsOfContinuousStates)(INSTANCE c, fmi3Float64 x[], size_t n) REFUSE
CALL(GetNumberOfEventIndicators)(INSTANCE c, size_t *n) REFUSE
CALL(GetNumberOfContinuousStates)(INSTANCE c, size_t *n) REFUSE
CALL(EnterStepMode)(INSTANCE c) REFUSE
CALL(GetOutputDerivatives)(INSTANCE c, VR, const fmi3Int32 o[], fmi3Float64 v[], size_t k) REFUSE
CALL(DoStep)(INSTANCE c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *end,
             fmi3Boolean *early, fmi3Float64 *reached) {
    const double *v = ((Model *)c)->s.value;
    *event = *early = 0;
    *end = v[FAULT] == 7 && t + h > v[FAULT_TIME];
    *reached = t + h;
    return advance(c, t, h);
}
CALL(ActivateModelPartition)(INSTANCE c, fmi3ValueReference r, fmi3Float64 t) REFUSE
#endif
