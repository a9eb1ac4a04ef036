"""Vectors of three as tuples, compiled: no memory is allocated, and formulas read as they are written.

All compiled functions of the snare are kept in the folder's ``__pycache__``; numba looks at the time stamp of the file
called, not of the files it calls: remove the folder after editing one of them by hand.
"""

from math import sqrt

from ...extras import needed_for

with needed_for("the snare"):
    import numba

compiled = numba.njit(cache=True, error_model="numpy")
"""Decorator of every compiled function: one source, with or without a C compiler on the machine."""


@compiled
def add(a, b):
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def subtract(a, b):
    """a − b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled
def scale(factor, a):
    """factor · a."""
    return (factor * a[0], factor * a[1], factor * a[2])


@compiled
def add_scaled(a, factor, b):
    """a + factor · b."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


@compiled
def dot(a, b):
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a, b):
    """a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def length(a):
    """|a|."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@compiled
def unit(axis):
    """Unit vector along axis 0, 1 or 2."""
    return (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)


@compiled
def row(array, index):
    """Row of an (n, 3) array as a tuple."""
    return (array[index, 0], array[index, 1], array[index, 2])


@compiled
def rotate(matrix, a):
    """R a."""
    return (
        matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
        matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
        matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
    )


@compiled
def rotate_back(matrix, a):
    """Rᵀ a."""
    return (
        matrix[0, 0] * a[0] + matrix[1, 0] * a[1] + matrix[2, 0] * a[2],
        matrix[0, 1] * a[0] + matrix[1, 1] * a[1] + matrix[2, 1] * a[2],
        matrix[0, 2] * a[0] + matrix[1, 2] * a[1] + matrix[2, 2] * a[2],
    )
