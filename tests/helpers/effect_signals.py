"""What an effect's law reads in its tests: the motion of a joint, a link, a sling and a base over eight seconds."""

import numpy as np

DT = 2e-3
TIME = np.arange(4000) * DT


def wave(time, *terms):
    """Sum of amplitude * sin(2 pi frequency time + phase), and its first two derivatives."""
    total = np.zeros((3, *np.shape(time)))
    for amplitude, frequency, phase in terms:
        turn = 2 * np.pi * frequency
        sine, cosine = np.sin(turn * time + phase), np.cos(turn * time + phase)
        total += amplitude * np.stack([sine, turn * cosine, -(turn**2) * sine])
    return total


def load(time):
    return wave(time, (20.0, 0.31, 0.4), (9.0, 1.7, 1.1), (4.0, 3.3, 2.0))[0]


def value(time):
    return wave(time, (2.0, 0.41, 0.3), (1.0, 1.9, 1.7), (0.5, 4.1, 0.2))[0]


def hang_point(time):
    """A sling's hang point on its way, and its velocity: (2, n, 3) [m, m/s]."""
    paths = [wave(time, (0.8, 0.17, 0.4), (0.2, 0.53, 0.1)), wave(time, (0.6, 0.23, 1.3)), wave(time, (0.1, 0.4, 2.0))]
    return np.stack(paths, axis=-1)[:2]


BEYOND = np.array([[1.2, 0.1, -0.2], [0.1, 2.5, 0.4], [-0.2, 0.4, 3.0]])
"""Inertia of what a beam carries about its far end [kg·m²]."""


def transmitted(time):
    """Moment that a beam transmits about its three axes (n, 3) [N·m]."""
    waves = (
        [(15.0, 0.31, 0.4), (9.0, 1.7, 1.1)],
        [(12.0, 0.5, 0.2), (8.0, 2.3, 1.0)],
        [(14.0, 0.4, 2.0), (5.0, 1.2, 0.3)],
    )
    return np.stack([wave(time, *terms)[0] for terms in waves], axis=-1)


def signals():
    """A joint's motion over 8 s, and 4000 random links; speeds from a crawl to about 4 rad/s."""
    q, qd, qdd = wave(TIME, (0.9, 0.23, 0.1), (0.4, 0.71, 1.3), (0.12, 1.9, 0.7))
    rng = np.random.default_rng(3)
    points = rng.normal(size=(TIME.size, 6, 3))
    masses = rng.uniform(0.5, 2.0, size=(TIME.size, 6))
    columns = {
        "q": q,
        "qd": qd,
        "qdd": qdd,
        "load": load(TIME),
        "inertia": 2.0,
        "temperature": 20 + 0.5 * TIME,
        "time": TIME,
    }
    columns |= {"speed_scale": np.abs(qd).max(), "value": value(TIME)}
    scalars = {name: np.broadcast_to(column, TIME.shape) for name, column in columns.items()}
    links = {"phi": inertial_parameters(masses, points), "tip": rng.normal(size=(TIME.size, 3))}
    slings = {
        "velocity": hang_point(TIME)[1],
        "weight": np.full(TIME.size, 400.0),
        "tension": np.full(TIME.size, 475.0),
    }
    links |= slings | {"spread": np.stack([4 + 3 * q**2, 20 + qd**2], axis=1)}
    links |= {"spin_rate": shaken(TIME)[0], "acceleration": shaken(TIME)[1]}
    links |= {"spin": spin(TIME), "spin_gained": spin(TIME), "impulse": told(TIME)[0]}
    links |= {"moment": transmitted(TIME), "inertia_beyond": np.broadcast_to(BEYOND.ravel(), (TIME.size, 9))}
    return scalars | links | contacts() | {"points": points, "masses": masses}


def contacts():
    """A cable on a pin, the cables' bending, and a target's motion: what laws of a capture read."""
    overlap, approach, _ = wave(TIME, (0.4, 0.3, 0.2))
    elastic = 2.0 * np.abs(overlap + 0.5) ** 1.5
    found = {"overlap": np.abs(overlap + 0.5), "approach": approach, "elastic_force": elastic, "normal_force": elastic}
    found |= {"slip": hang_point(TIME)[1], "slip_velocity": np.full(TIME.size, 2e-4)}
    found |= {"bending_stiffness": np.full(TIME.size, 0.25), "curvature_rate": wave(TIME, (3.0, 0.9, 0.1))[1]}
    return found | {"displacement": hang_point(TIME)[0]} | docking()


def docking():
    """Balls on their flanks and in their latches: what laws of a docking read."""
    x, y = wave(TIME, (0.7, 0.4, 0.2)), wave(TIME, (0.5, 0.9, 1.0))
    return {
        "presliding": np.stack([x[0], y[0]], axis=1),
        "across": x[0],
        "drawn": hang_point(TIME)[0],
        "stiffness": np.full(TIME.size, 3e3),
        "preload": np.full(TIME.size, 10.0),
        "since": TIME - 1.0,
    }


def shaken(time):
    """A base's angular and linear acceleration (2, n, 3) [rad/s², m/s²] that start from rest."""
    x, y, z = wave(time, (0.2, 0.31, 0.0), (0.1, 1.1, 0.0)), wave(time, (0.3, 0.23, 0.0)), wave(time, (0.1, 0.7, 0.0))
    return np.stack([[x[0], y[0], z[0]], [y[0], z[0], -x[0]]]).transpose(0, 2, 1)


def spin(time):
    """The base's angular velocity (n, 3) [rad/s], none at the start: the integral of `shaken`'s first."""
    x = 0.2 / 0.31 * np.sin(np.pi * 0.31 * time) ** 2 + 0.1 / 1.1 * np.sin(np.pi * 1.1 * time) ** 2
    y, z = 0.3 / 0.23 * np.sin(np.pi * 0.23 * time) ** 2, 0.1 / 0.7 * np.sin(np.pi * 0.7 * time) ** 2
    return np.stack([x, y, z], axis=-1) / np.pi


def told(time):
    """Impulse that wheels were told to give a base, and the torque (2, n, 3) [N·m·s, N·m]."""
    waves = [wave(time, (2.0, 0.31, 0.0)), wave(time, (1.5, 0.4, 0.0)), wave(time, (0.7, 0.9, 0.0))]
    return np.stack(waves, axis=-1)[:2]


def inertial_parameters(masses, points):
    """The ten numbers of clouds of point masses, by summation: shapes (n, k) and (n, k, 3) to (n, 10)."""
    x, y, z = np.moveaxis(points, -1, 0)
    terms = [np.ones_like(x), x, y, z, y**2 + z**2, -x * y, -x * z, x**2 + z**2, -y * z, x**2 + y**2]
    return np.stack([(masses * term).sum(axis=-1) for term in terms], axis=-1)


# ---- References: what hardware would have recorded, written without the laws -----------------------------------------
