/* FMI 3.0 co-simulation over instance.c. */
#define _GNU_SOURCE /* before any header: hosted.c needs POSIX */
#include "fmi3Functions.h"

#include "instance.c"
#if HOSTED
#include "hosted.c"
#else
#include "equations.c"
#endif

#define FMI(name) fmi3##name
#define FMI_STATE(before, after) STATE_NAME(before, after)
#define STATE_NAME(before, after) fmi3##before##FMUState##after
#define DESERIALIZE Deserialize
#define EXPORT FMI3_Export
typedef fmi3Status Result;
typedef fmi3Boolean Boolean;
typedef fmi3String String;
typedef fmi3Byte Byte;
typedef fmi3FMUState Saved;
typedef fmi3Instance Handle;

typedef struct {
  Instance *instance;
  fmi3LogMessageCallback log;
  fmi3InstanceEnvironment environment;
} Component;

static void report(void *host, Status status, const char *message) {
  static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError"};
  Component *c = host;
  if (c->log) c->log(c->environment, (fmi3Status)status, categories[status], message);
}

#include "calls.c"

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                                     fmi3Boolean visible, fmi3Boolean on, fmi3Boolean event_mode,
                                                     fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                                     size_t n_intermediate, fmi3InstanceEnvironment environment,
                                                     fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  Component *c = calloc(1, sizeof *c);
  (void)name, (void)visible, (void)on, (void)event_mode, (void)early_return, (void)intermediate, (void)n_intermediate;
  (void)update;
  if (!c) return NULL;
  c->log = log;
  c->environment = environment;
  return component_with(c, token, resources ? resources : "");
}

static fmi3Instance refused(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  if (log) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation only");
  return NULL;
}
FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean on,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  return (void)name, (void)token, (void)resources, (void)visible, (void)on, refused(environment, log);
}
FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                           fmi3Boolean visible, fmi3Boolean on,
                                                           fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                           fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                           fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)resources, (void)visible, (void)on, (void)update, (void)lock, (void)unlock;
  return refused(environment, log);
}

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                                   fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
  Status status = instance_experiment(HERE, tolerance_defined ? &tolerance : NULL, start, stop_defined ? &stop : NULL);
  return (fmi3Status)(status ? status : instance_enter_initialization(HERE, start));
}

static fmi3Status matched(fmi3Instance c, size_t n_references, size_t n_values) {
  if (n_references == n_values) return fmi3OK;
  return (fmi3Status)say(HERE, STATUS_ERROR, "%zu value references and %zu values; all variables are scalars",
                         n_references, n_values);
}
FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t nv) {
  return matched(c, n, nv) ? fmi3Error : (fmi3Status)instance_get(HERE, r, n, v);
}
FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[],
                                      size_t nv) {
  return matched(c, n, nv) ? fmi3Error : (fmi3Status)instance_set(HERE, r, n, v);
}

#define NO_VARIABLES(Type)                                                                                               \
  FMI3_Export fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3##Type v[],           \
                                       size_t nv) {                                                                      \
    return (void)r, (void)v, (void)nv, none_of(c, n, #Type);                                                             \
  }                                                                                                                      \
  FMI3_Export fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3##Type v[],     \
                                       size_t nv) {                                                                      \
    return (void)r, (void)v, (void)nv, none_of(c, n, #Type);                                                             \
  }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
FMI3_Export fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[],
                                     size_t nv) {
  return (void)r, (void)sizes, (void)v, (void)nv, none_of(c, n, "Binary");
}
FMI3_Export fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, const size_t sizes[],
                                     const fmi3Binary v[], size_t nv) {
  return (void)r, (void)sizes, (void)v, (void)nv, none_of(c, n, "Binary");
}
FMI3_Export fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Clock v[]) {
  return (void)r, (void)v, none_of(c, n, "Clock");
}
FMI3_Export fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Clock v[]) {
  return (void)r, (void)v, none_of(c, n, "Clock");
}

