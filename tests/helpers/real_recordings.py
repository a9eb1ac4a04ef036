"""Where recordings of real machines are, which are never copied into the repository."""

import os
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared" / "recordings"


def real_recordings(name: str, file: str = "*") -> Path:
    """A machine's folder that holds such a file; without one the test is skipped, and says what is missing."""
    given = os.environ.get("SNARELAB_RECORDINGS")
    for place in (Path(given), SHARED) if given else (SHARED,):
        if any((place / name).glob(file)):
            return place / name
    pytest.skip(f"no {name}/{file}: set SNARELAB_RECORDINGS to the folder that holds it")


def shared(file: str) -> Path:
    """A file beside the folder of recordings; without it the test is skipped, and says what is missing."""
    given = os.environ.get("SNARELAB_RECORDINGS")
    for place in (Path(given).parent, SHARED.parent) if given else (SHARED.parent,):
        if (place / file).is_file():
            return place / file
    pytest.skip(f"no {file} beside the folder of recordings: it is not part of the repository")
