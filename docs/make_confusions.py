"""Which effects look alike: ``python docs/make_confusions.py`` writes ``confusions.json``, for the page of effects.

Measured along the bundled recording (a three-joint arm), with the columns that `diagnose` itself tries. For two effects
at one joint, its link or its channel: the share of the first one's torque that the second makes as well as the first,
once viscous and Coulomb friction have taken what they can (but for pairs of which one is such). Shapes stand in the
middle of the first one's grid; the second takes the best of its own. An effect that acts at a joint is not measured at
an axis of two. Effects of suspension rigs, floating bases and snares have motions of their own, and are not measured.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from snarelab.identification.identify import Identification, identify
from snarelab.identification.search.candidates import candidate_columns, library, variants
from snarelab.models.axes import neighbours
from snarelab.models.model_file import load_model

ROOT = Path(__file__).resolve().parents[1]
JSON = Path(__file__).with_name("confusions.json")
JOINTS = (1, 2)
KNOWN = ("viscous_friction", "coulomb_friction")
ALIKE = 0.8


def alike() -> dict[str, dict[str, float]]:
    """For each effect, those that make at least `ALIKE` of its torque, and the share, the larger of the joints'."""
    bundled = ROOT / "studies" / "bundled"
    found = identify(load_model(bundled / "arm3.toml"), [bundled / "train.csv"])
    assert isinstance(found, Identification)  # an arm, not captures
    assembly, (experiment,) = found.fit.assembly, found.train
    state = assembly.evaluate(experiment, found.fit.theta)
    n_joints = len(found.model.joints)
    axes = {axis.name for axis in neighbours(found.model.tree)}
    places = library(replace(found.model, effects=()))
    at_joints = {p.effect.name for p in places if p.at not in axes}
    result: dict[str, dict[str, float]] = {}
    for joint in JOINTS:
        columns: dict[str, list[np.ndarray]] = {}
        for placed in places:
            if assembly.joint_of(placed) != joint or (placed.at in axes and placed.effect.name in at_joints):
                continue
            key = placed.effect.name
            for variant in variants(assembly, placed):
                whole = np.zeros((len(experiment.measured), n_joints, max(len(variant.amplitudes), 1)))
                for channel, own in candidate_columns(assembly, experiment, state, variant):
                    whole[:, channel] += own
                columns.setdefault(key, []).append(whole.reshape(-1, whole.shape[2]))
        for one, own in columns.items():
            result.setdefault(one, {})
            for other, rivals in columns.items():
                if other == one:
                    continue
                known = [columns[k][0] for k in KNOWN if k not in (one, other)]
                left = _without(own[len(own) // 2], known)
                share = max(_explained(left, _without(rival, known)) for rival in rivals)
                if share >= ALIKE:
                    result[one][other] = max(round(share, 2), result[one].get(other, 0.0))
    return {one: dict(sorted(others.items(), key=lambda pair: -pair[1])) for one, others in sorted(result.items())}


def _without(columns: np.ndarray, known: list[np.ndarray]) -> np.ndarray:
    """Columns (n, k) with what known ones can make of them taken off, each then of unit length."""
    if known:
        basis = np.linalg.qr(np.concatenate(known, axis=1))[0]
        columns = columns - basis @ (basis.T @ columns)
    size = np.linalg.norm(columns, axis=0)
    return columns[:, size > 1e-9 * size.max(initial=0.0)] / size[size > 1e-9 * size.max(initial=0.0)]


def _explained(columns: np.ndarray, others: np.ndarray) -> float:
    """Mean share of the energy of the directions in ``columns`` that ``others`` span, 0 to 1."""
    if not columns.size or not others.size:
        return 0.0
    mine, theirs = (np.linalg.svd(x, full_matrices=False) for x in (columns, others))
    a, b = (u[:, s > 1e-6 * s[0]] for u, s, _ in (mine, theirs))
    return float(np.sum((a.T @ b) ** 2) / a.shape[1])


if __name__ == "__main__":
    JSON.write_text(json.dumps(alike(), indent=1) + "\n", encoding="utf-8")
