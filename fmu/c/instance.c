/* Modes, variables and saved states of an instance, the same for every model and both versions of FMI. */
#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_PARAMETER (1u + N_INPUTS)
#define FIRST_OUTPUT (FIRST_PARAMETER + N_PARAMETERS)
#define N_VARIABLES (FIRST_OUTPUT + N_OUTPUTS)

static Status say(Instance *i, Status status, const char *format, ...) {
  char message[1024];
  va_list values;
  va_start(values, format);
  vsnprintf(message, sizeof message, format, values);
  va_end(values);
  if (i->report) i->report(i->host, status, message);
  return status;
}

static void set_defaults(Instance *i) {
  memset(&i->now, 0, sizeof i->now);
  memcpy(i->now.input, START_INPUT, sizeof START_INPUT);
  memcpy(i->now.parameter, START_PARAMETER, sizeof START_PARAMETER);
  i->now.stop = INFINITY;
  i->fresh = 0;
}

static void instance_free(Instance *i) {
  if (!i) return;
  backend_close(i);
  free(i);
}

static Instance *instance_new(const char *token, const char *resources, Report report, void *host) {
  Instance *i = calloc(1, sizeof *i);
  if (!i) return NULL;
  i->report = report;
  i->host = host;
  set_defaults(i);
  if (!token || strcmp(token, MODEL_TOKEN)) {
    say(i, STATUS_ERROR, "the model description has the token %s and this binary %s: they are not of one export",
        token ? token : "(none)", MODEL_TOKEN);
    free(i);
    return NULL;
  }
  if (backend_open(i, resources)) {
    instance_free(i);
    return NULL;
  }
  return i;
}

static Status demand(Instance *i, const char *what, unsigned modes) {
  static const char *const names[] = {"instantiated", "initialization mode", "step mode", "terminated"};
  if (modes >> i->now.mode & 1u) return STATUS_OK;
  return say(i, STATUS_ERROR, "%s is not allowed when %s", what, names[i->now.mode]);
}
#define IN(mode) (1u << (mode))

/* NULL: not defined by the importer. */
static Status instance_experiment(Instance *i, const double *tolerance, double start, const double *stop) {
  if (demand(i, "setting up the experiment", IN(INSTANTIATED))) return STATUS_ERROR;
  if (!isfinite(start)) return say(i, STATUS_ERROR, "the start time is %g; give a finite one", start);
  if (stop && !(*stop >= start)) return say(i, STATUS_ERROR, "the stop time %g is before the start time %g", *stop, start);
  if (tolerance && !(isfinite(*tolerance) && *tolerance > 0))
    return say(i, STATUS_ERROR, "the tolerance is %g; give a finite one above zero", *tolerance);
  i->now.time = start;
  i->now.stop = stop ? *stop : INFINITY;
  if (tolerance) backend_tolerance(i, *tolerance);
  return STATUS_OK;
}

static Status instance_enter_initialization(Instance *i, double start) {
  if (demand(i, "entering initialization mode", IN(INSTANTIATED))) return STATUS_ERROR;
  i->now.start = i->now.time = start;
  i->now.mode = INITIALIZING;
  return STATUS_OK;
}

/* States from start values and parameters, as often as those change during initialization. */
static Status made_ready(Instance *i) {
  if (i->now.ready) return STATUS_OK;
  i->fresh = 0;
  Status status = backend_initialize(i);
  if (!status) i->now.ready = 1;
  return status;
}

static Status instance_exit_initialization(Instance *i) {
  if (demand(i, "leaving initialization mode", IN(INITIALIZING))) return STATUS_ERROR;
  Status status = made_ready(i);
  if (!status) i->now.mode = STEPPING;
  return status;
}

static Status instance_terminate(Instance *i) {
  if (demand(i, "terminating", IN(STEPPING))) return STATUS_ERROR;
  i->now.mode = TERMINATED;
  return STATUS_OK;
}

static Status instance_reset(Instance *i) {
  Status status = backend_reset(i);
  if (!status) set_defaults(i);
  return status;
}

/* Whether a variable may take a value. Inputs may leave their range, as solvers and extrapolations do; a parameter that did
   would make another model (FMI 3.0, 2.2.6.3: discard, and the state is as before). */
