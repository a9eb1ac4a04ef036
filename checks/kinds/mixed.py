"""Recordings that contradict each other: one arm cannot have made both."""

from pathlib import Path
from typing import TypeAlias

import numpy as np

from ..case import Case
from ..compete import ODDS, SURE
from ..evidence import Fitted
from ..finding import Finding, Kind
from ..reading import as_read

WORSE = 1.5
"""Least ratio of relative residuals, on the channel that shows it best, of one arm and of two."""


Best: TypeAlias = tuple[float, Fitted, str, str]
"""Log odds but for the prior's, the fit, what differs, and where."""

Columns: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Columns (n, J, k), their widths and lower bounds (k,)."""


def find(case: Case) -> list[Finding]:
    """Links whose mass properties, and torques whose gain, are not the same in all recordings.

    Friction and biases may differ from day to day; they are fitted for each recording in both.
    """
    runs = len(case.experiments)
    if runs < 2 or not case.comparable:
        return []
    samples, n = case.samples, len(case.joints)
    grounds = case.grounds
    own = grounds.body.regressor(samples.q, samples.qd, samples.qdd)
    rms = np.sqrt(np.mean(samples.tau**2, axis=0)) + 1e-300
    daily = _daily(samples.qd, samples.run, rms)
    same = grounds.fit(as_read(n), daily)
    if np.nanmax(same.relative) < 0.06:
        return []
    best = None
    inertial = own @ grounds.spread
    for k, link in enumerate(case.tree.links):
        columns = inertial[:, :, 7 * k : 7 * k + 7]
        best = _better(best, case, same, daily, columns, 3.0, f"the mass properties of {link.name}", link.name)
    for c in range(n):
        column = np.zeros((len(samples.q), n, 1))
        column[:, c, 0] = own[:, c] @ case.tree.phi
        best = _better(
            best, case, same, daily, column, 1.0, f"the gain of tau.{case.joints[c]}", f"tau.{case.joints[c]}"
        )
    if best is None:
        return []
    odds, fit, what, at = best
    candidates = len(case.tree.links) + n
    log_odds = odds + np.log(ODDS / candidates)
    ratio = same.relative / np.maximum(fit.relative, 1e-12)
    if log_odds < np.log(SURE / (1 - SURE)) or np.nanmax(ratio) < WORSE:
        return []
    worst = int(np.nanargmax(ratio))
    names = [Path(str(e.motion.path)).name for e in case.experiments]
    sizes = _distance(fit.parameters, runs, len(fit.parameters))
    odd = names[int(np.argmax(sizes))] if runs > 2 else f"{names[0]} and {names[1]}"
    which = f"; {odd} is the one that differs" if runs > 2 else f": {odd}"
    return [
        Finding(
            "mixed",
            at,
            float(1 / (1 + np.exp(-min(log_odds, 50.0)))),
            f"recordings contradict each other in {what}{which}; fitted for each, the error of "
            f"tau.{case.joints[worst]} falls from {100 * same.relative[worst]:.3g} % to "
            f"{100 * fit.relative[worst]:.2g} %",
            f"# leave out {odd.partition(' and ')[2] or odd}, or diagnose the recordings apart: snarelab compare",
        )
    ]


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


def _better(
    best: Best | None, case: Case, same: Fitted, daily: Columns, columns: np.ndarray, width: float, what: str, at: str
) -> Best:
    """The better of the best so far and one arm whose columns have other amplitudes in every recording."""
    run = case.samples.run
    apart = np.concatenate([columns * (run == r)[:, None, None] for r in np.unique(run)[1:]], axis=2)
    every, widths, low = daily
    k = apart.shape[2]
    beside = (
        np.concatenate([every, apart], axis=2),
        np.concatenate([widths, np.full(k, width)]),
        np.concatenate([low, np.full(k, -np.inf)]),
    )
    fit = case.grounds.fit(as_read(len(case.joints)).but(free=0), beside)
    odds = fit.value - same.value - 0.5 * k * np.log(10.0)
    return (odds, fit, what, at) if best is None or odds > best[0] else best


def _distance(parameters: np.ndarray, runs: int, n: int) -> np.ndarray:
    """How far each recording is from the first (runs,), by its own amplitudes at the end of the list."""
    each = 7 if n >= 7 * (runs - 1) else 1
    own = parameters[-each * (runs - 1) :].reshape(runs - 1, -1)
    middle = np.median(np.vstack([np.zeros(own.shape[1]), own]), axis=0)
    return np.linalg.norm(np.vstack([np.zeros(own.shape[1]), own]) - middle, axis=1)


KIND = Kind("mixed", "recordings contradict each other", find=find)
