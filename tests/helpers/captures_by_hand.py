"""Captures worked out by hand, and simulations of them that are straight lines over the effects' values."""

from pathlib import Path
from typing import Any

import numpy as np

from snarelab.identification.snare.recording import EVERY, CaptureRecording, Start, Track
from snarelab.identification.snare.source import Captures
from snarelab.models.effects import get_effect
from snarelab.models.model import Model, PlacedEffect
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.setup import CaptureSetup, SnareTree
from snarelab.models.snare.target import Target

FRICTION = PlacedEffect(get_effect("contact_friction"), "pin")
"""Tried at 0.08 and 0.25."""
PRETENSION = PlacedEffect(get_effect("cable_pretension"), "cables")
"""Tried at 200 and 800 N."""
DAMPING = PlacedEffect(get_effect("cable_damping"), "cables")
"""The set-up's rope has 1 ms; tried at 3 and 10 ms."""
STIFFNESS = PlacedEffect(get_effect("contact_stiffness"), "pin")
"""The set-up's steel has 1.66e9; tried at 1e7, 2e6 and 3e5."""


def key_of(placed):
    (x,) = placed.effect.parameters
    return f"{placed.key}.{x.name}"


def track(position, quaternion=None, **force):
    """A track of positions (K, 3); without a quaternion it does not turn."""
    position = np.asarray(position, float)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(position), 1))
    return Track(position, still if quaternion is None else np.asarray(quaternion, float), force)


def known(setup):
    """A start that is known exactly."""
    return Start(setup.target.position, setup.target.velocity, np.zeros(3), 0.0)


def capture(measured, *, path="a.csv", zero=0.0, noise=1e-4, target=None, carried=1.0, sensor="wrist"):
    """What was measured, all its forces by one sensor, with the same noise on position and force."""
    times = np.asarray(EVERY * np.arange(len(measured.position)), float)
    setup = CaptureSetup(SnareParameters(), target or Target("free"))
    scatter: dict[str, float] = dict.fromkeys(["position", *measured.force], noise)
    bodies = dict.fromkeys(measured.force, sensor)
    forces = dict.fromkeys(measured.force, carried)
    start = known(setup)
    return CaptureRecording(path, "target", times, measured, bodies, setup, start, None, zero, scatter, forces, ())


def along(*directions):
    """A quarter of a second each: position (5 n, 3) that stands at these places [m]; a number is one along x."""
    places = [d if np.ndim(d) else (d, 0.0, 0.0) for d in directions]
    return np.repeat(np.array(places, float), 5, axis=0)


class Straight:
    """Simulations (K, 3) of the target: a motion that all have, and a course in proportion to each value, or a law of
    it; the cables touch from a time of the track on; a deviation of the start velocity is a ``push`` [m/s]. ``asked``
    keeps what was asked for, ``numbers`` of which capture; it stands for processes."""

    def __init__(self, motion, courses=(), law=None, fails=lambda _: False, touch=0, push=0.0):
        self.motion, self.courses, self.law = np.asarray(motion, float), dict(courses), law or {}
        self.fails, self.touch, self.push, self.asked, self.numbers = fails, touch, push, [], []

    def __call__(self, asked: Any):
        self.numbers += [n for n, *_ in asked]
        return [self.one(values, faster) for _, values, faster in asked]

    @property
    def count(self):
        return len(self.asked)

    def one(self, values, faster=(0.0, 0.0, 0.0)) -> Any:
        self.asked.append(dict(values))
        if self.fails(values):
            return None
        moved = [self.law.get(k, float)(values[k]) * x for k, x in self.courses.items() if k in values]
        if self.push:
            moved.append(self.push * EVERY * np.outer(np.arange(len(self.motion)), faster))
        force = np.where(np.arange(len(self.motion)) < self.touch, 0.0, 1.0)[:, None] * np.ones(3)
        return track(sum(moved, start=self.motion), target=force, effector=-force)


def model_of(given=("ring_radius", "pin_radius", "mass"), effects=(), values=None, support: Any = "free") -> Model:
    """A capture whose file gives these numbers of the set-up."""
    setup = CaptureSetup(SnareParameters(friction=0.0, contact_damping=0.0), Target(support), dict.fromkeys(given, 1.0))
    tree = SnareTree("capture", (), (), np.array([-9.81, 0.0, 0.0]), setup)
    return Model(
        Path("model.toml"),
        "capture",
        "snare_capture",
        None,
        tree,
        "fixed",
        tuple(effects),
        {},
        None,
        dict(values or {}),
    )


def captures_of(runs, *measured, n_train=1, model=None, noise=1e-4):
    """Captures whose simulations are these runs."""
    own = [capture(track(x), path=f"{k}.csv", noise=noise) for k, x in enumerate(measured)]
    return Captures(model or model_of(), own, n_train, runs)
