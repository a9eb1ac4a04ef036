"""Where the real recordings are, and robots that another engine drives."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))  # bench/ holds the independent plant; it is not part of the package
sys.path.append(str(ROOT / "tests"))  # what several files of tests share


@pytest.fixture(scope="session")
def emps() -> Path:
    """Folder of the EMPS recordings, which are never copied into the repository."""
    given = os.environ.get("SNARELAB_RECORDINGS")
    for folder in ([Path(given)] if given else []) + [ROOT.parent / "shared" / "recordings"]:
        if (folder / "emps" / "DATA_EMPS.mat").is_file():
            return folder / "emps"
    pytest.skip("EMPS recordings not found: set SNARELAB_RECORDINGS to the folder that holds emps/DATA_EMPS.mat")
