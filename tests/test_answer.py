"""The torques' answer: verdict and words by what was decided, probabilities, misfits, noise and excitation by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from encoder_pairs import RATE, motion, placed

from snarelab.identification import answer
from snarelab.identification.diagnosis import ChannelFit, Finding, Misfit, Step
from snarelab.identification.evidence.confirm import Missed
from snarelab.identification.evidence.diagnose import Decided
from snarelab.identification.evidence.found import Name, Remainder, Trial
from snarelab.identification.evidence.left import LeftOver
from snarelab.identification.evidence.rival import RivalOdds
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.nuisance.bursts import Bursts
from snarelab.identification.nuisance.noise import Noise

NAMES = ("joint1", "joint2", "joint3")
TREE: Any = SimpleNamespace(
    joints=[SimpleNamespace(name=n, kind=k) for n, k in zip(NAMES, ("revolute", "prismatic", "revolute"), strict=True)],
    n_joints=3,
)
MODEL: Any = SimpleNamespace(tree=TREE, joints=NAMES, name="arm")
COULOMB, BACKLASH, BIAS = (placed(n, "joint1") for n in ("coulomb_friction", "backlash", "sensor_bias"))
QUIET = Noise(0.1, 0.2, 0.3, 0.4, 8.0, 0.5)
HEARD = "0.1 N·m from sample to sample, 0.2 N·m over 0.3 s, a wander of 0.4 N·m over 8 s and 5 N·m of the encoders"


def experiment(tau, path="/data/a.csv", notes=(), **given):
    tau = np.asarray(tau, float)
    made = motion(np.zeros_like(tau) if "q" not in given else given.pop("q"), tau, joints=NAMES, path=path, **given)
    return Experiment(replace(made, notes=tuple(notes)), cast(Any, SimpleNamespace(tree=TREE)))


def fit(theta, *effects, **given) -> Any:
    """One parameter a channel, which is its torque."""
    level = np.array(theta, float)
    assembly = SimpleNamespace(
        torque=lambda e, t: np.tile(t, (len(e.motion.time), 1)), placed=effects, **given.pop("assembly", {})
    )
    return SimpleNamespace(assembly=assembly, theta=level, **given)


def name(effect, share=0.5, gain=30.0, rivals=(), channels=(0,)) -> Name:
    return Name(effect, channels, gain, share, tuple(RivalOdds(*r) for r in rivals))


def trial(effect, explained=0.5, odds=3.0, smallest=()) -> Trial:
    return Trial(effect, explained, odds, dict(smallest))


def curve(channel, over, explained) -> Remainder:
    return Remainder(channel, over, 20.0, explained, 3.0)


def decided(*, names=(), rest=(), bursting=(), rejected=(), missed=None, **found) -> Decided:
    best: Any = SimpleNamespace(names=tuple(names), missed=missed or {}, found=SimpleNamespace(**found))
    return Decided(best, LeftOver(tuple(rest), dict(bursting)), tuple(rejected))


@pytest.fixture
def reported(monkeypatch):
    """The report on what was decided; ``relative`` is what is left of each channel's torque."""

    def report(*, names=(), rest=(), bursting=(), rejected=(), trials=(), relative: Any = 0.1, train=None, held=()):
        left = np.broadcast_to(relative, 3)
        both = [(Misfit(9, 9, 9, x), Misfit(9, 9, x, x / 2)) for x in left]
        fits = [ChannelFit(f"tau.{n}", u, *own, 0) for n, u, own in zip(NAMES, ("N*m", "N", "N*m"), both, strict=True)]
        monkeypatch.setattr(answer, "_fits", lambda *_: tuple(fits))
        monkeypatch.setattr(
            answer, "_finding", lambda n, *_: Finding(n.placed.effect.name, n.placed.at, 1, 1, {}, "", ())
        )
        monkeypatch.setattr(answer, "locate", lambda _, explained: tuple(explained))
        for part in ("_moved", "_traces", "_limits"):
            monkeypatch.setattr(answer, part, lambda *_, part=part: part)
        monkeypatch.setattr(answer, "_excitation", lambda _: ["excited"])
        encoders = ([3.0, 1.0, 0.0], [np.sqrt(41), 1.0, 0.0])  # of two recordings: their RMS is 5, 1 and nothing
        weighed = SimpleNamespace(
            noises=[replace(QUIET, white=w) for w in (0.1, 0.0123, 4.0)],
            runs=[[SimpleNamespace(encoder=np.full(4, x)) for x in row] for row in encoders],
        )
        told = decided(
            names=names,
            rest=rest,
            bursting=bursting,
            rejected=rejected,
            trials=trials,
            weighed=weighed,
            first=fit([1, 1, 1]),
        )
        train = train or [experiment(np.ones((4, 3)))]
        return answer.report_on(MODEL, told, fit([3, 5, 7]), (Step("s", 1, 1),), train, held)

    return report


