"""The wheel as a stranger runs it: what it holds; uvx and pipx with files of one's own, away from the repository."""

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from bench.first_hour import build, own_files
from snarelab import __version__

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build(tmp_path_factory.mktemp("wheel") / "wheel")


def program(name):
    """Where it is: beside this Python, or on PATH; else the test is skipped."""
    found = shutil.which(name, path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    return found or pytest.skip(f"{name} is not installed: pip install '.[dev]'")


def test_the_wheel_holds_the_package_and_nothing_beside_it(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    packages = {name.split("/")[0] for name in names}
    assert packages == {"snarelab", f"snarelab-{__version__}.dist-info"}
    folders = {name.split("/")[1] for name in names if name.count("/") > 1}
    assert not folders & {"tests", "docs", "bench", "proof", "build"}
    wanted = ("py.typed", "identification/reliability.json", "studies/bundled/train.csv", "cli.py")
    assert {f"snarelab/{name}" for name in wanted} <= {*names}
    assert "snarelab/setup.py" not in names


@pytest.mark.parametrize("words", [("uvx", "--python", sys.executable, "--from"), ("pipx", "run", "--spec")])
def test_it_runs_without_being_installed(words, wheel, tmp_path):
    own = tmp_path / "own"
    own_files(own, wheel)
    kept = {k: v for k, v in os.environ.items() if not re.match(r"PYTHON|VIRTUAL_ENV|SNARELAB", k)}
    command = [program(words[0]), *words[1:], str(wheel), "snarelab", "identify", "my-arm.toml", "first.csv"]
    ran = subprocess.run([*command, "--json", "found.json"], cwd=own, env=kept, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr[-2000:]
    first = json.loads((own / "found.json").read_text(encoding="utf-8"))["parameters"][0]
    assert (first["effect"], first["at"]) == ("viscous_friction", "joint1")
    assert first["value"] == pytest.approx(17.6, abs=0.2)  # as docs/own-robot.md says
