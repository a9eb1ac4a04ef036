"""FMUs that mean harm, in ``snarelab cosim``: one line, soon, within bounds, and the others' rows are kept."""

import sys

import pytest

from bench.hostile_fmus import NAMES, run, write_folder

SOME = ("segmentation fault", "closes them and hangs", "forks and crashes", "2000 arrays of 100000")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("hostile")
    write_folder(place)
    return place


@pytest.fixture(scope="module")
def usual(folder):
    """Seconds that a run of sound FMUs takes here and now."""
    found = run(folder, "sound", 60.0)
    assert not found.problems(allowance=60.0)
    return found.seconds


def test_there_are_thirty():
    assert len(NAMES) >= 30


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in SOME else pytest.mark.slow) for n in NAMES])
def test_it_ends_in_one_line_and_leaves_nothing(folder, usual, name):
    found = run(folder, name, 3 * usual)
    assert not found.problems(allowance=3 * usual), found
