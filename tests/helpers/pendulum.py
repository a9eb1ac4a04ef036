"""A pendulum in a dozen lines of its own: sharp or rounded Coulomb friction, a servo, a disturbance and noise."""

import math

import numpy as np
from scipy.signal import butter, sosfilt

from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

MASS, LENGTH, GRAVITY = 4.0, 0.4, 9.81
INERTIA = MASS * LENGTH**2 + 0.02
RATE = 200


def record(
    path,
    seed,
    seconds,
    *,
    rounding=0.0,
    stribeck=0.0,
    speed=0.08,
    drag=0.0,
    stops=False,
    knocks=(),
    wander=0.0,
    edges=(0.3, 12.0),
    law=None,
):
    """A pendulum under a PD servo; friction of 3 N·m, rounded over ``rounding`` [rad/s] or sharp.

    It swings, or goes from point to point and ``stops`` there; something shakes it at the ``knocks`` [s]. Its
    disturbance is between two ``edges`` [Hz] or, where ``wander`` is above zero, a random walk of that RMS [N·m] about
    its mean. A ``law`` of position [rad] takes a torque [N·m] that no name stands for.
    """
    rng = np.random.default_rng(seed)
    steps, fine = int(1000 * seconds), 4
    t = np.arange(steps) / 1000
    phase, f = rng.uniform(0, 2 * np.pi, 4), np.array([0.11, 0.23, 0.37, 0.52])
    fade = np.clip(t / 2, 0, 1) ** 2 * (3 - 2 * np.clip(t / 2, 0, 1))
    target = fade * np.sum(np.sin(2 * np.pi * f * t[:, None] + phase) * 0.16 / f, axis=1)
    if stops:
        points = rng.uniform(-0.9, 0.9, int(seconds / 2) + 2)
        part = np.clip((t % 2.0) / 1.5, 0, 1)
        way = part**3 * (10 - 15 * part + 6 * part**2)
        at = (t // 2.0).astype(int)
        target = points[at] + way * (points[at + 1] - points[at])
    wanted = np.gradient(target, 1e-3)
    ahead = INERTIA * np.gradient(wanted, 1e-3) + MASS * GRAVITY * LENGTH * np.cos(target)
    push = np.asarray(sosfilt(butter(2, edges, "bandpass", fs=1000, output="sos"), rng.normal(size=steps)))
    push *= 0.3 / np.sqrt(np.mean(push**2))
    if wander:
        push = np.cumsum(rng.normal(size=steps))
        push = wander * (push - push.mean()) / push.std()
    for at in knocks:
        push += 9.0 * np.sin(2 * np.pi * 7 * t) * np.exp(-(((t - at) / 0.15) ** 2))
    kp, kd, h = INERTIA * 30.0**2, INERTIA * 45.0, 1e-3 / fine
    q, qd, held = float(target[0]), 0.0, float(ahead[0])
    positions, torques = np.empty(steps), np.empty(steps)
    for k in range(steps):
        command = float(ahead[k] + kp * (target[k] - q) + kd * (wanted[k] - qd))
        positions[k], torques[k] = q, 0.5 * (held + command)
        held = command
        nameless = law(q) if law else 0.0
        for _ in range(fine):
            pull = MASS * GRAVITY * LENGTH * math.cos(q) + nameless
            free = qd + h / INERTIA * (held + push[k] - pull - drag * qd * abs(qd))
            level = 3.0 + stribeck * math.exp(-((qd / speed) ** 2))
            if rounding:
                stiff = level / rounding / math.cosh(min(abs(qd) / rounding, 300)) ** 2
                slip = (free - qd) - h / INERTIA * (level * math.tanh(qd / rounding) + 2.0 * qd)
                qd += slip / (1 + h / INERTIA * (stiff + 2.0))
            else:
                qd = math.copysign(max(abs(free) - h / INERTIA * level, 0.0), free) / (1 + 2.0 * h / INERTIA)
            q += h * qd
    step = 2 * np.pi / 2**19
    table = np.column_stack([t, np.round(positions / step) * step, torques + 0.15 * rng.normal(size=steps)])
    np.savetxt(path, table[:: 1000 // RATE], delimiter=",", header="time,q.joint1,tau.joint1", comments="", fmt="%.8g")


def recorded(folder, seed, **concealed):
    """A model with viscous and Coulomb friction, beside two recordings."""
    own = f'<inertial><origin xyz="{LENGTH} 0 0"/><mass value="{MASS}"/>'
    own += '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
    (folder / "arm.urdf").write_text(
        f'<robot name="pendulum"><link name="base"/><link name="link1">{own}</link><joint name="joint1" '
        'type="revolute"><parent link="base"/><child link="link1"/><axis xyz="0 -1 0"/>'
        '<limit lower="-3" upper="3" velocity="5" effort="200"/></joint></robot>'
    )
    (folder / "arm.toml").write_text(
        'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = ["viscous_friction", "coulomb_friction"]\n'
    )
    record(folder / "train.csv", seed, 25.0, **concealed)
    record(folder / "hold.csv", seed + 1000, 12.0, **concealed)
    return load_model(folder / "arm.toml")


def diagnosed(folder, seed, **concealed):
    model = recorded(folder, seed, **concealed)
    return diagnose(model, [folder / "train.csv"], folder / "hold.csv").diagnosis
