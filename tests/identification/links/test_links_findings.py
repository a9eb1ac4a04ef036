"""One joint's encoders in words and numbers: findings, limits, noise and notes from small cases with known answers."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from encoder_pairs import RATE, link, named, pair, placed, run

from snarelab.identification.links import findings
from snarelab.identification.links.diagnose import Offset, Proof
from snarelab.identification.links.pair import PairFit
from snarelab.identification.links.search import Trial
from snarelab.identification.search.noise import Whitener
from snarelab.models.effects import get_effect

GAIN, DRIFT = placed("sensor_gain", "q_link.joint1"), placed("sensor_drift", "q_link.joint1")
SPRING, DELAY = placed("joint_elasticity", "joint1"), placed("sensor_delay", "q_link.joint1")
MOTOR_DELAY = placed("sensor_delay", "q.joint1")
THIRD = "hold either encoder of joint1 against a third measurement, such as a laser tracker's"


@pytest.fixture
def eighty(monkeypatch):
    """Names are right four times in five as often as they win the bootstrap."""
    monkeypatch.setattr(findings, "reliability", lambda margin: 0.8 * margin)


def fit(*effects, theta: Any = (), residual=(1.0,)):
    return PairFit(effects, np.array(theta, float), np.array(residual, float), np.zeros((len(residual), len(theta))))


def proof(effect, explained=0.5, margin=0.9, rivals=(), without=4e-3, within=1e-3):
    return Proof(named(effect, explained, margin, rivals), without, within)


def test_lengths_are_told_in_thousandths_of_the_joints_unit():
    assert findings.length(0.0012345, findings.unit_of(pair())) == "1.23 mrad"
    assert findings.length(-4.0, findings.unit_of(pair(kind="prismatic"))) == "-4e+03 mm"


def test_an_estimate_says_where_it_ended_at_a_bound(monkeypatch):
    """Bounds of the spring are 32 and 1.6e6, of the damper 0 and 1.6e5; within a millionth of it is at the bound."""
    monkeypatch.setattr(findings, "deviations", lambda *_: np.array([3.0, np.inf, 0.5, 1.0]))
    for theta, bounds in (
        ((32 * (1 + 9e-7), 1e-9), (True, False)),
        ((32 * (1 + 2e-6), 0.0), (False, True)),
        ((1.6e6 * (1 - 9e-7), 1.6e5 * (1 - 2e-6)), (True, False)),
        ((1.6e6 * (1 - 2e-6), 1.6e5), (False, True)),
    ):
        last = fit(SPRING, DELAY, theta=(*theta, 0.01, 0.0))
        made = findings._estimates(link(steps=(last,)), SPRING)
        assert [(e.value, e.at_bound) for e in made.values()] == list(zip(theta, bounds, strict=True))
    assert list(made) == ["stiffness", "damping"]
    assert [(e.std, e.unit) for e in made.values()] == [(3.0, "N*m/rad"), (np.inf, "N*m*s/rad")]
    (late,) = findings._estimates(link(steps=(last,)), DELAY).values()
    assert (late.value, late.std, late.unit, late.at_bound) == (0.01, 0.5, "s", False)


def test_what_was_named_first_at_each_joint_goes_first_and_a_zeros_offset_last(monkeypatch):
    """Explained: 0.3 then 0.9 at joint1, 0.6 then 0.2 at joint2, 0.5 at joint3."""
    monkeypatch.setattr(findings, "_finding", lambda one, p: (one.pair.joint, p.named.trial.explained))
    monkeypatch.setattr(findings, "_offset", lambda one: [f"offset of {one.pair.joint}"])
    rows = (("joint1", (0.3, 0.9)), ("joint2", (0.6, 0.2)), ("joint3", (0.5,)))
    links = [link(joint=j, proofs=tuple(proof(DELAY, x) for x in shares)) for j, shares in rows]
    assert list(findings.findings_of(links)) == [
        ("joint2", 0.6),
        ("joint3", 0.5),
        ("joint1", 0.3),
        ("joint1", 0.9),
        ("joint2", 0.2),
        *(f"offset of joint{k}" for k in (1, 2, 3)),
    ]


def test_an_effect_shares_its_probability_with_its_rivals(eighty, monkeypatch):
    """It won 0.75 of all draws: right in 0.6. A rival's 0.1 is 0.06; of those below 0.005 only what is alike stays."""
    monkeypatch.setattr(findings, "_estimates", lambda *_: {})
    rivals = ((SPRING, 0.1, True), (GAIN, 0.005, True), (DRIFT, 0.004, True), (MOTOR_DELAY, 0.004, False))
    one = link(proofs=(proof(DELAY, 0.625, 0.75, rivals),))
    (found,) = findings.findings_of([one])
    assert (found.name, found.at, found.margin) == ("sensor_delay", "q_link.joint1", 0.75)
    assert found.probability == pytest.approx(0.75 * 0.6)
    assert [(r.name, r.at, r.separable) for r in found.rivals] == [
        ("joint_elasticity", "joint1", True),
        ("sensor_gain", "q_link.joint1", True),
        ("sensor_delay", "q.joint1", False),
    ]
    assert [r.probability for r in found.rivals] == pytest.approx([0.06, 0.003, 0.0024])
    assert found.evidence == (
        "The channel lags the others by a constant time: it explains 62 % of what motor and link encoder of joint1 so "
        "far differed by; taking it out again raises the difference left on the held-out recording from 1 mrad to "
        "4 mrad."
    )


