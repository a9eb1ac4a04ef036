"""Encoders in words and numbers: findings, noise, traces and notes from small cases with known answers."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from encoder_pairs import RATE, links, placed, run

from snarelab.identification.decision.nameless import NamelessParts
from snarelab.identification.decision.selection import Naming, RivalOdds
from snarelab.identification.diagnosis import Estimate
from snarelab.identification.links import findings
from snarelab.identification.links.diagnose import EncoderComparison
from snarelab.identification.sources import answer
from snarelab.identification.sources.source import Linearisation, ModelPoint

GAIN, DELAY = placed("sensor_gain", "q_link.joint1"), placed("sensor_delay", "q_link.joint1")
SPRING, BIAS = placed("joint_elasticity", "joint1"), placed("sensor_bias", "q_link.joint1")
THIRD = "hold either encoder of joint1 against a third measurement, such as a laser tracker's"
WAVE = np.sin(3 * np.arange(64) / RATE)


@pytest.fixture(autouse=True)
def _right(monkeypatch):
    """Names are right in four times of five; an estimate is its value."""
    monkeypatch.setattr(answer, "of_name", lambda *_: 0.8)
    monkeypatch.setattr(findings, "covariances", lambda _: None)
    monkeypatch.setattr(
        findings,
        "estimates",
        lambda source, given, here, _: {
            p.key: {
                x.name: Estimate(float(v), 0.0, "")
                for x, v in zip(p.effect.parameters, here.at.of_effect(p), strict=True)
            }
            for p in here.at.placed
        },
    )


def left(at, *sizes):
    return Linearisation(at, tuple(np.full((4, 1), x) for x in sizes), ())


def compared(one, names, values=None, shifts=None, missed=(), rejected=(), curves=(), within=1e-3):
    """A decision by which these names stand; each is missed from ``within`` to 4 mrad unless said otherwise."""
    at = ModelPoint.of([n.placed for n in names], values or {}, one.n_shifts)
    at = at if shifts is None else replace(at, shifts=np.array(shifts, float))
    told = {n.placed.key: SimpleNamespace(gain=g, sure=3.0, fit=SimpleNamespace(held=left(at, w))) for n, (g, w) in
            zip(names, missed or [(9.0, 4e-3)] * len(names), strict=True)}  # fmt: skip
    last = SimpleNamespace(train=left(at, within), held=left(at, within))
    best = SimpleNamespace(names=tuple(names), missed=told, last=last)
    found = SimpleNamespace(weighed=None, first=SimpleNamespace(train=left(at, 1.0)))
    decided: Any = SimpleNamespace(
        given=None,
        best=best,
        found=found,
        rejected=rejected,
        left=NamelessParts(tuple(curves), {}),
        before=left(at, 1.0),
        train=last.train,
        held=last.held,
    )
    return EncoderComparison(one, decided, (), ())


def name(p, share=0.75, rivals=()):
    return Naming(p, (0,), 30.0, share, tuple(rivals))


def test_lengths_are_told_in_thousandths_of_the_joints_unit():
    units = [findings.unit_of(links(run(WAVE, WAVE), kind=k), 0) for k in ("revolute", "prismatic")]
    assert [findings.length(0.0012345, u) for u in units] == ["1.23 mrad", "1.23 mm"]


def test_an_effect_shares_its_probability_with_those_it_cannot_be_told_from():
    """Shares of 0.75 and of 0.25 with a rival that is as likely as not: 0.8 times these; one apart has its own."""
    rivals = (RivalOdds(SPRING, 0.25, False), RivalOdds(GAIN, 0.01, True))
    values = {f"{DELAY.key}.delay": 0.003}
    (found,) = findings.findings_of(compared(links(run(WAVE, WAVE)), [name(DELAY, 0.75, rivals)], values))
    assert found.probability == pytest.approx(0.6)
    assert [(r.name, r.at, r.separable) for r in found.rivals] == [
        ("joint_elasticity", "joint1", False),
        ("sensor_gain", "q_link.joint1", True),
    ]
    assert [r.probability for r in found.rivals] == pytest.approx([0.2, 0.008])
    assert found.evidence == (
        "The channel lags the others by a constant time: it explains 94 % of the difference of motor and link "
        "encoder of joint1. Without it, the remaining difference on the held-out recording rises from 1 mrad to 4 mrad."
    )


def test_of_a_fault_that_either_encoder_may_have_each_has_half():
    (found,) = findings.findings_of(compared(links(run(WAVE, WAVE)), [name(GAIN, 1.0)], {f"{GAIN.key}.error": 0.1}))
    assert found.probability == pytest.approx(0.4)
    (rival,) = found.rivals
    assert (rival.name, rival.at, rival.separable, rival.experiment) == ("sensor_gain", "q.joint1", False, THIRD)
    assert rival.probability == pytest.approx(0.4)


def test_what_is_missed_most_goes_first_and_what_never_changes_last():
    values = {f"{BIAS.key}.offset": 1.0, f"{GAIN.key}.error": 0.1, f"{DELAY.key}.delay": 0.003}
    names = [name(BIAS), name(GAIN), name(DELAY)]
    missed = [(99.0, 1e-3), (5.0, 2e-3), (9.0, 2e-3)]
    one = links(run(WAVE, WAVE), run(WAVE, WAVE), n_train=1)
    found = findings.findings_of(compared(one, names, values, missed=missed))
    assert [f.name for f in found] == ["sensor_delay", "sensor_gain", "sensor_bias"]


def test_a_bias_is_told_with_what_it_leaves_and_as_far_as_the_zeros_agree():
    """Zeros of 19, 21 and, held out, 23 mm of which 20 are the bias's; what is left is 4 mm."""
    runs = [run(WAVE, np.full(64, x)) for x in (0.019, 0.021, 0.023)]
    one = links(*runs, kind="prismatic", n_train=2)
    shifts = np.array([-0.001, 0.001, 0.003]) / 0.021
    given = compared(one, [name(BIAS)], {f"{BIAS.key}.offset": 0.02}, shifts, [(9.0, 4e-3)], within=4e-3)
    (found,) = findings.findings_of(given)
    (estimate,) = found.parameters.values()
    assert (estimate.value, estimate.std) == (0.02, pytest.approx(4e-3 / np.sqrt(2)))
    assert found.evidence == (
        "The sensor reads a constant too much or too little: in every recording the link encoder's zero differs from "
        "the motor encoder's by 20 mm. Without it, the difference on the held-out recording is 23.3 mm, with it 5 mm. "
        "It explains no motion."
    )


