"""A KR 300's motor and link encoders (Weigand et al. 2021): one is late, and the springs explain little.

The bars are those of an independent least-squares check, fitted on runs A and B, in mdeg RMS on run C.
"""

from pathlib import Path

import numpy as np
import pytest
from real_recordings import real_recordings

import snarelab.studies
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import fit
from snarelab.identification.links.diagnose import diagnose_links
from snarelab.identification.links.run import load_links
from snarelab.identification.links.source import links_of
from snarelab.identification.search.refit import assemble
from snarelab.identification.sources.answer import rms
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody
from snarelab.studies.kuka import CHECK, STIFFNESS, spring_alone, springs_of_measured_torque
from snarelab.studies.kuka_figures import MDEG, pattern

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs():
    folder = real_recordings("kuka_kr300", "run_A.mat")
    return [folder / f"run_{run}.mat" for run in "ABC"]


@pytest.fixture(scope="module")
def found(runs):
    """The encoders' diagnosis, on a fit of the torques without their own search."""
    model = load_model(Path(snarelab.studies.__file__).parent / "kuka" / "kr300.toml")
    body = RigidBody(model.tree)
    train = load_experiments(model, runs[:2], body)
    band, sizes = train[0].motion.band, scales(train)
    fitted = fit(assemble(model, base_parameters(body), sizes), train)
    one = diagnose_links(model, runs[:2], runs[2], body, fitted.assembly, fitted.theta, sizes, band)
    assert one is not None
    own, there = (load_links(model, paths, body, band)[1] for paths in (runs[:2], runs[2:]))
    every = [links_of([j], model, own, there, fitted.assembly, fitted.theta, sizes) for j in one.links.joints]
    return one, every, train, load_experiments(model, runs[2:], body, band)


def test_three_axes_have_two_encoders(found):
    assert found[0].links.joints == ("axis1", "axis2", "axis3")


@pytest.mark.parametrize("number", range(3))
def test_time_skew_leads_and_the_bar_is_met(found, number):
    one, key = found[0], f"sensor_delay.q_link.axis{number + 1}"
    before, after = (float(MDEG * rms(x)[number]) for x in (one.decided.before, one.decided.held))
    assert before == pytest.approx(CHECK["nothing"][number], rel=0.01)
    assert after <= 3.5
    own = [n for n in one.decided.best.names if n.channels == (number,)]
    assert own[0].placed.key == key
    assert MDEG * rms(one.decided.best.missed[key].fit.held)[number] > 4 * after
    assert one.decided.train.at.all_values[f"{key}.delay"] == pytest.approx(0.003, rel=0.05)


@pytest.mark.parametrize("number", range(3))
def test_elasticity_is_little(found, number):
    """Of the makers' order of size where it is named, and a small share of what the encoders differ by."""
    best, axis = found[0].decided.best, f"joint_elasticity.axis{number + 1}"
    if axis in best.missed:
        stiffness = best.last.train.at.all_values[f"{axis}.stiffness"]
        assert 0.7 < stiffness / STIFFNESS[number] < 2.5
        without, within = (rms(x)[number] for x in (best.missed[axis].fit.held, best.last.held))
        assert without**2 - within**2 < 0.02 * rms(found[0].decided.before)[number] ** 2


def test_a_spring_alone_only_seems_to_explain(found):
    """Of the measured torque it takes a third, as the check found: the torque's friction follows the velocity. Of the
    modelled load, which has no friction in it, it takes next to nothing."""
    _, every, train, locked = found
    felt = springs_of_measured_torque(every, train, locked)
    assert felt == pytest.approx(CHECK["spring"], rel=0.05)
    for number, links in enumerate(every):
        assert spring_alone(links) > 0.9 * CHECK["nothing"][number]


def test_pattern_is_found_where_it_was_put():
    rng = np.random.default_rng(0)
    angle = np.cumsum(rng.uniform(0, 2e-4, 5000))
    rest = 2e-5 * np.cos(828 * angle + 0.4) + 1e-5 * rng.standard_normal(5000)
    cycles, amplitude = pattern([(angle, angle, rest)])
    assert cycles == 828
    assert abs(amplitude) == pytest.approx(2e-5, rel=0.05)
    assert np.angle(amplitude) == pytest.approx(0.4, abs=0.1)
