"""Recordings that contradict each other: one arm cannot have made both."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from ....models.inertia import to_central
from ....report.words import percent
from ..case import CheckCase
from ..compete import ODDS, SURE
from ..evidence import GAIN, WAYS, ReadingFit
from ..finding import CheckFinding, Kind
from ..reading import as_read

WORSE = 1.5
"""Least ratio of relative residuals, on the channel that shows it best, of one arm and of two."""

OTHER_MASS, OTHER_GAIN, OTHER_ZERO = 3.0, 1.0, 0.3
"""One standard deviation of what may differ between recordings that contradict each other: a link's mass properties, in
those that a robot's file may be off by; a gain, as a share; an encoder's zero [rad or m]."""

Columns: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Columns (n, J, k), their widths and lower bounds (k,)."""


@dataclass(frozen=True)
class OwnValue:
    """What may have another value in every recording.

    ``what`` and ``at`` say it; ``columns`` (n, J, k) are torques, of amplitudes whose standard deviation is ``width``;
    ``words`` puts a recording's amplitudes (k,), in units of ``width``, into numbers with their unit. Of what all
    recordings may share, ``own`` (k,) takes the amplitudes from a fit, and the first recording has no others; None
    where there is nothing of the kind.
    """

    what: str
    at: str
    columns: np.ndarray
    width: float
    words: Callable[[np.ndarray], str]
    own: Callable[[ReadingFit], np.ndarray] | None = None

    def count(self, runs: int) -> int:
        """Recordings that have amplitudes of their own."""
        return runs if self.own is None else runs - 1


def find(case: CheckCase) -> list[CheckFinding]:
    """Links whose mass properties, torques whose gain, and encoders whose zero are not the same in all recordings.

    Friction and biases may differ from day to day; they are fitted for each recording in both.
    """
    runs = len(case.experiments)
    if runs < 2 or not case.comparable:
        return []
    samples, n, grounds = case.samples, len(case.joints), case.grounds
    rms = np.sqrt(np.mean(samples.tau**2, axis=0)) + 1e-300
    daily = _daily(samples.qd, samples.run, rms)
    same = grounds.fit(as_read(n), daily)
    if np.nanmax(same.relative) < 0.06:
        return []
    candidates = list(_candidates(case))
    judged = [(_apart(case, daily, x), x) for x in candidates]
    fit, best = max(judged, key=lambda pair: pair[0].value - _costs(pair[1], runs))
    log_odds = fit.value - same.value - _costs(best, runs) + np.log(ODDS / len(candidates))
    ratio = same.relative / np.maximum(fit.relative, 1e-12)
    if log_odds < np.log(SURE / (1 - SURE)) or np.nanmax(ratio) < WORSE:
        return []
    worst = int(np.nanargmax(ratio))
    names = [Path(str(e.motion.path)).name for e in case.experiments]
    each = _each(fit, best, runs)
    odd = int(np.argmax(_distances(each)))
    which = "is the one that differs" if runs > 2 else "is further from the model's own"
    values = "; ".join(f"{best.words(x)} in {name}" for x, name in zip(each, names, strict=True))
    return [
        CheckFinding(
            "mixed",
            best.at,
            float(1 / (1 + np.exp(-min(log_odds, 50.0)))),
            f"recordings contradict each other in {best.what}: {values}; {names[odd]} {which}; fitted for each, the "
            f"error of tau.{case.joints[worst]} falls from {percent(same.relative[worst])} to "
            f"{percent(fit.relative[worst])}",
            f"# leave out {names[odd]}, or diagnose the recordings apart: snarelab compare",
        )
    ]


