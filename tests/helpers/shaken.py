"""A structure that is shaken while its joint moves at a pace: an oscillator of its own, drawn in continuous time."""

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter


def rung(rng, force, step, hertz, damping):
    """Position (n,) of x'' + 2 ζ ω x' + ω² x = force(t) w(t), w white, at rest before; of unit RMS at a force of one.

    Each sample is a kick, and the exact propagator leads to the next.
    """
    w = 2 * np.pi * hertz
    forward = expm(step * np.array([[0.0, 1.0], [-(w**2), -2 * damping * w]]))
    denominator = [1.0, -np.trace(forward), np.linalg.det(forward)]
    response = np.asarray(lfilter([0.0, forward[0, 1]], denominator, np.eye(1, 20_000)[0]))
    x = np.asarray(lfilter([0.0, forward[0, 1]], denominator, rng.normal(size=len(force)) * force))
    return x / np.sqrt(np.sum(response**2))


def chattering(rng, at_pace, step, hertz):
    """A joint that chatters by itself while it moves at a pace (n,), and is damped else (van der Pol):

    x'' - 0.6 ω (1 - 4 x²) x' + ω² x = w at the pace, where it ends at an amplitude of one; x'' + 0.6 ω x' + ω² x = w
    """
    w, fine, x, v = 2 * np.pi * hertz, 20, 0.0, 0.0
    h, found = step / fine, np.empty(len(at_pace))
    kicks = 0.02 * w**2 * np.sqrt(step * h) * rng.normal(size=(len(at_pace), fine))
    for k, on in enumerate(at_pace):
        found[k] = x
        for kick in kicks[k]:
            push = 0.6 * w * (1 - 4 * x * x) * v if on else -0.6 * w * v
            v += h * (push - w * w * x) + kick
            x += h * v
    return found
