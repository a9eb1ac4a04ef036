"""A CasADi function over many samples, at the speed of C.

CasADi writes the function as C, and a loop over samples is appended and compiled. One call through `ctypes` (which
releases Python's lock, and keeps no state) does all samples: side by side, or one after another where each needs the
state that the last one left. Where there is no compiler the same function runs in CasADi's virtual machine, with one
`CompilerNotice`.
"""

import ctypes
import functools
import subprocess
import threading
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from .c_library import load_library
from .c_source import ENTRY, lanes_source, sequential_source
from .inertia import Array

_NOTICE = threading.Lock()
_Loop = Callable[[list[Array], list[Array], int], None]


class CompilerNotice(UserWarning):
    """No C code could be built: the results are the same and come tens of times slower."""


class SampleFunction:
    """A CasADi function evaluated on many samples at once; threads may share it.

    Parameters
    ----------
    function : casadi.Function
        Of SX symbols (else ``function.expand()``); inputs are columns, outputs may be matrices.
    lanes : bool
        Take samples in groups, with vector instructions: several times quicker for a short function of few outputs
        whose only transcendental is tanh. It cannot be scanned then; outputs are contiguous along the samples.
    """

    def __init__(self, function: ca.Function, *, lanes: bool = False) -> None:
        """Build, or find in the cache (see `load_library`)."""
        inputs = function.sx_in()
        outputs = [ca.densify(output) for output in function.call(inputs, True, False)]
        # CasADi stores columns, numpy rows: transposed and dense, a sample's output is written where it belongs.
        # The name is our own: the function's might be one of C's.
        written = ca.Function("sample", inputs, [output.T for output in outputs])
        self._name = function.name()
        self._names = function.name_in()
        self._sizes = [function.size1_in(i) for i in range(function.n_in())]
        self._shapes = [function.size_out(i) for i in range(function.n_out())]
        # Held here: building a map of the virtual machine takes as long as running it.
        self._map = functools.lru_cache(maxsize=16)(written.map)
        self._accumulate = functools.lru_cache(maxsize=16)(ca.Function("step", inputs, outputs).mapaccum)
        self._lanes = lanes
        self._loop = _compiled_loop(written, lanes)

    def __call__(self, *inputs: Array) -> tuple[Array, ...]:
        """Evaluate all samples.

        Parameters
        ----------
        *inputs : arrays
            For each input of k rows: (n_samples, k), or (k,) where all samples share it.

        Returns
        -------
        tuple of arrays (n_samples, rows, columns), one for each output

        Raises
        ------
        InputError
            Where the number of inputs, their shape, or the number of samples does not fit.
        """
        arrays, n_samples = self._checked(inputs)
        if self._lanes and self._loop:
            columns = [np.empty((*shape, n_samples)) for shape in self._shapes]
            self._loop(arrays, columns, n_samples)
            return tuple(np.moveaxis(column, -1, 0) for column in columns)
        results = [np.empty((n_samples, *shape)) for shape in self._shapes]
        if n_samples:
            loop = self._loop or functools.partial(_machine, self._map(n_samples))
            loop(arrays, results, n_samples)
        return tuple(results)

    def scan(self, start: Array, *inputs: Array) -> Array:
        """Follow a state, x[k + 1] = f(x[k], inputs[k]): the function's one output is its first input a sample later.

        Parameters
        ----------
        start : array (k,)
            The first state.
        *inputs : arrays
            All but the first input, as in a call.

        Returns
        -------
        array (n_samples + 1, k)

        Raises
        ------
        InputError
            As a call does.
        """
        if self._shapes != [(self._sizes[0], 1)]:
            raise ValueError(f"{self._name}: outputs {self._shapes} are not its first input a sample later")
        if self._lanes:
            raise ValueError(f"{self._name} was built for samples side by side")
        (_, *arrays), n_samples = self._checked((start, *inputs))
        states = np.empty((n_samples + 1, self._sizes[0]))
        states[0] = start
        if n_samples:
            # In C, each sample reads the row that the one before it has written.
            loop = self._loop or functools.partial(_machine, self._accumulate(n_samples))
            loop([states[:-1], *arrays], [states[1:]], n_samples)
        return states

    def _checked(self, inputs: Sequence[Array]) -> tuple[list[Array], int]:
        if len(inputs) != len(self._sizes):
            raise InputError(f"{self._name}: {len(inputs)} inputs given, {len(self._sizes)} wanted")
        arrays = [np.ascontiguousarray(array, dtype=np.float64) for array in inputs]
        counts = {len(array) for array in arrays if array.ndim == 2}
        for name, size, array in zip(self._names, self._sizes, arrays, strict=True):
            if array.ndim not in (1, 2) or array.shape[-1] != size:
                raise InputError(
                    f"{self._name}: input '{name}' has shape {array.shape}; give (n_samples, {size}) or ({size},)"
                )
        if len(counts) != 1:
            raise InputError(f"{self._name}: inputs have {sorted(counts)} samples; give one number of samples in all")
        return arrays, counts.pop()


def _machine(function: ca.Function, arrays: list[Array], results: list[Array], n_samples: int) -> None:
    """CasADi's virtual machine on NumPy's own memory: a row is one sample and is one column of CasADi's."""
    pair: Any = function.buffer()  # CasADi declares another signature than it has
    buffer, evaluate = pair
    held = [np.ascontiguousarray(np.broadcast_to(array, (n_samples, array.shape[-1]))) for array in arrays]
    for i, array in enumerate(held):
        if array.size:
            buffer.set_arg(i, array.data)
    for i, result in enumerate(results):
        if result.size:
            buffer.set_res(i, result.data)
    evaluate()


def _compiled_loop(function: ca.Function, lanes: bool) -> _Loop | None:
    """The loop over samples in C, or None after a notice that says why not."""
    try:
        library = load_library(lanes_source(function), 3) if lanes else load_library(sequential_source(function))
    except (OSError, subprocess.SubprocessError) as problem:
        with _NOTICE:
            _notify(str(problem))
        return None
    entry = getattr(library, ENTRY)
    entry.restype = None

    def loop(arrays: list[Array], results: list[Array], n_samples: int) -> None:
        pointers = (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])
        steps = (ctypes.c_longlong * len(arrays))(*[array.shape[1] if array.ndim == 2 else 0 for array in arrays])
        targets = (ctypes.c_void_p * len(results))(*[result.ctypes.data for result in results])
        entry(pointers, steps, targets, ctypes.c_longlong(n_samples))

    return loop


@functools.cache
def _notify(reason: str) -> None:
    """Say once why C is not used."""
    warnings.warn(
        CompilerNotice(
            f"samples run in CasADi's virtual machine, tens of times slower: {reason}; "
            "install a C compiler or name one in SNARELAB_CC"
        ),
        stacklevel=5,
    )
