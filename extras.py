"""What is not installed with the core: which extra brings it, said in one line at the moment it is needed."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

from .errors import InputError

EXTRA_OF = {
    "exudyn": "snare",
    "numba": "snare",
    "llvmlite": "snare",
    "fmpy": "fmu",
    "dask": "cluster",
    "distributed": "cluster",
    "sklearn": "cluster",
    "threadpoolctl": "cluster",
    "pyarrow": "formats",
    "h5py": "formats",
    "rosbags": "formats",
}
"""The extra that brings each package that the core does without, by the name under which it is imported."""

LIBRARIES = "libglib2.0-0 libsm6 libx11-6"
"""Debian's packages that Drake's wheel asks of the system, which a bare container has not."""


def command(extra: str) -> str:
    """What installs an extra."""
    return f"pip install 'snarelab[{extra}]'"


def refusal(error: ModuleNotFoundError, purpose: str = "this") -> InputError | None:
    """The one line for a package that is missing; None where no extra would bring it: that is a fault."""
    module = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(module)
    if extra is None:
        return None
    return InputError(f"{purpose} needs the package {module!r}, which is not installed; run {command(extra)}")


@contextmanager
def needed_for(purpose: str) -> Iterator[None]:
    """Around the import of a package that an extra brings; where it is missing, InputError names the command.

    Parameters
    ----------
    purpose : str
        What needs it, as the subject of a sentence: "a Parquet file".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        said = refusal(error, purpose)
        if said is None:
            raise
        raise said from error


def demand_drake() -> None:
    """Load Drake; where the system lacks a library that its wheel asks for, InputError has the command for it."""
    try:
        with redirect_stdout(io.StringIO()):  # on which Drake prints a page of advice
            import pydrake.common  # noqa: F401
    except ImportError as error:
        library = re.match(r"(\S+): cannot open shared object file", error.msg)
        if library is None:
            raise
        raise InputError(
            f"a robot is read by Drake, which needs the library {library[1]} of the system; on Debian and Ubuntu run "
            f"apt-get install {LIBRARIES}"
        ) from error
