"""The rods of the bench against closed forms, and against our cables where both must agree."""

import numpy as np
import pytest

from bench import mujoco_rods
from snarelab.models.snare.model import SnareModel
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled
from snarelab.models.snare.target import Target

N_SEGMENTS, STEP = 20, 1e-3
FAR = Target("spring", position=(0.5, 0.0, 0.0))
"""Out of the cables' reach."""


def test_rods_rest_as_the_elastica_and_target_hangs_still() -> None:
    parameters = SnareParameters()
    points = settled(parameters, N_SEGMENTS)[:, :, 0]  # Euler's elastica, closed form up to 1e-6 m
    run = mujoco_rods.capture(parameters, FAR, points, 0.02, STEP)
    assert np.isnan(run.first_contact)
    assert np.allclose(run.position, FAR.position, atol=1e-6)
    # A chain of n straight segments stands off by about κ²Δs²/24 of its length: 0.14 mm with κ = 8/m, n = 20.
    assert np.linalg.norm(run.start - points, axis=2).max() < 2e-4


@pytest.mark.slow
def test_first_contact_is_that_of_our_cables() -> None:
    parameters, target = SnareParameters(), Target("spring")
    ours = SnareModel(parameters, target).run(2.7).first_contact
    rods = mujoco_rods.capture(parameters, target, settled(parameters, N_SEGMENTS)[:, :, 0], 2.7, STEP)
    assert rods.first_contact == pytest.approx(ours, abs=0.01)


def test_what_rods_cannot_do_is_refused() -> None:
    points = settled(SnareParameters(), N_SEGMENTS)[:, :, 0]
    with pytest.raises(ValueError, match="on a spring"):
        mujoco_rods.capture(SnareParameters(), Target("free"), points, 0.1, STEP)
