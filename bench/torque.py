"""Time of inverse dynamics a sample: ours in C and in CasADi's machine, pinocchio and Drake from Python.

``python bench/torque.py [RESULT.json]``. One arm, one motion, one thread, bare and in ten slings of constant tension.
The engines take turns within each repetition, and figures are medians over the repetitions, of ratios too, so that a
busy machine slows all alike. Every engine must give the same torque within 1e-9, or nothing is reported.

A sling of constant tension T on a point of a link is a point mass -T/g that has weight and no inertia: ours adds a
second torque, at rest, with those masses for parameters.
"""

import os
import platform
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pinocchio as pin
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from bench.results import write_result
from snarelab.models.inertia import Array, from_central
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Tree
from snarelab.models.urdf import load_urdf

N_JOINTS, N_SAMPLES, N_SLINGS, REPETITIONS = 7, 20_000, 10, 7
GRAVITY = np.array([0.0, 0.0, -9.81])
Run = Callable[[Array, Array, Array], Array]


def arm(rng: np.random.Generator) -> str:
    """URDF of a serial arm with turned joint frames and full inertias."""
    text = '<link name="base"/>'
    for i in range(1, N_JOINTS + 1):
        points = rng.normal(size=(6, 3)) * 0.2
        matrix = np.sum([p @ p * np.eye(3) - np.outer(p, p) for p in points], axis=0)
        tensor = " ".join(
            f'{key}="{value}"'
            for key, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), matrix[np.triu_indices(3)], strict=True)
        )
        com, origin, turn = (" ".join(map(str, rng.uniform(-s, s, 3))) for s in (0.3, 0.6, 3.0))
        text += (
            f'<link name="link{i}"><inertial><origin xyz="{com}"/><mass value="{rng.uniform(5, 20)}"/>'
            f'<inertia {tensor}/></inertial></link><joint name="joint{i}" type="revolute">'
            f'<parent link="{f"link{i - 1}" if i > 1 else "base"}"/><child link="link{i}"/>'
            f'<origin xyz="{origin}" rpy="{turn}"/><axis xyz="0 0 1"/>'
            '<limit lower="-99" upper="99" velocity="99" effort="9999"/></joint>'
        )
    return f'<robot name="arm">{text}</robot>'


def ours(tree: Tree) -> Run:
    """Torque in one call for all samples."""
    body = RigidBody(tree)
    return lambda q, qd, qdd: body.torque(q, qd, qdd)


def ours_in_machine(tree: Tree) -> Run:
    """Torques in CasADi's virtual machine."""
    os.environ["SNARELAB_CC"] = "none"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = ours(tree)
        run(*np.zeros((3, 1, N_JOINTS)))
    del os.environ["SNARELAB_CC"]
    return run


def ours_in_slings(tree: Tree, slings: list[tuple[int, Array, float]]) -> Run:
    """Torque less the slings', which are the weight of negative masses."""
    body, lift = RigidBody(tree), np.zeros((N_JOINTS, 10))
    for link, point, tension in slings:
        lift[link] -= from_central(tension / -GRAVITY[2], point, np.zeros((3, 3)))

    def run(q: Array, qd: Array, qdd: Array) -> Array:
        rest = np.zeros_like(q)
        return body.torque(q, qd, qdd) + body.torque(q, rest, rest, phi=lift.ravel())

    return run


def pinocchio_loop(text: str) -> Run:
    """A Python loop over pinocchio's rnea."""
    engine: Any = pin
    model = engine.buildModelFromXML(text)
    model.gravity = engine.Motion(GRAVITY, np.zeros(3))
    data, rnea = model.createData(), engine.rnea

    def run(q: Array, qd: Array, qdd: Array) -> Array:
        tau = np.empty_like(q)
        for k in range(len(q)):
            tau[k] = rnea(model, data, q[k], qd[k], qdd[k])
        return tau

    return run


