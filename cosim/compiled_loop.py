"""The explicit master's loop in C, for systems of FMUs only: it spends little more than the FMUs' own time.

It does what `Sweep` does, in the same order of floating-point operations, so that the results are the same bits. It is
taken where every participant is an FMU in this process with real inputs and outputs, steps are equal, nothing is
iterated, no power bond is watched and no algebraic loop is solved.
"""

import ctypes
import subprocess
import warnings
from collections.abc import Sequence

import numpy as np

from ..models.c_library import load_library
from ..models.compiled import CompilerNotice
from .fmi_calls import CompiledCalls
from .sweep import Plan, Sweep
from .system import Layout, System

_SOURCE = r"""
#include <math.h>
#include <stddef.h>
#pragma STDC FP_CONTRACT OFF
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#endif
typedef struct {
    long fmi;
    void *component, *set, *get, *step;
    const unsigned *in_references, *out_references;
    long n_in_references, n_out_references, n_in, n_out, first_in, first_out, follows;
} Unit;
typedef struct {
    const Unit *units;
    const long *visits, *source;
    const double *factor, *offset, *before, *after;
    long n_units, n_visits, n_out, n_points, sequential;
    double origin, size;
} Plan;
typedef int (*Set2)(void *, const unsigned *, size_t, const double *);
typedef int (*Set3)(void *, const unsigned *, size_t, const double *, size_t);
typedef int (*Get2)(void *, const unsigned *, size_t, double *);
typedef int (*Get3)(void *, const unsigned *, size_t, double *, size_t);
typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *);

static int set(const Plan *p, const Unit *u, const double *y, double *input) {
    if (!u->n_in) return 0;
    for (long i = 0; i < u->n_in; i++) {
        long j = u->first_in + i;
        input[i] = p->factor[j] * y[p->source[j]] + p->offset[j];
    }
    int status = u->fmi == 2
        ? ((Set2)u->set)(u->component, u->in_references, u->n_in_references, input)
        : ((Set3)u->set)(u->component, u->in_references, u->n_in_references, input, u->n_in);
    return status > 1 ? status : 0;
}

static int get(const Unit *u, double *y) {
    if (!u->n_out) return 0;
    int status = u->fmi == 2
        ? ((Get2)u->get)(u->component, u->out_references, u->n_out_references, y + u->first_out)
        : ((Get3)u->get)(u->component, u->out_references, u->n_out_references, y + u->first_out, u->n_out);
    return status > 1 ? status : 0;
}

static int step(const Unit *u, double time, double size) {
    if (u->fmi == 2) {
        int status = ((Step2)u->step)(u->component, time, size, 0);
        return status > 1 ? status : 0;
    }
    _Bool event = 0, end = 0, early = 0;
    double reached = 0;
    int status = ((Step3)u->step)(u->component, time, size, 0, &event, &end, &early, &reached);
    return status > 1 ? status : end ? -1 : 0;
}

static double combine(const double *weights, const double *const *known, long n, long i) {
    double total = weights[0] * known[0][i];
    for (long k = 1; k < n; k++) total += weights[k] * known[k][i];
    return total;
}

/* Rows (n, 1 + n_out) of time and outputs; the rows before the first are the past. Number of good steps. */
__attribute__((visibility("default")))
long snarelab_cosim_run(const Plan *p, double *rows, long first, long n, double *held, double *input, long *failure) {
    long width = 1 + p->n_out;
    for (long s = 0; s < n; s++) {
        double *row = rows + s * width, *y = row + 1;
        double time = row[-width], next = p->origin + (double)(first + s + 1) * p->size;
        const double *past[4], *later[4];
        for (long k = 0; k < 3; k++) past[k] = y - (k + 1) * width, later[k + 1] = past[k];
        later[0] = y;
        for (long i = 0; i < p->n_out; i++) held[i] = combine(p->before, past, p->n_points, i);
        long *call = failure + 1, *unit = failure + 2;
        int bad = 0;
        if (p->sequential) {
            for (long i = 0; i < p->n_out; i++) y[i] = combine(p->before + 3, past, p->n_points, i);
            for (*unit = 0; *unit < p->n_units; ++*unit) {
                const Unit *u = p->units + *unit;
                *call = 0;
                if ((bad = set(p, u, held, input))) goto failed;
                *call = 1;
                if ((bad = step(u, time, p->size))) goto failed;
                *call = 0;
                if (u->follows && (bad = set(p, u, y, input))) goto failed;
                *call = 2;
                if ((bad = get(u, y))) goto failed;
                for (long i = u->first_out; i < u->first_out + u->n_out; i++)
                    held[i] = combine(p->after, later, p->n_points, i);
            }
        } else {
            for (*unit = 0; *unit < p->n_units; ++*unit) {
                *call = 0;
                if ((bad = set(p, p->units + *unit, held, input))) goto failed;
                *call = 1;
                if ((bad = step(p->units + *unit, time, p->size))) goto failed;
            }
            *call = 2;
            for (*unit = 0; *unit < p->n_units; ++*unit)
                if ((bad = get(p->units + *unit, y))) goto failed;
        }
        for (long v = 0; v < p->n_visits; v++) {
            *unit = p->visits[v];
            *call = 0;
            if ((bad = set(p, p->units + *unit, y, input))) goto failed;
            *call = 2;
            if ((bad = get(p->units + *unit, y))) goto failed;
        }
        for (long i = 0; i < p->n_out; i++)
            if (!isfinite(y[i])) {
                *call = 3;
                goto failed;
            }
        row[0] = next;
        continue;
    failed:
        failure[0] = bad;
        return s;
    }
    return n;
}
"""
_CALLS = ("Set", "DoStep", "Get", "finite")


