"""A CasADi function over many samples, at the speed of C.

CasADi writes the function as C; a loop over samples is appended, a C compiler makes a shared library of it, kept in the
user's cache, and one call through `ctypes` (which releases Python's lock) does all samples. Where there is no compiler
the same function runs in CasADi's virtual machine, with one `CompilerNotice`.
"""

import ctypes
import functools
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from ..errors import InputError
from .inertia import Array

_ENTRY = "snarelab_samples"
_DIGEST_BYTES = 32
# -O1: straight-line code gains next to nothing from more, and compiles in half the time.
# No -march=native: a home folder may be shared between machines.
_FLAGS = ("-O1", "-shared", "-fPIC", "-fvisibility=hidden", "-w")
_Loop = Callable[[list[Array], list[int], list[Array], int], None]


class CompilerNotice(UserWarning):
    """No C code could be built: the results are the same and come tens of times slower."""


class SampleFunction:
    """A CasADi function evaluated on many samples at once.

    Parameters
    ----------
    function : casadi.Function
        Of SX symbols (else ``function.expand()``); inputs are columns, outputs may be matrices.

    Notes
    -----
    The environment variable ``SNARELAB_CC`` names the compiler (``none``: use no compiler); else ``cc``, ``gcc`` or
    ``clang`` is taken. Libraries are kept in ``$XDG_CACHE_HOME/snarelab`` or ``~/.cache/snarelab``.
    """

    def __init__(self, function: ca.Function) -> None:
        """Build, or find in the cache."""
        inputs = function.sx_in()
        outputs = function.call(inputs, True, False)
        # CasADi stores columns, numpy rows: transposed and dense, a sample's output is written where it belongs.
        # The name is our own: the function's might be one of C's.
        self._function = ca.Function("sample", inputs, [ca.densify(output.T) for output in outputs])
        self._name = function.name()
        self._names = function.name_in()
        self._sizes = [function.size1_in(i) for i in range(function.n_in())]
        self._shapes = [function.size_out(i) for i in range(function.n_out())]
        self._loop = _compiled_loop(self._function) or self._machine_loop

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
        n_samples = counts.pop()
        results = [np.empty((n_samples, rows, columns)) for rows, columns in self._shapes]
        steps = [array.shape[1] if array.ndim == 2 else 0 for array in arrays]
        if n_samples:
            self._loop(arrays, steps, results, n_samples)
        return tuple(results)

    def _machine_loop(self, arrays: list[Array], steps: list[int], results: list[Array], n_samples: int) -> None:
        columns = [
            array.T if step else np.tile(array[:, None], n_samples) for array, step in zip(arrays, steps, strict=True)
        ]
        outputs = self._function.map(n_samples).call([ca.DM(column) for column in columns])
        for result, output in zip(results, outputs, strict=True):
            result[...] = np.asarray(output).reshape(-1, order="F").reshape(result.shape)


def _compiled_loop(function: ca.Function) -> _Loop | None:
    """The loop over samples in C, or None after a notice that says why not."""
    try:
        library = _load(_source(function))
    except (OSError, subprocess.SubprocessError) as problem:
        _notify(str(problem))
        return None
    entry = getattr(library, _ENTRY)
    entry.restype = None

    def loop(arrays: list[Array], steps: list[int], results: list[Array], n_samples: int) -> None:
        pointers = (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])
        targets = (ctypes.c_void_p * len(results))(*[result.ctypes.data for result in results])
        entry(pointers, (ctypes.c_longlong * len(steps))(*steps), targets, ctypes.c_longlong(n_samples))

    return loop


def _source(function: ca.Function) -> str:
    """C source of the function and its loop over samples."""
    generator = ca.CodeGenerator(f"{_ENTRY}.c", {"casadi_int": "long long int"})
    generator.add(function)
    sizes = ", ".join(str(function.numel_out(i)) for i in range(function.n_out()))
    # static: the compiler may inline it, and no other library's symbol of the same name can stand in for it
    return f"""#define CASADI_SYMBOL_EXPORT static
{generator.dump()}
__attribute__((visibility("default")))
void {_ENTRY}(const double *const *in, const long long *step, double *const *out, long long n_samples) {{
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


def _load(source: str) -> ctypes.CDLL:
    """The library of this source, from the cache or newly built there."""
    compiler, version = _compiler(os.environ.get("SNARELAB_CC", ""), os.environ.get("PATH", ""))
    identity = "\0".join([source, *compiler, version, platform.machine(), *_FLAGS])
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "snarelab"
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = cache / f"{hashlib.sha256(identity.encode()).hexdigest()}.so"
    if not _intact(path):
        with tempfile.TemporaryDirectory(dir=cache) as folder:
            built = Path(folder) / path.name
            command = [*compiler, *_FLAGS, "-x", "c", "-", "-o", str(built), "-lm"]
            run = subprocess.run(command, input=source, capture_output=True, text=True, check=False)
            if run.returncode:
                complaint = (run.stderr.strip().splitlines() or ["no message"])[0]
                raise OSError(f"{compiler[0]} failed with '{complaint}'")
            built.write_bytes(built.read_bytes() + hashlib.sha256(built.read_bytes()).digest())
            built.replace(path)
    return ctypes.CDLL(str(path))


def _intact(path: Path) -> bool:
    """Whether the library is there and ends in its own digest: a torn file may load and then crash."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return False
    return hashlib.sha256(content[:-_DIGEST_BYTES]).digest() == content[-_DIGEST_BYTES:]


@functools.cache
def _compiler(named: str, search_path: str) -> tuple[tuple[str, ...], str]:
    """Command and version of the C compiler; OSError where there is none."""
    if named == "none":
        raise OSError("SNARELAB_CC is 'none'")
    for candidate in [named] if named else ["cc", "gcc", "clang"]:
        program, *options = shlex.split(candidate)
        found = shutil.which(program, path=search_path)
        if found:
            run = subprocess.run([found, "--version"], capture_output=True, text=True, check=True)
            return (found, *options), run.stdout
    raise OSError(f"SNARELAB_CC is '{named}', which is not found" if named else "no cc, gcc or clang on PATH")


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
