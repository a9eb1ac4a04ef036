"""The words of a diagnosis: verdict, evidence and experiments, as a test engineer would say them."""

from collections.abc import Sequence

from ..models.model import Placed
from .diagnosis import ChannelFit, Finding
from .report.words import words


def percent(share: float, digits: int = 2) -> str:
    """A share (0 to 1) in per cent, to so many digits below a hundred."""
    value = 100 * share
    return f"{value:.{digits}g} %" if abs(value) < 10 else f"{value:.{digits - 2}f} %"


def from_to(before: float, after: float) -> str:
    """``from 14 % to 3.1 %``, with as many digits as it takes to see the difference."""
    digits = next((d for d in (2, 3) if percent(before, d) != percent(after, d)), 4)
    return f"from {percent(before, digits)} to {percent(after, digits)}"


def evidence_sentence(
    placed: Placed, explained: float, channels: Sequence[str], relative_with: float, relative_without: float
) -> str:
    """What an effect explains, and what happens on the held-out recording when it is taken out again."""
    where = " and ".join(channels) if len(channels) < 3 else f"{len(channels)} channels"
    what = placed.effect.sentence
    return (
        f"{what[:1].upper()}{what[1:]}: it explains {percent(explained)} of what the model so far left over on "
        f"{where}; "
        f"taking it out again raises the error on the held-out recording {from_to(relative_with, relative_without)}."
    )


def experiment_sentence(placed: Placed, rival: Placed) -> str:
    """The motion or measurement that would tell two effects apart."""
    own, other = placed.effect.experiment, rival.effect.experiment
    joint = rival.at.removeprefix("tau.").removeprefix("q.")
    if other and other != own:
        return other.format(at=joint)
    return own.format(at=placed.at.removeprefix("tau.").removeprefix("q."))


def verdict_sentence(findings: Sequence[Finding], fit: Sequence[ChannelFit], remainder: str) -> str:
    """The first sentence of the report."""
    worst = max(fit, key=lambda f: f.holdout.relative_before - f.holdout.relative_after)
    if not findings:
        worst = max(fit, key=lambda f: f.holdout.relative_before)
    if findings:
        by_name: dict[str, list[str]] = {}
        for f in findings:
            by_name.setdefault(f.name, []).append(f.at)
        named = [f"{words(name)} at {listed(places)}" for name, places in by_name.items()]
        fall = from_to(worst.holdout.relative_before, worst.holdout.relative_after)
        return (
            f"The model leaves out {listed(named)}. With that added, the error of {worst.channel} on the recording "
            f"that the fit never saw falls {fall}.{remainder}"
        )
    if remainder:
        return f"Something is missing on {worst.channel} that no effect of the vocabulary explains.{remainder}"
    return (
        f"The model is adequate: nothing is left out that these recordings can show. "
        f"On the recording that the fit never saw, the error of {worst.channel} is "
        f"{percent(worst.holdout.relative_before)}."
    )


def listed(items: Sequence[str]) -> str:
    """``a, b and c``."""
    if len(items) < 2:
        return "".join(items)
    return ", ".join(items[:-1]) + " and " + items[-1]