def test_of_a_fault_that_either_encoder_may_have_each_has_half(eighty, monkeypatch):
    monkeypatch.setattr(findings, "_estimates", lambda *_: {})
    (found,) = findings.findings_of([link(proofs=(proof(GAIN, 0.5, 1.0),))])
    assert (found.margin, found.probability) == (0.5, pytest.approx(0.4))
    ((name, at, probability, separable, experiment),) = [tuple(vars(r).values()) for r in found.rivals]
    assert (name, at, separable, experiment) == ("sensor_gain", "q.joint1", False, THIRD)
    assert probability == pytest.approx(0.4)


def test_a_zeros_offset_is_told_with_what_it_leaves(eighty):
    one = link(offset=Offset(0.02, 0.001, 0.0205, 0.003), kind="prismatic")
    (found,) = findings.findings_of([one])
    assert (found.name, found.at, found.margin, found.probability) == ("sensor_bias", "q_link.joint1", 0.5, 0.4)
    (estimate,) = found.parameters.values()
    assert (list(found.parameters), estimate.value, estimate.std, estimate.unit) == (["offset"], 0.02, 0.001, "m")
    assert found.evidence == (
        "The sensor reads a constant too much or too little: in every recording the link encoder's zero stands off the "
        "motor's by the same 20 mm; without it the held-out recording is missed by 20.5 mm, with it by 3 mm. It "
        "explains nothing that moves."
    )
    assert [(r.at, r.probability, r.experiment) for r in found.rivals] == [("q.joint1", 0.4, THIRD)]


def test_a_drives_twist_is_told_over_all_recordings():
    """Parameters 7 and 8 make twists from -1 to 2 mrad in one, and 1 mrad in the other recording."""
    seen = []

    def term(values):
        return SimpleNamespace(term=lambda p, theta: seen.append((p, theta.tolist())) or (np.array(values), None))

    one = link(steps=(fit(DELAY, SPRING, theta=(0.1, 7.0, 8.0, 0.0)),))
    runs: Any = (term([-1e-3, 2e-3]), term([1e-3]))
    one = replace(one, pair=replace(one.pair, runs=runs))
    assert findings._twist(one, SPRING) == " The drive twists over 3 mrad in all."
    assert seen == [(SPRING, [7.0, 8.0])] * 2
    assert findings._twist(one, DELAY) == ""


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
        floor = findings.noise_floor(replace(link(), pair=pair(*some)))
        assert floor == pytest.approx(sigma * np.sqrt(4 / 32), rel=0.06)


def test_the_noise_floor_of_a_wide_band_is_that_above_four_tenths_of_the_rate():
    """Noise of deviation 1 at 64 samples a second, and a thousand times as much, up to 0.35 of the rate only."""
    n = 8192
    spectrum = np.fft.rfft(np.random.default_rng(1).normal(size=n))
    spectrum[np.fft.rfftfreq(n) < 0.35] *= 1000
    one = run(np.zeros(n), np.fft.irfft(spectrum, n))
    for band, wanted in ((32.0, 1.0), (16.0, np.sqrt(0.5))):
        floor = findings.noise_floor(replace(link(), pair=pair(replace(one, motion=replace(one.motion, band=band)))))
        assert floor == pytest.approx(wanted, rel=0.06)


@pytest.mark.parametrize(
    ("share", "floor", "said"),
    [(0.25, 0.99e-3, True), (0.25, 1.01e-3, False), (0.1, 0.0, True), (0.0999, 0.0, False), (0.0, 0.0, False)],
)
def test_what_has_no_name_is_told_from_a_tenth_on_and_above_twice_the_noise(monkeypatch, share, floor, said):
    """A residual of 4 mrad RMS, of which a quarter's energy is 2 mrad."""
    monkeypatch.setattr(findings, "noise_floor", lambda _: floor)
    one = link(steps=(fit(), fit(residual=[4e-3, -4e-3])), nameless=share)
    text = findings.nameless(one)
    assert bool(text) is said
    if share == 0.25 and said:
        assert text == (
            "on q_link.joint1, smooth curves over position, speed, load and time together still explain 25 % of what "
            "is left between the encoders (2 mrad) in blocks that they were not fitted to"
        )


