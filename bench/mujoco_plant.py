"""A closed-loop robot in MuJoCo that writes recordings: the other side of every proof.

A recording that proves a diagnosis must not come from the model that explains it. Nothing here imports snarelab: the
rigid body, rotor inertia, springs and (if asked) friction are MuJoCo's, sliding friction is LuGre's, with a state of
its own, and the loop is closed by a servo on the encoder readings, so that noise and friction travel round it.

The time grid: the servo runs at 1 kHz; its drive moves linearly from one command to the next, one millisecond late;
MuJoCo steps at ``timestep``. The recorded torque is the drive's, at the instant of the encoder reading, so the two
channels are not skewed against each other unless ``tau_delay`` asks for it.
"""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import signal

from .arm import STANDARD_GRAVITY, Arm
from .lugre import Bristles, LuGre
from .motion import Motion
from .parts import (
    Beam,
    Bumper,
    Disturbance,
    Drift,
    Elasticity,
    Harness,
    Payload,
    Ripple,
    Servo,
    SolverFriction,
    Stop,
    Tie,
)

CONTROL_RATE = 1000


@dataclass(frozen=True, eq=False)
class Running:
    """A run for what acts in it: ``dof`` by joint name, and the bristles, whose friction is on the joints already."""

    model: mujoco.MjModel
    data: mujoco.MjData
    dof: Mapping[str, int]
    bristles: Bristles


Mechanism = Callable[[Running], Callable[[], None]]
"""Made anew for each run: what it gives back is called before each MuJoCo step and adds to ``data.qfrc_applied``."""

Motor = Callable[[], Callable[[float], float]]
"""Made anew for each run: from the torque that a motor's current stands for, at each MuJoCo step, to what it gives."""


