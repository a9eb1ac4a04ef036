/* FMI 2.0 co-simulation over instance.c. */
#define _GNU_SOURCE /* before any header: hosted.c needs POSIX */
#include "fmi2Functions.h"

#include "instance.c"
#if HOSTED
#include "hosted.c"
#else
#include "equations.c"
#endif

#define FMI(name) fmi2##name
#define FMI_STATE(before, after) STATE_NAME(before, after)
#define STATE_NAME(before, after) fmi2##before##FMUstate##after
#define DESERIALIZE DeSerialize
#define EXPORT FMI2_Export
typedef fmi2Status Result;
typedef fmi2Boolean Boolean;
typedef fmi2String String;
typedef fmi2Byte Byte;
typedef fmi2FMUstate Saved;
typedef fmi2Component Handle;

typedef struct {
  Instance *instance;
  fmi2CallbackLogger logger;
  fmi2ComponentEnvironment environment;
  char name[256];
} Component;

static void report(void *host, Status status, const char *message) {
  static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError"};
  Component *c = host;
  char format[2100];
  size_t n = 0;
  /* The text is the format itself, for importers that print it without its arguments. */
  for (; *message && n + 2 < sizeof format; ++message) {
    if (*message == '%') format[n++] = '%';
    format[n++] = *message;
  }
  format[n] = 0;
  if (c->logger) c->logger(c->environment, c->name, (fmi2Status)status, categories[status], format);
}

/* file:///a%20b -> /a b */
static void path_of(const char *uri, char *path, size_t size) {
  size_t n = 0;
  if (!strncmp(uri, "file://", 7)) {
    uri += 7;
    if (strncmp(uri, "localhost/", 10) == 0) uri += 9;
  } else if (!strncmp(uri, "file:", 5)) {
    uri += 5;
  }
  for (; *uri && n + 1 < size; ++uri) {
    unsigned code;
    if (*uri == '%' && sscanf(uri + 1, "%2x", &code) == 1) {
      path[n++] = (char)code;
      uri += 2;
    } else {
      path[n++] = *uri;
    }
  }
  path[n] = 0;
}

#include "calls.c"

FMI2_Export const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean on) {
  char path[4096] = "";
  Component *c = calloc(1, sizeof *c);
  (void)visible, (void)on;
  if (!c) return NULL;
  if (functions) {
    c->logger = functions->logger;
    c->environment = functions->componentEnvironment;
  }
  snprintf(c->name, sizeof c->name, "%s", name ? name : "");
  if (resources) path_of(resources, path, sizeof path);
  if (type == fmi2CoSimulation) return component_with(c, token, path);
  report(c, STATUS_ERROR, "this FMU is for co-simulation only");
  free(c);
  return NULL;
}

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
  return (fmi2Status)instance_experiment(HERE, tolerance_defined ? &tolerance : NULL, start, stop_defined ? &stop : NULL);
}
FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  return (fmi2Status)instance_enter_initialization(HERE, HERE->now.time);
}

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real value[]) {
  return (fmi2Status)instance_get(HERE, r, n, value);
}
FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real value[]) {
  return (fmi2Status)instance_set(HERE, r, n, value);
}

#define NO_VARIABLES(Type, word)                                                                                   \
  FMI2_Export fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2##Type value[]) {    \
    return (void)r, (void)value, none_of(c, n, word);                                                                    \
  }                                                                                                                      \
  FMI2_Export fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2##Type v[]) {  \
    return (void)r, (void)v, none_of(c, n, word);                                                                        \
  }
NO_VARIABLES(Integer, "Integer")
NO_VARIABLES(Boolean, "Boolean")
NO_VARIABLES(String, "String")

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                                    const fmi2ValueReference known[], size_t n_known,
                                                    const fmi2Real seed[], fmi2Real result[]) {
  return (fmi2Status)instance_derivative(HERE, unknown, n_unknown, known, n_known, seed, result);
}
FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                                   const fmi2Integer order[], const fmi2Real value[]) {
  return (fmi2Status)instance_slope(HERE, r, n, order, value);
}
FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                                    const fmi2Integer order[], fmi2Real value[]) {
  (void)r, (void)n, (void)order, (void)value;
  return (fmi2Status)say(HERE, STATUS_ERROR, "output derivatives are not provided");
}
FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_return) {
  (void)no_return;
  return (fmi2Status)instance_step(HERE, time, size);
}
FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c) {
  return (fmi2Status)say(HERE, STATUS_ERROR, "a step is over when fmi2DoStep returns: there is none to cancel");
}
FMI2_Export fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
  return (void)kind, (void)value, (fmi2Status)say(HERE, STATUS_DISCARD, "steps are never pending");
}
FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime) return (fmi2Status)say(HERE, STATUS_DISCARD, "steps are never pending");
  *value = HERE->now.time;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
  return (void)kind, (void)value, (fmi2Status)say(HERE, STATUS_DISCARD, "steps are never pending");
}
FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  if (kind != fmi2Terminated) return (fmi2Status)say(HERE, STATUS_DISCARD, "steps are never pending");
  *value = fmi2False;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
  return (void)kind, (void)value, (fmi2Status)say(HERE, STATUS_DISCARD, "steps are never pending");
}

/* Model exchange: importers look the symbols up, and must be told no. */
static fmi2Status no_exchange(fmi2Component c) {
  return (fmi2Status)say(HERE, STATUS_ERROR, "this FMU is for co-simulation only");
}
FMI2_Export fmi2Status fmi2EnterEventMode(fmi2Component c) { return no_exchange(c); }
FMI2_Export fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *i) { return (void)i, no_exchange(c); }
FMI2_Export fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return no_exchange(c); }
FMI2_Export fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean n, fmi2Boolean *e, fmi2Boolean *t) {
  return (void)n, (void)e, (void)t, no_exchange(c);
}
FMI2_Export fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) { return (void)t, no_exchange(c); }
FMI2_Export fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
  return (void)x, (void)n, no_exchange(c);
}
FMI2_Export fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) { return (void)x, (void)n, no_exchange(c); }
FMI2_Export fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real x[], size_t n) {
  return (void)x, (void)n, no_exchange(c);
}
FMI2_Export fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
  return (void)x, (void)n, no_exchange(c);
}
FMI2_Export fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
  return (void)x, (void)n, no_exchange(c);
}
