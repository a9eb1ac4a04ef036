"""What the samples before do not predict of the next: a Kalman filter whose state is a channel's hidden noise.

    s_t = P h_t,  v_t = h_t' s_t + variance_t,  e_t = (x_t - h_t' z) / √v_t
    z <- F (z + s_t e_t / √v_t),  P <- F (P - s_t s_t' / v_t) F' + Q

(Durbin and Koopman 2012, chapter 4). Innovations e of many columns x go through the samples side by side, in C. Where
there is no compiler NumPy does the same, tens of times slower.
"""

import ctypes
import functools
import subprocess
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.c_library import load_library

Array = NDArray[np.float64]

_SOURCE = """#include <math.h>
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WIDEST
#endif
#define SHOWN __attribute__((visibility("default")))
typedef long long whole;

/* to = by from, of matrices (d, d) and (d, k); most of by is zero. */
static inline void product(whole d, whole k, const double *by, const double *restrict from, double *restrict to) {
  for (whole i = 0; i < d; i++) {
    double *restrict row = to + i * k;
    for (whole c = 0; c < k; c++) row[c] = 0;
    for (whole j = 0; j < d; j++) {
      const double f = by[i * d + j];
      if (f == 0) continue;
      const double *restrict other = from + j * k;
      for (whole c = 0; c < k; c++) row[c] += f * other[c];
    }
  }
}

SHOWN void snarelab_gains(whole n, whole d, const double *h, const double *variance, const unsigned char *first,
                          const double *forward, const double *start, const double *news, double *gains,
                          double *roots, double *spread, double *turned) {
  for (whole t = 0; t < n; t++, h += d, gains += d) {
    if (first[t])
      for (whole i = 0; i < d * d; i++) spread[i] = start[i];
    double total = variance[t];
    for (whole i = 0; i < d; i++) {
      double seen = 0;
      for (whole j = 0; j < d; j++) seen += spread[i * d + j] * h[j];
      gains[i] = seen;
      total += h[i] * seen;
    }
    roots[t] = sqrt(total);
    for (whole i = 0; i < d; i++)
      for (whole j = 0; j < d; j++) spread[i * d + j] -= gains[i] * gains[j] / total;
    for (whole i = 0; i < d; i++) gains[i] /= roots[t];
    product(d, d, forward, spread, turned);
    for (whole i = 0; i < d; i++)
      for (whole j = 0; j < d; j++) {
        double sum = news[i * d + j];
        for (whole m = 0; m < d; m++) sum += turned[i * d + m] * forward[j * d + m];
        spread[i * d + j] = sum;
      }
  }
}

SHOWN WIDEST void snarelab_innovations(whole n, whole d, whole k, const double *h, const unsigned char *first,
                                       const double *forward, const double *gains, const double *roots,
                                       double *restrict state, double *restrict next, double *restrict x) {
  for (whole t = 0; t < n; t++, h += d, gains += d, x += k) {
    if (first[t])
      for (whole i = 0; i < d * k; i++) state[i] = 0;
    for (whole j = 0; j < d; j++) {
      if (h[j] == 0) continue;
      const double by = h[j];
      for (whole c = 0; c < k; c++) x[c] -= by * state[j * k + c];
    }
    const double root = roots[t];
    for (whole c = 0; c < k; c++) x[c] /= root;
    for (whole j = 0; j < d; j++) {
      const double by = gains[j];
      if (by == 0) continue;
      for (whole c = 0; c < k; c++) state[j * k + c] += by * x[c];
    }
    product(d, k, forward, state, next);
    for (whole i = 0; i < d * k; i++) state[i] = next[i];
  }
}
"""


@dataclass(frozen=True)
class HiddenNoise:
    """A channel's noise as a hidden state of m values, which starts anew where ``first`` says so.

    Parameters
    ----------
    weights : array (n, m)
        h_t.
    variance : array (n,)
        Of what is independent from sample to sample; positive.
    first : array of bool (n,)
    forward, start, news : arrays (m, m)
        F, P at a start, and Q.
    """

    weights: Array
    variance: Array
    first: NDArray[np.bool_]
    forward: Array
    start: Array
    news: Array

    def gains(self) -> tuple[Array, Array]:
        """s_t / √v_t (n, m) and √v_t (n,)."""
        n, d = self.weights.shape
        gains, roots = np.empty((n, d)), np.empty(n)
        if compiled := _compiled():
            spread = np.empty((2, d, d))
            given = (
                self.weights,
                self.variance,
                self.first,
                self.forward,
                self.start,
                self.news,
                gains,
                roots,
                *spread,
            )
            compiled[0](n, d, *(x.ctypes.data for x in given))
            return gains, roots
        spread = self.start
        for t, (h, variance) in enumerate(zip(self.weights, self.variance, strict=True)):
            spread = self.start if self.first[t] else spread
            seen = spread @ h
            roots[t] = np.sqrt(h @ seen + variance)
            gains[t] = seen / roots[t]
            spread = self.forward @ (spread - np.outer(gains[t], gains[t])) @ self.forward.T + self.news
        return gains, roots

    def innovations(self, x: Array, rows: slice, state: Array, gains: Array, roots: Array) -> Array:
        """e of columns (n_rows, k) of some samples, and the ``state`` (m, k) before them, which becomes the one after.

        ``gains`` and ``roots`` are of all samples.
        """
        found = np.array(x, float, order="C")
        weights, first, gains, roots = self.weights[rows], self.first[rows], gains[rows], roots[rows]
        if compiled := _compiled():
            given = (weights, first, self.forward, gains, roots, state, np.empty_like(state), found)
            compiled[1](*found.shape[:1], *state.shape, *(v.ctypes.data for v in given))
            return found
        for t, (h, gain, root) in enumerate(zip(weights, gains, roots, strict=True)):
            if first[t]:
                state[:] = 0.0
            found[t] = (found[t] - h @ state) / root
            state[:] = self.forward @ (state + np.outer(gain, found[t]))
        return found


def compiles() -> bool:
    """Whether there is a compiler, and innovations cost next to nothing."""
    return _compiled() is not None


@functools.cache
def _compiled() -> tuple[Callable[..., None], Callable[..., None]] | None:
    """The two loops in C; None where nothing can be compiled, as the model's own functions have said before."""
    try:
        library = load_library(_SOURCE, 3)
    except (OSError, subprocess.SubprocessError):
        return None
    whole, pointer = ctypes.c_longlong, ctypes.c_void_p
    gains, innovations = library.snarelab_gains, library.snarelab_innovations
    gains.argtypes, gains.restype = [whole] * 2 + [pointer] * 10, None
    innovations.argtypes, innovations.restype = [whole] * 3 + [pointer] * 8, None
    return gains, innovations