@dataclass(frozen=True, eq=False)
class Plant:
    """An arm and all that its URDF does not say, each by joint name (``com_offset``, ``beam``: by link name).

    Parameters
    ----------
    arm : Arm
        The nominal arm, which is also what the servo believes.
    armature : float
        Rotor inertia behind the gear [T·s²/S].
    elasticity : Elasticity
        Encoder and recorded torque are then on the motor's side; the joint needs an ``armature``. The servo's gain is
        limited to what the motor's inertia bears.
    com_offset : tuple of three floats
        Shift of a link's centre of mass [m, link frame].
    encoder_step, encoder_noise : float
        Quantum and RMS of the position reading [S]; the servo sees the same readings.
    tau_gain, tau_bias, tau_drift, tau_delay, tau_noise
        The torque channel reads gain · torque(t − delay [s]) + bias [T] + drift + white noise of this RMS [T].
    ties : tuple of Tie or Bumper
        MuJoCo's own couplings of two joints, and soft ends of a joint's travel.
    motor : Motor
        What the drive gives of the torque that is commanded and logged; the servo does not know.
    mechanisms : tuple of Mechanism
        Torques of any other law.
    servo : Servo or None
        None leaves the arm to itself.

    Raises
    ------
    ValueError
        A name that the arm does not have; an elastic joint without armature.
    """

    arm: Arm
    friction: Mapping[str, LuGre | SolverFriction] = field(default_factory=dict)
    armature: Mapping[str, float] = field(default_factory=dict)
    elasticity: Mapping[str, Elasticity] = field(default_factory=dict)
    beam: Mapping[str, Beam] = field(default_factory=dict)
    ripple: Mapping[str, Ripple | tuple[Ripple, ...]] = field(default_factory=dict)
    harness: Mapping[str, Harness] = field(default_factory=dict)
    stop: Mapping[str, Stop] = field(default_factory=dict)
    disturbance: Mapping[str, Disturbance] = field(default_factory=dict)
    payload: Payload | None = None
    com_offset: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    encoder_step: Mapping[str, float] = field(default_factory=dict)
    encoder_noise: Mapping[str, float] = field(default_factory=dict)
    tau_gain: Mapping[str, float] = field(default_factory=dict)
    tau_bias: Mapping[str, float] = field(default_factory=dict)
    tau_drift: Mapping[str, Drift] = field(default_factory=dict)
    tau_delay: Mapping[str, float] = field(default_factory=dict)
    tau_noise: Mapping[str, float] = field(default_factory=dict)
    ties: tuple[Tie | Bumper, ...] = ()
    motor: Mapping[str, Motor] = field(default_factory=dict)
    mechanisms: tuple[Mechanism, ...] = ()
    gravity: tuple[float, float, float] = STANDARD_GRAVITY
    servo: Servo | None = field(default_factory=Servo)

    def __post_init__(self) -> None:
        """Refuse names that would be ignored."""
        for name, value in vars(self).items():
            if isinstance(value, Mapping):
                prefix = "link" if name in ("com_offset", "beam") else "joint"
                known = {f"{prefix}{k}" for k in range(1, len(self.arm.links) + 1)}
                if unknown := set(value) - known:
                    raise ValueError(f"{name}: {sorted(unknown)} not in the arm; it has {sorted(known)}")
        if rotorless := [j for j in self.elasticity if not self.armature.get(j)]:
            raise ValueError(f"elasticity: {rotorless} need an armature, the inertia of the motor before the spring")

    def per_joint(self, name: str, default: float = 0.0) -> NDArray:
        """A field of numbers as an array (n_joints,)."""
        return np.array([getattr(self, name).get(joint, default) for joint in self.arm.joints], float)

    def model(self, timestep: float) -> mujoco.MjModel:
        """The plant's MuJoCo model, with all that MuJoCo does by itself; the rest acts in ``simulate``."""
        real = self.arm if self.payload is None else self.arm.with_payload(self.payload.mass, self.payload.point)
        for link, offset in self.com_offset.items():
            real = real.with_com_offset(link, offset)
        attributes = {joint: f'armature="{self.armature.get(joint, 0.0)!r}"' for joint in self.arm.joints}
        for joint, spring in self.harness.items():
            attributes[joint] += f' stiffness="{spring.stiffness!r}" springref="{spring.rest!r}"'
        for joint, law in self.friction.items():
            if isinstance(law, SolverFriction):
                attributes[joint] += f' damping="{law.viscous!r}" frictionloss="{law.level!r}"'
                attributes[joint] += f' solreffriction="{4 * timestep!r} 1" solimpfriction="0.99 0.99 0.001"'
        twist = {
            joint: f'stiffness="{0.0 if spring.gap else spring.stiffness!r}" damping="{spring.damping!r}"'
            for joint, spring in self.elasticity.items()
        }
        turns = {link: beam.hinges for link, beam in self.beam.items()}
        text = real.mjcf(timestep=timestep, gravity=self.gravity, attributes=attributes, twist=twist, turns=turns)
        tendons = "".join(tie.mjcf(timestep) for tie in self.ties)
        text = text.replace("</worldbody>", f"</worldbody><tendon>{tendons}</tendon>") if tendons else text
        return mujoco.MjModel.from_xml_string(text)


def simulate(
    plant: Plant,
    motion: Motion,
    duration: float,
    rate: float,
    rng: np.random.Generator,
    *,
    timestep: float = 2.5e-4,
    settle: float = 1.0,
    anti_alias: bool = False,
    link_encoder: bool = False,
) -> dict[str, NDArray]:
    """Run the plant along a motion and record it.

    The arm is held at the motion's first pose for ``settle`` [s] before the recording starts, and starts from rest.

    Parameters
    ----------
    rate : float
        Samples per second; divides 1000. Plain sampling, as most controllers do it; with ``anti_alias`` all channels
        pass a linear-phase low-pass at 0.4 · rate first, without delay.
    timestep : float
        MuJoCo's [s]; divides 1 ms.
    link_encoder : bool
        Adds ``q_link.<joint>``, exact, behind the elasticity.

    Returns
    -------
    dict of arrays (n_samples,)
        ``time``, ``q.<joint>``, ``tau.<joint>``: columns of a recording, in SI units.
    """
    stride, substeps = round(CONTROL_RATE / rate), round(1.0 / (CONTROL_RATE * timestep))
    if abs(stride * rate - CONTROL_RATE) > 1e-9 or abs(substeps * CONTROL_RATE * timestep - 1.0) > 1e-9:
        raise ValueError(f"rate {rate} must divide {CONTROL_RATE} Hz, and timestep {timestep} must divide 1 ms")
    joints, n = plant.arm.joints, len(plant.arm.links)
    first, steps = round(settle * CONTROL_RATE), round((settle + duration) * CONTROL_RATE) + 1
    time = (np.arange(steps) - first) / CONTROL_RATE
    disturbing, reading, sensing = rng.spawn(3)
    disturbance = _disturbance(plant, disturbing, steps)
    noise = reading.standard_normal((steps, n)) * plant.per_joint("encoder_noise")
    target = motion(np.maximum(time, 0.0))

    q, q_link, tau = _closed_loop(plant, target, disturbance, noise, timestep, substeps)
    if np.abs(q).max() > 1e3 or not np.isfinite(q).all():
        raise ValueError("the arm ran away: lower Servo.bandwidth or timestep")
    measured = _torque_channel(plant, sensing, time, tau)

    channels = {}
    for k, joint in enumerate(joints):
        channels[f"q.{joint}"] = q[:, k]
        if link_encoder:
            channels[f"q_link.{joint}"] = q_link[:, k]
        channels[f"tau.{joint}"] = measured[:, k]
    if anti_alias:
        taps = np.asarray(signal.firwin(16 * stride + 1, 0.4 * rate, fs=CONTROL_RATE))
        channels = {name: _low_pass(values, taps) for name, values in channels.items()}
    return {"time": time[first::stride], **{name: values[first::stride] for name, values in channels.items()}}


