"""The diagnosis as one self-contained HTML page for test engineers: the answer on one sheet, then its grounds."""

from datetime import date
from functools import partial
from pathlib import Path

from ...errors import InputError
from ...files import written_whole
from ...report.html import page
from ...report.provenance import Provenance, provenance
from ..diagnosis import Diagnosis
from .answer import answer
from .findings import STATUS, checked, missing, verdict, where
from .fit import notes, parameters, screened, shape, step_by_step, unseen


def write_report(diagnosis: Diagnosis, path: str | Path, origin: Provenance | None = None) -> None:
    """Write a diagnosis as one HTML file that needs nothing else, and asks nothing of the network.

    ``origin`` is what it stands on: command, files and versions; without it, the versions are told. The file appears
    whole or not at all. Raises InputError where it cannot be written.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it, or choose another")
    document = _document(diagnosis, date.today(), origin or provenance())
    with written_whole(path) as part:
        part.write_text(document, encoding="utf-8")


def _document(diagnosis: Diagnosis, day: date, origin: Provenance) -> str:
    first = partial(answer, origin=origin)
    parts = (first, missing, where, partial(unseen, skip=1), step_by_step, shape, screened, parameters, notes)
    if diagnosis.verdict == "data_fault":  # nothing was fitted
        parts = (first, checked, notes)
    elif diagnosis.checks:
        parts = (*parts[:-1], checked, notes)
    return page(
        f"{diagnosis.model}: {STATUS[diagnosis.verdict]}",
        verdict(diagnosis, day),
        [part(diagnosis) for part in parts],
        f"Written by snarelab. All residuals are measurement minus model, in the band 0 to {diagnosis.band:.3g} Hz.",
    )
