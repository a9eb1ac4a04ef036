"""The whole decision: search, confirm, search again in place of names that were not confirmed, nameless curves and
bursts.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ...models.model import Model
from ..deciding import SECOND_CHOICES
from ..fitting.base_parameters import BaseParameters
from ..fitting.experiment import Experiment, Scales
from ..verdict import Verdict, verdict
from .confirm import ArmConfirmation, confirm
from .nameless import NamelessParts, left_over
from .rounds import search
from .selection import ArmNaming


@dataclass(frozen=True)
class ArmDecision:
    """The decision: names that the held-out recordings confirmed, nameless curves and bursts, and the names that were
    rejected.
    """

    best: ArmConfirmation
    left: NamelessParts
    rejected: tuple[ArmNaming, ...]

    @property
    def verdict(self) -> Verdict:
        """The verdict by the names, and by nameless curves and bursts; a burst that occurs once does not count."""
        return verdict(self.best.names, [*self.left.curves, *(b for b in self.left.bursts.values() if b.again)])


def decide(
    model: Model,
    base: BaseParameters | None,
    scales: Mapping[str, Scales],
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> ArmDecision:
    """Name what a model leaves out.

    Parameters
    ----------
    model : Model
        Baseline.
    base : BaseParameters or None
        With ``inertia = "free"``.
    scales : mapping of str to Scales
    train, held : sequence of Experiment
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of random starts.
    """
    found = search(model, base, scales, train, held, progress=progress, seed=seed)
    best = last = confirm(found, train, held, scales, progress)
    rejected = {n.placed.key: n for n in last.rejected}
    for _ in range(SECOND_CHOICES):
        if not last.rejected:
            break
        progress("searching another explanation for what the held-out recordings did not confirm")
        again = search(
            model, base, scales, train, held, before=last.found, barred=rejected, progress=progress, seed=seed
        )
        last = confirm(again, train, held, scales, progress)
        rejected |= {n.placed.key: n for n in last.rejected}
        if last.forecast.density > best.forecast.density:
            best = last
    return ArmDecision(best, left_over(best, scales, train, held, rejected), tuple(rejected.values()))
