"""What real machines leave unexplained: torque of recordings beside all that a regression finds in their motion.

Each recording's torque is regressed on what its motion could have caused: accelerations, speeds, friction over speed
and place, gravity as sines of the angles and of their sums, products of two speeds. What is left has the noise, the
wander, the steps of the current's reading and the servo's ringing of a real drive. It is played back on another arm as
it is, but for its size, its direction and where it starts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, resample_poly, sosfiltfilt

RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "recordings"
EMPS_FORCE = 35.15
"""Of the controller's output [N/V] (Janot, Gautier and Brunot 2019)."""

BAND, LOUDEST = 15.0, 4.0
"""Hz; times the RMS below it."""

PLACES = 12
"""Levels of friction over the travel, of either direction."""


@dataclass(frozen=True, eq=False)
class Residual:
    """What was left of one channel: ``runs`` of RMS 1 (n,), one a recording, sampled at ``rate`` [Hz]."""

    machine: str
    rate: float
    runs: tuple[NDArray, ...]


@cache
def residuals() -> tuple[Residual, ...]:
    """All channels of all machines whose recordings are there; none where there are no recordings."""
    found: list[Residual] = []
    for machine, read in MACHINES.items():
        if (RECORDINGS / machine).exists():
            rate, runs = read(RECORDINGS / machine)
            left = [unexplained(q, tau, rate) for q, tau in runs]
            for k in range(left[0].shape[1]):
                parts = tuple(x[:, k] / np.sqrt(np.mean(x[:, k] ** 2)) for x in left)
                found.append(Residual(f"{machine} {k + 1}", rate, parts))
    return tuple(found)


def unexplained(q: NDArray, tau: NDArray, rate: float) -> NDArray:
    """What a regression on the motion leaves of torques (n, J); positions (n, J)."""
    low = butter(3, min(20.0, 0.3 * rate), fs=rate, output="sos")
    q = np.asarray(sosfiltfilt(low, q, axis=0))
    qd = np.gradient(q, 1.0 / rate, axis=0)
    qdd = np.gradient(qd, 1.0 / rate, axis=0)
    peak = np.abs(qd).max(axis=0) + 1e-12
    shared = [np.ones(len(q)), np.linspace(-1.0, 1.0, len(q))]
    J = q.shape[1]
    for first in range(J):
        angle = np.zeros(len(q))
        for k in range(first, J):
            angle = angle + q[:, k]
            shared += [np.sin(angle), np.cos(angle)]
    shared += list(qdd.T) + [qd[:, i] * qd[:, j] for i, j in combinations_with_replacement(range(J), 2)]
    made = np.empty_like(tau)
    for k in range(J):
        v = qd[:, k] / peak[k]
        own = [v, v * np.abs(v), *(np.tanh(v / s) for s in (0.003, 0.02, 0.1)), np.abs(v)]
        edges = np.quantile(q[:, k], np.linspace(0.0, 1.0, PLACES + 1)[1:-1])
        place = np.searchsorted(edges, q[:, k])
        for p in range(PLACES):
            own += [(place == p) * np.tanh(v / 0.02), (place == p) * 1.0]
        x = np.stack([*shared, *own], axis=1)
        x = x / (np.sqrt(np.mean(x**2, axis=0)) + 1e-12)
        made[:, k] = tau[:, k] - x @ np.linalg.lstsq(x, tau[:, k], rcond=1e-8)[0]
    return made


def play(residual: Residual, run: int, rate: float, count: int, rng: np.random.Generator) -> NDArray:
    """A stretch (count,) of a residual at another rate [Hz]; run backwards at its ends where it is too short.

    Its RMS below `BAND` is 1, or that of all of it is `LOUDEST`: real torque is mostly louder above, where no law is.
    """
    x = residual.runs[run % len(residual.runs)]
    up, down = round(rate), round(residual.rate)
    x = np.asarray(resample_poly(x, up, down)) if up != down else x
    there = np.concatenate([x, x[::-1]])
    start = int(rng.integers(len(there)))
    own = there[(start + np.arange(count)) % len(there)] * rng.choice([-1.0, 1.0])
    low = np.asarray(sosfiltfilt(butter(4, BAND, fs=rate, output="sos"), own))
    return own / max(rms(low), rms(own) / LOUDEST)


def rms(x: NDArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def _emps(folder: Path) -> tuple[float, list[tuple[NDArray, NDArray]]]:
    runs = []
    for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"):
        m = loadmat(folder / name, squeeze_me=True)
        force = EMPS_FORCE * m["vir"] + m.get("pulses_N", 0.0)
        runs.append((m["qm"][:, None], np.asarray(force)[:, None]))
    return 1000.0, runs


def _kuka(folder: Path) -> tuple[float, list[tuple[NDArray, NDArray]]]:
    runs = []
    for name in "ABC":
        r = loadmat(folder / f"run_{name}.mat", squeeze_me=True, simplify_cells=True)["rec"]
        runs.append((np.deg2rad(r["act_pos_mot_deg"]).T, np.asarray(r["act_torque_abs_nm"], float).T))
    return 250.0, runs


def _tx40(folder: Path) -> tuple[float, list[tuple[NDArray, NDArray]]]:
    q, tau = (np.loadtxt(folder / f"{x}.csv", delimiter=",", skiprows=1) for x in ("pos_read_data", "curr_data"))
    q, tau = (np.asarray(resample_poly(x, 1, 10, axis=0)) for x in (np.deg2rad(q), tau))
    half = len(q) // 2
    return 500.0, [(q[:half], tau[:half]), (q[half:], tau[half:])]


def _cart(folder: Path) -> tuple[float, list[tuple[NDArray, NDArray]]]:
    runs = []
    for path in sorted(folder.glob("*/*.csv")):
        t = np.loadtxt(path, delimiter=",")
        time = np.arange(t[0, 0], t[-1, 0], 1.0 / 150.0)
        once = np.concatenate([[True], np.diff(t[:, 0]) > 0])
        runs.append(tuple(np.interp(time, t[once, 0], t[once, c])[:, None] for c in (2, 1)))
    return 150.0, runs


Read = Callable[[Path], tuple[float, Sequence[tuple[NDArray, NDArray]]]]
MACHINES: dict[str, Read] = {"emps": _emps, "kuka_kr300": _kuka, "tx40": _tx40, "cart": _cart}
