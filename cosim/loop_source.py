"""C of the explicit master's loop, and its structures as C lays them out. `snarelab.cosim.compiled_loop` fills them."""

import ctypes

SOURCE = r"""
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
    long n_in_references, n_out_references, n_in, n_out, first_in, first_out, follows, halves;
} Unit;
typedef struct {
    const Unit *units;
    const long *visits, *source;
    const double *factor, *offset, *before, *end, *after; /* rows of three weights; before and after: whole, halves */
    long n_units, n_visits, n_out, n_points, sequential, halves;
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

/* What is held of outputs from one to another: over the step, and over its halves where any unit takes these. */
static void hold(const Plan *p, const double *rows, const double *const *known, double *held, long from, long to) {
    for (long i = from; i < to; i++) held[i] = combine(rows, known, p->n_points, i);
    if (!p->halves) return;
    for (long part = 1; part < 3; part++)
        for (long i = from; i < to; i++) held[part * p->n_out + i] = combine(rows + 3 * part, known, p->n_points, i);
}

/* A unit's step on what is held, in one or in halves; call says which function failed. */
static int advance(const Plan *p, const Unit *u, double time, const double *held, double *input, long *call) {
    int bad;
    double size = p->size;
    if (u->halves) {
        size *= 0.5;
        *call = 0;
        if ((bad = set(p, u, held + p->n_out, input))) return bad;
        *call = 1;
        if ((bad = step(u, time, size))) return bad;
        time += size;
        held += 2 * p->n_out;
    }
    *call = 0;
    if ((bad = set(p, u, held, input))) return bad;
    *call = 1;
    return step(u, time, size);
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
        hold(p, p->before, past, held, 0, p->n_out);
        long *call = failure + 1, *unit = failure + 2;
        int bad = 0;
        if (p->sequential) {
            for (long i = 0; i < p->n_out; i++) y[i] = combine(p->end, past, p->n_points, i);
            for (*unit = 0; *unit < p->n_units; ++*unit) {
                const Unit *u = p->units + *unit;
                if ((bad = advance(p, u, time, held, input, call))) goto failed;
                *call = 0;
                if (u->follows && (bad = set(p, u, y, input))) goto failed;
                *call = 2;
                if ((bad = get(u, y))) goto failed;
                hold(p, p->after, later, held, u->first_out, u->first_out + u->n_out);
            }
        } else {
            for (*unit = 0; *unit < p->n_units; ++*unit)
                if ((bad = advance(p, p->units + *unit, time, held, input, call))) goto failed;
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


class LoopParticipant(ctypes.Structure):
    """One participant."""

    _fields_ = (
        ("fmi", ctypes.c_long),
        *((name, ctypes.c_void_p) for name in ("component", "set", "get", "step")),
        ("in_references", ctypes.c_void_p),
        ("out_references", ctypes.c_void_p),
        *(
            (name, ctypes.c_long)
            for name in (
                "n_in_references",
                "n_out_references",
                "n_in",
                "n_out",
                "first_in",
                "first_out",
                "follows",
                "halves",
            )
        ),
    )


class LoopPlan(ctypes.Structure):
    """The system; pointers to arrays that the caller keeps."""

    _fields_ = (
        *(
            (name, ctypes.c_void_p)
            for name in ("units", "visits", "source", "factor", "offset", "before", "end", "after")
        ),
        *((name, ctypes.c_long) for name in ("n_units", "n_visits", "n_out", "n_points", "sequential", "halves")),
        ("origin", ctypes.c_double),
        ("size", ctypes.c_double),
    )
