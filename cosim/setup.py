"""Reading a system file, of either kind.

Each reader makes an `experiment.Setup` of a file, and starts its participants through a `hosting.Hosting`; neither of
those knows of files.
"""

from pathlib import Path

from ..errors import InputError
from .experiment import Setup
from .hosting import Hosting
from .ssp import read_ssp
from .toml_system import read_toml

__all__ = ["Hosting", "Setup", "load_setup"]

_READERS = {".ssp": read_ssp, ".toml": read_toml}


def load_setup(path: str | Path, hosting: Hosting | None = None) -> Setup:
    """Read a system file, ``.ssp`` or ``.toml``; raises InputError for another kind, and for a mistake in it."""
    path = Path(path)
    if path.suffix.lower() not in _READERS:
        raise InputError(f"{path}: a system file is .ssp or .toml, not {path.suffix!r}; give one of these")
    if not path.is_file():
        raise InputError(f"{path}: is not there; give the path of a system file")
    return _READERS[path.suffix.lower()](path, hosting or Hosting())
