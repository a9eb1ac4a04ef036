"""Making the study's recordings, and sealing what they conceal: written first, opened last."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...recordings.write import write_recording
from .concealed import ConcealedCase, conceal
from .motion import DURATION, HOLDOUT, TRAIN, JointMoves, varied
from .plant import RigRecord, simulate

ANSWER = "answer.json"


def make_recordings(
    folder: Path, kind: str, seed: int, names: Sequence[str] = ("train", "holdout"), tensions: bool = False
) -> str:
    """Run the plant through its sequences.

    Leaves ``train.parquet``, ``holdout.parquet`` and ``answer.json`` in ``folder``. Seed 0 runs the sequences as
    printed; others vary targets and speeds.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    kind : str
        One of `concealed.KINDS`.
    seed : int
        Of friction, of the concealed effect, of motion and noise.
    names : sequence of str
        Which of the two recordings to make.
    tensions : bool
        Whether load cells on the slings are recorded too.

    Returns
    -------
    str
        SHA-256 of the answer.
    """
    folder.mkdir(parents=True, exist_ok=True)
    hidden = conceal(kind, seed)
    rng = np.random.default_rng([seed, 99])
    for k, (name, moves) in enumerate((("train", TRAIN), ("holdout", HOLDOUT))):
        motion = JointMoves(varied(moves, rng) if seed else moves)
        if name not in names:
            continue
        record = simulate(hidden.plant, motion, DURATION, seed=1000 * seed + k)
        write_recording(_table(record, hidden, tensions), folder / f"{name}.parquet")
    (folder / ANSWER).write_text(json.dumps(hidden.answer(), indent=1) + "\n", encoding="utf-8")
    return seal(folder)


def seal(folder: Path) -> str:
    """SHA-256 of the answer in a folder."""
    return hashlib.sha256((folder / ANSWER).read_bytes()).hexdigest()


def open_answer(folder: Path, digest: str) -> dict[str, Any]:
    """The answer; RuntimeError where it is not the one that was sealed."""
    if seal(folder) != digest:
        raise RuntimeError(f"{folder / ANSWER}: not the answer that was sealed ({digest}); run the study again")
    return json.loads((folder / ANSWER).read_text(encoding="utf-8"))


def _table(record: RigRecord, hidden: ConcealedCase, tensions: bool) -> xr.Dataset:
    columns = {}
    for k, joint in enumerate(hidden.plant.arm.joints):
        columns[f"q.{joint}"] = ("time", record.q[:, k])
        columns[f"tau.{joint}"] = ("time", record.tau[:, k])
    if tensions:
        rng = np.random.default_rng(1)
        seen = record.tension + 0.2 * rng.standard_normal(record.tension.shape)
        columns |= {
            f"tension.{u.name}": ("time", seen[:, k] + u.hardware) for k, u in enumerate(hidden.plant.arm.units)
        }
    return xr.Dataset(columns, coords={"time": record.time})
