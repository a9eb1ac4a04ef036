"""Error-controlled Runge-Kutta steps of fifth order, in C around the right-hand side that CasADi writes.

Dormand and Prince (1980): seven stages of which the last is the next step's first, solution of fifth order, error from
the embedded fourth; step sizes by Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, II.4. The
loop keeps no state of its own: the same start gives the same steps, bit for bit, in any process on one machine.
"""

import ctypes
import subprocess
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from .c_library import load_library
from .inertia import Array

_DONE, _ROOM, _TINY, _LIMIT = 0, 1, 2, 3

_HEAD = "#define CASADI_SYMBOL_EXPORT static\n#include <math.h>\n#include <string.h>\n"

_LOOP = """
static double snarelab_norm(const double *e, const double *x, const double *y, const double *floor, int n, double tol) {
  double worst = 0;
  for (int i = 0; i < n; ++i) {
    double big = fabs(x[i]) > fabs(y[i]) ? fabs(x[i]) : fabs(y[i]);
    double share = fabs(e[i]) / (tol * (floor[i] + big));
    if (share != share) return INFINITY;
    if (share > worst) worst = share;
  }
  return worst;
}

__attribute__((visibility("default")))
int snarelab_advance(double *at, double *x, double end, const double *input, const double *floor, double tolerance,
                     double longest, long long limit, double *log, long long room, long long *count) {
  static const double c[7] = {0, 0.2, 0.3, 0.8, 8.0 / 9, 1, 1};
  static const double a[7][6] = {{0}, {0.2}, {3.0 / 40, 9.0 / 40}, {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static const double e[7] = {71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
  double k[7][N], y[N], error[N], now, w[SZ_W + 1];
  const double *arg[SZ_ARG + 1];
  double *res[SZ_RES + 1];
  casadi_int iw[SZ_IW + 1];
  double t = at[0], h = at[1];
#define RATE(time, state, out) do { now = (time); arg[0] = &now; arg[1] = (state); arg[2] = input; res[0] = (out); \\
    sample(arg, res, iw, w, 0); } while (0)
  count[0] = count[1] = 0;
  RATE(t, x, k[0]);
  while (t < end) {
    if (count[0] >= room) { at[0] = t; at[1] = h; return 1; }
    if (count[1] >= limit) { at[0] = t; at[1] = h; return 3; }
    double wanted = h > longest ? longest : h, left = end - t;
    int last = wanted >= left * (1 - 1e-9);
    /* two equal steps rather than a long one and a crumb */
    double size = last ? left : wanted > 0.5 * left ? 0.5 * left : wanted;
    for (int s = 1; s < 7; ++s) {
      for (int i = 0; i < N; ++i) {
        double sum = 0;
        for (int j = 0; j < s; ++j) sum += a[s][j] * k[j][i];
        y[i] = x[i] + size * sum;
      }
      RATE(t + c[s] * size, y, k[s]);
    }
    for (int i = 0; i < N; ++i) {
      double sum = 0;
      for (int j = 0; j < 7; ++j) sum += e[j] * k[j][i];
      error[i] = size * sum;
    }
    double share = snarelab_norm(error, x, y, floor, N, tolerance);
    double factor = share > 0 ? 0.9 * pow(share, -0.2) : 5;
    if (!(factor > 0.2)) factor = 0.2;
    if (factor > 5) factor = 5;
    ++count[1];
    if (share <= 1) {
      t = last ? end : t + size;
      memcpy(x, y, sizeof y);
      memcpy(k[0], k[6], sizeof y);
      if (log) {
        log[count[0] * (N + 1)] = t;
        memcpy(log + count[0] * (N + 1) + 1, x, sizeof y);
      }
      ++count[0];
      /* a step cut short by the end says little about the next */
      double next = size * factor;
      h = size < wanted && next < wanted ? wanted : next;
    } else {
      h = size * (factor < 0.9 ? factor : 0.9);
      if (!(h > 1e-14 * (1 + fabs(t)))) { at[0] = t; at[1] = h; return 2; }
    }
  }
  at[0] = t;
  at[1] = h;
  return 0;
}
"""


class StepFault(RuntimeError):
    """No step is short enough: what the equations gave was not finite, or turned too fast."""


