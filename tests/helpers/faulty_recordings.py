"""A bank of recordings, sound and with one mistake each: arms drawn at random, moved by Pinocchio.

Nothing here imports snarelab. Torque is Pinocchio's along a drawn motion, with friction and sensors of a real machine
on top, so that no model that is given to the tool explains all of it.
"""

# pyright: reportAttributeAccessIssue=false
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from bench.arm import random_arm
from bench.motion import fourier_motion

SECONDS, RATE = 12.0, 200.0
HELD_OUT = 700
"""What the seed of a held-out recording is higher by."""


@dataclass
class Machine:
    """What an arm's URDF does not say: friction, payload, sensors. Drawn at random, moderate."""

    arm: object
    real: object
    viscous: np.ndarray
    coulomb: np.ndarray
    stribeck: np.ndarray
    armature: np.ndarray
    bias: np.ndarray
    gain: np.ndarray
    delay: float
    encoder_step: float
    torque_noise: float
    gravity: tuple = (0.0, 0.0, -9.81)


def machine(seed, n_joints=3, missing=True):
    """An arm and what it has besides; with ``missing`` physics, or none but a little noise."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, n_joints)
    size = level(arm)
    draw = (lambda low, high: rng.uniform(low, high, n_joints)) if missing else (lambda low, high: np.zeros(n_joints))
    real = arm
    if missing and rng.random() < 0.5:
        real = arm.with_payload(rng.uniform(0.1, 0.5) * arm.links[-1].mass, rng.uniform(-0.1, 0.1, 3))
    if missing and rng.random() < 0.3:
        real = real.with_com_offset(f"link{n_joints}", rng.uniform(-0.02, 0.02, 3))
    return Machine(
        arm,
        real,
        draw(0, 0.3) * size,
        draw(0, 0.4) * size + 1e-6,
        draw(0, 0.5),
        draw(0, 0.3),
        draw(-0.1, 0.1) * size,
        1 + draw(-0.1, 0.1),
        rng.uniform(0, 0.01) if missing else 0.0,
        rng.choice([0.0, 1e-5, 1e-4]),
        rng.uniform(0.002, 0.03),
    )


def level(arm):
    """RMS torque of each joint in drawn poses: what friction and biases are a share of."""
    model = engine(arm)
    data, rng = model.createData(), np.random.default_rng(0)
    travel = np.array([link.travel for link in arm.links])
    poses = rng.uniform(-travel, travel, (50, len(arm.links)))
    still = np.zeros(len(arm.links))
    torques = np.array([pin.rnea(model, data, q, still, 3.0 * rng.normal(size=len(q))) for q in poses])
    return np.sqrt(np.mean(torques**2, axis=0))


def engine(arm, gravity=(0.0, 0.0, -9.81)):
    model = pin.buildModelFromXML(arm.urdf())
    model.gravity.linear = np.array(gravity)
    return model


@dataclass
class Run:
    """A recording: time (n,), positions and torques (n, J)."""

    time: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    joints: tuple = field(default=())

    def table(self):
        columns = {"time": self.time}
        for k, joint in enumerate(self.joints):
            columns[f"q.{joint}"] = self.q[:, k]
            columns[f"tau.{joint}"] = self.tau[:, k]
        return columns


def record(made, seed, seconds=SECONDS, real=None, gravity=None, time=None, still=None):
    """One motion of a machine, sampled at ``time``; a joint that is held ``still`` does not move in it."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE if time is None else time
    moving = fourier_motion(made.arm, rng, seconds)

    def motion(t):
        state = [np.array(x) for x in moving(t)]
        if still is not None:
            for x, value in zip(state, (0.3, 0.0, 0.0), strict=True):
                x[:, still] = value
        return state

    model = engine(made.real if real is None else real, made.gravity if gravity is None else gravity)
    data = model.createData()

    def torque(t):
        q, qd, qdd = motion(np.clip(t, 0, seconds))
        rigid = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
        inertia = np.diag(pin.crba(model, data, np.zeros(len(made.viscous))))
        slow = 1 + made.stribeck * np.exp(-((qd / 0.1) ** 2))
        friction = made.viscous * qd / (0.3 + np.abs(qd).mean(0)) + made.coulomb * slow * np.tanh(qd / 0.01)
        return rigid + friction + made.armature * inertia * qdd

    q = motion(time)[0]
    if made.encoder_step:
        q = np.round(q / made.encoder_step) * made.encoder_step
    tau = made.gain * torque(time - made.delay) + made.bias
    tau = tau + made.torque_noise * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    return Run(time, q + 1e-6 * rng.normal(size=q.shape), tau, made.arm.joints)


