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
from . import loop_source
from .fmi_calls import CompiledCalls
from .sweep import Sweep, SweepPlan
from .system import Layout, System

_CALLS = ("Set", "DoStep", "Get", "finite")


class CompiledLoop:
    """Macro steps of one size, by the thousand.

    Parameters
    ----------
    calls : sequence of CompiledCalls
        Of every participant, in order.
    layout : Layout
    plan : SweepPlan
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
        plan: SweepPlan,
        size: float,
    ) -> None:
        """Build, or find in the cache, and lay out."""
        self._entry = load_library(loop_source.SOURCE).snarelab_cosim_run
        self._entry.restype = ctypes.c_long
        self._calls, self.n_points = calls, len(plan.end)
        units = (loop_source.LoopParticipant * len(calls))()
        for i, c in enumerate(calls):
            units[i] = loop_source.LoopParticipant(
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
                i in plan.halves,
            )
        n_out = len(layout.outputs)
        self._arrays = [
            np.array(plan.visits, dtype=np.int_),
            layout.source.astype(np.int_),
            layout.factor.astype(float),
            layout.offset.astype(float),
            *(_rows(rows) for rows in (plan.before, [plan.end], plan.after)),
            np.zeros(3 * n_out),
            np.zeros(len(layout.inputs)),
            np.zeros(3, dtype=np.int_),
        ]
        self._held, self._input, self._failure = self._arrays[7:]
        pointers = [array.ctypes.data for array in self._arrays[:7]]
        self._units = units
        self._plan = loop_source.LoopPlan(
            ctypes.addressof(units),
            *pointers,
            len(calls),
            len(plan.visits),
            n_out,
            self.n_points,
            plan.sequential,
            bool(plan.halves),
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


def _rows(weights: Sequence[tuple[float, ...]]) -> np.ndarray:
    """Rows of three, which C counts on."""
    return np.array([[*row, *[0.0] * (3 - len(row))] for row in weights])


def compiled_loop(system: System, sweep: Sweep, size: float) -> CompiledLoop | None:
    """The loop; None if a participant is no FMU that it can drive, or (with a notice) if there is no compiler."""
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
