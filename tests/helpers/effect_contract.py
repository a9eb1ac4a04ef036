"""The contract of an effect: what each file of the vocabulary keeps to, and each file that is written as one."""

import itertools
import re
from typing import Any

import numpy as np
import pint
from effect_references import Reference
from effect_signals import DT, TIME, signals
from scipy.optimize import least_squares

from snarelab.models.effect import Effect
from snarelab.models.effects import FAMILIES, effects
from snarelab.models.hidden_state import THROUGH, LawEvaluation, evaluate_law


def scale_of(parameter, s):
    travel, torque = np.ptp(s["q"]), np.abs(s["value" if parameter.unit == "U" else "load"]).max()
    scales = {"": 1.0, "speed": s["speed_scale"][0], "travel": travel, "torque": torque, "rate": torque / travel}
    scales |= {"per_torque": 1 / torque, "place": travel}  # the motion's middle is near zero
    return scales[parameter.relative_to]


def draw(parameter, s, rng):
    """A random value inside the bounds."""
    if np.isfinite(parameter.high):
        low = max(parameter.low, 1e-3 * parameter.high)
        return scale_of(parameter, s) * np.exp(rng.uniform(*np.log([low, parameter.high])))
    drawn = rng.normal()
    return drawn if drawn > parameter.low else abs(drawn)


def evaluate(effect, s, parameters) -> LawEvaluation:
    """Along the samples; of what leads, against time, as a fit has it."""
    way = slice(None, None, -1 if effect.leads else 1)
    found = evaluate_law(effect, {name: x[way] for name, x in s.items()}, np.asarray(parameters), dt=DT)
    values, by_parameter, *others = found
    return LawEvaluation(values[way], by_parameter[way], *(x if x is None else x[way] for x in others))


def baseline(effect, s):
    """What stands where the effect acts, without it."""
    return s[THROUGH[effect.at]].reshape(TIME.size, -1) if effect.at in ("link", "sensor") else 0.0


def rms(rows):
    return np.sqrt(np.mean(rows**2, axis=0))


def fit(effect, s, measured, keep):
    """Best start on the shapes' grid with the amplitudes by linear least squares, then a nonlinear refinement."""
    spread = rms(measured - baseline(effect, s)) + 1e-9
    scales = np.array([scale_of(parameter, s) for parameter in effect.parameters])
    low = np.array([parameter.low for parameter in effect.parameters]) * scales
    high = np.array([parameter.high for parameter in effect.parameters]) * scales
    amplitudes = np.array([not parameter.grid for parameter in effect.parameters])

    def residual(p):
        return ((evaluate(effect, s, p).values - measured) / spread)[keep].ravel()

    def slope(p):
        return (evaluate(effect, s, p).by_parameter / spread[:, None])[keep].reshape(-1, p.size)

    starts = []
    for shape in itertools.product(*(parameter.grid or (0.0,) for parameter in effect.parameters)):
        start = np.array(shape) * scales
        if amplitudes.any():
            start[amplitudes] -= np.linalg.lstsq(slope(start)[:, amplitudes], residual(start))[0]
        start = np.clip(start, low, high)
        starts.append((np.sum(residual(start) ** 2), tuple(start)))
    how: dict[str, Any] = {"jac": slope, "bounds": (low, high), "x_scale": "jac", "xtol": 1e-10}
    return least_squares(residual, min(starts)[1], **how).x


def check_metadata(effect: Effect) -> None:
    assert effect.family in FAMILIES
    assert min(len(effect.sentence), len(effect.equation)) > 10
    assert effect.experiment.format(at="joint3").count("joint3") == effect.experiment.count("{at}") > 0
    assert set(effect.contains) <= set(effects()) - {effect.name}
    assert re.search(r"\(.*(\d{4}|eq).*\)|\d{4}", effect.source)
    assert bool(effect.states) == bool(effect.rate)
    units = pint.UnitRegistry()
    for parameter in effect.parameters:
        assert parameter.meaning
        for torque, position in (("(N*m)", "rad"), ("N", "m")):
            spelled = {"T": torque, "S": position, "U": "(N*m)"}
            units.parse_units(re.sub(r"\b[TSU]\b", lambda match, by=spelled: by[match[0]], parameter.unit))
        assert all(parameter.low <= number <= parameter.high for number in (*parameter.grid, parameter.zero))
        assert list(parameter.grid) in (sorted(parameter.grid), sorted(parameter.grid, reverse=True))
        assert not parameter.relative_to or parameter.grid


