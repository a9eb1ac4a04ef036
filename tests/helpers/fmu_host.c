/* An importer in C: opens an FMU's library without any Python around it, and holds it to exact rollback.

     fmu_host LIBRARY TOKEN RESOURCES N_OUTPUTS FIRST_OUTPUT STEPS SIZE [REFERENCE=VALUE ...]

   Two instances; values are set before initialization ends. Prints the outputs after STEPS steps as hexadecimal numbers, one
   a line. Then: save, 50 steps, restore, 50 steps again, the same into the second instance, and after serialising; the
   outputs must have the same bits each time. Exit status 0: all held; 2: no instance; 1: anything else. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Component Component;
typedef fmi2FMUstate State;
typedef fmi2Byte Byte;
#define NAME(two, three) "fmi2" two
#define TYPE(two, three) fmi2##two##TYPE
#else
#include "fmi3Functions.h"
typedef fmi3Instance Component;
typedef fmi3FMUState State;
typedef fmi3Byte Byte;
#define NAME(two, three) "fmi3" three
#define TYPE(two, three) fmi3##three##TYPE
#endif

#define FUNCTIONS(DO)                                                                   \
  DO(free_instance, FreeInstance, FreeInstance)                                         \
  DO(enter, EnterInitializationMode, EnterInitializationMode)                           \
  DO(leave, ExitInitializationMode, ExitInitializationMode)                             \
  DO(terminate, Terminate, Terminate)                                                   \
  DO(reset, Reset, Reset)                                                               \
  DO(get, GetReal, GetFloat64)                                                          \
  DO(set, SetReal, SetFloat64)                                                          \
  DO(do_step, DoStep, DoStep)                                                           \
  DO(get_state, GetFMUstate, GetFMUState)                                               \
  DO(set_state, SetFMUstate, SetFMUState)                                               \
  DO(free_state, FreeFMUstate, FreeFMUState)                                            \
  DO(state_size, SerializedFMUstateSize, SerializedFMUStateSize)                        \
  DO(serialise, SerializeFMUstate, SerializeFMUState)                                   \
  DO(deserialise, DeSerializeFMUstate, DeserializeFMUState)

#define DECLARE(name, two, three) static TYPE(two, three) *name;
FUNCTIONS(DECLARE)

static int failures;
#define DEMAND(what)                                                \
  do {                                                              \
    if (!(what)) {                                                  \
      fprintf(stderr, "line %d: %s does not hold\n", __LINE__, #what); \
      ++failures;                                                   \
    }                                                               \
  } while (0)

#if FMI == 2
static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...) {
  va_list values;
  va_start(values, text);
  (void)e;
  fprintf(stderr, "log %s %d %s: ", name, status, category);
  vfprintf(stderr, text, values);
  fprintf(stderr, "\n");
  va_end(values);
}
static fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
static Component instantiate(void *library, const char *name, const char *token, const char *resources) {
  char uri[5000];
  fmi2InstantiateTYPE *make = (fmi2InstantiateTYPE *)dlsym(library, "fmi2Instantiate");
  snprintf(uri, sizeof uri, "file://%s", resources);
  return make(name, fmi2CoSimulation, token, uri, &callbacks, fmi2False, fmi2True);
}
static int start(void *library, Component c) {
  fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)dlsym(library, "fmi2SetupExperiment");
  return setup(c, fmi2False, 0, 0, fmi2False, 0) || enter(c);
}
static int get_all(Component c, const unsigned *r, size_t n, double *v) { return get(c, r, n, v); }
static int set_all(Component c, const unsigned *r, size_t n, const double *v) { return set(c, r, n, v); }
static int step(Component c, double time, double size) { return do_step(c, time, size, fmi2False); }
#else
static void logger(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String text) {
  (void)e;
  fprintf(stderr, "log %d %s: %s\n", status, category, text);
}
static Component instantiate(void *library, const char *name, const char *token, const char *resources) {
  fmi3InstantiateCoSimulationTYPE *make =
      (fmi3InstantiateCoSimulationTYPE *)dlsym(library, "fmi3InstantiateCoSimulation");
  return make(name, token, resources, fmi3False, fmi3True, fmi3False, fmi3False, NULL, 0, NULL, logger, NULL);
}
static int start(void *library, Component c) {
  (void)library;
  return enter(c, fmi3False, 0, 0, fmi3False, 0);
}
static int get_all(Component c, const unsigned *r, size_t n, double *v) { return get(c, r, n, v, n); }
static int set_all(Component c, const unsigned *r, size_t n, const double *v) { return set(c, r, n, v, n); }
static int step(Component c, double time, double size) {
  fmi3Boolean event, end, early;
  fmi3Float64 last;
  return do_step(c, time, size, fmi3False, &event, &end, &early, &last);
}
#endif

static double run(Component c, double time, double size, int n) {
  for (int k = 0; k < n; ++k) {
    if (step(c, time, size)) {
      ++failures;
      fprintf(stderr, "step at %g failed\n", time);
      break;
    }
    time += size;
  }
  return time;
}

int main(int count, char **argument) {
  if (count < 8) return 1;
  void *library = dlopen(argument[1], RTLD_NOW | RTLD_LOCAL);
  if (!library) {
    fprintf(stderr, "%s\n", dlerror());
    return 1;
  }
#define LOAD(name, two, three)                                                          \
  name = (TYPE(two, three) *)dlsym(library, NAME(#two, #three));                        \
  if (!name) {                                                                          \
    fprintf(stderr, "%s is missing\n", NAME(#two, #three));                             \
    return 1;                                                                           \
  }
  FUNCTIONS(LOAD)

  const int n = atoi(argument[4]), first = atoi(argument[5]), steps = atoi(argument[6]);
  const double size = atof(argument[7]);
  const size_t bytes = (size_t)n * sizeof(double);
  Component one = instantiate(library, "one", argument[2], argument[3]);
  if (!one) return 2;
  Component two = instantiate(library, "two", argument[2], argument[3]);
  DEMAND(two);
  DEMAND(!instantiate(library, "three", "{another token}", argument[3]));

  unsigned *outputs = malloc((size_t)n * sizeof *outputs);
  double *wanted = malloc(bytes), *found = malloc(bytes);
  for (int k = 0; k < n; ++k) outputs[k] = (unsigned)(first + k);
  Component both[] = {one, two};
  for (int k = 0; k < 2; ++k) {
    DEMAND(!start(library, both[k]));
    for (int a = 8; a < count; ++a) {
      const unsigned reference = (unsigned)strtoul(argument[a], NULL, 10);
      const double value = atof(strchr(argument[a], '=') + 1);
      DEMAND(!set_all(both[k], &reference, 1, &value));
    }
    DEMAND(!leave(both[k]));
  }
  double time = run(one, 0, size, steps);
  DEMAND(!get_all(one, outputs, (size_t)n, found));
  for (int k = 0; k < n; ++k) printf("%a\n", found[k]);

  State saved = NULL, copy = NULL, again = NULL;
  DEMAND(!get_state(one, &saved));
  run(one, time, size, 50);
  DEMAND(!get_all(one, outputs, (size_t)n, wanted));
#define SAME(c)                                     \
  run(c, time, size, 50);                           \
  memset(found, 0, bytes);                          \
  DEMAND(!get_all(c, outputs, (size_t)n, found));   \
  DEMAND(!memcmp(found, wanted, bytes))
  DEMAND(!set_state(one, saved));
  SAME(one);
  DEMAND(!set_state(two, saved));
  SAME(two);
  size_t length = 0;
  DEMAND(!state_size(one, saved, &length));
  Byte *serialised = malloc(length);
  DEMAND(!serialise(one, saved, serialised, length));
  DEMAND(!deserialise(two, serialised, length, &copy));
  DEMAND(!set_state(two, copy));
  SAME(two);
  DEMAND(!set_state(one, saved));
  DEMAND(!get_state(one, &again));
  DEMAND(!get_state(one, &again)); /* into the same place */
  DEMAND(!set_state(one, again));
  SAME(one);
  DEMAND(deserialise(two, serialised, length - 1, &copy)); /* a torn one is refused, and said so */
  DEMAND(step(one, time - 1, size));                         /* a step from another time too */
  free_state(one, &saved);
  free_state(one, &again);
  free_state(two, &copy);
  DEMAND(!terminate(one));
  DEMAND(!reset(one));
  DEMAND(!start(library, one) && !leave(one));
  run(one, 0, size, 1);
  free_instance(one);
  free_instance(two);
  free(serialised);
  free(outputs);
  free(wanted);
  free(found);
  dlclose(library);
  return failures ? 1 : 0;
}
