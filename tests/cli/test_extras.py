"""The core alone: what is missing is told in one line with the command that brings it, when it is needed."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from documentation import EXTRAS, IMPORTED_AS

from snarelab.extras import EXTRA_OF, LIBRARIES

ROOT = Path(__file__).resolve().parents[2]
BUNDLED = ROOT / "studies" / "bundled"

CORE = f"""
import sys
from importlib.machinery import PathFinder

class WithoutExtras(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in {set(EXTRA_OF)!r} else super().find_spec(name, path, target)

sys.meta_path = [WithoutExtras if finder is PathFinder else finder for finder in sys.meta_path]
"""
"""A Python in which no package of an extra is installed."""


def in_core(code):
    return subprocess.run([sys.executable, "-c", CORE + code], capture_output=True, text=True)


def test_the_core_identifies_an_arm_from_files_and_from_tables():
    code = f"""
import pandas as pd, snarelab
table = pd.read_csv({str(BUNDLED / "train.csv")!r})
found = snarelab.identify({str(BUNDLED / "arm3.toml")!r}, table, holdout={str(BUNDLED / "holdout.csv")!r})
print(found.parameters[0].value)
import snarelab.identification.diagnose, snarelab.identification.report.page, snarelab.studies.emps
"""
    ran = in_core(code)
    assert ran.returncode == 0, ran.stderr
    assert float(ran.stdout) == pytest.approx(17.6, abs=0.2)  # as docs/own-robot.md says


def commands(folder):
    """What asks for each extra."""
    model, motion = str(BUNDLED / "arm3.toml"), str(BUNDLED / "train.csv")
    capture = folder / "snare.toml"
    capture.write_text('system = "snare_capture"\n')
    for name in ("a.mcap", "a.h5", "a.parquet", "a.fmu"):
        (folder / name).write_bytes(b"anything")
    return {
        "rosbags": ("formats", ["identify", model, str(folder / "a.mcap")]),
        "h5py": ("formats", ["identify", model, str(folder / "a.h5")]),
        "pyarrow": ("formats", ["identify", model, str(folder / "a.parquet")]),
        "written": ("formats", ["simulate", model, "--motion", motion, "--out", str(folder / "b.parquet")]),
        "snare": ("snare", ["simulate", str(capture), "--out", str(folder / "b.csv")]),
        "tolerance": ("cluster", ["tolerance", str(ROOT / "tolerance" / "ground.toml"), "--out", str(folder / "r")]),
    }


def test_what_is_missing_is_one_line_with_the_command(tmp_path):
    asked = commands(tmp_path)
    calls = "\n".join(f"print({key!r}, main({arguments!r}))" for key, (_, arguments) in asked.items())
    ran = in_core(f"from snarelab.cli import main\n{calls}")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines() == [f"{key} 2" for key in asked]
    lines = ran.stderr.splitlines()
    assert len(lines) == len(asked), ran.stderr
    for line, (extra, _) in zip(lines, asked.values(), strict=True):
        assert line.endswith(f"which is not installed; run pip install 'snarelab[{extra}]'"), line
    assert not list(tmp_path.glob("b.*"))


def test_a_library_that_the_system_lacks_is_one_line_with_the_command():
    """Drake's wheel asks for some; what it prints of its own when one is missing is kept away."""
    code = f"""
import importlib.util, sys
from importlib.machinery import PathFinder, SourceFileLoader

class Bare(SourceFileLoader):
    def exec_module(self, module):
        print("a page of advice")
        raise ImportError("libglib-2.0.so.0: cannot open shared object file: No such file or directory")

class WithoutLibrary(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        found = super().find_spec(name, path, target)
        if name == "pydrake":
            found = importlib.util.spec_from_file_location(name, found.origin, loader=Bare(name, found.origin))
        return found

sys.meta_path = [WithoutLibrary if finder is PathFinder else finder for finder in sys.meta_path]
from snarelab.cli import main
print(main(["identify", {str(BUNDLED / "arm3.toml")!r}, {str(BUNDLED / "train.csv")!r}]))
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.stdout == "2\n", ran.stderr
    (line,) = ran.stderr.splitlines()
    assert "needs the library libglib-2.0.so.0 of the system" in line
    assert line.endswith(f"run apt-get install {LIBRARIES}")


@pytest.mark.parametrize("file", ["README.md", "Containerfile", "docs/own-robot.md"])
def test_the_systems_libraries_are_named_where_one_installs(file):
    assert LIBRARIES in (ROOT / file).read_text(encoding="utf-8")


def test_the_map_of_extras_is_what_the_project_asks_for():
    given = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    more = given["optional-dependencies"]
    core = {line.partition(">")[0] for line in given["dependencies"]}
    for extra in EXTRAS:
        names = {IMPORTED_AS.get(name, name) for name in (line.partition(">")[0] for line in more[extra])}
        assert not names & core
        assert {module for module, of in EXTRA_OF.items() if of == extra} - {"llvmlite"} <= names
        assert names <= set(EXTRA_OF), "snarelab.extras does not know what brings it"
    assert more["all"] == [f"snarelab[{','.join(EXTRAS)}]"]


@pytest.mark.parametrize("file", ["Containerfile", "Makefile"])
def test_extras_that_are_asked_for_by_name_exist(file):
    text = (ROOT / file).read_text(encoding="utf-8")
    assert "constraints.txt" in text
    assert 'EXTRAS=""' in text or 'e["all"]' in text