# Mistakes: from (machine, seed) to (recordings as logged, expected name, expected places, what a mend must hold).


def degrees(made, seed):
    run = record(made, seed)
    return [replace(run, q=np.degrees(run.q))], "unit", {f"q.{j}" for j in run.joints}


def degrees_of_one(made, seed):
    run, k = record(made, seed), seed % len(made.viscous)
    q = run.q.copy()
    q[:, k] = np.degrees(q[:, k])
    return [replace(run, q=q)], "unit", {f"q.{run.joints[k]}"}


def newton_centimetres(made, seed):
    run = record(made, seed)
    return [replace(run, tau=100 * run.tau)], "unit", {f"tau.{j}" for j in run.joints}


def newton_centimetres_of_one(made, seed):
    run, k = record(made, seed), seed % len(made.viscous)
    tau = run.tau.copy()
    tau[:, k] *= 100
    return [replace(run, tau=tau)], "unit", {f"tau.{run.joints[k]}"}


def milliseconds(made, seed):
    run = record(made, seed)
    return [replace(run, time=1000 * run.time)], "time_unit", {"time"}


def encoder_reversed(made, seed):
    run, k = record(made, seed), seed % len(made.viscous)
    q = run.q.copy()
    q[:, k] *= -1
    return [replace(run, q=q)], "sign", {f"q.{run.joints[k]}"}


def torque_reversed(made, seed):
    run, k = record(made, seed), seed % len(made.viscous)
    tau = run.tau.copy()
    tau[:, k] *= -1
    return [replace(run, tau=tau)], "sign", {f"tau.{run.joints[k]}"}


def joined(made, seed):
    first, second = record(made, seed), record(made, seed + 1000)
    half = len(first.time) // 2 - 37
    rest = len(first.time) // 3
    q = np.concatenate([first.q[:half], second.q[rest:]])
    tau = np.concatenate([first.tau[:half], second.tau[rest:]])
    return [Run(np.arange(len(q)) / RATE, q, tau, first.joints)], "jump", {f"q.{j}" for j in first.joints}


def load_turned(made, seed):
    """A load mounted one way round in the first run, and the other in the second."""
    point = np.array([0.25, 0.1, 0.15])
    mass = 0.6 * made.arm.links[-1].mass + 0.5
    runs = [record(made, seed + k, real=made.arm.with_payload(mass, sign * point)) for k, sign in ((0, 1), (1, -1))]
    links = {f"link{len(made.viscous)}", f"link{len(made.viscous) - 1}"}
    return runs, "mixed", links


def torques_swapped(made, seed):
    run = record(made, seed)
    order = np.arange(len(made.viscous))
    order[[1, 2]] = 2, 1
    return [replace(run, tau=run.tau[:, order])], "swapped", {"tau.joint2", "tau.joint3"}


def positions_swapped(made, seed):
    run = record(made, seed)
    order = np.arange(len(made.viscous))
    order[[0, 1]] = 1, 0
    return [replace(run, q=run.q[:, order])], "swapped", {"q.joint1", "q.joint2"}


def on_the_wall(made, seed):
    return [record(made, seed, gravity=(9.81, 0.0, 0.0))], "gravity", {"gravity"}


def zero_off(made, seed):
    """Of a joint that torque tells: by a shift of its zero, some torque changes by half. Not of the last: to turn its
    link is to take something from one side of it and to hold it on the other."""
    run = record(made, seed)
    far = 0.6 if seed % 4 < 2 else -1.2
    told = _shifts(made, run, far)[:-1]
    able = [k for k in range(len(told)) if told[k] > 0.5] or [int(np.argmax(told))]
    k = able[seed % len(able)]
    q = run.q.copy()
    q[:, k] += far
    return [replace(run, q=q)], "encoder_offset", {f"q.{run.joints[k]}"}


def _shifts(made, run, far):
    """By how much of itself some torque changes where each joint's zero is shifted."""
    told = []
    model = engine(made.arm)
    data, still = model.createData(), np.zeros(len(made.viscous))
    for k in range(len(made.viscous)):
        q = run.q[::40].copy()
        before = np.array([pin.rnea(model, data, x, still, still) for x in q])
        q[:, k] += far
        after = np.array([pin.rnea(model, data, x, still, still) for x in q])
        size = np.sqrt(np.mean(before**2, axis=0)) + 1e-3 * np.sqrt(np.mean(before**2))
        told.append(np.max(np.sqrt(np.mean((after - before) ** 2, axis=0)) / size * (size > 0.05 * size.max())))
    return told


def _told(made, run, far):
    """Joints, those whose zero torque tells best first."""
    return [int(k) for k in np.argsort(_shifts(made, run, far))[::-1]]


