"""The main job on real data: a servo axis (EMPS) whose model knows viscous friction only.

Fits the published model and compares its parameters; then starts from viscous friction alone and lets the diagnosis
name what is missing; then diagnoses the model that came out. Recordings: Janot, Gautier, Brunot (2019), looked for in
``$SNARELAB_RECORDINGS``, beside the project, and at their publisher. Without them a bundled recording, made by another
engine than ours, is diagnosed instead.
"""

import sys
import time
from pathlib import Path

from ..errors import InputError
from ..exit_status import status_of
from ..identification.diagnose import Answer, diagnose
from ..identification.diagnosis import Diagnosis
from ..identification.identify import identify
from ..identification.report.page import write_report
from ..models.model_file import load_model
from ..models.model_write import save_model
from ..progress import stages
from ..recordings import find_recording
from ..report.provenance import provenance
from ..report.words import percent
from .outcome import FOLDER, Quantity, write_json, write_result

HERE = Path(__file__).parent

PUBLISHED = {
    "mass": (95.1089, "kg"),
    "coefficient": (203.5034, "N*s/m"),
    "level": (20.3935, "N"),
    "offset": (-3.1648, "N"),
}
"""IDIM-LS on DATA_EMPS (Janot, Gautier, Brunot 2019)."""

PUBLISHED_ERROR = {"train": 0.040834, "holdout": 0.059824}
"""Relative force error of the same, on DATA_EMPS and as a cross-test on DATA_EMPS_PULSES."""


def main() -> int:
    """Run the study; leaves report, numbers and the improved model in ``build/studies/emps`` (or ``bundled``)."""
    begun, name = time.monotonic(), "emps"
    quantities: list[Quantity] = []
    try:
        train, holdout = find_recording("DATA_EMPS.mat"), find_recording("DATA_EMPS_PULSES.mat")
        model = HERE / "emps" / "viscous.toml"
    except InputError as error:
        _say(f"The EMPS recordings cannot be had: {error}.")
        _say("A bundled recording of a three-joint arm is diagnosed instead; another engine (MuJoCo) made it.")
        name = "bundled"
        model, train, holdout = (HERE / name / file for file in ("arm3.toml", "train.csv", "holdout.csv"))
    else:
        quantities += _published(train, holdout)
    out = FOLDER / name
    out.mkdir(parents=True, exist_ok=True)
    answer = _diagnose(model, train, holdout)
    found = answer.diagnosis
    _say(_table(found))
    save_model(answer.model, out / "model.toml", found.sentence)
    again = _diagnose(out / "model.toml", train, holdout).diagnosis
    _say(f"  {again.sentence}")
    last = found.steps[-1]
    quantities += [
        Quantity("relative_error_fitted", "1", last.train, "reference"),
        Quantity("relative_error_held_out", "1", last.holdout, "reference"),
        Quantity("named", "", ", ".join(f"{e.name} at {e.at}" for e in found.effects), "reference"),
        Quantity("second_verdict", "", again.verdict, "reference"),
    ]
    write_json(out / "diagnosis.json", found.to_json())
    write_json(out / "again.json", again.to_json())
    more = {"recording": train.name, "steps": [vars(s) for s in found.steps]}
    write_result(name, quantities, time.monotonic() - begun, more)
    origin = provenance("make study-emps", [("Model", model), ("Training", train), ("Held-out", holdout)])
    write_report(found, out / "report.html", origin)
    _say(f"\n{found.sentence}\nReport: {(out / 'report.html').resolve()}")
    return 0


def _say(text: str) -> None:
    print(text, flush=True)


def _diagnose(model: Path, train: Path, holdout: Path) -> Answer:
    _say(f"Diagnosing {model.stem} against {train.name}, with {holdout.name} as the held-out recording ...")
    return diagnose(load_model(model), [train], holdout, progress=stages(_say))


def _published(train: Path, holdout: Path) -> list[Quantity]:
    """Fit the published model and set its parameters beside the published ones; nothing is tuned to meet these."""
    found = identify(load_model(HERE / "emps" / "published.toml"), [train], [holdout]).to_json()
    _say(f"The published model, fitted here:\n  {'':<14}{'published':>12}{'ours':>12}{'difference':>12}")
    quantities = []
    for p in found["parameters"]:
        paper, unit = PUBLISHED[p["name"]]
        quantities.append(Quantity(p["name"], unit, p["value"], "predicted", paper))
        _say(f"  {p['name']:<14}{paper:>12.4f}{p['value']:>12.4f}{percent(p['value'] / paper - 1, 3):>13} {unit}")
    for role, paper in PUBLISHED_ERROR.items():
        ours = found["fit"]["tau.slide"][role]["relative"]
        quantities.append(Quantity(f"relative_error_{role}", "1", ours, "predicted", paper))
        _say(f"  error, {role:<8}{percent(paper, 3):>12}{percent(ours, 3):>12}")
    return quantities


def _table(found: Diagnosis) -> str:
    """The README's table."""
    lines = ["| model | error, training | error, held-out |", "| --- | ---: | ---: |"]
    lines += [f"| {s.label} | {percent(s.train, 3)} | {percent(s.holdout, 3)} |" for s in found.steps]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(status_of(main))
