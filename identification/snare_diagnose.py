"""``diagnose``, ``identify`` and ``simulate`` for captures: ``system = "snare_capture"``."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError
from ..models.model import Model
from ..models.snare.setup import SnareTree
from .diagnosis import Diagnosis
from .snare_answer import estimates, report_on, with_found
from .snare_channels import misfits
from .snare_fit import Fit, evaluate, fit, key_of, normal, started, values_of, with_slopes
from .snare_library import start_of
from .snare_recording import ON_TARGET, Capture, load_captures, sensed_by
from .snare_runs import Runs
from .snare_search import demand, search

SAMPLE = 0.01
"""[s] Between the rows of a simulated recording."""
DURATION = 10.0
"""[s] Of a simulated capture without a motion: the paper's."""


def workers() -> int:
    """Processes for the simulations: what SNARELAB_JOBS says, else one a core, at most four."""
    given = os.environ.get("SNARELAB_JOBS", "")
    return max(1, int(given)) if given.isdigit() else max(1, min(4, os.cpu_count() or 1))


def diagnose_captures(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path,
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
    jobs: int | None = None,
) -> tuple[Diagnosis, Model]:
    """Find, name, add and confirm the physics that a capture's model leaves out.

    Parameters
    ----------
    model : Model
        Of a capture.
    recordings : sequence of path
    holdout : path
        Looked at for the proof only.
    progress : callable
    seed : int
        Of the bootstrap.
    jobs : int or None
        Processes; None: `workers`.

    Returns
    -------
    the diagnosis, and the model with what it found

    Raises
    ------
    InputError
        Whatever is wrong with a recording, or a model that cannot be simulated from where it starts.
    """
    begun = time.monotonic()
    progress("reading the recordings")
    captures = load_captures(model, [*recordings, holdout])
    train, locked = list(range(len(captures) - 1)), [len(captures) - 1]
    if not all(c.sensors.keys() == captures[0].sensors.keys() for c in captures):
        raise InputError(f"{captures[-1].path}: its force sensors are not those of {captures[0].path}; give the same")
    with Runs(captures, jobs or workers()) as runs:
        captures = _sensed(model, runs, captures)
        found = search(model, runs, captures, train, locked, progress=progress, seed=seed)
        count = runs.count
    own, apart = [captures[n] for n in train], [captures[n] for n in locked]
    diagnosis = report_on(model, found, own, apart, time.monotonic() - begun, count)
    return diagnosis, with_found(model, found.last)


def _sensed(model: Model, runs: Runs, captures: Sequence[Capture]) -> list[Capture]:
    """Each capture with its sensor where its sign says, in a simulation of the model as it comes."""
    values = values_of(model.effects, start_of(model, model.effects))
    tracks = runs([(n, values) for n in range(len(captures))])
    return [sensed_by(c, track) for c, track in zip(captures, tracks, strict=True)]


@dataclass(frozen=True)
class IdentifiedCaptures:
    """A fit of captures, the model with its values, and the recordings."""

    model: Model
    fit: Fit
    train: tuple[Capture, ...]
    holdout: tuple[Capture, ...]
    held: Fit | None

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        made = estimates(self.train, self.fit)
        parameters = [
            {
                "effect": p.effect.name,
                "at": p.at,
                "name": name,
                "value": e.value,
                "std": e.std if np.isfinite(e.std) else None,
                "unit": e.unit,
                "at_bound": e.at_bound,
                "identifiable": bool(np.isfinite(e.std)),
            }
            for p in self.fit.placed
            for name, e in made[p.key].items()
        ]
        fits: dict[str, Any] = {}
        for role, captures, found in (("train", self.train, self.fit), ("holdout", self.holdout, self.held)):
            if found is not None:
                for name, unit, left, size in misfits(captures, found):
                    entry = fits.setdefault(name, {})
                    entry[role] = {"rms": float(left), "relative": float(left / max(size, 1e-12))}
                    entry["unit"] = unit
        matrix = normal(self.train, self.fit)[1] if len(self.fit.x) else np.eye(1)
        notes = [f"{Path(c.path).name}: {note}" for c in (*self.train, *self.holdout) for note in c.notes]
        return {
            "model": self.model.name,
            "parameters": parameters,
            "fit": fits,
            "condition": float(min(np.linalg.cond(matrix), 1e300)),
            "notes": notes,
        }