class _Unit(ctypes.Structure):
    _fields_ = (
        ("fmi", ctypes.c_long),
        *((name, ctypes.c_void_p) for name in ("component", "set", "get", "step")),
        ("in_references", ctypes.c_void_p),
        ("out_references", ctypes.c_void_p),
        *(
            (name, ctypes.c_long)
            for name in ("n_in_references", "n_out_references", "n_in", "n_out", "first_in", "first_out", "follows")
        ),
    )


class _Plan(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("units", "visits", "source", "factor", "offset", "before", "after")),
        *((name, ctypes.c_long) for name in ("n_units", "n_visits", "n_out", "n_points", "sequential")),
        ("origin", ctypes.c_double),
        ("size", ctypes.c_double),
    )


class CompiledLoop:
    """Macro steps of one size, by the thousand.

    Parameters
    ----------
    calls : sequence of CompiledCalls
        Of every participant, in order.
    layout : Layout
    plan : Plan
    size : float
        Macro step [s].

    Raises
    ------
    OSError, subprocess.SubprocessError
        Where there is no compiler.
    """

    def __init__(
        self,
        calls: Sequence[CompiledCalls],
        layout: Layout,
        plan: Plan,
        size: float,
    ) -> None:
        """Build, or find in the cache, and lay out."""
        self._entry = load_library(_SOURCE).snarelab_cosim_run
        self._entry.restype = ctypes.c_long
        self._calls, self.n_points = calls, len(plan.after)
        units = (_Unit * len(calls))()
        for i, c in enumerate(calls):
            units[i] = _Unit(
                c.fmi,
                c.component,
                c.set,
                c.get,
                c.step,
                ctypes.addressof(c.in_references),
                ctypes.addressof(c.out_references),
                len(c.in_references),
                len(c.out_references),
                c.n_in,
                c.n_out,
                layout.input_slices[i].start,
                layout.output_slices[i].start,
                i in plan.follow,
            )
        n_out = len(layout.outputs)
        self._arrays = [
            np.array(plan.visits, dtype=np.int_),
            layout.source.astype(np.int_),
            layout.factor.astype(float),
            layout.offset.astype(float),
            np.array([[*row, *[0.0] * (3 - len(row))] for row in plan.before]),
            np.array(plan.after),
            np.zeros(n_out),
            np.zeros(len(layout.inputs)),
            np.zeros(3, dtype=np.int_),
        ]
        self._held, self._input, self._failure = self._arrays[6:]
        pointers = [array.ctypes.data for array in self._arrays[:6]]
        self._units = units
        self._plan = _Plan(
            ctypes.addressof(units),
            *pointers,
            len(calls),
            len(plan.visits),
            n_out,
            self.n_points,
            plan.sequential,
            0.0,
            size,
        )

    def __call__(self, rows: np.ndarray, origin: float, first: int) -> tuple[int, str, int, int]:
        """Fill rows of time and outputs.

        Parameters
        ----------
        rows : array (n_points + n, 1 + n_outputs)
            Contiguous; the first ``n_points`` rows are the past.
        origin, first : float, int
            Time [s] and number of the step that is taken first: step k ends at ``origin + (k + 1)·size``.

        Returns
        -------
        tuple
            Steps taken; what failed then ("", "Set", "DoStep", "Get" or "finite"), in which participant, its status.
        """
        self._plan.origin = origin
        n = len(rows) - self.n_points
        done = self._entry(
            ctypes.byref(self._plan),
            ctypes.c_void_p(rows[self.n_points :].ctypes.data),
            ctypes.c_long(first),
            ctypes.c_long(n),
            ctypes.c_void_p(self._held.ctypes.data),
            ctypes.c_void_p(self._input.ctypes.data),
            ctypes.c_void_p(self._failure.ctypes.data),
        )
        status, call, unit = map(int, self._failure)
        return (done, "", 0, 0) if done == n else (done, _CALLS[call], unit, status)


def compiled_loop(system: System, sweep: Sweep, size: float) -> CompiledLoop | None:
    """The loop, or None where not all are FMUs that it can drive; also, with a notice, where there is no compiler."""
    calls = [participant.compiled_calls() for participant in system.participants.values()]
    plan = sweep.plan(size)
    if plan is None or any(c is None for c in calls):
        return None
    try:
        return CompiledLoop([c for c in calls if c is not None], system.layout, plan, size)
    except (OSError, subprocess.SubprocessError) as problem:
        warnings.warn(
            CompilerNotice(f"macro steps run in Python, ten times slower: {problem}; install a C compiler"),
            stacklevel=3,
        )
        return None
