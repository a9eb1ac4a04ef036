/* RODAS: a linearly implicit Runge-Kutta method of order 4 with an embedded one of order 3, L-stable and stiffly accurate
   (Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd edition 1996, section IV.7). Friction through
   rest and fast hidden states cost it nothing. The local error of each internal step stays within the last parameter,
   relative to max(1, |x|). */
#define SQUARE (N_STATES * N_STATES + 1)

static int factorise(double *a, int *pivot) {
  for (int k = 0; k < N_STATES; ++k) {
    int best = k;
    for (int r = k + 1; r < N_STATES; ++r)
      if (fabs(a[r + k * N_STATES]) > fabs(a[best + k * N_STATES])) best = r;
    pivot[k] = best;
    if (!(fabs(a[best + k * N_STATES]) > 0)) return 0;
    for (int c = 0; c < N_STATES && best != k; ++c) {
      double held = a[k + c * N_STATES];
      a[k + c * N_STATES] = a[best + c * N_STATES];
      a[best + c * N_STATES] = held;
    }
    for (int r = k + 1; r < N_STATES; ++r) a[r + k * N_STATES] /= a[k + k * N_STATES];
    for (int c = k + 1; c < N_STATES; ++c) {
      const double factor = a[k + c * N_STATES];
      for (int r = k + 1; r < N_STATES; ++r) a[r + c * N_STATES] -= a[r + k * N_STATES] * factor;
    }
  }
  return 1;
}

static void solve(const double *a, const int *pivot, double *b) {
  for (int k = 0; k < N_STATES; ++k) {
    const double held = b[k];
    b[k] = b[pivot[k]];
    b[pivot[k]] = held;
  }
  for (int k = 0; k < N_STATES; ++k)
    for (int r = k + 1; r < N_STATES; ++r) b[r] -= a[r + k * N_STATES] * b[k];
  for (int k = N_STATES - 1; k >= 0; --k) {
    b[k] /= a[k + k * N_STATES];
    for (int r = 0; r < k; ++r) b[r] -= a[r + k * N_STATES] * b[k];
  }
}

/* One step of h from a time since the macro step began: y a step later, and its error in the weighted norm. */
static double attempt(Instance *i, double since, double h, const double *x, const double *by_state, const double *slope,
                      double tolerance, double *y) {
  static const double gamma = 0.25, at[6] = {0, 0.386, 0.21, 0.63, 1, 1};
  static const double d[6] = {0.25, -0.1043, 0.1035, -0.0362, 0, 0};
  static const double a[5][5] = {{0},
                                 {1.544},
                                 {0.9466785280815826, 0.2557011698983284},
                                 {3.314825187068521, 2.896124015972201, 0.9986419139977817},
                                 {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950}};
  static const double c[6][5] = {
      {0},
      {-5.6688},
      {-2.430093356833875, -0.2063599157091915},
      {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
      {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
      {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}};
  double matrix[SQUARE], k[6][N_STATES + 1], f[N_STATES + 1];
  int pivot[N_STATES + 1];
  for (int n = 0; n < N_STATES * N_STATES; ++n) matrix[n] = -by_state[n];
  for (int n = 0; n < N_STATES; ++n) matrix[n * (N_STATES + 1)] += 1 / (h * gamma);
  if (!factorise(matrix, pivot)) return INFINITY;
  for (int stage = 0; stage < 6; ++stage) {
    for (int n = 0; n < N_STATES; ++n) {
      if (stage < 5) {
        y[n] = x[n];
        for (int s = 0; s < stage; ++s) y[n] += a[stage][s] * k[s][n];
      } else {
        y[n] += k[4][n];
      }
    }
    rate(i, since + at[stage] * h, y, f);
    for (int n = 0; n < N_STATES; ++n) {
      k[stage][n] = f[n] + h * d[stage] * slope[n];
      for (int s = 0; s < stage; ++s) k[stage][n] += c[stage][s] / h * k[s][n];
    }
    solve(matrix, pivot, k[stage]);
  }
  double sum = 0;
  for (int n = 0; n < N_STATES; ++n) {
    y[n] += k[5][n];
    const double scaled = k[5][n] / (tolerance * fmax(1, fmax(fabs(x[n]), fabs(y[n]))));
    sum += scaled * scaled;
  }
  return sqrt(sum / N_STATES);
}

static int integrate(Instance *i, double size, double *x) {
  double y[N_STATES + 1], by_state[SQUARE], first[N_STATES + 1], slope[N_STATES + 1] = {0}, input[N_INPUTS + 1];
  const double tolerance = i->now.parameter[N_PARAMETERS - 1];
  double *trial = &i->now.memory.trial, since = 0;
  int moving = 0, stale = 1;
  for (int k = 0; k < N_INPUTS; ++k) moving |= i->now.slope[k] != 0;
  if (!(*trial > 0)) *trial = size;
  for (int count = 0; since < size; ++count) {
    if (count > 1000000 || !(*trial > 1e-14 * size)) return 0;
    const int last = since + *trial * (1 + 1e-9) >= size;
    const double h = last ? size - since : *trial;
    if (stale) {
      const double elapsed = i->now.time - i->now.start + since, shift = 1e-6 * size;
      for (int k = 0; k < N_INPUTS; ++k) input[k] = i->now.input[k] + i->now.slope[k] * since;
      const double *arguments[] = {&elapsed, x, input, i->now.parameter};
      evaluate(i, model_jacobian, arguments, by_state);
      if (moving) {
        rate(i, since, x, first);
        rate(i, since + shift, x, slope);
        for (int k = 0; k < N_STATES; ++k) slope[k] = (slope[k] - first[k]) / shift;
      }
      stale = 0;
    }
    const double error = attempt(i, since, h, x, by_state, slope, tolerance, y);
    const double factor = isfinite(error) ? fmin(5, fmax(0.1, 0.9 * pow(fmax(error, 1e-10), -0.25))) : 0.1;
    if (error <= 1 && all_finite(y, N_STATES)) {
      memcpy(x, y, sizeof y);
      since += h;
      stale = 1;
      if (last) since = size;
      if (!last || h * factor > *trial) *trial = h * factor;
    } else {
      *trial = h * fmin(factor, 0.5);
    }
  }
  return 1;
}
