"""Where the real recordings are, and robots that another engine drives."""

import os
import signal
import sys
import warnings
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from snarelab.errors import InputError
from snarelab.models import compiled
from snarelab.models.c_library import find_compiler

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))  # bench/ holds the independent plant; it is not part of the package
sys.path.append(str(ROOT / "tests" / "helpers"))  # what several files of tests share
sys.path.append(str(ROOT / "tests"))  # for fuzz/

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell starts what runs in the background deaf to Ctrl-C, and so would be what the tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


try:
    find_compiler(os.environ.get("SNARELAB_CC", ""), os.environ.get("PATH", ""))
    NO_COMPILER = ""
except OSError as problem:
    NO_COMPILER = str(problem)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--part", type=int, default=1, metavar="N", help="one file in N, each commit others")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Of the files whose tests are asked for, one in N: all of them over N commits or so, whole files each time."""
    from this_commit import number  # found by the paths above

    parts: int = config.option.part
    if parts < 1:
        raise pytest.UsageError(f"--part {parts}: give 1 for all files, or more")
    files = sorted({item.path for item in items})
    mine = set(files[number() % parts :: parts])
    left_out = [item for item in items if item.path not in mine]
    if left_out:
        items[:] = [item for item in items if item.path in mine]
        config.hook.pytest_deselected(items=left_out)


def _skipped_without_compiler() -> Generator[None, Any, Any]:
    """Where this machine has no C compiler, a test that asks for one is skipped, and says so."""
    try:
        return (yield)
    except (InputError, OSError, Warning) as error:
        if NO_COMPILER and ("C compiler" in str(error) or NO_COMPILER in str(error)):
            pytest.skip(f"no C compiler: {error}")
        raise


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, Any, Any]:
    """Fixtures that build something."""
    return (yield from _skipped_without_compiler())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """Tests that build something."""
    return (yield from _skipped_without_compiler())


@pytest.fixture(autouse=True)
def _told_of_no_compiler() -> None:
    """Where there is none, a process says so once: before any test, so that none depends on which comes first."""
    if NO_COMPILER:
        with warnings.catch_warnings(action="ignore"):
            compiled._notify(NO_COMPILER)


@pytest.fixture
def compiler() -> None:
    """For tests of what only a compiled program does, or says nothing more of."""
    if NO_COMPILER:
        pytest.skip(NO_COMPILER)


@pytest.fixture(scope="session")
def emps() -> Path:
    """Folder of the EMPS recordings."""
    from real_recordings import real_recordings  # found by the paths above

    return real_recordings("emps", "DATA_EMPS.mat")


@pytest.fixture(scope="session")
def of_this_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all workers of a run share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="module")
def own_cache(of_this_run):
    """A cache of compiled models that this run fills: what it compiles is compiled once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(of_this_run / "compiled"))
        yield


@pytest.fixture(scope="module")
def each_diagnosis_once(of_this_run):
    """What `once.remembered` says, over all workers of a run."""
    from once import remembered  # found by the paths above

    with remembered(of_this_run):
        yield


@pytest.fixture(scope="module")
def halves(tmp_path_factory) -> Path:
    """A folder with the two halves of an oscillator as FMUs of FMI 2.0, in plain C."""
    from bench.oscillator_fmu import build

    place = tmp_path_factory.mktemp("system")
    for side in ("left", "right"):
        build(place, side, 2)
    return place


@pytest.fixture
def arm_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with an arm's model and recordings as a user has them."""
    from arm_commands import write_arm_folder  # found by the paths above

    write_arm_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def browser():
    """A headless browser of one file of tests."""
    from browser import started  # found by the paths above

    with started() as running:
        yield running