def words(channel, over, share, size):
    return (
        f"on tau.{channel}, a smooth curve over {over} still explains {share} of the residual "
        f"({size} of the channel's torque)"
    )


@pytest.mark.parametrize(
    ("names", "rest", "verdict"),
    [
        ((), (), "adequate"),
        ((), (curve(1, "load", 0.01),), "unknown_effect"),
        ((name(COULOMB),), (), "missing_physics"),
        ((name(COULOMB),), (curve(1, "load", 0.9),), "missing_physics"),
    ],
)
def test_the_verdict_hangs_on_names_first_and_on_nameless_curves_then(reported, names, rest, verdict):
    made = reported(names=names, rest=rest)
    assert made.verdict == verdict
    assert bool(made.description) is bool(rest)
    assert [(e.name, e.at) for e in made.effects] == [("coulomb_friction", "joint1")] * len(names)


def test_without_a_finding_the_sentence_tells_what_has_no_name_and_where(reported):
    """Of the two channels with a curve the worse; joint1 misses more, but has nothing to say."""
    made = reported(rest=[curve(2, "time", 0.64), curve(1, "load", 0.25)], relative=(0.9, 0.2, 0.4))
    one, two = words("joint3", "time", "64 %", "32 %"), words("joint2", "load", "25 %", "10 %")
    assert made.description == f"{one}; {two}"
    assert made.sentence == (
        f"Something is missing on tau.joint3 that no effect of the vocabulary explains. O{one[1:]}; {two}."
    )
    # What is located is the residual itself there, measured 1 less modelled 3, 5 and 7, and nothing elsewhere.
    (residual,) = cast(Any, made.location)
    assert residual.tolist() == [[0.0, -4.0, -6.0]] * 4


def test_with_a_finding_the_rest_is_told_by_its_channels(reported):
    """What is located is the change of the model's torque: from 1 to 3, 5 and 7."""
    rest = [curve(2, "time", 0.64), curve(0, "load", 0.25), curve(2, "speed", 0.1)]
    made = reported(names=[name(COULOMB)], rest=rest, relative=(0.9, 0.001, 0.4))
    assert made.sentence == (
        "The model leaves out Coulomb friction at joint1. With that added, the error of tau.joint1 on the held-out "
        "recording falls from 90 % to 45 %. Part of what is left on tau.joint1 and tau.joint3 has no name."
    )
    assert made.description == "; ".join(
        (
            words("joint3", "time", "64 %", "32 %"),
            words("joint1", "load", "25 %", "45 %"),
            words("joint3", "speed", "10 %", "13 %"),
        )
    )
    (change,) = cast(Any, made.location)
    assert change.tolist() == [[2.0, 4.0, 6.0]] * 4
    assert reported(names=[name(COULOMB)]).sentence.endswith("from 10 % to 5 %.")


def test_an_adequate_model_is_told_by_the_worst_channel(reported):
    made = reported(relative=(0.02, 0.03, 0.01))
    assert (made.verdict, made.description) == ("adequate", "")
    assert made.sentence.endswith(f" is 2 % of tau.joint1. It is noise: {HEARD}.")
    assert (made.model, made.steps, made.moved, made.traces, made.limits) == (
        "arm", (Step("s", 1, 1),), "_moved", "_traces", "_limits",
    )  # fmt: skip
    assert made.band == RATE / 2
    (nothing,) = cast(Any, made.location)
    assert not nothing.any()