def identify_captures(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: Sequence[str | Path] = (),
    *,
    progress: Callable[[str], None] = lambda _: None,
    jobs: int | None = None,
) -> IdentifiedCaptures:
    """Fit every parameter of a capture's effects; arguments and errors as `diagnose_captures`."""
    progress("reading the recordings")
    captures = load_captures(model, [*recordings, *holdout])
    n = len(recordings)
    with Runs(captures, jobs or workers()) as runs:
        progress("fitting the effects' parameters with the simulation in the loop")
        captures = _sensed(model, runs, captures)
        start = started(runs, captures, range(n), model.effects, start_of(model, model.effects))
        demand(model, start)
        found = with_slopes(runs, captures, range(n), fit(runs, captures, range(n), start, most=8))
        held = evaluate(runs, captures, range(n, len(captures)), found.placed, [found.x])[0] if holdout else None
    return IdentifiedCaptures(with_found(model, found), found, tuple(captures[:n]), tuple(captures[n:]), held)


def simulate_capture(model: Model, motion: str | Path | None = None) -> xr.Dataset:
    """A capture by a model with values, as a recording.

    Parameters
    ----------
    model : Model
        With a value for every effect's parameter.
    motion : path or None
        Recording that gives the ring's angle and the target's pose at the start; None: those of the model, for 10 s.

    Returns
    -------
    xarray.Dataset
        ``angle.ring``, ``pos quat vel omega`` of the target, ``force`` on target and on the end effector's root
        (``ring``), averaged since the row before, ``torque.ring``; every 10 ms.

    Raises
    ------
    InputError
        A parameter without a value, or whatever is wrong with the recording.
    """
    from ..models.snare.model import SnareModel, SnareStepError

    assert isinstance(model.tree, SnareTree)
    missing = [key_of(p) for p in model.effects if key_of(p) not in model.values]
    if missing:
        raise InputError(
            f"{model.path}: no value for {missing[0]!r} ({len(missing)} missing); "
            f"write it under [parameters], or let 'snarelab identify --save-model' do it"
        )
    setup, drive, duration, zero, body, sensor = model.tree.setup, None, DURATION, 0.0, "target", "ring"
    if motion is not None:
        (given,) = load_captures(model, [motion])
        setup, drive, duration, zero, body = given.setup, given.drive, float(given.times[-1]), given.zero, given.body
        sensor = given.sensors.get("effector", sensor)
    setup = setup.with_values({key_of(p): model.values[key_of(p)] for p in model.effects})
    try:
        history = SnareModel(setup.parameters, setup.target, drive=drive).run(duration, every=SAMPLE)
    except SnareStepError as fault:
        raise InputError(f"{model.path}: the capture cannot be simulated: {fault}") from None
    vectors = {
        f"pos.{body}": history.target_position,
        f"vel.{body}": history.target_velocity,
        f"omega.{body}": history.target_angular_velocity,
        f"force.{sensor}": history.mean_force,
        f"torque.{sensor}": history.torque,
        f"force.{ON_TARGET[0]}": history.mean_pin_force,
    }
    columns = {f"{name}.{a}": x[:, i] for name, x in vectors.items() for i, a in enumerate("xyz")}
    columns |= {f"quat.{body}.{a}": history.target_quaternion[:, i] for i, a in enumerate("wxyz")}
    columns["angle.ring"] = history.ring_angle
    variables = {name: ("time", np.ascontiguousarray(x)) for name, x in columns.items()}
    attributes = {"path": str(motion or model.path), "notes": []}
    return xr.Dataset(variables, coords={"time": history.times + zero}, attrs=attributes)
