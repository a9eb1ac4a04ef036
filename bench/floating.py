"""Real-time factor of a floating base and arm: ours and Drake, pinocchio and MuJoCo with Runge-Kutta steps of order 4.

``python bench/floating.py [RESULT.json]``. ETS-VII's published run (25 s, six joints under a servo) with the inertias
that bodies can have, as MuJoCo refuses others. Ours and Drake take error-controlled steps of order 5 at 1e-8; the other
two take the longest step that leaves their tip no further off than Drake's. All log each step. Off is measured 2 s into
the motion and at its end, from Drake's at 1e-12. One thread; the engines take turns within each repetition, and figures
are medians over the repetitions.
"""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import mujoco
import numpy as np
import pinocchio as pin
from mujoco import rollout
from scipy.spatial.transform import Rotation

from bench.results import write_result
from snarelab.models.floating.arm import FloatingArm
from snarelab.models.floating.dynamics import in_world, tip_pose
from snarelab.models.floating.ets_vii import ets_vii
from snarelab.models.floating.joint_drive import Drive
from snarelab.models.floating.motion import FloatingMotion
from snarelab.models.floating.plant import FloatingPlant
from snarelab.models.inertia import Array, from_central, to_central
from snarelab.models.tree import Link
from snarelab.studies.free_floating import DURATION, TARGET, gains

REPETITIONS, GOAL = 7, 1000.0
EARLY = 2.0  # s
STEPS = (
    0.05,
    0.04,
    0.025,
    0.02,
    0.0125,
    0.01,
    0.008,
    0.005,
    0.004,
    0.0025,
    0.002,
    0.001,
)  # s, whole in 2 s and in 25 s
Run = Callable[[float], tuple[Array, Array, Array]]
"""Runs for a time [s]; gives position, quaternion (w first) and joint positions at the end."""


def physical() -> FloatingArm:
    """ETS-VII with inertias that bodies can have, off the very edge of what they can: MuJoCo takes no rounding."""
    arm = ets_vii(projected=True)
    links = []
    for link in arm.tree.links:
        mass, com, inertia = to_central(link.phi)
        links.append(Link(link.name, from_central(mass, com, inertia + 1e-6 * np.trace(inertia) * np.eye(3))))
    return replace(arm, tree=replace(arm.tree, links=tuple(links)))


def ours(arm: FloatingArm) -> Run:
    motion = FloatingMotion(arm, Drive(*gains(arm)))
    start, inputs = motion.start(), np.concatenate([np.zeros(6), TARGET])

    def run(duration: float) -> tuple[Array, Array, Array]:
        log = motion.advance(0.0, start, duration, 0.01, inputs, log=True).log
        seen = motion.observe(log[:, 1:])
        return seen.base_position[-1], seen.base_quaternion[-1], motion.joints(log[-1:, 1:])[0][0]

    return run


def drake(arm: FloatingArm, accuracy: float = 1e-8) -> Run:
    plant = FloatingPlant(arm, *gains(arm), accuracy=accuracy)

    def run(duration: float) -> tuple[Array, Array, Array]:
        found = plant.run(TARGET, duration)
        return found.position[-1], found.quaternion[-1], found.q[-1]

    return run


