"""C source of a CasADi function and its loop over samples.

Two loops. One goes sample by sample, so that each may need what the last one left. The other has no such order and
takes samples in groups, every number in lanes of its own, which a compiler turns into vector instructions; the widest
that the machine has are chosen when the library is loaded, and all give the same bits. The C library's tanh would stop
that, so the code brings its own, without branches:

    tanh(x) = -e / (e + 2),  e = expm1(-2 |x|) = 2^k expm1(r) + 2^k - 1,  -2 |x| = k ln 2 + r,  |r| <= ln 2 / 2

with the sign of x, ln 2 in two parts (Cody & Waite 1980), and expm1(r) from its Taylor series to r^13, which leaves
less than 2e-17 of it.
"""

import casadi as ca

ENTRY = "snarelab_samples"
LANES = 128

_TANH = """#include <math.h>
#include <string.h>
static inline double snarelab_tanh(double x) {
  const double size = fabs(x), bounded = size > 20. ? 20. : size;  // NaN stays NaN
  const double whole = 6755399441055744.;  // 1.5 * 2^52: a sum with it is rounded to an integer, in its low bits
  const double y = -2. * bounded, n = y * 1.44269504088896341 + whole, k = n - whole;
  const double r = (y - k * 6.93147180369123816e-01) - k * 1.90821492927058770e-10;
  double p = 1. / 6227020800.;
  p = p * r + 1. / 479001600.;
  p = p * r + 1. / 39916800.;
  p = p * r + 1. / 3628800.;
  p = p * r + 1. / 362880.;
  p = p * r + 1. / 40320.;
  p = p * r + 1. / 5040.;
  p = p * r + 1. / 720.;
  p = p * r + 1. / 120.;
  p = p * r + 1. / 24.;
  p = p * r + 1. / 6.;
  p = p * r + .5;
  p = p * r * r + r;
  unsigned long long bits;
  memcpy(&bits, &n, 8);
  bits = (bits + 1023) << 52;
  double power;
  memcpy(&power, &bits, 8);
  const double e = power * p + (power - 1.);
  return copysign(-e / (e + 2.), x);
}
#define tanh snarelab_tanh
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WIDEST
#endif
"""


def sequential_source(function: ca.Function) -> str:
    """Sample after sample: rows (n_samples, k) in, outputs (n_samples, k) out; step 0 where all share an input."""
    sizes = ", ".join(str(function.numel_out(i)) for i in range(function.n_out()))
    return f"""{_generated(function)}
__attribute__((visibility("default")))
void {ENTRY}(const double *const *in, const long long *step, double *const *out, long long n_samples) {{
  static const long long size[] = {{{sizes}}};
  const double *arg[{max(1, function.sz_arg())}];
  double *res[{max(1, function.sz_res())}];
  casadi_int iw[{max(1, function.sz_iw())}];
  double w[{max(1, function.sz_w())}];
  for (long long k = 0; k < n_samples; ++k) {{
    for (int i = 0; i < {function.n_in()}; ++i) arg[i] = in[i] + k * step[i];
    for (int i = 0; i < {function.n_out()}; ++i) res[i] = out[i] + k * size[i];
    sample(arg, res, iw, w, 0);
  }}
}}
"""


def lanes_source(function: ca.Function) -> str:
    """Samples side by side: rows (n_samples, k) in, outputs (k, n_samples) out."""
    n_in, n_out = function.n_in(), function.n_out()
    into, outof = [function.numel_in(i) for i in range(n_in)], [function.numel_out(i) for i in range(n_out)]
    # An address into a local array is known not to be null, which spares the loop CasADi's tests for that.
    arguments = ", ".join(f"x + {sum(into[:i])}" for i in range(n_in))
    results = ", ".join(f"y + {sum(outof[:i])}" for i in range(n_out))
    total_in, total_out = max(1, sum(into)), max(1, sum(outof))
    return f"""{_TANH}{_generated(function)}
WIDEST __attribute__((visibility("default"), flatten))
void {ENTRY}(const double *const *in, const long long *step, double *const *out, long long n_samples) {{
  static const int into[] = {{{", ".join(map(str, into))}}}, outof[] = {{{", ".join(map(str, outof))}}};
  double lanes_in[{total_in}][{LANES}], lanes_out[{total_out}][{LANES}];
  memset(lanes_in, 0, sizeof lanes_in);
  for (long long first = 0; first < n_samples; first += {LANES}) {{
    const int n = n_samples - first < {LANES} ? n_samples - first : {LANES};
    for (int i = 0, row = 0; i < {n_in}; ++i)
      for (int j = 0; j < into[i]; ++j, ++row)
        if (!first || step[i]) for (int k = 0; k < n; ++k) lanes_in[row][k] = in[i][(first + k) * step[i] + j];
    for (int k = 0; k < {LANES}; ++k) {{
      double x[{total_in}], y[{total_out}];
      const double *arg[] = {{{arguments}}};
      double *res[] = {{{results}}};
      for (int row = 0; row < {total_in}; ++row) x[row] = lanes_in[row][k];
      sample(arg, res, 0, 0, 0);
      for (int row = 0; row < {total_out}; ++row) lanes_out[row][k] = y[row];
    }}
    for (int i = 0, row = 0; i < {n_out}; ++i)
      for (int j = 0; j < outof[i]; ++j, ++row)
        for (int k = 0; k < n; ++k) out[i][j * n_samples + first + k] = lanes_out[row][k];
  }}
}}
"""


def _generated(function: ca.Function) -> str:
    """CasADi's own C for one sample, named ``sample``."""
    generator = ca.CodeGenerator(f"{ENTRY}.c", {"casadi_int": "long long int"})
    generator.add(function)
    # static: the compiler may inline it, and no other library's symbol of the same name can stand in for it
    return f"#define CASADI_SYMBOL_EXPORT static\n{generator.dump()}"
