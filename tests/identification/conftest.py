"""The arm that tests of the assembly and of what stands beside it share."""

import pytest
from moving_arm import motion, three_joints

from snarelab.identification.fitting.experiment import Experiment


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return three_joints(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def experiment(arm):
    tree, body = arm
    return Experiment(motion([j.kind for j in tree.joints]), body)