def test_notes_tell_the_recordings_first_then_what_was_not_named_then_the_noise(reported):
    """A name that another attempt had rejected, and the best one kept, is not said to be unnamed."""
    train = [experiment(np.ones((4, 3)), "/d/a.csv", ["n1", "n2"]), experiment(np.ones((4, 3)), "/d/b.csv", ["n3"])]
    held = [experiment(np.ones((4, 3)), "/d/h.csv", ["n4"])]
    made = reported(names=[name(COULOMB)], rejected=[name(BACKLASH), name(COULOMB)], train=train, held=held)
    assert made.notes[:5] == (
        "a.csv: n1",
        "a.csv: n2",
        "b.csv: n3",
        "h.csv: n4",
        "backlash at joint1 passed on the training recordings, but the held-out ones are foretold no better with it: "
        "not named",
    )
    assert made.notes[5] == f"noise of tau.joint1: {HEARD}"
    assert made.notes[6].startswith("noise of tau.joint2: 0.012 N from sample to sample, 0.2 N over 0.3 s,")
    assert made.notes[6].endswith("and 1 N of the encoders")
    assert made.notes[7].startswith("noise of tau.joint3: 4 N·m from sample to sample,")
    assert made.notes[8:] == ("excited",)


@pytest.mark.parametrize("again", [True, False])
@pytest.mark.parametrize("curves", [(), (curve(1, "speed", 0.49),)])
def test_bursts_have_no_name_unless_they_came_once(reported, again, curves):
    made = reported(rest=curves, bursting=[(2, Bursts(0.36, 12.345, again))], relative=0.1)
    text = (
        "on tau.joint3, 36 % of the residual comes in bursts, at 12 Hz where it is strongest "
        "(6 % of the channel's torque)"
    )
    smooth = [words("joint2", "speed", "49 %", "7 %")] * len(curves)
    assert made.description == "; ".join([*smooth, *[text] * again])
    assert made.verdict == ("unknown_effect" if again or curves else "adequate")
    knock = "on tau.joint3, 36 % of the residual stands in one window and has not come again: a knock, or an outlier"
    assert (knock in made.notes) is not again
    (residual,) = cast(Any, made.location)
    assert np.flatnonzero(residual[0]).tolist() == [1] * len(curves) + [2] * again


def test_candidates_are_what_explains_anything_by_itself(reported):
    trials = [trial(COULOMB, 0.4, 9.5), trial(BIAS, 0.1, -2.0), trial(BACKLASH, 0.0, -3.0)]
    made = reported(names=[name(COULOMB)], trials=trials)
    assert [tuple(vars(c).values()) for c in made.candidates] == [
        ("coulomb_friction", "joint1", 0.4, 9.5, True),
        ("sensor_bias", "joint1", 0.1, -2.0, False),
    ]


def found(monkeypatch, right, share, rivals) -> Finding:
    """The finding of a name that is right in so many of all cases with its evidence: 30, and 2.5 standard errors."""
    monkeypatch.setattr(answer, "of_name", lambda gain, sure: right if (gain, sure) == (30.0, 2.5) else np.nan)
    slots = [SimpleNamespace(name=n, unit=u) for n, u in (("other", "m"), ("level", "N*m"), ("more", "s"))]
    final = fit([1, 2, 3], std=[0.1, 0.2, 0.3], at_bound=np.array([True, False, True]),
                assembly={"slots": slots, "index_of": lambda p: [1, 2]})  # fmt: skip
    own = name(COULOMB, share, rivals=rivals, channels=(2, 0))
    told = decided(names=[own], missed={COULOMB.key: Missed(5.0, 2.0, (0.02, 0.08), cast(Any, None))})
    return answer._finding(own, told, final, ["tau.a", "tau.b", "tau.c"])


def test_an_effect_and_what_cannot_be_told_from_it_share_how_often_such_a_name_was_right(monkeypatch):
    """It has half of the posterior, with its twins 0.75: right in 0.6 of all cases, of which it has two thirds."""
    rivals = ((BACKLASH, 0.246, False), (COULOMB, 0.004, False), (BIAS, 0.2, True), (BACKLASH, 0.005, True))
    made = found(monkeypatch, 0.6, 0.5, rivals)
    assert (made.name, made.at, made.margin, made.gain) == ("coulomb_friction", "joint1", 2.5, 30.0)
    assert made.probability == pytest.approx(0.4)
    assert [(r.name, r.separable) for r in made.rivals] == [
        ("backlash", False),
        ("coulomb_friction", False),
        ("sensor_bias", True),
        ("backlash", True),
    ]
    assert [r.probability for r in made.rivals] == pytest.approx([0.246 * 0.8, 0.0032, 0.12, 0.003])
    assert {n: tuple(vars(e).values()) for n, e in made.parameters.items()} == {
        "level": (2.0, 0.2, "N*m", False),
        "more": (3.0, 0.3, "s", True),
    }
    assert made.evidence.endswith(
        "it explains 94 % of what the model without it leaves over on tau.c and tau.a; taking it out again raises the "
        "error on the held-out recording from 2 % to 8 %."
    )