FMI3_Export fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknown[], size_t n_unknown,
                                                    const fmi3ValueReference known[], size_t n_known,
                                                    const fmi3Float64 seed[], size_t n_seed, fmi3Float64 result[],
                                                    size_t n_result) {
  if (matched(c, n_known, n_seed) || matched(c, n_unknown, n_result)) return fmi3Error;
  return (fmi3Status)instance_derivative(HERE, unknown, n_unknown, known, n_known, seed, result);
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_return,
                                  fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
  (void)no_return;
  *event = *end = *early = fmi3False;
  fmi3Status status = (fmi3Status)instance_step(HERE, time, size);
  *last = HERE->now.time;
  return status;
}

/* What co-simulation without clocks, events and structural parameters never calls; importers look the symbols up. */
static fmi3Status not_provided(fmi3Instance c, const char *what) {
  return (fmi3Status)say(HERE, STATUS_ERROR, "%s is not provided", what);
}
#define NOT_PROVIDED(Name, ...) \
  FMI3_Export fmi3Status fmi3##Name(fmi3Instance c, __VA_ARGS__) { return not_provided(c, "fmi3" #Name); }
#define NOT_PROVIDED_ALONE(Name) \
  FMI3_Export fmi3Status fmi3##Name(fmi3Instance c) { return not_provided(c, "fmi3" #Name); }
typedef fmi3ValueReference VR;
NOT_PROVIDED_ALONE(EnterEventMode)
NOT_PROVIDED_ALONE(EnterStepMode)
NOT_PROVIDED_ALONE(EnterConfigurationMode)
NOT_PROVIDED_ALONE(ExitConfigurationMode)
NOT_PROVIDED_ALONE(EvaluateDiscreteStates)
NOT_PROVIDED_ALONE(EnterContinuousTimeMode)
NOT_PROVIDED(GetNumberOfVariableDependencies, VR r, size_t *n)
NOT_PROVIDED(GetVariableDependencies, VR r, size_t e[], VR i[], size_t k[], fmi3DependencyKind d[], size_t n)
NOT_PROVIDED(GetAdjointDerivative, const VR u[], size_t nu, const VR k[], size_t nk, const fmi3Float64 s[], size_t ns,
             fmi3Float64 r[], size_t nr)
NOT_PROVIDED(GetIntervalDecimal, const VR r[], size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[])
NOT_PROVIDED(GetIntervalFraction, const VR r[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier q[])
NOT_PROVIDED(GetShiftDecimal, const VR r[], size_t n, fmi3Float64 v[])
NOT_PROVIDED(GetShiftFraction, const VR r[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[])
NOT_PROVIDED(SetIntervalDecimal, const VR r[], size_t n, const fmi3Float64 v[])
NOT_PROVIDED(SetIntervalFraction, const VR r[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
NOT_PROVIDED(SetShiftDecimal, const VR r[], size_t n, const fmi3Float64 v[])
NOT_PROVIDED(SetShiftFraction, const VR r[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
NOT_PROVIDED(UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Boolean *f,
             fmi3Float64 *t)
NOT_PROVIDED(CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d)
NOT_PROVIDED(SetTime, fmi3Float64 t)
NOT_PROVIDED(SetContinuousStates, const fmi3Float64 x[], size_t n)
NOT_PROVIDED(GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
NOT_PROVIDED(GetEventIndicators, fmi3Float64 x[], size_t n)
NOT_PROVIDED(GetContinuousStates, fmi3Float64 x[], size_t n)
NOT_PROVIDED(GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
NOT_PROVIDED(GetNumberOfEventIndicators, size_t *n)
NOT_PROVIDED(GetNumberOfContinuousStates, size_t *n)
NOT_PROVIDED(GetOutputDerivatives, const VR r[], size_t n, const fmi3Int32 o[], fmi3Float64 v[], size_t nv)
NOT_PROVIDED(ActivateModelPartition, VR r, fmi3Float64 t)
