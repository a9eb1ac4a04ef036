"""The usual ways, on the same recordings: joint BIC, PySINDy on the residual, a Gaussian process, MuJoCo's sysid.

``run(folder)`` gives each one's answer in the tool's own JSON form, so that one scorer judges all.

- ``joint_bic``: forward selection over the textbook columns by the Bayesian information criterion (Schwarz 1978), the
  baseline refitted with each; noise is taken as white. Probabilities are BIC weights over what could have been chosen.
- ``pysindy``: two steps. The baseline is fitted and frozen; PySINDy's sequentially thresholded least squares (Brunton,
  Proctor and Kutz 2016), bagged, picks columns for each joint's residual; the threshold is the one that predicts the
  last quarter of the training recording best. Probabilities are inclusion frequencies (Fasel et al. 2022).
- ``gaussian_process``: each joint's residual as a smooth function of its q, qd, qdd and load. It names nothing.
- ``mujoco_sysid``: MuJoCo's own toolbox with friction, rotors and masses free (`rival_sysid`).
"""

import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rival_columns import CUTOFF, TRAVELS, Column, Recording, baseline, fixed, library, read

NAMES = ("joint_bic", "pysindy", "gaussian_process", "mujoco_sysid")
MOST = 8
"""Most effects that a rival may name."""
THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Of coefficients on columns of unit RMS, in units of the residual's RMS."""
RIDGE = 5.0
"""On columns of unit RMS over some 500 samples: a hundredth."""
BAGS = 10
POINTS = 300

Columns = Mapping[Column, NDArray]


class Task:
    """What all rivals start from: both recordings, the frozen baseline's residuals (m, J), the columns."""

    def __init__(self, folder: Path, names: tuple[str, str] = ("train.csv", "third.csv")) -> None:
        """Read, condition, fit the baseline."""
        self.train, self.hold = (read(folder, name) for name in names)
        self.library, self.library_hold = library(self.train), library(self.hold, self.train)
        self.target, self.target_hold = self.train.tau - fixed(self.train), self.hold.tau - fixed(self.hold)
        self.scale = np.ones(self.target.shape[1])
        self.travels = self._travels()
        self.base, self.base_hold = baseline(self.train, self.travels), baseline(self.hold, self.travels)
        self.scale = self._left_over(self.base)
        self.theta = self.fit(self.base)
        self.residual = self.target - self.base @ self.theta
        self.residual_hold = self.target_hold - self.base_hold @ self.theta

    def _travels(self) -> list[float]:
        """Presliding travel of every joint: each the one that leaves least on its own channel."""
        sizes = np.array([self._left_over(baseline(self.train, [t] * len(self.scale))) for t in TRAVELS])
        return [TRAVELS[i] for i in np.argmin(sizes, axis=0)]

    def _left_over(self, columns: NDArray) -> NDArray:
        """RMS (J,) of what a fit of the columns leaves of each channel."""
        return np.sqrt(np.mean((self.target - columns @ self.fit(columns)) ** 2, axis=0))

    def flat(self, columns: NDArray) -> NDArray:
        """Columns (m, J, k) of all channels as one weighted matrix (m·J, k)."""
        return (columns / self.scale[:, None]).reshape(-1, columns.shape[2])

    def fit(self, columns: NDArray) -> NDArray:
        """Coefficients (k,) of a weighted least-squares fit to the training torque."""
        return np.linalg.lstsq(self.flat(columns), (self.target / self.scale).ravel())[0]

    def answer(self, effects: list[dict[str, Any]], left: NDArray, verdict: str = "") -> dict[str, Any]:
        """In the tool's form; ``left`` (m, J) is the third recording's residual after."""
        joints = self.train.model.joints
        before, after = (np.sqrt(np.mean(x**2, axis=0)) for x in (self.residual_hold, left))
        return {
            "verdict": verdict or ("missing_physics" if effects else "adequate"),
            "effects": effects,
            "third": {f"tau.{j}": [float(b), float(a)] for j, b, a in zip(joints, before, after, strict=True)},
            "band": {"value": CUTOFF},
        }


def run(folder: Path) -> dict[str, Any]:
    """Every rival's answer on a case, by name."""
    start = time.perf_counter()
    task = Task(folder)
    found = {"joint_bic": joint_bic(task), "pysindy": pysindy(task), "gaussian_process": gaussian_process(task)}
    found["mujoco_sysid"] = mujoco_sysid(task, folder / "arm.urdf")
    return found | {"seconds": round(time.perf_counter() - start, 1)}


def joint_bic(task: Task) -> dict[str, Any]:
    """Forward selection by BIC; stops where no effect lowers it."""
    chosen, effects = selected(task)
    base, held = (
        np.concatenate([b, *(lib[key] for key in chosen)], axis=2)
        for b, lib in ((task.base, task.library), (task.base_hold, task.library_hold))
    )
    return task.answer(effects, task.target_hold - held @ task.fit(base))


def selected(task: Task) -> tuple[list[Column], list[dict[str, Any]]]:
    """Columns that forward selection by BIC takes, and the effects that they are of."""
    chosen: list[Column] = []
    effects = []
    matrix, y = task.flat(task.base), (task.target / task.scale).ravel()
    n = len(y)
    flats = {key: task.flat(columns) for key, columns in task.library.items()}
    while len(chosen) < MOST:
        basis = _basis(matrix)
        left = y - basis @ (basis.T @ y)
        rss, taken = float(left @ left), {key[:2] for key in chosen}
        gains = {}
        for key, own in flats.items():
            if key[:2] not in taken:
                fresh = _basis(own - basis @ (basis.T @ own), np.linalg.norm(own, axis=0).max())
                explained = float(np.sum((fresh.T @ left) ** 2))
                gains[key] = -n * np.log(1.0 - explained / rss) - fresh.shape[1] * np.log(n)
        best = max(gains, key=lambda key: gains[key])
        if gains[best] <= 0.0:
            break
        chosen.append(best)
        effects.append(_weighed(best, gains))
        matrix = np.concatenate([matrix, flats[best]], axis=1)
    return chosen, effects


