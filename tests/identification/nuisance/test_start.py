"""The start of a hidden state: the free response of a law, alone in its run, against closed forms."""

import numpy as np
from moving_arm import PERIOD, build, motion, placed

from snarelab.identification.fitting.effect_places import TorqueState
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.nuisance.start import free_responses, springs_back
from snarelab.models.effects import effects, get_effect
from snarelab.models.hidden_state import evaluate_law
from snarelab.models.model import PlacedEffect

RUNS = (slice(0, 500), slice(500, 1200))
STIFFNESS, DAMPING = 900.0, 30.0


def test_a_panel_that_starts_bent_rings_as_an_oscillator():
    frequency, damping, inertia, bent, dt = 0.35, 0.02, 12.0, 0.01, 0.02
    parameters, n = np.array([inertia, 0.0, 0.0, frequency, damping]), 3000
    still = {"spin_rate": np.zeros((n, 3))}
    start = np.array([bent, 0.0, 0.0, 0.0, 0.0, 0.0])
    panel = get_effect("flexible_appendage")
    moment = evaluate_law(panel, still, parameters, dt, bare=True, start=start).values[:, 3]
    t, w = dt * np.arange(n), 2 * np.pi * frequency
    own = w * np.sqrt(1 - damping**2)
    envelope = np.exp(-damping * w * t)
    shift = bent * envelope * (np.cos(own * t) + damping * w / own * np.sin(own * t))
    speed = -bent * envelope * w**2 / own * np.sin(own * t)
    wanted = inertia * (2 * damping * w * speed + w**2 * shift)
    np.testing.assert_allclose(moment, wanted, atol=2e-3 * np.abs(wanted).max())
    assert not evaluate_law(panel, still, parameters, dt, bare=True).values.any()


def test_columns_are_free_responses_in_their_run_alone(arm):
    """A drive's spring far stiffer than the motion: each run begins with a ring of its own frequency, which decays."""
    experiment = Experiment(motion([j.kind for j in arm[0].joints], segments=RUNS), arm[1])
    elasticity = placed(("joint_elasticity", "joint2"))[0]
    assembly = build(arm, experiment, [])
    state = assembly.evaluate(experiment, np.zeros(0))
    names = [p.name for p in elasticity.effect.parameters]
    parameters = np.array([{"stiffness": STIFFNESS, "damping": DAMPING}[n] for n in names])
    found = dict(free_responses(assembly, experiment, state, elasticity, parameters))
    assert set(found) == set(arm[0].coupled(1))
    columns = found[1]
    assert columns.shape[1] == 2 * len(RUNS)
    runs = experiment.motion.band_segments()
    for k, x in enumerate(columns.T):
        own = np.zeros(len(x), bool)
        own[runs[k // 2]] = True
        assert not x[~own].any()
        assert np.abs(x[own][-20:]).max() < 0.1 * np.abs(x[own]).max()
    # Where the law starts off rest, its torque is what it is at rest and these columns.
    place = assembly.at(elasticity)
    signals = place.signals(TorqueState(experiment, state.load, state.tau))
    inputs = {name: x[RUNS[0]] for name, x in signals.items()}
    first = [evaluate_law(elasticity.effect, inputs, parameters, PERIOD, bare=True, start=s).values for s in
             (None, np.array([1e-3, 0.0]), np.array([1e-3, 2e-2]))]  # fmt: skip
    np.testing.assert_allclose(first[2] - first[1], 2.0 * _free(elasticity, inputs, parameters, 1e-2), atol=1e-9)


def _free(p, inputs, parameters, rate):
    both = [evaluate_law(p.effect, inputs, parameters, PERIOD, bare=True, start=s).values for s in
            (None, np.array([0.0, rate]))]  # fmt: skip
    return both[1] - both[0]


def test_what_stays_where_it_is_has_no_free_response():
    """Heat, a bristle that stays bent and a delay have no rest that they go back to."""
    back = {e.name for e in effects().values() if springs_back(PlacedEffect(e, "joint1"))}
    assert {"joint_elasticity", "flexible_appendage", "suspension_sway"} <= back
    assert not back & {"heating_friction", "presliding_hysteresis", "sensor_delay", "coulomb_friction"}
