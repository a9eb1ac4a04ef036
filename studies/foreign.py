"""Machines that no rule of ours was made on: their publishers' bytes, through a model file alone, to a verdict."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ..identification.diagnose import Answer, diagnose
from ..identification.report.page import write_report
from ..models.model_file import load_model
from ..models.model_write import save_model
from ..progress import stages
from ..report.provenance import provenance
from .outcome import FOLDER, Quantity, table, write_json, write_result
from .page import Section, write_page


@dataclass(frozen=True)
class Machine:
    """One study.

    Parameters
    ----------
    name, title : str
    model : Path
    train : sequence of str
        Recordings to fit, or parts of them.
    holdout : sequence of str
    sections : callable
        What the page says of an answer, beside the numbers.
    """

    name: str
    title: str
    model: Path
    train: Sequence[str]
    holdout: Sequence[str]
    sections: Callable[[Answer], list[Section]]


def run(machine: Machine, more: Callable[[Answer], list[Quantity]] = lambda _: []) -> Answer:
    """Diagnose, and leave page, numbers, diagnosis and the improved model in ``build/studies/NAME``.

    Parameters
    ----------
    machine : Machine
    more : callable
        Quantities of its own.
    """
    begun = time.monotonic()
    answer = diagnose(
        load_model(machine.model), machine.train, machine.holdout, progress=stages(partial(print, flush=True))
    )
    found, folder = answer.diagnosis, FOLDER / machine.name
    folder.mkdir(parents=True, exist_ok=True)
    quantities = [*_misfits(answer), *more(answer)]
    save_model(answer.model, folder / "model.toml", found.sentence)
    files: list[tuple[str, str | Path]] = [
        ("Model", machine.model),
        *(("Training", x) for x in machine.train),
        *(("Held-out", x) for x in machine.holdout),
    ]
    write_report(found, folder / "diagnosis.html", provenance(f"make study-{machine.name}", files))
    write_json(folder / "diagnosis.json", found.to_json())
    write_result(machine.name, quantities, time.monotonic() - begun, {"steps": [vars(s) for s in found.steps]})
    page = write_page(machine.name, machine.title, found.sentence, quantities, machine.sections(answer), files=files)
    print(f"{table(quantities)}\n\n{found.sentence}\nReport: {page.resolve()}")
    return answer


def _misfits(answer: Answer) -> list[Quantity]:
    """Held-out error of each channel before and after, relative to what was measured; names, verdict."""
    found = answer.diagnosis
    quantities = []
    for f in found.fit:
        quantities.append(Quantity(f"holdout_before.{f.channel}", "1", f.holdout.relative_before, "reference"))
        quantities.append(Quantity(f"holdout_after.{f.channel}", "1", f.holdout.relative_after, "reference"))
    named = ", ".join(f"{e.name} at {e.at}" for e in found.effects) or "nothing"
    return [
        *quantities,
        Quantity("named", "", named, "reference"),
        Quantity("verdict", "", found.verdict, "reference"),
    ]


def alike(answer: Answer) -> str:
    """In a sentence, what the recordings cannot tell from what was named."""
    pairs = [
        f"{e.name.replace('_', ' ')} at {e.at} from {r.name.replace('_', ' ')} at {r.at}"
        for e in answer.diagnosis.effects
        for r in e.rivals
        if not r.separable
    ]
    return (
        f"These recordings cannot tell {'; nor '.join(pairs)}."
        if pairs
        else "Nothing named has a rival that these recordings cannot tell from it."
    )
