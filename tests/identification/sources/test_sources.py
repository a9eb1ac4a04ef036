"""A kind of recording is one class: channels that are linear in two effects, searched and confirmed like any other."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.errors import InputError
from snarelab.identification.deciding import BASELINE_OWN
from snarelab.identification.nuisance.covariance import Covariance
from snarelab.identification.nuisance.noise import NoiseChannel
from snarelab.identification.sources.answer import rms
from snarelab.identification.sources.decide import decide
from snarelab.identification.sources.fit import fit, kept_columns, linearised, priors
from snarelab.identification.sources.own import known, settled
from snarelab.identification.sources.source import GridPoint, ModelPoint
from snarelab.identification.sources.stages import stages
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

N, STEP = 400, 0.02
TIME = STEP * np.arange(N)
VISCOUS, COULOMB = (PlacedEffect(get_effect(name), "joint1") for name in ("viscous_friction", "coulomb_friction"))
NONE = ModelPoint.of((), {}, 1)


@dataclass
class Slide:
    """A carriage whose force is friction of its speed, beside a bias of the force sensor that is known to 0.1 N."""

    truths: tuple[tuple[float, float, float], ...]
    channels: tuple[str, ...] = ("tau.joint1",)
    n_shifts: int = 1
    anew: bool = False
    bent: bool = False
    steps: int = 4
    train: range = field(default_factory=lambda: range(2))
    held: range = field(default_factory=lambda: range(2, 3))
    tolerance: tuple[int, ...] = ()

    def columns_of(self, i):
        speed = np.sin(2.0 * TIME + i) + 0.3 * np.sin(7.1 * TIME)
        return {VISCOUS.key: speed, COULOMB.key: np.tanh(speed / 0.01)}

    def measured(self, i):
        own, noise = self.columns_of(i), np.random.default_rng(i).standard_normal(N)
        viscous, coulomb, bias = self.truths[i]
        return (viscous * own[VISCOUS.key] + coulomb * own[COULOMB.key] + bias + 0.05 * noise)[:, None]

    def predicted(self, i, at):
        own = self.columns_of(i)
        return sum((at.of_effect(p)[0] * own[p.key] for p in at.placed), np.full(N, 0.1 * at.shifts[0]))[:, None]

    def refused(self, i):
        return InputError("no")

    def slopes(self, i, at, here):
        return np.array([self.columns_of(i)[p.key] for p in at.placed]).reshape(-1, N).T[:, None]

    def shift_slopes(self, i, at, here):
        return np.full((N, 1, 1), 0.1)

    def own_shifts(self, p):
        return self.tolerance if p.key == COULOMB.key else ()

    def settled(self, at, numbers):
        return at

    def scale(self):
        return np.sqrt(np.mean(np.concatenate([self.measured(i) for i in self.train]) ** 2, axis=0))

    def bounds(self, p, x):
        return x.low, x.high

    def size(self, p, x):
        return 1.0

    def unit(self, p, x):
        return x.unit

    def library(self, placed):
        return [p for p in (VISCOUS, COULOMB) if p.key not in {x.key for x in placed}]

    def variants(self, p):
        return [GridPoint(p, {}, (f"{p.key}.{p.effect.parameters[0].name}",))]

    def columns(self, i, at, many):
        return [self.columns_of(i)[v.placed.key][:, None, None] for v in many]

    def curves(self, numbers):
        return {}

    def noise_channels(self, numbers, linear, could):
        none = np.zeros(N)
        return [[NoiseChannel(STEP, (slice(0, N),), none, (none,), none, 0.0)] for _ in numbers]

    def blocks(self, i, x):
        return np.array([b.sum() for b in np.array_split(x, 5)])


def test_only_what_the_model_file_says_has_a_prior():
    """A start at what hardware usually has says nothing: fitted first, and then the point a search starts from."""
    model: Any = SimpleNamespace(effects=(VISCOUS, COULOMB), values={f"{VISCOUS.key}.coefficient": 2.1})
    keys = [f"{p.key}.{p.effect.parameters[0].name}" for p in (VISCOUS, COULOMB)]
    start = ModelPoint.of((VISCOUS, COULOMB), dict(zip(keys, (2.1, 30.0), strict=True)), 1)
    mean, spread = priors(Slide(((2.0, 0.7, 0.1),) * 3), known(model, start), start)
    assert (mean[0], spread[0]) == (2.1, BASELINE_OWN * 2.1)
    assert np.isinf(spread[1])
    at = settled(Slide(((2.0, 0.7, 0.1),) * 3), model, start)
    assert at.all_values == pytest.approx(dict(zip(keys, (2.0, 0.7), strict=True)), rel=0.02)
    assert at.shifts == pytest.approx([0.0])
    model.values[keys[1]] = 30.0
    assert settled(Slide(((2.0, 0.7, 0.1),) * 3), model, start) is start


def test_each_name_is_a_stage_and_every_other_is_fitted_again():
    """Without Coulomb friction the viscous one stands for some of it."""
    slide = Slide(((2.0, 0.7, 0.1),) * 3)
    found = decide(slide, NONE)
    first, second, third = stages(slide, found)
    names = [n.placed for n in found.best.names]
    assert [x[0] for x in (first, second, third)] == [
        "model as given",
        *(f"+ {p.effect.name} at joint1" for p in names),
    ]
    assert second[1].at.keys == found.best.last.train.at.keys[:1]
    for _, train, held in (second, third):
        left = slide.measured(2) - slide.predicted(2, train.at)
        np.testing.assert_allclose(held.residuals[0], left)
    alone = np.concatenate([slide.columns_of(i)[names[0].key] for i in slide.train])
    beside = np.concatenate([slide.measured(i)[:, 0] for i in slide.train])
    both = np.stack([alone, np.full(len(alone), 0.1)], axis=1)
    expected = np.linalg.lstsq(both, beside, rcond=None)[0][0]
    assert second[1].at.values[0] == pytest.approx(expected, rel=0.05)
    assert rms(third[2])[0] < 0.5 * rms(second[2])[0] < rms(first[2])[0]


class Grease(Slide):
    """A carriage whose viscous friction is known to a tolerance, over which it bends, unless the effect has it."""

    def coefficient(self, at):
        (s,) = at.shifts
        return at.all_values.get(f"{VISCOUS.key}.coefficient", 0.1 * s + 0.05 * s**2)

    def predicted(self, i, at):
        return self.coefficient(at) * self.columns_of(i)[VISCOUS.key][:, None]

    def shift_slopes(self, i, at, here):
        slope = 0.0 if at.placed else 0.1 + 0.1 * at.shifts[0]
        return slope * self.columns_of(i)[VISCOUS.key][:, None, None]


WHITE = [[Covariance(np.full(N, 0.05**2), [], None, STEP, (slice(0, N),))] for _ in range(2)]


def test_a_tolerance_that_bends_is_fitted_to_where_it_ends():
    """0.1 s + 0.05 s^2 = 0.8. Slopes of the start, a quarter of those there, would not settle."""
    slide = Grease(((0.8, 0.0, 0.0),) * 3, bent=True)
    found = fit(slide, NONE, NONE, WHITE, None, 8)
    assert found.at.shifts == pytest.approx([(np.sqrt(0.17) - 0.1) / 0.1], abs=0.02)
    np.testing.assert_allclose(found.columns[0], slide.shift_slopes(0, found.at, None))


def test_an_effect_in_place_of_a_tolerance_is_fitted_although_the_tolerance_had_moved():
    """Beside the column that the tolerance had, the effect stays where it starts: the tolerance moves, and does
    nothing."""
    slide = Grease(((0.8, 0.0, 0.0),) * 3, bent=True)
    before = linearised(slide, slide.train, ModelPoint.of((), {}, 1))
    start = replace(NONE, shifts=np.array([2.0])).with_effects([VISCOUS], {f"{VISCOUS.key}.coefficient": 0.3})
    found = fit(slide, NONE, start, WHITE, kept_columns(slide, before), 8)
    speed = np.concatenate([slide.columns_of(i)[VISCOUS.key] for i in slide.train])
    force = np.concatenate([slide.measured(i)[:, 0] for i in slide.train])
    assert found.at.values == pytest.approx([speed @ force / (speed @ speed)], rel=1e-3)
    assert found.at.shifts == pytest.approx([0.0], abs=0.02)


def named(found):
    return sorted(n.placed.effect.name for n in found.best.names)


@pytest.mark.parametrize("bias", [0.0, 0.15])
def test_noise_and_a_shift_within_its_deviation_have_no_name(bias):
    found = decide(Slide(((0.0, 0.0, bias),) * 3), NONE)
    assert named(found) == []
    assert 0.1 * found.best.last.train.at.shifts[0] == pytest.approx(bias, abs=0.02)


def test_what_is_there_is_named_with_its_size_beside_the_shift():
    found = decide(Slide(((2.0, 0.7, 0.1),) * 3), NONE)
    assert named(found) == ["coulomb_friction", "viscous_friction"]
    values = found.best.last.train.at.all_values
    assert values["viscous_friction.joint1.coefficient"] == pytest.approx(2.0, rel=0.02)
    assert values["coulomb_friction.joint1.level"] == pytest.approx(0.7, rel=0.02)
    assert rms(found.best.last.held)[0] == pytest.approx(0.05, rel=0.1)


@dataclass
class OneWay(Slide):
    """A carriage that moves one way only: Coulomb friction looks like the bias, and only its size tells them apart."""

    def columns_of(self, i):
        speed = 1.5 + np.sin(2.0 * TIME + i)
        return {VISCOUS.key: speed, COULOMB.key: np.ones(N)}


@pytest.mark.parametrize(("size", "names"), [(0.5, ["coulomb_friction"]), (0.1, [])])
def test_what_exceeds_its_own_tolerance_is_confirmed(size, names):
    """Five deviations of the bias are no tolerance. Without the name the fit takes them for one, and predicts the
    held-out recording as well: then the name was not confirmed."""
    assert named(decide(OneWay(((0.0, size, 0.0),) * 3, tolerance=(0,)), NONE)) == names
    assert named(decide(OneWay(((0.0, size, 0.0),) * 3), NONE)) == []


def test_what_only_the_training_recordings_have_is_not_confirmed():
    found = decide(Slide(((2.0, 0.7, 0.1), (2.0, 0.7, 0.1), (2.0, 0.0, 0.1))), NONE)
    assert named(found) == ["viscous_friction"]
    assert [n.placed.effect.name for n in found.rejected] == ["coulomb_friction"]