def check_derivatives(effect: Effect) -> None:
    s, rng = signals(), np.random.default_rng(11)
    through = THROUGH.get(effect.at, "")
    for _ in range(4):
        p = np.array([draw(parameter, s, rng) for parameter in effect.parameters])
        result = evaluate(effect, s, p)
        for i in range(p.size):
            step = 1e-5 * max(abs(p[i]), 1e-3) * np.eye(p.size)[i]
            change = (evaluate(effect, s, p + step).values - evaluate(effect, s, p - step).values) / (2 * step[i])
            size = np.abs(change).max(axis=0) + 1e-6 * np.abs(result.values).max(axis=0) / max(abs(p[i]), 1e-3)
            assert np.all(np.abs(result.by_parameter[:, :, i] - change) <= 2e-5 * size + 1e-12)
        if result.by_signal is None:
            continue
        for i in range(result.by_signal.shape[2]) if not effect.states else ():
            step = 1e-6 * (np.eye(10)[i] if effect.at == "link" else 1.0)
            ahead, behind = (evaluate(effect, s | {through: s[through] + sign * step}, p) for sign in (1, -1))
            change = (ahead.values - behind.values) / 2e-6
            np.testing.assert_allclose(result.by_signal[:, :, i], change, rtol=1e-6, atol=1e-6)


def check_zero(effect: Effect) -> None:
    s, rng = signals(), np.random.default_rng(12)
    elastic = effect.acts_on == "position"  # vanishes as the stiffness grows, not at zero
    p = [draw(parameter, s, rng) if parameter.zero else 0.0 for parameter in effect.parameters]
    if elastic:
        p[0] = 1e14
    result = evaluate(effect, s, p).values
    np.testing.assert_allclose(result, np.broadcast_to(baseline(effect, s), result.shape), rtol=0, atol=1e-6)
    if not elastic:
        p = [draw(parameter, s, rng) for parameter in effect.parameters]
        assert np.abs(evaluate(effect, s, p).values - baseline(effect, s)).max() > 1e-3


def check_dissipation(effect: Effect) -> None:
    s, rng = signals(), np.random.default_rng(13)
    s = s | {"qd": np.sign(s["qd"]) * 10 ** rng.uniform(-7, 1.5, TIME.size), "load": rng.normal(size=TIME.size)}
    for _ in range(50):
        p = np.array([draw(parameter, s, rng) for parameter in effect.parameters])
        power = s["qd"] * evaluate(effect, s, p).values[:, 0]
        assert power.min() >= -1e-12 * power.max()
        assert power.max() > 0


def check_recovery(effect: Effect, reference: Reference) -> None:
    s, rng = signals(), np.random.default_rng(14)
    truth = [reference.truth[parameter.name] for parameter in effect.parameters]
    clean = reference.output(s, *reference.truth.values()).reshape(TIME.size, -1)
    keep = (s["time"][::-1] if effect.leads else s["time"]) >= reference.settle
    size = rms(clean - baseline(effect, s))
    sharp = keep & (np.abs(s["qd"]) > 0.005 * s["speed_scale"])  # where a smooth sign equals a sign
    assert np.all(rms((evaluate(effect, s, truth).values - clean)[sharp]) <= reference.likeness * size)
    measured = clean + 0.01 * size * rng.normal(size=clean.shape)
    np.testing.assert_allclose(fit(effect, s, measured, keep), truth, rtol=reference.tolerance)
