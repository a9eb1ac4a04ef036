"""Captures of a few samples, and simulations of them that are straight lines over the effects' handles."""

from typing import Any

import numpy as np

from snarelab.identification.snare.fit import CaptureFit
from snarelab.identification.snare.handles import handle_of, key_of
from snarelab.identification.snare.recording import EVERY, CaptureRecording, Track
from snarelab.identification.snare.sets import CaptureSet
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.setup import CaptureSetup
from snarelab.models.snare.target import Target

FRICTION = PlacedEffect(get_effect("contact_friction"), "pin")
"""Its handle is the coefficient itself: from 0 to 1.5, differences of 0.03, tried at 0.08 and 0.25."""
PRETENSION = PlacedEffect(get_effect("cable_pretension"), "cables")
"""Its handle is the tension itself: from 0 to 5000 N, differences of 60 N."""
CLEARANCE = PlacedEffect(get_effect("hang_point_clearance"), "target")
"""Its handle is the play itself: from 0 to 0.1 m, differences of 0.4 mm."""
UMBILICAL = PlacedEffect(get_effect("umbilical_stiffness"), "target")
"""Its handle is the stiffness' root: from 0 to 100, differences of 1, tried at 20, 100 and 500 N/m."""


def track(position, quaternion=None, **force):
    """A track of positions (K, 3); without a quaternion it does not turn."""
    position = np.asarray(position, float)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(position), 1))
    return Track(position, still if quaternion is None else np.asarray(quaternion, float), force)


def capture(measured, *, path="a.csv", zero=0.0, noise=1e-4, target=None, carried=1.0, sensor="wrist"):
    """What was measured, all its forces by one sensor, with the same noise on position and force."""
    times = np.asarray(EVERY * np.arange(len(measured.position)), float)
    setup = CaptureSetup(SnareParameters(), target or Target("free"))
    scatter: dict[str, float] = dict.fromkeys(["position", *measured.force], noise)
    bodies = dict.fromkeys(measured.force, sensor)
    forces = dict.fromkeys(measured.force, carried)
    return CaptureRecording(path, "target", times, measured, bodies, setup, None, zero, scatter, forces, ())


def along(*directions):
    """A quarter of a second each: position (5 n, 3) that stands at these places [m]; a number is one along x."""
    places = [d if np.ndim(d) else (d, 0.0, 0.0) for d in directions]
    return np.repeat(np.array(places, float), 5, axis=0)


class Straight:
    """Simulations in which every handle moves the target along its own course, in proportion or by a given law.

    ``asked`` keeps the handles' values in the order they were asked for.
    """

    def __init__(self, courses, law=lambda x: x, fails=lambda _: False):
        self.courses, self.law, self.fails, self.asked = courses, law, fails, []

    def __call__(self, asked: Any):
        return [self.one(values) for _, values in asked]

    def one(self, values):
        handles = {p: handle_of(p).x(values[key_of(p)]) for p in self.courses if key_of(p) in values}
        self.asked.append(tuple(handles.values()))
        if self.fails(handles):
            return None
        still = 0.0 * next(iter(self.courses.values()))
        return track(sum((self.law(x) * self.courses[p] for p, x in handles.items()), start=still))


def captures_of(runs, *measured, **options):
    """A set of captures whose simulations are these runs."""
    own = [capture(track(position), **options) for position in measured]
    return CaptureSet(runs, range(len(own)), own)


def fit_of(placed, x, likelihood, residuals=(), tracks=(), slopes=None):
    """A fit as it came."""
    return CaptureFit(tuple(placed), np.array(x, float), likelihood, tuple(tracks), tuple(residuals), slopes)
