"""Gravity in another direction: a robot on a wall, on the ceiling, or on a table that is tilted."""

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading

EARTH = 9.80665
"""[m/s²]"""


def readings(case: CheckCase) -> list[Reading]:
    """Gravity along each axis, none, and along the direction that fits the torques best."""
    given = case.tree.gravity
    size = float(np.linalg.norm(given)) or EARTH
    found = [
        _pulled(case, size * axis, "gravity points along")
        for axis in (*np.eye(3), *-np.eye(3))
        if np.linalg.norm(size * axis - given) > 0.05 * size
    ]
    if given.any():
        found.append(_pulled(case, np.zeros(3), "there is no gravity:").but(rarer=-2.0))
    fitted = _fitted(case, size)
    if fitted is not None and np.linalg.norm(fitted - given) > 0.2 * size:
        found.append(_pulled(case, fitted, "gravity points along").but(free=2, rarer=-1.0))
    return found


def _pulled(case: CheckCase, gravity: np.ndarray, words: str) -> Reading:
    line = f"gravity = [{', '.join(f'{x + 0.0:.4g}' if x % 1 else f'{x + 0.0:.1f}' for x in gravity)}]"
    text = f"{words} ({', '.join(f'{x + 0.0:.3g}' for x in gravity)}) m/s²"
    return case.reading("gravity", ["gravity"], text, [line]).but(gravity=gravity)


def _fitted(case: CheckCase, size: float) -> np.ndarray | None:
    """Direction of least squares, torque being linear in gravity; beside what friction is proportional to."""
    body, s = case.grounds.body, case.samples
    none = np.zeros(3)
    still = body.torque(s.q, s.qd, s.qdd, gravity=none)
    along = [body.torque(s.q, 0 * s.qd, 0 * s.qdd, gravity=axis) for axis in np.eye(3)]
    rms = np.sqrt(np.mean(s.tau**2, axis=0)) + 1e-300
    used = case.grounds.counted > 0
    rows = []
    for j in np.flatnonzero(used):
        beside = np.column_stack([s.qd[:, j], np.sign(s.qd[:, j]), s.qdd[:, j]])
        beside = beside / (np.linalg.norm(beside, axis=0) + 1e-300)
        q, _ = np.linalg.qr(beside)
        block = np.column_stack([*(g[:, j] for g in along), (s.tau - still)[:, j]]) / rms[j]
        rows.append(block - q @ (q.T @ block))
    block = np.concatenate(rows)
    found, *_ = np.linalg.lstsq(block[:, :3], block[:, 3], rcond=1e-6)
    length = float(np.linalg.norm(found))
    return size * found / length if length > 0.3 * size else None


KIND = Kind("gravity", "gravity points another way than in the model file", readings)