def write_csv(path: Path | str, recording: Mapping[str, NDArray]) -> None:
    """Write a recording as a table that snarelab reads, to nine significant digits."""
    table = np.column_stack(list(recording.values()))
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(recording), comments="")


def _closed_loop(
    plant: Plant,
    target: tuple[NDArray, NDArray, NDArray],
    disturbance: NDArray,
    noise: NDArray,
    timestep: float,
    substeps: int,
) -> tuple[NDArray, NDArray, NDArray]:
    """Encoder readings, link positions and drive torque at the servo's instants, each (n_steps, n_joints)."""
    model = plant.model(timestep)
    data = mujoco.MjData(model)
    joints = plant.arm.joints
    motor = np.array([model.joint(joint).dofadr[0] for joint in joints])
    twist = np.array([model.joint(f"{joint}_twist").dofadr[0] for joint in plant.elasticity], int)
    elastic = np.array([joints.index(joint) for joint in plant.elasticity], int)
    backlash = [(d, spring) for d, spring in zip(twist, plant.elasticity.values(), strict=True) if spring.gap]
    ripples = [(j, w) for j, own in plant.ripple.items() for w in ((own,) if isinstance(own, Ripple) else own)]
    rippled = np.array([joints.index(j) for j, _ in ripples], int)
    waves = [(wave.amplitude, wave.cycles, wave.phase) for _, wave in ripples]
    amplitude, cycles, phase = np.array(waves).reshape(-1, 3).T
    stops = [(joints.index(j), int(motor[joints.index(j)]), s) for j, s in plant.stop.items()]
    bristles = Bristles(model, data, {j: law for j, law in plant.friction.items() if isinstance(law, LuGre)})
    running = Running(model, data, dict(zip(joints, motor.tolist(), strict=True)), bristles)
    acting = [begin(running) for begin in plant.mechanisms]
    giving = [(joints.index(joint), begin()) for joint, begin in plant.motor.items()]
    step = plant.per_joint("encoder_step")
    quantised = step > 0.0
    forward, kp, kd = _servo_gains(plant, target)
    blend = 1.0 - np.exp(-2.0 * np.pi * (plant.servo.speed_filter if plant.servo else 0.0) / CONTROL_RATE)
    shares = np.arange(substeps) / substeps

    q, applied = data.qpos, data.qfrc_applied
    q[motor] = target[0][0]
    torque, command = forward[0], forward[0]
    read_q, read_link, drive = np.empty((3, len(forward), len(joints)))
    last, speed = target[0][0], np.zeros(len(joints))
    push, later = disturbance[0], disturbance[0]
    for k in range(len(forward)):
        now = q[motor] + noise[k]
        if quantised.any():
            now[quantised] = np.round(now[quantised] / step[quantised]) * step[quantised]
        read_q[k], drive[k], read_link[k] = now, torque, q[motor]
        read_link[k, elastic] += q[twist]
        speed = speed + blend * (CONTROL_RATE * (now - last) - speed)
        last = now
        command = forward[k] + kp * (target[0][k] - now) + kd * (target[1][k] - speed)
        push, later = later, disturbance[k]
        for share in shares:
            load = torque + push + share * (command - torque + later - push)
            for j, given in giving:
                asked = torque[j] + share * (command[j] - torque[j])
                load[j] += given(asked) - asked
            if rippled.size:
                np.add.at(load, rippled, amplitude * np.sin(cycles * q[motor[rippled]] + phase))
            for joint, dof, stop in stops:
                load[joint] -= stop.stiffness * max(q[dof] - stop.where, 0.0)
            for dof, spring in backlash:
                applied[dof] = -spring.stiffness * (q[dof] - min(max(q[dof], -spring.gap / 2.0), spring.gap / 2.0))
            applied[motor] = load
            bristles.act()
            for act in acting:
                act()
            mujoco.mj_step(model, data)
            bristles.slip()
        torque = command
    return read_q, read_link, drive


