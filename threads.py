"""Threads of the linear algebra library: one, where many small matrices are worked on."""

import os

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread() -> None:
    """One thread for libraries that are loaded from now on, unless the environment says how many.

    On matrices of a few hundred columns, threads wait for each other and burn the time they wait: a diagnosis of EMPS
    takes a quarter of the processor's time with one. Nor do its sums then depend on how many cores a machine has.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