def test_a_name_alone_in_its_place_is_as_likely_as_such_a_name_was_right(monkeypatch):
    """However little of the posterior it has: what is shared is shared among those that cannot be told apart."""
    assert found(monkeypatch, 0.6, 0.3, ((BIAS, 0.2, True),)).probability == pytest.approx(0.6)


def test_limits_are_told_by_parameter_with_its_unit():
    sling = trial(placed("sling_tension_error", "joint1"), smallest={"lag_loss": 0.3, "share": 0.2})
    trials = [sling, trial(BACKLASH), trial(BIAS, smallest={"offset": 4})]
    final = fit([1, 2, 3], assembly={"unit": lambda placed, p: f"{p.unit} of {placed.effect.name}"})
    assert [tuple(vars(x).values()) for x in answer._limits(decided(closing=trials), final)] == [
        ("sling_tension_error", "joint1", "share", 0.2, "1 of sling_tension_error"),
        ("sling_tension_error", "joint1", "lag_loss", 0.3, "N*s/m of sling_tension_error"),
        ("sensor_bias", "joint1", "offset", 4, "U of sensor_bias"),
    ]


def test_misfits_are_root_mean_squares_over_all_recordings_of_a_set(monkeypatch):
    """Fitted: a torque of 4 modelled as 2, then 3; held out 10, as 2 and 3. Channels 2 and 3 with other numbers."""
    monkeypatch.setattr(answer, "_noise_floor", lambda *_: np.array([0.1, 0.2, 0.3]))
    train = [experiment(np.tile([4.0, 8.0, 5.0], (n, 1))) for n in (4, 8)]
    fits = answer._fits(MODEL, fit([2, 0, 5]), fit([3, 4, 6]), train, [experiment(np.tile([10.0, 2.0, 5.0], (4, 1)))])
    assert [(f.channel, f.unit, f.noise_floor) for f in fits] == [
        ("tau.joint1", "N*m", 0.1),
        ("tau.joint2", "N", 0.2),
        ("tau.joint3", "N*m", 0.3),
    ]
    assert [tuple(vars(f.train).values()) for f in fits] == [(2, 1, 0.5, 0.25), (8, 4, 1.0, 0.5), (0, 1, 0, 0.2)]
    assert [tuple(vars(f.holdout).values()) for f in fits] == [(8, 7, 0.8, 0.7), (2, 2, 1, 1), (0, 1, 0, 0.2)]


def noisy(sigmas, band=4.0, segments=None, n=8192, seed=0):
    """White noise of these deviations at 64 samples a second, beside a slow motion and a single line at 20 Hz."""
    t = np.arange(n) / RATE
    other = 3 + 5 * np.sin(2 * np.pi * 3 * t) + 0.1 * np.sin(2 * np.pi * 20 * t)
    tau = np.random.default_rng(seed).normal(size=(n, 3)) * sigmas + other[:, None]
    if segments:
        tau[segments[0]] = 0.0
    made = experiment(tau, segments=segments)
    return replace(made, motion=replace(made.motion, band=band))


def test_a_noise_floor_is_white_noise_of_the_longest_run_above_twice_the_band():
    """In 4 of 32 Hz; the smallest of all recordings', channel by channel. A model's torque does not count."""
    final = fit([3.0, 3.0, 3.0])
    one = noisy([1e-2, 1e-3, 1.0], segments=(slice(0, 1000), slice(1000, 8192)))
    two = noisy([2e-2, 5e-4, 2.0], seed=1)
    part = np.sqrt(4 / 32)
    assert answer._noise_floor([one], final) / part == pytest.approx([1e-2, 1e-3, 1.0], rel=0.07)
    assert answer._noise_floor([one, two], final) / part == pytest.approx([1e-2, 5e-4, 1.0], rel=0.07)


def test_a_wide_bands_noise_floor_is_what_is_above_four_tenths_of_the_rate():
    """Of noise a thousand times as loud below 0.35 of the rate."""
    n = 8192
    spectrum = np.fft.rfft(np.random.default_rng(1).normal(size=(n, 3)), axis=0)
    spectrum[np.fft.rfftfreq(n) < 0.35] *= 1000
    e = experiment(np.fft.irfft(spectrum, n, axis=0))
    assert answer._noise_floor([e], fit([0, 0, 0])) == pytest.approx([1.0] * 3, rel=0.07)