def axis_reversed(made, seed):
    run, k = record(made, seed), seed % len(made.viscous)
    q, tau = run.q.copy(), run.tau.copy()
    q[:, k] *= -1
    tau[:, k] *= -1
    return [replace(run, q=q, tau=tau)], "geometry", {run.joints[k]}


def cut_off(made, seed, share=0.65):
    """The range ends at a share of the largest torque; that of a held-out recording where the other one ends."""
    run, k = record(made, seed), seed % len(made.viscous)
    tau = run.tau.copy()
    level = share * np.abs(record(made, seed % HELD_OUT).tau[:, k]).max()
    tau[:, k] = np.clip(tau[:, k], -level, level)
    return [replace(run, tau=tau)], "saturation", {f"tau.{run.joints[k]}"}


def cut_off_anew(made, seed):
    """The same motion twice, and between the two the sensor's range was set anew."""
    (runs, *told), (again, *_) = cut_off(made, seed), cut_off(made, seed, 0.55)
    return [*runs, *again], *told


def bursting_clock(made, seed):
    """Stamps of when packets of ten samples arrived, not of when samples were taken."""
    run = record(made, seed)
    index = np.arange(len(run.time))
    stamped = (index // 10) * 10 / RATE + (index % 10) * 0.02 / RATE
    return [replace(run, time=stamped)], "clock", {"time"}


def standing(made, seed):
    k = seed % len(made.viscous)
    run = record(made, seed, still=k)
    return [run], "excitation", {run.joints[k]}


def zero_moved(made, seed):
    """An encoder lost its zero before the second of three runs; of the joint whose torque tells it best."""
    runs = [record(made, seed + n) for n in range(3)]
    q, k = runs[1].q.copy(), _told(made, runs[1], 0.3)[0]
    q[:, k] += 0.3
    return [runs[0], replace(runs[1], q=q), runs[2]], "mixed", {f"q.{runs[0].joints[k]}"}


def gain_changed(made, seed):
    """A torque channel was wired to another amplifier before the last of three runs; the loudest one."""
    runs = [record(made, seed + n) for n in range(3)]
    tau, k = runs[2].tau.copy(), int(np.argmax(np.std(runs[2].tau, axis=0)))
    tau[:, k] *= 2.0
    return [*runs[:2], replace(runs[2], tau=tau)], "mixed", {f"tau.{runs[0].joints[k]}"}


MISTAKES = [
    degrees,
    degrees_of_one,
    newton_centimetres,
    newton_centimetres_of_one,
    milliseconds,
    encoder_reversed,
    torque_reversed,
    joined,
    load_turned,
    torques_swapped,
    positions_swapped,
    on_the_wall,
    zero_off,
    axis_reversed,
    cut_off,
    cut_off_anew,
    bursting_clock,
    standing,
    zero_moved,
    gain_changed,
]

SAME = {
    degrees,
    degrees_of_one,
    newton_centimetres,
    newton_centimetres_of_one,
    milliseconds,
    encoder_reversed,
    torque_reversed,
    torques_swapped,
    positions_swapped,
    axis_reversed,
}
"""Mistakes whose mend gives the very numbers of the sound recording."""


def sound(mistake, made, seed):
    """The recordings that a mistake was made in, as they should have been, and lines for the model file that say so."""
    if mistake is on_the_wall:
        return [record(made, seed, gravity=(9.81, 0.0, 0.0))], "gravity = [9.81, 0.0, 0.0]\n"
    if mistake is load_turned:
        return load_turned(made, seed)[0][:1], ""
    if mistake is standing:
        return standing(made, seed)[0], ""
    return [record(made, seed)], ""


def disturbed(made, seed):
    """A sound recording as real loggers leave it: a clock that jitters, rows that are lost, in bursts too, coarse
    encoders; which of them hangs on the seed."""
    rng = np.random.default_rng(seed + 9000)
    time = np.arange(round(SECONDS * RATE)) / RATE
    if seed % 2:
        time = np.sort(time + rng.normal(0, (0.02, 0.1)[seed % 4 // 2] / RATE, len(time)))
    run = record(made, seed, time=time)
    q = run.q
    if seed % 5 == 0:
        step = 2 * np.pi / 2**14
        q = np.round(q / step) * step
    kept = np.ones(len(time), bool)
    if seed % 3 == 0:
        kept = rng.random(len(time)) > 0.006
        for start in rng.integers(100, len(time) - 100, 3):
            kept[start : start + rng.integers(3, 12)] = False
    return Run(time[kept], q[kept], run.tau[kept], run.joints)
