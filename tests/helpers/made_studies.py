"""What a study leaves, made once: by `make study-NAME` where that is newer than every source, else by the test."""

import json
from pathlib import Path
from subprocess import run
from types import ModuleType
from typing import Any

import pytest

from snarelab.studies.outcome import FOLDER

ROOT = Path(__file__).resolve().parents[2]


def made_study(name: str, study: ModuleType, recordings: Path, tmp_path: Path, patch: pytest.MonkeyPatch) -> Path:
    """The folder with a study's page and numbers, of today's sources."""
    left = ROOT / FOLDER / name
    if _newer_than_sources(left / "report.html"):
        return left
    patch.setenv("SNARELAB_RECORDINGS", str(recordings.resolve()))
    patch.chdir(tmp_path)
    assert study.main() == 0
    return tmp_path / FOLDER / name


def result_left(name: str) -> dict[str, Any] | None:
    """A study's result, of today's sources; None where it was not made."""
    left = ROOT / FOLDER / name
    return json.loads((left / "result.json").read_text()) if _newer_than_sources(left / "report.html") else None


def numbers_left(name: str) -> dict[str, Any] | None:
    """A study's quantities by name, of today's sources; None where it was not made."""
    result = result_left(name)
    return None if result is None else {q["name"]: q["ours"] for q in result["quantities"]}


def _newer_than_sources(page: Path) -> bool:
    """As `make` decides it: the page, which a study writes last, beside every source file of the package."""
    if not page.is_file():
        return False
    listed = run(["git", "ls-files", "*.py", "*.toml", "*.urdf"], cwd=ROOT, capture_output=True, text=True, check=True)
    sources = [ROOT / x for x in listed.stdout.split() if not x.startswith(("tests/", "bench/", "proof/"))]
    return all(x.stat().st_mtime < page.stat().st_mtime for x in sources if x.is_file())
