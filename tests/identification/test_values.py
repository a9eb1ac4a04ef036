"""How well values are known: the truth lies within two deviations, where noise remembers and the joint sticks."""

import numpy as np
import pytest
from pendulum import diagnosed

TRUE = {"viscous_friction.joint1.coefficient": 2.0, "coulomb_friction.joint1.level": 3.0}


@pytest.mark.slow
def test_the_truth_lies_within_two_deviations_under_a_torque_that_wanders(tmp_path):
    """Least squares takes its samples for independent beyond half a second, and was five of its deviations off."""
    off = []
    for seed in range(300, 308):
        folder = tmp_path / str(seed)
        folder.mkdir()
        moved = diagnosed(folder, seed, stops=True, wander=0.4).moved
        off += [(x.after - TRUE[x.name]) / x.std for x in moved]
    assert len(off) == 16
    assert np.mean(np.abs(off) < 2) >= 0.9
    assert np.max(np.abs(off)) < 3
    assert np.sqrt(np.mean(np.square(off))) > 0.5  # nor is it far too wide