def test_a_drives_twist_is_told_over_all_training_recordings():
    """6 and -3 N·m on 2000 N·m/rad: from -3 to 1.5 mrad."""
    one = links(*(run(WAVE, WAVE, load=x) for x in (6.0, -3.0, 90.0)), n_train=2)
    values = {f"{SPRING.key}.stiffness": 2000.0, f"{SPRING.key}.damping": 20.0}
    (found,) = findings.findings_of(compared(one, [name(SPRING)], values))
    assert found.evidence.endswith(" The drive twists over 4.5 mrad in all.")


def test_the_noise_floor_is_white_noise_of_the_longest_run_above_twice_the_band():
    """Deviation 1e-3 at 64 samples a second, 4 Hz of 32: 1e-3 √(4/32). What is slower, and single lines, are not
    noise; the smallest recording's counts."""
    rng = np.random.default_rng(0)
    n = 8192
    t = np.arange(n) / RATE
    quiet, loud = (s * rng.normal(size=n) + 5 + np.sin(2 * np.pi * 3 * t) + 0.1 * np.sin(2 * np.pi * 20 * t)
                   for s in (1e-3, 1e-2))  # fmt: skip
    loud[:1000] = 0.0
    parts = (slice(0, 1000), slice(1000, n))
    runs = [run(t, x, segments=s) for x, s in ((loud, parts), (quiet, None))]
    runs = [replace(r, motion=replace(r.motion, band=4.0)) for r in runs]
    for some, sigma in ((runs, 1e-3), (runs[:1], 1e-2)):
        assert findings.noise_floor(links(*some), 0) == pytest.approx(sigma * np.sqrt(4 / 32), rel=0.06)


def test_the_noise_floor_of_a_wide_band_is_that_above_four_tenths_of_the_rate():
    """Noise of deviation 1 at 64 samples a second, and a thousand times as much, up to 0.35 of the rate only."""
    n = 8192
    spectrum = np.fft.rfft(np.random.default_rng(1).normal(size=n))
    spectrum[np.fft.rfftfreq(n) < 0.35] *= 1000
    one = run(np.zeros(n), np.fft.irfft(spectrum, n))
    for band, wanted in ((32.0, 1.0), (16.0, np.sqrt(0.5))):
        other = replace(one, motion=replace(one.motion, band=band))
        assert findings.noise_floor(links(other), 0) == pytest.approx(wanted, rel=0.06)


def test_traces_show_the_difference_as_measured_as_given_and_after():
    runs = [
        run([0, 1, 2], [5, 6, 7], path="/d/a.csv", qd=[1, 1, 1]),
        run([5], [10], path="/d/c.csv", qd=[3]),
    ]
    one = links(*runs, n_train=1)
    at = ModelPoint.of((), {}, 2)

    def columns(*values):
        return Linearisation(at, (np.array(values, float)[:, None],), ())

    decided: Any = SimpleNamespace(
        found=SimpleNamespace(first=SimpleNamespace(train=columns(1, 2, 3))),
        before=columns(6),
        train=columns(0.1, 0.2, 0.3),
        held=columns(0.6),
    )
    a, c = findings.traces_of(EncoderComparison(one, decided, (), ()))
    assert (a.recording, a.role, a.channel, a.unit) == ("a.csv", "train", "q_link.joint1", "rad")
    assert (c.recording, c.role) == ("c.csv", "holdout")
    assert a.time.tolist() == [100.0, 100 + 1 / 64, 100 + 2 / 64]
    assert (a.position.tolist(), a.speed.tolist(), a.measured.tolist()) == ([0, 1, 2], [1, 1, 1], [5, 6, 7])
    assert (a.before.tolist(), c.before.tolist()) == ([4, 4, 4], [4])
    np.testing.assert_allclose(a.after, [4.9, 5.8, 6.7])


def test_notes_tell_every_zero_what_was_not_named_and_what_has_no_name():
    """Largest reading 4 mrad; a quarter of what is left is half its RMS."""
    one = links(*(run(WAVE, np.full(64, x)) for x in (1e-3, -2.5e-3, 4e-3)))
    curve = SimpleNamespace(channel=0, over="position", explained=0.25)
    given = compared(one, [], shifts=[0.25, -0.625, 1.0], rejected=(name(GAIN),), curves=(curve,), within=4e-3)
    given = replace(given, links=cast(Any, one))
    one.train, one.held = range(2), range(2, 3)
    notes = findings.notes_of(given)
    words = (
        "on q_link.joint1, a smooth curve over position still explains 25 % of the remaining difference between the "
        "encoders (2 mrad)"
    )
    assert notes == [
        "zero of q_link.joint1 against q.joint1, one recording after another: 1, -2.5, 4 mrad",
        "sensor_gain at q_link.joint1 passed on the training recordings, but the held-out ones are predicted no better "
        "with it: not named",
        f"without a name: {words}",
    ]
    assert findings.nameless(given) == words
