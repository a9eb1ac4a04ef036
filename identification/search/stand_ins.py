"""Names that only stand in for what has no name.

An effect outside the vocabulary is often mimicked in part: a damaged tooth by a ripple, a seal that drags over one
stretch by several small effects at once. Each then lowers the error on every recording, and none is the answer. What
tells is that a curve without a name, in blocks that it was not fitted to, leaves far less of the channel than all names
together, fitted to all blocks: a curve in their place, or one on top of them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.model import Placed
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit, channel_rms
from .choice import Taken
from .forward import Found, carry, without
from .rest import moving

LEFT = 0.7
"""Names stand in for something else where a curve leaves less than this share of the energy that they leave, ..."""

LOUDER = 1.3
"""... gains this much more than they did, in blocks that neither was fitted to, ..."""

PLAIN = 0.5
"""... and explains this share of the whole, ..."""

MUCH = 0.1
"""... of which they leave this share: what explains nearly all of it is its name."""


def stand_ins(
    found: Found, confirmed: Sequence[Taken], final: Fit, experiments: Sequence[Experiment]
) -> tuple[tuple[Taken, ...], Found]:
    """Names that a nameless curve beats where they show most, and the search with those curves as its remainder.

    Parameters
    ----------
    found : Found
    confirmed : sequence of Taken
        What the held-out recording confirmed.
    final : Fit
        With these.
    experiments : sequence of Experiment
        Training recordings.
    """
    in_motion = [moving(e) for e in experiments]
    after, _ = channel_rms(final.assembly, in_motion, final.theta)
    before, _ = channel_rms(found.first.assembly, in_motion, found.first.theta)
    left = (after / np.maximum(before, 1e-300)) ** 2
    curves = found.opening.nameless

    def better(c: int) -> bool:
        # Each name was judged on top of those before it, so that what they gain adds up.
        gained = sum(t.gained for t in confirmed if c in t.judged.channels)
        x, more = curves[c], found.closing.nameless.get(c)
        leaves = min(1.0 - x.share, left[c] * (1.0 - (more.share if more else 0.0)))
        return left[c] > MUCH and x.share > PLAIN and leaves < LEFT * left[c] and x.gain > LOUDER * gained

    poor = {c for c in curves if better(c)}
    doubtful = tuple(t for t in confirmed if poor and _mainly(final, t.judged.placed, experiments) in poor)
    nameless = {**found.closing.nameless, **{c: curves[c] for c in poor}} if doubtful else found.closing.nameless
    return doubtful, replace(found, closing=replace(found.closing, nameless=nameless))


def _mainly(final: Fit, placed: Placed, experiments: Sequence[Experiment]) -> int:
    """The channel on which an effect shows most, as the fit weights them."""
    assembly = without(final, placed)
    theta = carry(final, assembly)
    shown = [e.motion.to_band(final.assembly.torque(e, final.theta) - assembly.torque(e, theta)) for e in experiments]
    return int(np.argmax(np.sum((np.concatenate(shown) / final.sigma) ** 2, axis=0)))
