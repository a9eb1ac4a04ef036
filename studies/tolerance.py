"""How far off can the arm arrive and still capture? The ground test and the inspection case over all that is not known.

Chooses cases where success is in doubt until the boundary is narrow or the cases are used up, runs the paper's own
misalignment by itself, and goes on where it was stopped. The cases are kept in
``build/studies/tolerance/<study>-<version>``, a folder for each version of the physics. It starts from the cases of
that version in ``tolerance/kept``: a study of hours goes on on another machine, and its figures are told in seconds.
"""

import shutil
import sys
import time
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..exit_status import status_of
from ..files import written_whole
from ..progress import Progress
from ..report.html import page, paragraph
from ..report.html import table as markup_table
from ..tolerance.report import summarise
from ..tolerance.results import Results
from ..tolerance.run import run_study
from ..tolerance.study import Study, load_study
from .outcome import FOLDER, Quantity, table, write_result

STUDIES = {
    "ground": "ground_",
    "inspection": "",
    "latched_ground": "latched.ground_",
    "latched_inspection": "latched.",
    "latched_hover": "latched.hover_",
}
"""And what stands before the names of their quantities: without another word they are of the inspection case."""
_FILES = Path(__file__).parents[1] / "tolerance"
KEPT = Path("tolerance/kept")
"""Cases that the repository keeps, from its root, where studies run; an installed package has none."""


def main() -> int:
    """Run all studies, or go on with them; leaves reports and numbers in ``build/studies/tolerance``."""
    begun = time.monotonic()
    folder = FOLDER / "tolerance"
    folder.mkdir(parents=True, exist_ok=True)
    quantities, found = [], []
    for name, prefix in STUDIES.items():
        results, content, seconds = _run(folder, load_study(_FILES / f"{name}.toml"))
        quantities += _quantities(prefix, content)
        if seconds is not None:
            quantities.append(Quantity(f"{prefix}seconds_per_case", "s", seconds, "reference"))
        found.append((content, results.folder.name))
        print(f"  {content['sentence']}", flush=True)
    sentences = " ".join(content["sentence"] for content, _ in found)
    with written_whole(folder / "report.html") as part:
        part.write_text(_page(quantities, found), encoding="utf-8")
    write_result("tolerance", quantities, time.monotonic() - begun, {"found": sentences})
    print(f"{table(quantities)}\n\n{sentences}\nReport: {(folder / 'report.html').resolve()}")
    return 0


def _run(folder: Path, study: Study) -> tuple[Results, dict[str, Any], float | None]:
    """Results, their summary, and the time by the clock a case took [s], where cases were run."""
    results = opened(folder, study)
    known, begun = len(results), time.monotonic()
    print(f"  {study.name}: {known} cases are there; captures run until the boundary is narrow ...", flush=True)
    with Progress() as show:
        run_study(study, results, say=lambda text: show(f"{study.name}: {text}"))
    new = len(results) - known
    seconds = (time.monotonic() - begun) / new if new else None
    return results, summarise(study, results), seconds


def opened(folder: Path, study: Study, kept: Path = KEPT) -> Results:
    """A study's results in its folder, which starts from the kept cases of the same version, if there are any."""
    own = f"{study.name}-{study.capture.version}"
    if (kept / own).is_dir() and not (folder / own).exists():
        shutil.copytree(kept / own, folder / own)
    return Results(folder / own, study)


def _quantities(prefix: str, content: dict[str, Any]) -> list[Quantity]:
    return [
        _quantity(f"{prefix}probability_at_paper", "1", content["probability_box"]),
        _quantity(f"{prefix}envelope_radial", "m", content["envelope_radial"]),
        _quantity(f"{prefix}envelope_angle", "rad", content["envelope_angle"]),
        Quantity(f"{prefix}undecided", "1", content["width"], "reference"),
        Quantity(f"{prefix}cases", "1", content["cases"], "reference"),
        *(
            Quantity(f"{prefix}proxy_{key}", "1", content["proxy"][key], "reference")
            for key in ("disagree", "latched_against", "failed_against")
            if "proxy" in content
        ),
    ]


def _quantity(name: str, unit: str, interval: dict[str, float | None]) -> Quantity:
    if interval["value"] is None:
        raise InputError(f"tolerance: {name} is unknown: the nominal capture fails; look at the study's criterion")
    return Quantity(name, unit, interval["value"], "reference", None, interval["low"], interval["high"])


def _page(quantities: list[Quantity], found: list[tuple[dict[str, Any], str]]) -> str:
    links = "".join(
        f'<li><a href="{folder}/report.html">{content["study"]}</a>: maps, envelope, sensitivities'
        f"{', typical misses to play' if content['misses'] else ''}.</li>"
        for content, folder in found
    )
    rows = [
        [q.name.replace("_", " "), f"{q.ours:.4g}", "" if q.low is None else f"{q.low:.4g} to {q.high:.4g}", q.unit]
        for q in quantities
    ]
    numbers = markup_table(
        "Of the inspection case, where no other is named. Intervals of probabilities are exact at 95 % (Clopper and "
        "Pearson); those of an envelope run from the last capture outwards that succeeded to the first that did not.",
        ["quantity", "ours", "interval", "unit"],
        rows,
        numeric=(1, 2),
    )
    parts = [("numbers", "In numbers", numbers), ("studies", "The studies", f"<ul>{links}</ul>")]
    header = "<h1>How far off may the arm arrive?</h1>" + "".join(
        paragraph(c["sentence"]) + paragraph(c["box"]) for c, _ in found
    )
    return page("Capture tolerances", header, parts, "Written by snarelab: make study-tolerance.")


if __name__ == "__main__":
    sys.exit(status_of(main))
