"""``snarelab identify``: every parameter of a model from recordings, with its standard deviation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..models.floating.tree import channel
from ..models.inertia import Array
from ..models.model import Model
from ..models.rigid_body import RigidBody
from .checks.finding import CheckFinding
from .checks.run import early_checks, run_checks
from .fitting.assembly import TorqueModel
from .fitting.base_parameters import INERTIAL, BaseParameters, base_parameters
from .fitting.consistent_inertia import ConsistentInertia, consistent_inertia
from .fitting.constants import notes_on, settled, with_constants
from .fitting.experiment import Experiment, load_experiments, scales, with_silence
from .fitting.fit import Fit, channel_rms, fit
from .fitting.friction_curve import friction_curves, identifiable
from .fitting.held_out import demand_apart
from .fitting.recorded import read_all, with_recorded_joints
from .simulated import SimulatedIdentification, demand_one_process, simulated_kind


@dataclass(frozen=True)
class Identification:
    """A fit, the model with its values, and the recordings.

    ``inertia`` holds the physically consistent links where inertia was identified; ``base`` what was identified.
    """

    model: Model
    fit: Fit
    train: tuple[Experiment, ...]
    holdout: tuple[Experiment, ...]
    base: BaseParameters | None
    inertia: ConsistentInertia | None
    checks: tuple[CheckFinding, ...] = ()
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        found = self.fit
        combination = {} if self.base is None else {f"inertia.{n[0]}.{n[1]}": n[2] for n in self.base.names}
        parameters = [
            {
                "effect": s.effect,
                "at": s.at,
                "name": s.name,
                "value": float(value),
                "std": float(std) if np.isfinite(std) else None,
                "unit": s.unit,
                "at_bound": bool(bound),
                "identifiable": bool(carried),
            }
            | ({"combination": combination[s.key]} if s.key in combination else {})
            for s, value, std, bound, carried in zip(
                found.assembly.slots, found.theta, found.std, found.at_bound, identifiable(found), strict=True
            )
        ]
        fits: dict[str, Any] = {}
        for role, experiments in (("train", self.train), ("holdout", self.holdout)):
            if experiments:
                rms, measured = channel_rms(found.assembly, experiments, found.theta)
                for c, (joint, r, m) in enumerate(zip(self.model.tree.joints, rms, measured, strict=True)):
                    entry = fits.setdefault(channel(self.model.tree, c), {})
                    entry[role] = {"rms": float(r), "relative": float(r / m)}
                    entry["unit"] = "N" if joint.kind == "prismatic" else "N*m"
        answer: dict[str, Any] = {
            "model": self.model.name,
            "checks": [c.to_json() for c in self.checks],
            "parameters": parameters,
            "fit": fits,
            "condition": found.condition,
            "band": {"value": self.train[0].motion.band, "unit": "Hz"},
            "starts": {"tried": found.starts, "agreed": found.agreed},
            "notes": [
                *self.model.tree.notes,
                *self.notes,
                *(
                    f"{Path(e.motion.path).name}: {note}"
                    for e in (*self.train, *self.holdout)
                    for note in e.motion.notes
                ),
            ],
        }
        curves = friction_curves(found, self.train)
        if curves:
            answer["curves"] = [c.to_json() for c in curves]
        if self.inertia is not None:
            answer["inertia"] = {
                "physical": not self.inertia.changed,
                "links": {
                    link.name: dict(zip(INERTIAL, map(float, phi), strict=True))
                    for link, phi in zip(self.model.tree.links, self.inertia.phi.reshape(-1, 10), strict=True)
                },
            }
        return answer


def identify(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: Sequence[str | Path] = (),
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
    jobs: int | None = None,
) -> "Identification | SimulatedIdentification":
    """Fit all parameters of a model to all recordings jointly.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
    holdout : sequence of path
        Recordings on which the fit is only evaluated.
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of the random starts.
    jobs : int or None
        Processes in which captures are simulated; None: one a core, at most four. For captures only.

    Raises
    ------
    InputError
        Whatever is wrong with a recording, effects that the identified inertia already holds, or ``jobs`` for another
        system.
    """
    for recording in holdout:
        demand_apart(recordings, recording)
    simulated = simulated_kind(model.tree)
    if simulated is not None:
        return simulated.identify(model, recordings, holdout, progress=progress, jobs=jobs)
    demand_one_process(model, jobs)
    progress("reading and conditioning the recordings")
    read = read_all(model, [*recordings, *holdout])
    model = with_recorded_joints(model, read)
    body = RigidBody(model.tree)
    checks = early_checks(model, read)
    try:
        model, read, said = with_constants(model, read, len(recordings))
        fitted, held = read[: len(recordings)], read[len(recordings) :]
        train = with_silence(load_experiments(model, recordings, body, datasets=fitted))
    except InputError as error:
        raise InputError(f"{error}; {checks[0].message}: {checks[0].mend}" if checks else error) from None
    band = min(e.motion.band for e in train)
    locked = with_silence(load_experiments(model, holdout, body, band, datasets=held)) if holdout else []
    checks = run_checks(model, read, [*train, *locked], checks, progress)
    base = base_parameters(body) if model.inertia == "free" else None
    assembly = TorqueModel(model.tree, model.effects, base, scales(train), model.values)
    found = fit(assembly, train, progress=progress, seed=seed)
    found, inertia = physical(found, train)
    values = {**model.values, **assembly.values(found.theta), **inertial_values(model, inertia)}
    model = settled(replace(model, values=values))
    notes = (*said, *notes_on(found))
    return Identification(model, found, tuple(train), tuple(locked), base, inertia, checks, notes)


def physical(found: Fit, experiments: Sequence[Experiment]) -> tuple[Fit, ConsistentInertia | None]:
    """Make an identified inertia one that bodies can have; where that changes it, fit all the rest again beside it."""
    assembly = found.assembly
    if assembly.base is None:
        return found, None
    n = len(assembly.base.names)
    information = np.linalg.pinv(found.covariance[:n, :n], hermitian=True)
    nearest = consistent_inertia(assembly.base, found.theta[:n], information, assembly.phi)
    if not nearest.changed:
        return found, nearest
    held = TorqueModel(assembly.tree, assembly.placed, assembly.base, assembly.scales, assembly.values(found.theta))
    held.low[:n] = held.high[:n] = nearest.beta_consistent
    start: Array = np.concatenate([nearest.beta_consistent, found.theta[n:]])
    again = fit(held, experiments, start=start, multi_start=False)
    return replace(again, std=np.concatenate([found.std[:n], again.std[n:]])), nearest


def inertial_values(model: Model, inertia: ConsistentInertia | None) -> dict[str, float]:
    """Links' inertial parameters by key, for a model file."""
    if inertia is None:
        return {}
    return {
        f"inertia.{link.name}.{name}": float(value)
        for link, phi in zip(model.tree.links, inertia.phi.reshape(-1, 10), strict=True)
        for name, value in zip(INERTIAL, phi, strict=True)
    }