def test_candidates_stand_by_what_they_explain_and_say_whether_they_were_named():
    none = cast(Any, None)
    shares = ((GAIN, 0.2), (DELAY, 0.6), (DRIFT, 0.0), (SPRING, -0.1))
    opening = tuple(Trial(p, none, np.zeros(1), 1.0, 10 * x, x, True) for p, x in shares)
    made = findings.candidates_of(link(opening=opening, proofs=(proof(GAIN),)))
    assert [tuple(vars(c).values()) for c in made] == [
        ("sensor_delay", "q_link.joint1", 0.6, 6.0, False),
        ("sensor_gain", "q_link.joint1", 0.2, 2.0, True),
    ]


def test_traces_show_the_difference_as_measured_as_given_and_after():
    """Two recordings fitted, of 3 and 2 samples, and one held out; residuals numbered through."""
    runs = [
        run([0, 1, 2], [5, 6, 7], path="/d/a.csv", qd=[1, 1, 1]),
        run([3, 4], [8, 9], path="/d/b.csv", qd=[2, 2]),
        run([5], [10], path="/d/c.csv", qd=[3]),
    ]
    steps = (fit(residual=[1, 2, 3, 4, 5]), fit(residual=[9]), fit(residual=[0.1, 0.2, 0.3, 0.4, 0.5]))
    held = (fit(residual=[6]), fit(residual=[0.6]))
    made = findings.traces_of(link(runs=runs[:2], locked=runs[2:], steps=steps, held=held, joint="joint7"))
    assert [(t.recording, t.role, t.channel, t.unit) for t in made] == [
        (name, role, "q_link.joint7", "rad")
        for name, role in (("a.csv", "train"), ("b.csv", "train"), ("c.csv", "holdout"))
    ]
    assert [t.time.tolist() for t in made] == [[100.0, 100 + 1 / 64, 100 + 2 / 64], [100.0, 100 + 1 / 64], [100.0]]
    assert [t.position.tolist() for t in made] == [[0, 1, 2], [3, 4], [5]]
    assert [t.speed.tolist() for t in made] == [[1, 1, 1], [2, 2], [3]]
    assert [t.measured.tolist() for t in made] == [[5, 6, 7], [8, 9], [10]]
    assert [t.before.tolist() for t in made] == [[4, 4, 4], [4, 4], [4]]
    for t, after in zip(made, ([4.9, 5.8, 6.7], [7.6, 8.5], [9.4]), strict=True):
        np.testing.assert_allclose(t.after, after)


def test_limits_are_what_would_have_gained_the_bar_and_its_price():
    """Beside a zero, a term c of rms deviation s in noise of 0.01 gains n s² c² / (2 · 0.01²): as much as is asked."""
    n = 512
    t = np.arange(n) / RATE
    q, qd, load = np.sin(3 * t), 2 + np.cos(5 * t), 1 + t**2
    last = PairFit((GAIN,), np.zeros(1), np.zeros(n), np.ones((n, 1)))
    one = link(runs=[run(q, 0 * q, qd=qd, load=load, start=50.0)], steps=(last,), bar=7.0)
    one = replace(one, searched=replace(one.searched, whiten=Whitener(np.zeros(0), 0.01, 0)))
    made = {x.name: x for x in findings.limits_of(one)}
    needed = 7.0 + 0.5 * np.log(n)
    c = {name: np.sqrt(2 * needed * 1e-4 / (n * np.var(x))) for name, x in (("d", qd), ("t", t), ("l", load))}
    assert [(x.name, x.at, x.parameter, x.unit) for x in made.values()] == [
        ("sensor_delay", "q_link.joint1", "delay", "s"),
        ("sensor_drift", "q_link.joint1", "rate", "rad/s"),
        ("joint_elasticity", "joint1", "stiffness", "N*m/rad"),
    ]
    assert [x.value for x in made.values()] == pytest.approx([c["d"], c["t"], 1 / c["l"]], rel=1e-9)
    without = findings.limits_of(replace(one, steps=(replace(last, placed=()),)))
    assert [x.name for x in without] == ["sensor_delay", "sensor_gain", "sensor_drift", "joint_elasticity"]
    assert without[1].value == pytest.approx(np.sqrt(2 * needed * 1e-4 / (n * np.var(q))), rel=1e-9)


def test_notes_tell_every_zero_and_what_was_not_named(monkeypatch):
    steps = (fit(), fit(DELAY, theta=(0.5, 1e-3, -2.5e-3)))
    held = (fit(), fit(DELAY, theta=(0.5, 4e-3)))
    one = link(steps=steps, held=held, rejected=(GAIN,))
    monkeypatch.setattr(findings, "nameless", lambda _: "")
    notes = [
        "zero of q_link.joint1 against q.joint1, one recording after another: 1, -2.5, 4 mrad",
        "sensor_gain at q_link.joint1 passed on the training recordings but made the held-out one hardly better: "
        "not named",
    ]
    assert findings.notes_of(one) == notes
    monkeypatch.setattr(findings, "nameless", lambda _: "something")
    assert findings.notes_of(one) == [*notes, "without a name: something"]
    assert get_effect("sensor_gain").name in findings.EITHER