@dataclass(frozen=True, eq=False)
class Steps:
    """Where an integration ended: time [s], state (n_states,), the step to go on with [s], and steps tried.

    ``log`` (n_steps, 1 + n_states) holds time and state after each step, or nothing.
    """

    time: float
    state: Array
    size: float
    tried: int
    log: Array


class DormandPrince:
    """Integrates x' = f(t, x, u), u held constant.

    Parameters
    ----------
    rate : casadi.Function
        ``(t, x, u) -> x'`` of SX symbols.
    floor : array (n_states,)
        An error counts relative to the state's size plus this, in the state's unit.
    tolerance : float
        Largest such relative error of one step.

    Raises
    ------
    InputError
        Where there is no C compiler.
    """

    def __init__(self, rate: ca.Function, floor: Array, tolerance: float = 1e-8) -> None:
        """Build the loop, or find it in the cache (see `load_library`)."""
        self.tolerance, self._floor = tolerance, np.ascontiguousarray(floor, float)
        self._n, self._n_inputs = rate.numel_in(1), rate.numel_in(2)
        inputs = rate.sx_in()
        sample = ca.Function("sample", inputs, [ca.densify(rate(*inputs))])
        generator = ca.CodeGenerator("dormand_prince.c", {"casadi_int": "long long int"})
        generator.add(sample)
        sizes = {
            "N": self._n,
            "SZ_W": sample.sz_w(),
            "SZ_IW": sample.sz_iw(),
            "SZ_ARG": sample.sz_arg(),
            "SZ_RES": sample.sz_res(),
        }
        defines = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
        source = f"{_HEAD}{generator.dump()}\n{defines}{_LOOP}"
        try:
            self._advance: Any = load_library(source).snarelab_advance
        except (OSError, subprocess.SubprocessError) as problem:
            raise InputError(
                f"this simulation runs in C: {problem}; install a C compiler or name one in SNARELAB_CC"
            ) from None
        self._advance.restype = ctypes.c_int

    def advance(
        self,
        time: float,
        state: Array,
        end: float,
        inputs: Array,
        size: float,
        longest: float = np.inf,
        log: bool = False,
        limit: int = 1_000_000,
    ) -> Steps:
        """Go from ``time`` to ``end`` [s] with ``inputs`` (n_inputs,) held; ``size`` is the first step to try [s].

        ``longest`` [s] bounds the step. Raises StepFault where a step had to be shorter than time can resolve, or more
        than ``limit`` steps were tried.
        """
        at, x = np.array([time, size]), np.array(state, float)
        held = np.ascontiguousarray(inputs, float)
        if x.shape != (self._n,) or held.shape != (self._n_inputs,):
            raise InputError(f"state {x.shape} and inputs {held.shape}; give ({self._n},) and ({self._n_inputs},)")
        rows: list[Array] = []
        count, tried, outcome = np.zeros(2, np.int64), 0, _ROOM
        room = 1024 if log else np.iinfo(np.int64).max
        while outcome == _ROOM:
            block = np.empty((1024 if log else 0, 1 + self._n))
            outcome = self._advance(
                ctypes.c_void_p(at.ctypes.data),
                ctypes.c_void_p(x.ctypes.data),
                ctypes.c_double(end),
                ctypes.c_void_p(held.ctypes.data),
                ctypes.c_void_p(self._floor.ctypes.data),
                ctypes.c_double(self.tolerance),
                ctypes.c_double(longest),
                ctypes.c_longlong(limit - tried),
                ctypes.c_void_p(block.ctypes.data if log else None),
                ctypes.c_longlong(room),
                ctypes.c_void_p(count.ctypes.data),
            )
            rows.append(block[: count[0]])
            tried += int(count[1])
        if outcome == _TINY:
            raise StepFault(f"no step is short enough at {at[0]:.9g} s: the equations have no finite solution there")
        if outcome == _LIMIT:
            raise StepFault(f"{limit} steps reached only {at[0]:.9g} s of {end:.9g} s: the equations are too stiff")
        return Steps(float(at[0]), x, float(at[1]), tried, np.concatenate(rows) if log else np.empty((0, 1 + self._n)))