def _candidates(case: CheckCase) -> Iterator[OwnValue]:
    """All that may differ: of links, of torques, of encoders."""
    samples, tree, body = case.samples, case.tree, case.grounds.body
    regressor = body.regressor(samples.q, samples.qd, samples.qdd)
    spread = case.grounds.spread
    inertial, modelled = regressor @ spread, regressor @ tree.phi
    for k, link in enumerate(tree.links):
        part, rows = case.grounds.ways[k], slice(10 * k, 10 * k + 10)
        yield OwnValue(
            f"the mass properties of {link.name}",
            link.name,
            inertial[:, :, part],
            OTHER_MASS,
            lambda x, part=part, rows=rows, phi=link.phi: _masses(phi + spread[rows, part] @ (OTHER_MASS * x)),
            lambda fit, part=part: fit.parameters[part] / OTHER_MASS,
        )
    slope, _ = body.tangent(samples.q, samples.qd, samples.qdd)
    for c, joint in enumerate(case.joints):
        column, gain = np.zeros((*samples.q.shape, 1)), len(case.grounds.least) + WAYS * (c + 1) - 1
        column[:, c, 0] = modelled[:, c]
        yield OwnValue(
            f"the gain of tau.{joint}",
            f"tau.{joint}",
            column,
            OTHER_GAIN,
            lambda x: f"{1 + OTHER_GAIN * x[0]:.3g}",
            lambda fit, gain=gain: fit.parameters[[gain]] * GAIN / OTHER_GAIN,
        )
        unit = "m" if tree.joints[c].kind == "prismatic" else "rad"
        yield OwnValue(
            f"the zero of q.{joint}",
            f"q.{joint}",
            slope[:, :, [c]],
            OTHER_ZERO,
            # the joint is where its encoder says, and so much further
            lambda x, unit=unit: f"{-OTHER_ZERO * x[0]:.3g} {unit}",
        )


def _masses(phi: np.ndarray) -> str:
    """Mass and centre of a link, in words."""
    mass, com, _ = to_central(phi)
    return f"{mass:.3g} kg about ({', '.join(f'{x:.3g}' for x in com)}) m"


def _apart(case: CheckCase, daily: Columns, what: OwnValue) -> ReadingFit:
    """Fit of one arm that has another value of something in every recording."""
    run = case.samples.run
    own = np.unique(run)[-what.count(len(case.experiments)) :]
    apart = np.concatenate([what.columns * (run == r)[:, None, None] for r in own], axis=2)
    every, widths, low = daily
    k = apart.shape[2]
    beside = (
        np.concatenate([every, apart], axis=2),
        np.concatenate([widths, np.full(k, what.width)]),
        np.concatenate([low, np.full(k, -np.inf)]),
    )
    return case.grounds.fit(as_read(len(case.joints)), beside)


def _costs(what: OwnValue, runs: int) -> float:
    """What evidence counts against numbers that were fitted for each recording."""
    return 0.5 * what.columns.shape[2] * what.count(runs) * float(np.log(10.0))


def _each(fit: ReadingFit, what: OwnValue, runs: int) -> np.ndarray:
    """Amplitudes of each recording (runs, k) as differences to the model's own."""
    k, count = what.columns.shape[2], what.count(runs)
    differ = fit.parameters[-k * count :].reshape(count, k)
    return differ if what.own is None else what.own(fit) + np.vstack([np.zeros(k), differ])


def _distances(each: np.ndarray) -> np.ndarray:
    """How far each recording is from most of the others (runs,); of two, from the model."""
    middle = np.median(each, axis=0) if len(each) > 2 else np.zeros(each.shape[1])
    return np.linalg.norm(each - middle, axis=1)


def _daily(qd: np.ndarray, run: np.ndarray, rms: np.ndarray) -> Columns:
    """Columns for what may differ from day to day: viscous and Coulomb friction and a bias of each joint."""
    n, n_joints = qd.shape
    made = []
    for r in np.unique(run)[1:]:
        for j in range(n_joints):
            fast = np.sqrt(np.mean(qd[:, j] ** 2)) + 1e-300
            for values, width in (
                (qd[:, j] / fast, 0.2),
                (np.tanh(qd[:, j] / (0.02 * np.abs(qd[:, j]).max() + 1e-300)), 0.2),
                (np.ones(n), 0.1),
            ):
                column = np.zeros((n, n_joints))
                column[:, j] = np.where(run == r, values, 0.0) * width * rms[j]
                made.append(column)
    columns = np.stack(made, 2)
    return columns, np.ones(columns.shape[2]), np.full(columns.shape[2], -np.inf)


KIND = Kind("mixed", "recordings contradict each other", find=find)