def mujoco_rk4(arm: FloatingArm, step: float) -> Run:
    """The steps and their log run in C (`mujoco.rollout`)."""

    def words(values: Array) -> str:
        return " ".join(repr(float(x)) for x in values)

    def inertial(phi: Array) -> str:
        mass, com, inertia = to_central(phi)
        six = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        return f'<inertial mass="{mass!r}" pos="{words(com)}" fullinertia="{words(six)}"/>'

    body, ends, actuators = "", "", ""
    stiffness, damping = gains(arm)
    for joint, link, kp, kd in zip(arm.tree.joints, arm.tree.links, stiffness, damping, strict=True):
        turned = Rotation.from_matrix(joint.rotation).as_quat(scalar_first=True)
        body += f'<body pos="{words(joint.translation)}" quat="{words(turned)}">{inertial(link.phi)}'
        body += f'<joint name="{joint.name}" axis="{words(joint.axis)}"/>'
        law = f'gainprm="{float(kp)!r}" biasprm="0 {-float(kp)!r} {-float(kd)!r}"'
        actuators += f'<general joint="{joint.name}" biastype="affine" {law}/>'
        ends += "</body>"
    text = (
        f'<mujoco><compiler angle="radian"/><option timestep="{step!r}" gravity="0 0 0" integrator="RK4"/><worldbody>'
        f"<body><freejoint/>{inertial(arm.base)}{body}{ends}</body></worldbody><actuator>{actuators}</actuator></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    start = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)

    def run(duration: float) -> tuple[Array, Array, Array]:
        n = round(duration / step)
        control = np.broadcast_to(TARGET, (1, n, 6))
        states, _ = rollout.rollout(model, data, start[None], control, nstep=n)
        q = np.asarray(states, float)[0, -1, 1 : 1 + model.nq]
        return q[:3], q[3:7], q[7:]

    return run


def pinocchio_rk4(arm: FloatingArm, step: float) -> Run:
    """The loop is Python's, as pinocchio has none; each stage is one call of its forward dynamics (ABA)."""
    model = pin.Model()

    def inertia(phi: Array) -> pin.Inertia:
        mass, com, about = to_central(phi)
        return pin.Inertia(mass, com, about)

    last = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(last, inertia(arm.base), pin.SE3.Identity())
    for joint, link in zip(arm.tree.joints, arm.tree.links, strict=True):
        place = pin.SE3(joint.rotation, joint.translation)
        last = model.addJoint(last, pin.JointModelRZ(), place, joint.name)
        model.appendBodyToJoint(last, inertia(link.phi), pin.SE3.Identity())
    model.gravity = pin.Motion.Zero()
    data, (kp, kd) = model.createData(), gains(arm)
    torque = np.zeros(model.nv)

    def acceleration(q: Array, v: Array) -> Array:
        torque[6:] = kp * (TARGET - q[7:]) - kd * v[6:]
        return pin.aba(model, data, q, v, torque)

    def run(duration: float) -> tuple[Array, Array, Array]:
        q, v = pin.neutral(model), np.zeros(model.nv)
        n = round(duration / step)
        log = np.empty((n, model.nq + model.nv))
        for k in range(n):
            a1 = acceleration(q, v)
            v2 = v + 0.5 * step * a1
            a2 = acceleration(pin.integrate(model, q, 0.5 * step * v), v2)
            v3 = v + 0.5 * step * a2
            a3 = acceleration(pin.integrate(model, q, 0.5 * step * v2), v3)
            v4 = v + step * a3
            a4 = acceleration(pin.integrate(model, q, step * v3), v4)
            q = pin.integrate(model, q, step / 6 * (v + 2 * v2 + 2 * v3 + v4))
            v = v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            log[k, : model.nq], log[k, model.nq :] = q, v
        return q[:3], q[[6, 3, 4, 5]], q[7:]

    return run


def tip(arm: FloatingArm, end: tuple[Array, Array, Array]) -> Array:
    """Place of the tip in the world (3,) [m]."""
    position, quaternion, q = end
    return position + in_world(quaternion[None], tip_pose(arm, q[None]).translation)[0]


def main() -> int:
    """Find the steps, take turns, print and write; 1 where a rival does not come to the same motion."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/floating.json")
    arm = physical()
    exact = drake(arm, 1e-12)
    truth = {duration: tip(arm, exact(duration)) for duration in (EARLY, DURATION)}

    def off(run: Run) -> float:
        return max(float(np.linalg.norm(tip(arm, run(t)) - place)) for t, place in truth.items())

    runs: dict[str, Run] = {"ours, RK5 at 1e-8": ours(arm), "Drake, RK5 at 1e-8": drake(arm)}
    bar = off(runs["Drake, RK5 at 1e-8"])
    for name, build in (("pinocchio, RK4 from Python", pinocchio_rk4), ("MuJoCo, RK4 in C", mujoco_rk4)):
        step = next((h for h in STEPS if off(build(arm, h)) <= bar), None)
        if step is None:
            print(f"{name}: no step down to {STEPS[-1]} s comes within {bar:.2g} m of Drake's tip", file=sys.stderr)
            return 1
        runs[f"{name}, {1e3 * step:g} ms"] = build(arm, step)
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(REPETITIONS):
        for name, run in runs.items():
            begun = time.process_time()
            run(DURATION)
            spent[name].append(time.process_time() - begun)
    first = np.array(spent["ours, RK5 at 1e-8"])
    rows = [
        {
            "name": name,
            "real_time_factor": DURATION / float(np.median(spent[name])),
            "times_ours": float(np.median(np.array(spent[name]) / first)),
            "tip_error": off(run),
        }
        for name, run in runs.items()
    ]
    print(f"ETS-VII, {DURATION:g} s, each step logged, processor time, {REPETITIONS} repetitions")
    print(f"{'':34}{'x real time':>12}{'x ours':>9}{'tip off, m':>12}")
    for row in rows:
        print(f"{row['name']:34}{row['real_time_factor']:12.0f}{row['times_ours']:9.1f}{row['tip_error']:12.1e}")
    print(f"goal: {GOAL:g} x real time")
    result = {
        "bench": "floating",
        "machine": platform.machine(),
        "repetitions": REPETITIONS,
        "goal": GOAL,
        "engines": rows,
    }
    write_result(path, result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
