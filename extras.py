"""What is not installed with the core: which extra brings it, said in one line at the moment it is needed."""

from collections.abc import Iterator
from contextlib import contextmanager

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
