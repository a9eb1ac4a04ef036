"""Readings of the data compete: which one explains what physics could only explain with impossible values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...report.words import percent
from .case import ALL, CheckCase
from .evidence import ReadingFit
from .finding import CheckFinding
from .reading import Reading

ODDS = 1e-3
"""Prior probability of one kind of mistake in a recording that was made with care."""

SURE = 0.95
"""Probability from which on a reading is said to be the one."""

SOUND, SOUND_OF_MANY = 0.02, 0.15
"""Relative residual of every channel up to which the reading as given stands and no other is tried; the second of
robots of more joints than `case.ALL`, which cost more."""

BETTER, CHEAPER = 0.6, 8.0
"""What a reading explains must be plain: it leaves at most this share of a channel's residual, or its parameters are
that many nats likelier, which is an offset of four standard deviations less."""

LEFT = 0.25
"""Most that a reading may leave of the torque on the channel that it mends best, or, where only its parameters are
likelier, on any: a reading that explains hardly more is one of several mistakes, or none."""

CLOSELY = 12
"""Readings that are fitted between bounds, after all were without."""


@dataclass(frozen=True, eq=False)
class ReadingScore:
    """A reading, its fit, and its log posterior odds against the reading as given."""

    reading: Reading
    fit: ReadingFit
    odds: float


def compete(case: CheckCase, readings: Sequence[Reading]) -> list[ReadingScore]:
    """Scores of all readings, best first; empty where the reading as given is sound.

    All are fitted without bounds first, and the `CLOSELY` best with them. Odds are evidence times prior odds. The
    readings of one kind share `ODDS`. Positions, speeds and torques far beyond the URDF's limits count against a
    reading.
    """
    given = case.given
    if not readings or is_sound(case):
        return []
    kinds = {r.name: sum(other.name == r.name for other in readings) for r in readings}
    prior = {r.name: np.log(ODDS / kinds[r.name]) for r in readings}

    def odds(reading: Reading, fit: ReadingFit, base: float) -> float:
        return fit.value + limits(case, reading) - base + prior[reading.name] + reading.rarer

    plain = case.grounds.fit(case.reading("", (), "", ()), bounded=False)
    base = plain.value + limits(case, case.reading("", (), "", ()))
    rough = [(odds(r, case.grounds.fit(r, bounded=False), base), r) for r in readings]
    rough.sort(key=lambda pair: -pair[0])
    bound = given.value + limits(case, case.reading("", (), "", ()))
    judged = []
    for _, reading in rough[:CLOSELY]:
        fit = case.grounds.fit(reading)
        judged.append(ReadingScore(reading, fit, odds(reading, fit, bound)))
    return sorted(judged, key=lambda j: -j.odds)


def is_sound(case: CheckCase) -> bool:
    """Whether the residual of the reading as given is so small that no other needs to be tried."""
    bar = SOUND if len(case.joints) <= ALL else SOUND_OF_MANY
    return bool(np.nanmax(case.given.relative) <= bar)


def findings(case: CheckCase, judged: Sequence[ReadingScore]) -> list[CheckFinding]:
    """Findings of the best reading, if it is sure and clear: one for each of its channels.

    The probability of a place is that of its reading among all, the reading as given included; readings that say the
    same of the torque (an encoder reversed, or its torque) share it, and the message names them.
    """
    if not judged:
        return []
    best = judged[0]
    log_odds = np.array([0.0, *(j.odds for j in judged)])
    share = np.exp(log_odds - log_odds.max())
    share /= share.sum()
    fault = float(share[1:].sum())
    # Where a reading gives a recorded torque to another joint, its error is compared with its own, not that joint's.
    before = case.given.relative[best.reading.torque_source]
    change = best.fit.relative / np.maximum(before, 1e-12)
    worst = int(np.nanargmin(change))
    plain = change[worst] <= BETTER and best.fit.relative[worst] <= LEFT
    likelier = case.given.prior - best.fit.prior >= CHEAPER and np.nanmax(best.fit.relative) <= LEFT
    if fault < SURE or not (plain or likelier):
        return []
    fall = (
        f"the error of tau.{case.joints[worst]} falls from {percent(before[worst])} to "
        f"{percent(best.fit.relative[worst])}"
    )
    alike = [j.reading for j, s in zip(judged[1:], share[2:], strict=True) if s > 0.05]
    besides = f"; as likely: {'; '.join(r.message for r in alike[:3])}" if alike else ""
    beyond = beyond_limits(case, case.reading("", (), "", ()))
    stated = f"; as it is read, {beyond}" if beyond else ""
    return [
        CheckFinding(
            best.reading.name,
            at,
            float(share[1]) if not alike else fault,
            f"{best.reading.message}: {fall}{besides}{stated}",
            mend,
        )
        for at, mend in zip(best.reading.at, best.reading.mends, strict=True)
    ]


def limits(case: CheckCase, reading: Reading) -> float:
    """Log prior of where a reading puts the robot: far outside the URDF's limits is rare (to -10), inside is 0."""
    return -10.0 * min(1.0, 2 * max((share for share, _ in _beyond(case, reading)), default=0.0))


def beyond_limits(case: CheckCase, reading: Reading) -> str:
    """In words, what lies far beyond the URDF's limits; empty where nothing does."""
    worst = max(_beyond(case, reading), default=(0.0, ""))
    return worst[1] if worst[0] > 0.05 else ""


def _beyond(case: CheckCase, reading: Reading) -> list[tuple[float, str]]:
    """Share of samples far beyond a limit (a quarter of a joint's range, twice a speed, three efforts), and where."""
    samples = case.samples.under(reading)
    found = []
    for j, joint in enumerate(case.tree.joints):
        q, span = samples.q[:, j], joint.upper - joint.lower
        if np.isfinite(span) and span > 0:
            out = (q < joint.lower - 0.25 * span) | (q > joint.upper + 0.25 * span)
            text = f"q.{joint.name} goes from {q.min():.3g} to {q.max():.3g}, and the URDF allows {joint.lower:g} to "
            found.append((float(np.mean(out)), f"{text}{joint.upper:g}"))
        for name, values, limit, times in (
            ("speed", samples.qd[:, j], joint.speed, 2.0),
            ("effort", samples.tau[:, j], joint.effort, 3.0),
        ):
            if 0 < limit < np.inf:
                top = np.abs(values).max()
                text = f"the {name} of {joint.name} reaches {top:.3g}, and the URDF allows {limit:g}"
                found.append((float(np.mean(np.abs(values) > times * limit)), text))
    return found