def test_a_noise_floor_is_what_the_model_leaves_from_twice_the_band_on():
    """Modelled is a torque a thousand times as loud. Of 8 to 32 Hz the noise is loud up to 21 Hz, in 13 of 24: the
    median has 11 quiet ones below it, and 1 / 26 of the loud: of their exponential law's mean -ln(1 - 1 / 13)."""
    n = 8192
    rng = np.random.default_rng(2)
    spectrum = np.fft.rfft(rng.normal(size=(n, 3)), axis=0)
    spectrum[np.fft.rfftfreq(n, 1 / RATE) > 21] *= 1e-3
    modelled = 1e3 * rng.normal(size=(n, 3))
    e = experiment(np.fft.irfft(spectrum, n, axis=0) + modelled)
    e = replace(e, motion=replace(e.motion, band=4.0))
    final: Any = SimpleNamespace(assembly=SimpleNamespace(torque=lambda *_: modelled), theta=None)
    wanted = np.sqrt(4 / 32 * -np.log(1 - 1 / 13) / np.log(2))
    assert answer._noise_floor([e], final) == pytest.approx([wanted] * 3, rel=0.2)


def test_a_floating_bases_noise_floor_is_its_momentums(monkeypatch):
    monkeypatch.setattr(answer, "n_carriers", lambda _: 2)
    monkeypatch.setattr(answer, "momentum_floor", lambda _: np.array([7.0, 8.0]))
    floors = answer._noise_floor([noisy([1.0, 1.0, 1.0])] * 2, fit([0, 0, 0]))
    assert floors[:2].tolist() == [7.0, 8.0]
    assert floors[2] == pytest.approx(np.sqrt(4 / 32), rel=0.07)


def test_parameters_that_stay_in_the_model_are_told_before_and_after():
    def slots(*keys):
        return {"slots": [SimpleNamespace(key=k, unit=f"unit of {k}") for k in keys]}

    first, final = fit([1, 2, 3], assembly=slots("a", "b", "c")), fit([30, 20, 10], assembly=slots("c", "x", "a"))
    final.std = np.array([0.3, 0.2, 0.1])
    assert [tuple(vars(m).values()) for m in answer._moved(first, final)] == [
        ("a", "unit of a", 1.0, 10.0, 0.1),
        ("c", "unit of c", 3.0, 30.0, 0.3),
    ]


def test_every_channel_of_every_recording_has_a_trace():
    """Position k and speed 10 k of joint k, torque 100 k; models 1, 2, 3 and 4, 5, 6."""
    k = np.array([1.0, 2.0, 3.0])
    es = [experiment(np.tile(100 * k, (2, 1)), f"/d/{n}.csv", q=np.tile(k, (2, 1)), qd=np.tile(10 * k, (2, 1)))
          for n in "abh"]  # fmt: skip
    made = answer._traces(fit([1, 2, 3]), fit([4, 5, 6]), es[:2], es[2:])
    assert [(t.recording, t.role, t.channel, t.unit) for t in made] == [
        (f"{n}.csv", "holdout" if n == "h" else "train", f"tau.{j}", u)
        for n in "abh"
        for j, u in zip(NAMES, ("N*m", "N", "N*m"), strict=True)
    ]
    assert made[4].time.tolist() == [100.0, 100 + 1 / 64]
    arrays = (made[4].position, made[4].speed, made[4].measured, made[4].before, made[4].after)
    assert [x.tolist() for x in arrays] == [[x, x] for x in (2.0, 20.0, 200.0, 2.0, 5.0)]


def test_excitation_counts_reversals_among_the_samples_in_motion():
    """Faster than a twentieth of the peak of 2: of eight samples in two recordings five, four, and all."""
    one = np.array([[2, 1, -1], [0.12, 1, 1], [-0.12, 0.05, -1], [0.1, 0, 1]])
    two = np.array([[1, -2, 1], [-1, -1, 1], [0.02, 0, 1], [0, 0.1, 1.0]])
    es = [experiment(np.zeros((4, 3)), qd=qd) for qd in (one, two)]
    assert answer._excitation(es) == [
        "excitation of joint1: moving 62 % of the time, 3 reversals",
        "excitation of joint2: moving 50 % of the time, 1 reversals",
        "excitation of joint3: moving 100 % of the time, 3 reversals",
    ]
