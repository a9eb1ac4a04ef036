"""The inspection capture in Ecos from one SSP file: the first 0.3 s of `bench/ecos_inspection.py`."""

import importlib.util

import pytest

from bench.ecos_inspection import apart, in_ecos, write_system
from snarelab.cosim.orbit_capture import JointResistance, capture_of, co_simulate
from snarelab.studies.orbit.setting import setting


@pytest.mark.slow
def test_both_fmus_in_ecos_move_as_the_study_does(tmp_path):
    """Held inputs and one exchange a step, yet the pin is where the study's own master has it.

    Fixed steps in the arm, for the compiler's sake; joints' friction is too sharp for those of 1 ms.
    """
    for needed in ("ecospy", "exudyn"):
        if importlib.util.find_spec(needed) is None:
            pytest.skip(f"{needed} is not installed")
    ssp = write_system(tmp_path, 3, stiff=False, values={"arm.solver.step": 1e-4})
    try:
        table = in_ecos(ssp, 1e-3, 300, 10)
    except RuntimeError as fault:
        if "libtbb" in str(fault):
            pytest.skip("ecospy finds no oneTBB: pip install tbb")
        raise
    place, force = apart(
        table, capture_of(co_simulate(setting("inspection"), JointResistance(), duration=0.3), "inspection")
    )
    assert place < 1e-11  # the tip moves by 17 nm
    assert force < 1e-3