def _weighed(best: Column, gains: Mapping[Column, float]) -> dict[str, Any]:
    """An effect with its BIC weight among all that could have been chosen; those of equal evidence are one class."""
    top: dict[tuple[str, str], float] = {}
    for (name, at, _), gain in gains.items():
        top[name, at] = max(gain, top.get((name, at), -np.inf))
    weights = {key: np.exp((gain - gains[best]) / 2.0) for key, gain in top.items()}
    total = sum(weights.values())
    rivals = [
        {"name": n, "at": at, "probability": float(w / total), "separable": bool(w < 1.0 / 3.0)}
        for (n, at), w in weights.items()
        if (n, at) != best[:2] and w > 1e-3
    ]
    return {"name": best[0], "at": best[1], "probability": float(weights[best[:2]] / total), "rivals": rivals}


def _basis(columns: NDArray, size: float = 0.0) -> NDArray:
    """Orthonormal basis of the columns; directions that are nothing beside ``size`` are left out."""
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, values > 1e-6 * max(size, values[0])]


def pysindy(task: Task) -> dict[str, Any]:
    """Each joint's residual, by PySINDy's thresholded least squares over that joint's columns."""
    left, claims = task.residual_hold.copy(), {}
    for k in range(task.residual.shape[1]):
        own, keys = _channel(task.library, k)
        size = np.sqrt(np.mean(own**2, axis=0))
        loud = size > 1e-9
        own, size, keys = own[:, loud], size[loud], [key for key, on in zip(keys, loud, strict=True) if on]
        unit = float(np.sqrt(np.mean(task.residual[:, k] ** 2)))
        x, y = own / size, task.residual[:, k] / unit
        cut = 3 * len(y) // 4
        errors = []
        for threshold in THRESHOLDS:
            coefficients = np.mean(_bagged(x[:cut], y[:cut], threshold), axis=0)
            errors.append(float(np.mean((y[cut:] - x[cut:] @ coefficients) ** 2)))
        if min(errors) >= float(np.mean(y[cut:] ** 2)):
            continue
        every = _bagged(x, y, THRESHOLDS[int(np.argmin(errors))])
        mean, often = np.mean(every, axis=0), np.mean(every != 0.0, axis=0)
        held, _ = _channel(task.library_hold, k)
        left[:, k] -= unit * (held[:, loud] / size) @ mean
        for key, share, value in zip(keys, often, mean, strict=True):
            if share > 0.5:
                claims[key[:2]] = max(claims.get(key[:2], (0.0, 0.0)), (float(share), abs(float(value))))
    order = sorted(claims, key=lambda key: claims[key], reverse=True)[:MOST]
    effects = [{"name": n, "at": at, "probability": claims[n, at][0], "rivals": []} for n, at in order]
    return task.answer(effects, left)


def _channel(columns: Columns, k: int) -> tuple[NDArray, list[Column]]:
    """All columns of one channel (m, c), and which effect each is of."""
    parts = [(x[:, k, i], key) for key, x in columns.items() for i in range(x.shape[2])]
    return np.stack([x for x, _ in parts], axis=1), [key for _, key in parts]


def _bagged(x: NDArray, y: NDArray, threshold: float) -> NDArray:
    """Coefficients (n_bags, c) of thresholded least squares on resampled rows."""
    from pysindy.optimizers import STLSQ

    rng, found = np.random.default_rng(0), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # STLSQ warns where a threshold leaves nothing, which is an answer
        for _ in range(BAGS):
            rows = rng.integers(len(y), size=len(y))
            fitted = STLSQ(threshold=threshold, alpha=RIDGE).fit(x[rows], y[rows, None])
            found.append(np.ravel(fitted.coef_))
    return np.array(found)


def gaussian_process(task: Task) -> dict[str, Any]:
    """Each joint's residual by a Gaussian process with a length scale for each input (Rasmussen and Williams 2006)."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    left = task.residual_hold.copy()
    for k in range(left.shape[1]):
        x, held = (_inputs(r, k) for r in (task.train, task.hold))
        middle, size = x.mean(axis=0), x.std(axis=0) + 1e-12
        unit = float(np.sqrt(np.mean(task.residual[:, k] ** 2)))
        rows = np.random.default_rng(k).permutation(len(x))[:POINTS]
        kernel = ConstantKernel(1.0) * RBF([1.0] * x.shape[1], (0.05, 1e3)) + WhiteKernel(0.5)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a length scale at its bound: an input that does not matter
            process = GaussianProcessRegressor(kernel).fit((x[rows] - middle) / size, task.residual[rows, k] / unit)
        left[:, k] -= unit * np.ravel(process.predict((held - middle) / size))
    return task.answer([], left, "none")


def mujoco_sysid(task: Task, urdf: Path) -> dict[str, Any]:
    """Friction, rotors and masses of every joint and link at once, by MuJoCo's toolbox."""
    from .rival_sysid import fitted

    found = fitted(urdf, task.train, task.scale)
    known = {(p.effect.name, p.at) for p in task.train.model.effects}
    return task.answer(found.effects(known), task.hold.tau - found.torque(found.model, task.hold))


def _inputs(r: Recording, k: int) -> NDArray:
    signals: Sequence[NDArray] = (r.q, r.qd, r.qdd, r.load)
    return np.stack([x[:: r.stride, k] for x in signals], axis=1)
