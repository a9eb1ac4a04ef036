"""A set of cases on the disk, and what is kept apart from it: what is true, and the torque nobody was given.

``DIR`` can be handed out. ``DIR.truth`` stays with whoever scores; its SHA-256 stands in ``DIR/set.json``, so that who
was handed the cases can check later that the answers were fixed first.
"""

import csv
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snarelab.models.model_file import load_model

from ..drives.make import make as drives
from ..mujoco.make import make as mujoco
from ..played.make import make as played
from ..rival_columns import baseline, fixed, low_pass, read
from ..rivals import Task
from .rules import rules, vocabulary

Tell = Callable[[str], None]

GIVEN = {"train.csv": "fit.csv", "hold.csv": "confirm.csv", "arm.urdf": "arm.urdf"}
"""Files of a drawn case, and their names in the set."""


@dataclass(frozen=True)
class CaseSet:
    """Where a set lies. Raises ValueError, with what to do, where it is none, or is not the one that was sealed."""

    folder: Path

    @property
    def truth_folder(self) -> Path:
        """Beside the set: true effects of each case, and the measured torque of its last recording."""
        return self.folder.with_name(self.folder.name + ".truth")

    def names(self) -> list[str]:
        """Numbers of all cases."""
        return list(self._about()["cases"])

    def case(self, name: str) -> Path:
        """Folder of a case."""
        return self.folder / "cases" / name

    def truths(self) -> Mapping[str, Any]:
        """What is true of each case, by its number."""
        path = self.truth_folder / "truths.json"
        if not path.exists():
            raise ValueError(f"{path} is not there; only who made the set can score it: python -m proof export")
        text = path.read_bytes()
        if hashlib.sha256(text).hexdigest() != self._about()["truth_sha256"]:
            raise ValueError(f"{path} is not what {self.folder / 'set.json'} was sealed with; export the set anew")
        return json.loads(text)

    def torque(self, name: str) -> dict[str, NDArray]:
        """Measured torque of the last recording (n,) by channel."""
        return columns(self.truth_folder / "torque" / f"{name}.csv")

    def _about(self) -> dict[str, Any]:
        path = self.folder / "set.json"
        if not path.exists():
            raise ValueError(f"{self.folder} holds no cases; write some: python -m proof export {self.folder} --seed N")
        return json.loads(path.read_text(encoding="utf-8"))


GENERATORS = {"drives": drives, "played": played, "mujoco": mujoco}


def export(folder: Path, seed: int, count: int, tell: Tell = print, generator: str = "drives") -> CaseSet:
    """Draw cases and write them without answers.

    Parameters
    ----------
    folder : Path
        New or empty, or an export of the same seed and count that was stopped, which goes on.
    seed, count : int
        Of the generator, and how many.
    tell : callable
        Told of each case.
    generator : "drives" or "played"
        Who draws them.

    Raises
    ------
    ValueError
        ``folder`` holds another set.
    """
    made = CaseSet(folder)
    drawn = GENERATORS[generator](made.truth_folder / "drawn", seed, count, tell=tell)
    mark = folder / "set.json"
    if mark.exists() and json.loads(mark.read_text())["cases"] != [path.name for path in drawn]:
        raise ValueError(f"{folder} holds another set of cases; give another folder")
    truths = {}
    for k, path in enumerate(drawn, 1):
        truths[path.name] = _write(path, made)
        tell(f"written {k}/{len(drawn)}: {made.case(path.name)}")
    text = json.dumps(truths, indent=1, sort_keys=True) + "\n"
    (made.truth_folder / "truths.json").write_text(text, encoding="utf-8")
    (folder / "RULES.md").write_text(rules(), encoding="utf-8")
    (folder / "vocabulary.json").write_text(json.dumps(vocabulary(), indent=1) + "\n", encoding="utf-8")
    about = {"cases": list(truths), "truth_sha256": hashlib.sha256(text.encode()).hexdigest()}
    mark.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    return made


def _write(drawn: Path, made: CaseSet) -> dict[str, Any]:
    """One case into the set, its last torque apart from it; what is true of it, with the textbook baseline's error."""
    case, name = made.case(drawn.name), drawn.name
    case.mkdir(parents=True, exist_ok=True)
    for own, given in GIVEN.items():
        (case / given).write_bytes((drawn / own).read_bytes())
    text = (drawn / "arm.toml").read_text(encoding="utf-8")
    (case / "arm.toml").write_text(text, encoding="utf-8")
    model = load_model(drawn / "arm.toml")
    plain = {
        "joints": list(model.joints),
        "known_physics": [{"name": p.effect.name, "at": p.at} for p in model.effects],
        "gravity": [0.0, 0.0, -9.81],
    }
    (case / "case.json").write_text(json.dumps(plain, indent=1) + "\n", encoding="utf-8")
    last = columns(drawn / "third.csv")
    (made.truth_folder / "torque").mkdir(parents=True, exist_ok=True)
    write(made.truth_folder / "torque" / f"{name}.csv", {k: x for k, x in last.items() if k.startswith("tau.")})
    write(case / "predict.csv", {k: x for k, x in last.items() if not k.startswith("tau.")})
    truth = json.loads((drawn / "truth.json").read_text(encoding="utf-8"))
    return truth | {"baseline_rms": _baseline_rms(drawn)}


def _baseline_rms(drawn: Path) -> dict[str, float]:
    """RMS by channel that a least-squares fit of the known physics leaves of the last recording's torque, in band."""
    task, last = Task(drawn), read(drawn, "third.csv")
    left = last.tau - fixed(last) - baseline(last, task.travels) @ task.theta
    return {f"tau.{j}": float(np.sqrt(np.mean(left[:, k] ** 2))) for k, j in enumerate(last.model.joints)}


def columns(path: Path) -> dict[str, NDArray]:
    """Columns of a CSV with a header; raises ValueError where it is none."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            heads = next(csv.reader(file))
            table = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, StopIteration, ValueError) as error:
        raise ValueError(f"{path} is no CSV file of numbers with a header: {error}") from None
    if table.shape[1] != len(heads):
        raise ValueError(f"{path} has {len(heads)} names and {table.shape[1]} columns; give each column one name")
    return dict(zip(heads, table.T, strict=True))


def write(path: Path, given: Mapping[str, NDArray]) -> None:
    """A CSV with a header."""
    table = np.column_stack(list(given.values()))
    np.savetxt(path, table, "%.9g", ",", header=",".join(given), comments="")


def in_band(torque: Sequence[float] | NDArray, time: NDArray) -> NDArray:
    """A torque (n,) below the band's edge, as errors are compared."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    return low_pass(np.asarray(torque, float), rate)
