"""How far off can the target be and still be captured? The ground test over misalignment and friction.

Chooses cases where success is in doubt until the boundary is narrow, runs the paper's own misalignment by itself, and
goes on where it was stopped. The cases are kept in ``build/studies/tolerance/cases``.
"""

import sys
import time
from pathlib import Path

from ..errors import InputError
from ..tolerance.report import summarise
from ..tolerance.results import Results
from ..tolerance.run import run_study
from ..tolerance.study import load_study
from .outcome import FOLDER, Quantity, table, write_result

STUDY = Path(__file__).parents[1] / "tolerance" / "ground.toml"


def main() -> int:
    """Run the study, or go on with it; leaves report and numbers in ``build/studies/tolerance``."""
    begun = time.monotonic()
    folder = FOLDER / "tolerance"
    folder.mkdir(parents=True, exist_ok=True)
    study = load_study(STUDY)
    results = Results(folder / "cases", study)
    known = len(results)
    run_study(study, results, say=lambda text: print(f"  {text}", flush=True))
    content = summarise(study, results)
    seconds = time.monotonic() - begun
    quantities = [
        _quantity("probability_at_paper", "1", content["probability_box"]),
        _quantity("envelope_radial", "m", content["envelope_radial"]),
        _quantity("envelope_angle", "rad", content["envelope_angle"]),
        Quantity("undecided", "1", content["width"], "reference"),
    ]
    if len(results) > known:
        quantities.append(Quantity("seconds_per_case", "s", seconds / (len(results) - known), "reference"))
    (folder / "report.html").write_bytes((results.folder / "report.html").read_bytes())
    write_result("tolerance", quantities, seconds, {"found": content["sentence"], "cases": len(results)})
    print(f"{table(quantities)}\n\n{content['sentence']}\nReport: {(folder / 'report.html').resolve()}")
    return 0


def _quantity(name: str, unit: str, interval: dict[str, float | None]) -> Quantity:
    """The envelope's ends are ordered by probability, which is not always by size."""
    if interval["value"] is None:
        raise InputError(f"tolerance: {name} is unknown: the nominal capture fails; look at {STUDY.name}'s criterion")
    ends = sorted(x for x in (interval["low"], interval["high"]) if x is not None)
    return Quantity(name, unit, interval["value"], "reference", None, ends[0], ends[-1])


if __name__ == "__main__":
    sys.exit(main())