static Status settable(Instance *i, unsigned r, double value) {
  if (r == 0 || r >= FIRST_OUTPUT)
    return say(i, STATUS_ERROR, "variable %s (value reference %u) cannot be set", r < N_VARIABLES ? VARIABLE_NAME[r] : "(none)",
               r);
  if (!isfinite(value)) return say(i, STATUS_ERROR, "%s was set to %g; give a finite number", VARIABLE_NAME[r], value);
  if (r < FIRST_PARAMETER) return STATUS_OK;
  const unsigned p = r - FIRST_PARAMETER;
  if (value < LEAST_PARAMETER[p] || value > MOST_PARAMETER[p])
    return say(i, STATUS_DISCARD, "%s was set to %g; give a value from %g to %g", VARIABLE_NAME[r], value, LEAST_PARAMETER[p],
               MOST_PARAMETER[p]);
  if (FIXED_PARAMETER[p] && i->now.mode == STEPPING && value != i->now.parameter[p])
    return say(i, STATUS_ERROR, "%s is fixed once initialization has ended; set it before", VARIABLE_NAME[r]);
  return STATUS_OK;
}

static Status instance_set(Instance *i, const unsigned *reference, size_t n, const double *value) {
  if (demand(i, "setting a variable", IN(INSTANTIATED) | IN(INITIALIZING) | IN(STEPPING))) return STATUS_ERROR;
  for (size_t k = 0; k < n; ++k) {
    Status status = settable(i, reference[k], value[k]);
    if (status) return status;
  }
  for (size_t k = 0; k < n; ++k) {
    unsigned r = reference[k];
    if (r < FIRST_PARAMETER) {
      if (i->now.input[r - 1] == value[k]) continue;
      i->now.input[r - 1] = value[k];
      if (i->now.mode != STEPPING) i->now.ready = 0;
    } else {
      unsigned p = r - FIRST_PARAMETER;
      if (i->now.parameter[p] == value[k]) continue;
      i->now.parameter[p] = value[k];
      if (i->now.mode != STEPPING) i->now.ready = 0;
    }
    i->fresh = 0;
  }
  return STATUS_OK;
}

static Status instance_get(Instance *i, const unsigned *reference, size_t n, double *value) {
  for (size_t k = 0; k < n; ++k) {
    unsigned r = reference[k];
    if (r >= N_VARIABLES) return say(i, STATUS_ERROR, "there is no variable of value reference %u", r);
    if (r == 0) {
      value[k] = i->now.time;
    } else if (r < FIRST_PARAMETER) {
      value[k] = i->now.input[r - 1];
    } else if (r < FIRST_OUTPUT) {
      value[k] = i->now.parameter[r - FIRST_PARAMETER];
    } else {
      if (i->now.mode == INSTANTIATED)
        return say(i, STATUS_ERROR, "%s is not known before initialization", VARIABLE_NAME[r]);
      if (!i->fresh) {
        Status status = made_ready(i);
        if (!status && !i->fresh) status = backend_outputs(i);
        if (status) return status;
        i->fresh = 1;
      }
      value[k] = i->output[r - FIRST_OUTPUT];
    }
  }
  return STATUS_OK;
}

/* First derivatives of inputs, for the next step only (FMI 2). */
static Status instance_slope(Instance *i, const unsigned *reference, size_t n, const int *order, const double *value) {
  for (size_t k = 0; k < n; ++k) {
    unsigned r = reference[k];
    if (r == 0 || r >= FIRST_PARAMETER || order[k] != 1 || !isfinite(value[k]))
      return say(i, STATUS_ERROR, "derivative %d of value reference %u: only finite first derivatives of inputs are taken",
                 order[k], r);
    i->now.slope[r - 1] = value[k];
  }
  return STATUS_OK;
}

static Status instance_step(Instance *i, double time, double size) {
  if (demand(i, "a step", IN(STEPPING))) return STATUS_ERROR;
  if (!(isfinite(size) && size >= 0))
    return say(i, STATUS_ERROR, "a step of %g s was asked for; give a finite one above zero", size);
  if (!(fabs(time - i->now.time) <= 1e-6 * size + 1e-9 * fabs(i->now.time)))
    return say(i, STATUS_ERROR, "a step from %.17g s was asked for, but this instance stands at %.17g s", time, i->now.time);
  if (time + size > i->now.stop + 1e-6 * size + 1e-9 * fabs(i->now.stop))
    return say(i, STATUS_ERROR, "a step from %.17g s by %.17g s was asked for, but the stop time is %.17g s", time, size,
               i->now.stop);
  if (size == 0) return STATUS_OK;
  i->fresh = 0; /* unless the step itself gives the outputs */
  Status status = backend_step(i, size);
  if (status) return status;
  for (int k = 0; k < N_INPUTS; ++k) {
    if (i->now.slope[k] != 0) i->fresh = 0;
    i->now.input[k] += i->now.slope[k] * size;
  }
  memset(i->now.slope, 0, sizeof i->now.slope);
  i->now.time = time + size;
  return STATUS_OK;
}

