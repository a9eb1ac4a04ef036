"""The verdict that no physics can be named, because recordings and model contradict each other."""

from collections.abc import Sequence
from pathlib import Path

from ..models.model import Model
from ..report.words import words
from .checks.finding import CheckFinding
from .diagnosis import Diagnosis
from .fitting.experiment import Experiment
from .verdict import verdict
from .wording import listed

_MEND = "Correct this first, with the lines under checks, or go on with --anyway."


def contradict(checks: Sequence[CheckFinding]) -> bool:
    """Whether one of the findings is that recordings and model contradict each other."""
    return any(check.fault for check in checks)


def data_fault(model: Model, checks: Sequence[CheckFinding], experiments: Sequence[Experiment] = ()) -> Diagnosis:
    """A diagnosis that names no physics: what is not as it should be, and the lines that mend it."""
    faults = [check for check in checks if check.fault]
    messages = list(dict.fromkeys(check.message for check in faults))
    places = listed([check.at for check in faults if check.message == messages[0]])
    more = f" Besides: {'; '.join(messages[1:])}." if len(messages) > 1 else ""
    sentence = (
        f"The recordings and the model contradict each other, and no physics explains it "
        f"({words(faults[0].name)} at {places}): {messages[0]}.{more} {_MEND}"
    )
    notes = [*model.tree.notes]
    notes += [f"{Path(e.motion.path).name}: {note}" for e in experiments for note in e.motion.notes]
    band = experiments[0].motion.band if experiments else 0.0
    said = verdict((), (), faults)
    return Diagnosis(said, sentence, "", model.name, (), (), (), (), (), (), (), (), tuple(notes), band, tuple(checks))