def drake_loop(text: str, slings: list[tuple[int, Array, float]]) -> Run:
    """A Python loop over Drake's inverse dynamics, with gravity and the slings as external forces."""
    plant: Any = MultibodyPlant(0.0)
    spatial_force: Any = SpatialForce
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetBodyByName("base").body_frame())
    plant.mutable_gravity_field().set_gravity_vector(GRAVITY)
    plant.Finalize()
    context, forces, world = plant.CreateDefaultContext(), MultibodyForces(plant), plant.world_frame()
    hung = [
        (plant.GetBodyByName(f"link{link + 1}"), point, spatial_force(np.zeros(3), np.array([0.0, 0.0, tension])))
        for link, point, tension in slings
    ]

    def run(q: Array, qd: Array, qdd: Array) -> Array:
        tau = np.empty_like(q)
        for k in range(len(q)):
            plant.SetPositions(context, q[k])
            plant.SetVelocities(context, qd[k])
            plant.CalcForceElementsContribution(context, forces)
            for body, point, force in hung:
                arm_in_world = plant.EvalBodyPoseInWorld(context, body).rotation().matrix() @ point
                body.AddInForce(context, arm_in_world, force, world, forces)
            tau[k] = plant.CalcInverseDynamics(context, qdd[k], forces)
        return tau

    return run


def microseconds(run: Run, motion: Array) -> float:
    """Wall time a sample."""
    start = time.perf_counter()
    run(*motion)
    return (time.perf_counter() - start) / motion.shape[1] * 1e6


def main() -> int:
    """Run, compare, print and write; 1 where the engines disagree."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/torque.json")
    rng = np.random.default_rng(7)
    text, motion = arm(rng), rng.normal(size=(3, N_SAMPLES, N_JOINTS))
    slings = [(int(rng.integers(N_JOINTS)), rng.uniform(-0.3, 0.3, 3), rng.uniform(20, 100)) for _ in range(N_SLINGS)]
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(text)
        file.flush()
        tree = load_urdf(file.name, GRAVITY)
    runs: dict[str, Run] = {
        "ours": ours(tree),
        "ours, slings": ours_in_slings(tree, slings),
        "ours, CasADi's machine": ours_in_machine(tree),
        "pinocchio": pinocchio_loop(text),
        "Drake": drake_loop(text, []),
        "Drake, slings": drake_loop(text, slings),
    }
    same = {"ours": ("ours, CasADi's machine", "pinocchio", "Drake"), "ours, slings": ("Drake, slings",)}
    for name, others in same.items():
        torque = runs[name](*motion)
        for other in others:
            difference = np.abs(runs[other](*motion) - torque).max() / np.abs(torque).max()
            if not difference <= 1e-9:
                print(f"{name} and {other} differ by {difference:.1e} of the largest torque, not 1e-9", file=sys.stderr)
                return 1
    turns = [{name: microseconds(run, motion) for name, run in runs.items()} for _ in range(REPETITIONS)]
    rows = [
        {
            "name": name,
            "microseconds": float(np.median([turn[name] for turn in turns])),
            "times_ours": float(np.median([turn[name] / turn["ours"] for turn in turns])),
            "times_ours_slings": float(np.median([turn[name] / turn["ours, slings"] for turn in turns])),
        }
        for name in runs
    ]
    print(f"{N_SAMPLES} samples x {N_JOINTS} joints, {REPETITIONS} repetitions, {platform.machine()}")
    print(f"{'':24}{'us a sample':>12}{'x ours':>10}{'x ours, slings':>16}")
    for row in rows:
        print(f"{row['name']:24}{row['microseconds']:12.3f}{row['times_ours']:10.1f}{row['times_ours_slings']:16.1f}")
    result = {
        "bench": "torque",
        "n_samples": N_SAMPLES,
        "n_joints": N_JOINTS,
        "repetitions": REPETITIONS,
        "engines": rows,
    }
    write_result(path, result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
