/* A model as generated functions of elapsed time t, states x, inputs u and parameters p (generated.c):

     initial (t, u, p) -> x          output (t, x, u, p) -> y          derivative (t, x, u, p, du, dp) -> dy
     rate (t, x, u, p) -> x'                                                    unless FOLLOWS
     jacobian (t, x, u, p) -> by columns d x' / d x                             if STIFF
     advance (t, h, x, u before, u now, p) -> x a step later                    if FOLLOWS

   A model that FOLLOWS a given motion knows its inputs at both ends of a step only once the next ones are set:
   `state` stays a step behind and is advanced when an output is asked for, or the next step begins. */
#include "generated.c"

typedef int (*Generated)(const casadi_real **, casadi_real **, casadi_int *, casadi_real *, int);

static void evaluate(Instance *i, Generated function, const double **arguments, double *result) {
  double *results[] = {result};
  function(arguments, results, NULL, i->backend.work, 0);
}

static int all_finite(const double *x, int n) {
  for (int k = 0; k < n; ++k)
    if (!isfinite(x[k])) return 0;
  return 1;
}

static Status backend_open(Instance *i, const char *resources) { return (void)i, (void)resources, STATUS_OK; }
static void backend_close(Instance *i) { (void)i; }
static Status backend_reset(Instance *i) { return (void)i, STATUS_OK; }

/* Taken for solver.tolerance, within its range, where there is one; a value that was set there goes before it. */
static void backend_tolerance(Instance *i, double tolerance) {
#if STIFF
  const int last = N_PARAMETERS - 1;
  if (i->now.parameter[last] == START_PARAMETER[last])
    i->now.parameter[last] = fmin(fmax(tolerance, LEAST_PARAMETER[last]), MOST_PARAMETER[last]);
#else
  (void)i, (void)tolerance; /* equal internal steps know no error */
#endif
}

static Status backend_initialize(Instance *i) {
  const double elapsed = 0, *arguments[] = {&elapsed, i->now.input, i->now.parameter};
  Memory *m = &i->now.memory;
  memset(m, 0, sizeof *m);
  evaluate(i, model_initial, arguments, m->state);
#if FOLLOWS
  m->before = i->now.time;
  memcpy(m->input_before, i->now.input, sizeof m->input_before);
#endif
  if (all_finite(m->state, N_STATES)) return STATUS_OK;
  return say(i, STATUS_ERROR, "the start values and parameters give no state to start from");
}

#if FOLLOWS
static void advanced(Instance *i, double *state) {
  const Memory *m = &i->now.memory;
  const double elapsed = m->before - i->now.start, size = i->now.time - m->before;
  const double *arguments[] = {&elapsed, &size, m->state, m->input_before, i->now.input, i->now.parameter};
  if (size > 0) evaluate(i, model_advance, arguments, state);
  else memcpy(state, m->state, sizeof m->state);
}

static const double *state_now(Instance *i, double *room) { return advanced(i, room), room; }

static Status backend_step(Instance *i, double size) {
  double state[N_STATES + 1];
  (void)size;
  advanced(i, state);
  if (!all_finite(state, N_STATES))
    return say(i, STATUS_DISCARD, "no finite state at %g s; is the motion's sampling too coarse?", i->now.time);
  memcpy(i->now.memory.state, state, sizeof state);
  memcpy(i->now.memory.input_before, i->now.input, sizeof i->now.input);
  i->now.memory.before = i->now.time;
  return STATUS_OK;
}
#else
static const double *state_now(Instance *i, double *room) { return (void)room, i->now.memory.state; }

/* x' at a time since the step began; the inputs move along their slopes. */
static void rate(Instance *i, double since, const double *state, double *result) {
  const double elapsed = i->now.time - i->now.start + since;
  double input[N_INPUTS + 1];
  for (int k = 0; k < N_INPUTS; ++k) input[k] = i->now.input[k] + i->now.slope[k] * since;
  const double *arguments[] = {&elapsed, state, input, i->now.parameter};
  evaluate(i, model_rate, arguments, result);
}

#if STIFF
#include "rosenbrock.c"
#else
/* Classical Runge-Kutta (Kutta 1901) in equal parts of at most the last parameter, the internal step [s]. */
static int integrate(Instance *i, double size, double *x) {
  double k1[N_STATES + 1], k2[N_STATES + 1], k3[N_STATES + 1], k4[N_STATES + 1], y[N_STATES + 1];
  const double parts = ceil(size / i->now.parameter[N_PARAMETERS - 1] - 1e-9);
  if (!(parts < 1e9)) return 0;
  const long n = parts < 1 ? 1 : (long)parts;
  const double h = size / n;
  for (long part = 0; part < n; ++part) {
    const double t = part * h;
    rate(i, t, x, k1);
    for (int k = 0; k < N_STATES; ++k) y[k] = x[k] + h / 2 * k1[k];
    rate(i, t + h / 2, y, k2);
    for (int k = 0; k < N_STATES; ++k) y[k] = x[k] + h / 2 * k2[k];
    rate(i, t + h / 2, y, k3);
    for (int k = 0; k < N_STATES; ++k) y[k] = x[k] + h * k3[k];
    rate(i, t + h, y, k4);
    for (int k = 0; k < N_STATES; ++k) x[k] += h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k]);
  }
  return all_finite(x, N_STATES);
}
#endif

static Status backend_step(Instance *i, double size) {
  Memory before = i->now.memory;
  if (integrate(i, size, i->now.memory.state)) return STATUS_OK;
  i->now.memory = before;
  return say(i, STATUS_DISCARD, "no finite state after the step of %g s from %g s; make %s smaller", size, i->now.time,
             VARIABLE_NAME[N_INPUTS + N_PARAMETERS]);
}
#endif

static Status backend_outputs(Instance *i) {
  double room[N_STATES + 1];
  const double *state = state_now(i, room);
  const double elapsed = i->now.time - i->now.start, *arguments[] = {&elapsed, state, i->now.input, i->now.parameter};
  evaluate(i, model_output, arguments, i->output);
  return STATUS_OK;
}

static Status backend_derivative(Instance *i, const double *by_input, const double *by_parameter, double *output) {
  double room[N_STATES + 1];
  const double *state = state_now(i, room);
  const double elapsed = i->now.time - i->now.start;
  const double *arguments[] = {&elapsed, state, i->now.input, i->now.parameter, by_input, by_parameter};
  evaluate(i, model_derivative, arguments, output);
  return STATUS_OK;
}

static Status backend_save(Instance *i, unsigned char **bytes, size_t *size) { return (void)i, (void)bytes, (void)size, STATUS_OK; }
static Status backend_restore(Instance *i, const unsigned char *bytes, size_t size) {
  return (void)i, (void)bytes, (void)size, STATUS_OK;
}
