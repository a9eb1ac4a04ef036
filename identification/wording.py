"""The words of a diagnosis: verdict, evidence and experiments, as a test engineer would say them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..models.model import PlacedEffect
from ..report.words import chance, percent, words
from .diagnosis import ChannelFit, Finding
from .nuisance.noise import Noise

LIKELY = 0.5
"""Probability [1] from which an effect is said to be there; below it, another explanation is likelier."""


def from_to(before: float, after: float) -> str:
    """``from 14 % to 3.1 %``, with as many digits as it takes to see the difference."""
    digits = next((d for d in (2, 3) if percent(before, d) != percent(after, d)), 4)
    return f"from {percent(before, digits)} to {percent(after, digits)}"


def evidence_sentence(
    placed: PlacedEffect, channels: Sequence[str], relative_with: float, relative_without: float
) -> str:
    """What an effect explains, and what happens on the held-out recording when it is taken out again."""
    where = " and ".join(channels) if len(channels) < 3 else f"{len(channels)} channels"
    what = placed.effect.sentence
    explained = 1 - (relative_with / relative_without) ** 2 if relative_without > relative_with else 0.0
    told = f"it explains {_part(explained)} the remaining residual of {where}"
    return (
        f"{what[:1].upper()}{what[1:]}: {told}. "
        f"Without it, the error on the held-out recording rises {from_to(relative_with, relative_without)}."
    )


def _part(share: float) -> str:
    """A share of what was left."""
    return "all of" if share > 0.995 else f"{percent(share)} of"


def experiment_sentence(placed: PlacedEffect, rival: PlacedEffect) -> str:
    """The motion or measurement that would tell two effects apart."""
    own, other = placed.effect.experiment, rival.effect.experiment
    joint = rival.at.removeprefix("tau.").removeprefix("q.")
    if other and other != own:
        return other.format(at=joint)
    return own.format(at=placed.at.removeprefix("tau.").removeprefix("q."))


def rejection(placed: PlacedEffect) -> str:
    """The note on an effect that the training recordings asked for and the held-out ones did not confirm."""
    return (
        f"{placed.effect.name} at {placed.at} passed on the training recordings, but the held-out ones are predicted "
        "no better with it: not named"
    )


def noise_words(unit: str, noise: Noise, encoders: Sequence[NDArray[np.float64]]) -> str:
    """What a channel's noise is made of, with sizes and times."""
    u = unit.replace("*", "·")
    heard = float(np.sqrt(np.mean(np.concatenate(encoders) ** 2)))
    parts = [
        f"{noise.white:.2g} {u} from sample to sample",
        f"{noise.coloured:.2g} {u} over {noise.coloured_time:.2g} s{' (smooth)' if noise.order == 2 else ''}",
        f"a wander of {noise.wander:.2g} {u} over {noise.wander_time:.2g} s",
        f"{heard:.2g} {u} of the encoders",
    ]
    if (v := noise.vibration) is not None:
        where = "any speed" if v.steady else f"about {percent(v.pace)} of the peak speed"
        parts.append(f"a vibration of {v.level:.2g} {u} and {v.frequency:.2g} Hz at {where}")
    return listed(parts)


def foremost(findings: Sequence[Finding], fit: Sequence[ChannelFit], remainder: str = "") -> ChannelFit:
    """The channel that the first sentence speaks of, and that the report draws first.

    With names, the one whose relative error on all held-out recordings together falls most; where something is left
    that has no name, the one with the largest; of an adequate model, the one that stands highest above its noise.
    """
    if findings:
        return max(fit, key=lambda f: f.holdout.relative_before - f.holdout.relative_after)
    if remainder:
        return max(fit, key=lambda f: f.holdout.relative_before)
    return max(fit, key=lambda f: f.holdout.rms_before / f.noise_floor if f.noise_floor > 0 else 0.0)


def verdict_sentence(
    findings: Sequence[Finding], fit: Sequence[ChannelFit], remainder: str, noise: Mapping[str, str] | None = None
) -> str:
    """The first sentence of the report; ``noise`` tells what explains the rest of each channel."""
    worst = foremost(findings, fit, remainder)
    if findings:
        before, after = worst.holdout.relative_before, worst.holdout.relative_after
        return (
            f"The model leaves out {named(findings)}. With that added, the error of {worst.channel} on the held-out "
            f"recording {'rises' if after > before else 'falls'} {from_to(before, after)}.{remainder}"
        )
    if remainder:
        return f"Something is missing on {worst.channel} that no effect of the vocabulary explains.{remainder}"
    return f"The model is adequate: nothing larger than the limits listed is left out. {_rest(worst, noise or {})}"


def _rest(worst: ChannelFit, noise: Mapping[str, str]) -> str:
    """An adequate model's remaining residual, on the channel where it stands highest above the noise."""
    share = percent(worst.holdout.relative_before)
    left = f"The remaining residual on the held-out recording is {share} of {worst.channel}"
    if worst.noise_floor > 0:
        left += f", {worst.holdout.rms_before / worst.noise_floor:.2g} times that channel's noise floor"
    told = f" It is noise: {noise[worst.channel]}." if worst.channel in noise else ""
    return f"{left}.{told}"


def named(findings: Sequence[Finding]) -> str:
    """Effects with their places, the likely ones first; what is less likely than not is said to be so."""
    sure: dict[str, list[str]] = {}
    for f in findings:
        if f.probability >= LIKELY:
            sure.setdefault(f.name, []).append(f.at)
    doubtful = [
        f"{words(f.name)} at {f.at} ({chance(f.probability)})"
        for f in sorted(findings, key=lambda f: -f.probability)
        if not f.probability >= LIKELY
    ]
    certain = listed([f"{words(name)} at {listed(places)}" for name, places in sure.items()])
    if not doubtful:
        return certain
    return f"{certain}, and perhaps {listed(doubtful)}" if certain else f"something, perhaps {listed(doubtful)}"


def listed(items: Sequence[str]) -> str:
    """``a, b and c``."""
    if len(items) < 2:
        return "".join(items)
    return ", ".join(items[:-1]) + " and " + items[-1]