def _servo_gains(plant: Plant, target: tuple[NDArray, NDArray, NDArray]) -> tuple[NDArray, NDArray, NDArray]:
    """Torque ahead (n_steps, n_joints) from the nominal arm, and the gains on position and speed (n_joints,)."""
    forward = np.zeros_like(target[0])
    if plant.servo is None:
        return forward, np.zeros(forward.shape[1]), np.zeros(forward.shape[1])
    model = mujoco.MjModel.from_xml_string(plant.arm.mjcf(gravity=plant.gravity))
    data = mujoco.MjData(model)
    for k in range(len(forward)):
        data.qpos[:], data.qvel[:], data.qacc[:] = target[0][k], target[1][k], target[2][k]
        mujoco.mj_inverse(model, data)
        forward[k] = data.qfrc_inverse
    data.qpos[:] = target[0].mean(axis=0)
    mujoco.mj_forward(model, data)
    inertia, unit = np.empty(model.nv), np.eye(model.nv)
    column = np.empty(model.nv)
    for k in range(model.nv):
        mujoco.mj_mulM(model, data, column, unit[k])
        inertia[k] = column[k]
    rotor = plant.per_joint("armature")
    inertia += rotor
    elastic = np.isin(plant.arm.joints, list(plant.elasticity))
    inertia[elastic] = np.minimum(inertia, 4.0 * rotor)[elastic]
    omega = 2.0 * np.pi * plant.servo.bandwidth
    return forward, omega**2 * inertia, 2.0 * plant.servo.damping_ratio * omega * inertia


def _disturbance(plant: Plant, rng: np.random.Generator, steps: int) -> NDArray:
    """Band-limited torque at the servo's instants (n_steps, n_joints), scaled to the very RMS asked for."""
    white = rng.standard_normal((steps, len(plant.arm.links)))
    torque = np.zeros_like(white)
    for k, joint in enumerate(plant.arm.joints):
        if wanted := plant.disturbance.get(joint):
            band = signal.butter(2, (wanted.low, wanted.high), "bandpass", fs=CONTROL_RATE, output="sos")
            coloured = np.asarray(signal.sosfilt(band, white[:, k]))
            torque[:, k] = coloured * wanted.rms / np.sqrt(np.mean(coloured**2))
    return torque


def _torque_channel(plant: Plant, rng: np.random.Generator, time: NDArray, tau: NDArray) -> NDArray:
    """What the torque sensor makes of the drive's torque (n_steps, n_joints)."""
    noise = rng.standard_normal(tau.shape) * plant.per_joint("tau_noise")
    gain, bias, delay = plant.per_joint("tau_gain", 1.0), plant.per_joint("tau_bias"), plant.per_joint("tau_delay")
    measured = bias + noise
    for k, joint in enumerate(plant.arm.joints):
        measured[:, k] += gain[k] * np.interp(time - delay[k], time, tau[:, k])
        if drift := plant.tau_drift.get(joint):
            measured[:, k] += drift.final * (1.0 - np.exp(-np.maximum(time, 0.0) / drift.time_constant))
    return measured


def _low_pass(values: NDArray, taps: NDArray) -> NDArray:
    """Symmetric filter without delay; the ends are continued by their own value."""
    half = len(taps) // 2
    return np.convolve(np.pad(values, half, mode="edge"), taps, mode="valid")