static Status instance_derivative(Instance *i, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                                  size_t n_known, const double *seed, double *result) {
  double by_input[N_INPUTS + 1] = {0}, by_parameter[N_PARAMETERS + 1] = {0}, output[N_OUTPUTS + 1];
  if (demand(i, "a directional derivative", IN(INITIALIZING) | IN(STEPPING)) || made_ready(i)) return STATUS_ERROR;
  for (size_t k = 0; k < n_known; ++k) {
    if (known[k] == 0 || known[k] >= FIRST_OUTPUT)
      return say(i, STATUS_ERROR, "no derivative by value reference %u: it is no input or parameter", known[k]);
    if (known[k] < FIRST_PARAMETER) by_input[known[k] - 1] = seed[k];
    else by_parameter[known[k] - FIRST_PARAMETER] = seed[k];
  }
  Status status = backend_derivative(i, by_input, by_parameter, output);
  if (status) return status;
  for (size_t k = 0; k < n_unknown; ++k) {
    if (unknown[k] < FIRST_OUTPUT || unknown[k] >= N_VARIABLES)
      return say(i, STATUS_ERROR, "no derivative of value reference %u: it is no output", unknown[k]);
    result[k] = output[unknown[k] - FIRST_OUTPUT];
  }
  return STATUS_OK;
}

static Status instance_save(Instance *i, void **saved) {
  unsigned char *bytes = NULL;
  size_t size = 0;
  Status status = backend_save(i, &bytes, &size);
  if (status) return status;
  Snapshot *s = realloc(*saved, sizeof *s + size);
  if (s) {
    s->numbers = i->now;
    s->size = size;
    if (size) memcpy(s->bytes, bytes, size);
    *saved = s;
  }
  free(bytes);
  return s ? STATUS_OK : say(i, STATUS_ERROR, "no memory for a saved state of %zu bytes", size);
}

static Status instance_restore(Instance *i, const void *saved) {
  const Snapshot *s = saved;
  if (!s) return say(i, STATUS_ERROR, "there is no saved state to restore");
  Numbers before = i->now;
  i->now = s->numbers;
  i->fresh = 0;
  Status status = backend_restore(i, s->bytes, s->size);
  if (status) i->now = before;
  return status;
}

/* A serialised state: token, sizes, numbers, bytes. */
typedef struct {
  char token[sizeof MODEL_TOKEN];
  uint64_t numbers, bytes;
} Header;

static size_t instance_serialised_size(const void *saved) {
  const Snapshot *s = saved;
  return s ? sizeof(Header) + sizeof(Numbers) + s->size : 0;
}

static Status instance_serialise(Instance *i, const void *saved, void *to, size_t size) {
  const Snapshot *s = saved;
  if (!s || size < instance_serialised_size(s)) return say(i, STATUS_ERROR, "%zu bytes are too few to serialise into", size);
  Header header;
  memset(&header, 0, sizeof header);
  memcpy(header.token, MODEL_TOKEN, sizeof MODEL_TOKEN);
  header.numbers = sizeof(Numbers);
  header.bytes = s->size;
  memcpy(to, &header, sizeof header);
  memcpy((char *)to + sizeof header, &s->numbers, sizeof s->numbers);
  memcpy((char *)to + sizeof header + sizeof s->numbers, s->bytes, s->size);
  return STATUS_OK;
}

static Status instance_deserialise(Instance *i, const void *from, size_t size, void **saved) {
  Header header;
  const char *data = from;
  if (size >= sizeof header) memcpy(&header, data, sizeof header);
  if (size < sizeof header || memcmp(header.token, MODEL_TOKEN, sizeof MODEL_TOKEN) || header.numbers != sizeof(Numbers) ||
      header.bytes > size || size - header.bytes < sizeof header + sizeof(Numbers))
    return say(i, STATUS_ERROR, "%zu bytes were given that are no serialised state of this model", size);
  Snapshot *s = realloc(*saved, sizeof *s + header.bytes);
  if (!s) return say(i, STATUS_ERROR, "no memory for a saved state");
  *saved = s;
  memcpy(&s->numbers, data + sizeof header, sizeof s->numbers);
  s->size = header.bytes;
  memcpy(s->bytes, data + sizeof header + sizeof s->numbers, s->size);
  return STATUS_OK;
}
