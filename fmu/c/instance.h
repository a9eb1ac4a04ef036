/* One simulation of a model: what fmi2.c and fmi3.c have in common.

   model.h is written at export. It gives the counts N_*, the tables START_INPUT, START_PARAMETER, LEAST_PARAMETER,
   MOST_PARAMETER, FIXED_PARAMETER and VARIABLE_NAME, and MODEL_TOKEN. Value references: 0 is time, then inputs, parameters, outputs, in one row.

   Everything is static and is compiled as one file: only FMI's own functions can be seen from outside, so that models
   in one process never share a symbol. There are no global variables. */
#ifndef SNARELAB_INSTANCE_H
#define SNARELAB_INSTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"

/* FMI 2 and FMI 3 number their statuses alike. */
typedef enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR } Status;
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Mode;
typedef void (*Report)(void *host, Status status, const char *message);

#if HOSTED
#include "hosted.h"
#else
#include "equations.h"
#endif

/* All numbers that decide the future. Saving is a copy of this, and of the bytes that a hosted model adds. */
typedef struct {
  int64_t mode, ready;
  double start, time, stop;
  double input[N_INPUTS + 1], slope[N_INPUTS + 1], parameter[N_PARAMETERS + 1];
  Memory memory;
} Numbers;

typedef struct {
  Numbers now;
  double output[N_OUTPUTS + 1];
  int fresh; /* whether output belongs to now */
  Backend backend;
  Report report;
  void *host;
} Instance;

typedef struct {
  Numbers numbers;
  size_t size;
  unsigned char bytes[];
} Snapshot;

/* What a kind of model does; each returns STATUS_OK or says why not through say(). */
static Status backend_open(Instance *i, const char *resources);
static void backend_close(Instance *i);
static Status backend_reset(Instance *i);
static void backend_tolerance(Instance *i, double tolerance); /* what the importer asks for, relative */
static Status backend_initialize(Instance *i);
static Status backend_step(Instance *i, double size);
static Status backend_outputs(Instance *i);
static Status backend_derivative(Instance *i, const double *by_input, const double *by_parameter, double *output);
static Status backend_save(Instance *i, unsigned char **bytes, size_t *size);
static Status backend_restore(Instance *i, const unsigned char *bytes, size_t size);

static Status say(Instance *i, Status status, const char *format, ...);

#endif
