"""The ledger's entries: where each recording comes from, what is concealed in it, and how the tool is asked."""

# pyright: reportMissingImports=false
# (folders of tests are put on the path here)
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
# The pendulum and the free-floating arms are those of the tests.
sys.path += [str(ROOT / "tests" / "helpers"), str(ROOT / "tests" / "models" / "floating")]

import proof.run as proof_run
from bench.drake_servicer import Tank, Wheel, model, record
from bench.snare_concealed import EFFECTS, run_case
from proof.cases import draw as draw_case
from proof.cases import planned_cases
from proof.drives.cases import draw, planned
from snarelab import studies
from snarelab.identification.diagnose import diagnose
from snarelab.identification.diagnosis import Diagnosis
from snarelab.identification.sources.answer import rms
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.recordings import find_recording
from snarelab.studies import bam
from snarelab.studies.bam_recordings import read_all
from snarelab.studies.zero_g_rig.concealed import KINDS
from snarelab.studies.zero_g_rig.recordings import make_recordings
from snarelab.studies.zero_g_rig.study import MODEL

Said = dict[str, Any]
STUDIES = Path(next(iter(studies.__path__)))
PROOF_SEED, DRIVES_SEED = 90600, 1
"""Development seeds: of neither is any figure a proof."""

PENDULUMS, RIG_SEEDS, SNARE_SEEDS = 10, (1,), (1, 2, 3)
DIGITS = 5


@dataclass(frozen=True)
class Entry:
    """A recording that the ledger holds the answer to. ``ask`` works in a folder of its own."""

    key: str
    concealed: str
    ask: Callable[[Path], Said]


def said(found: Diagnosis) -> Said:
    """What the ledger keeps of a diagnosis: verdict, names with places and values, where it shows, held-out error."""
    effects = [
        {
            "name": e.name,
            "at": e.at,
            "probability": round(e.probability, 3),
            "values": {key: [_short(p.value), _short(p.std)] for key, p in e.parameters.items()},
            "not_told_apart": [f"{r.name} at {r.at}" for r in e.rivals if not r.separable],
        }
        for e in found.effects
    ]
    held_out = [_short(step.holdout) for step in (found.steps[0], found.steps[-1])] if found.steps else [None, None]
    places = {place.channel: round(place.share, 3) for place in found.location}
    return {"verdict": found.verdict, "effects": effects, "location": places, "held_out": held_out}


def _short(x: float) -> float | None:
    """A few digits, or None of what is not finite."""
    return float(f"{x:.{DIGITS}g}") if abs(x) < float("inf") else None


def entries(cases: int, slow: bool) -> list[Entry]:
    """All entries, in order."""
    found = [
        Entry("bundled", "arm of three joints, friction unknown", _bundled),
        Entry("emps/viscous", "real axis, viscous friction known", _emps),
        Entry("emps/again", "the model that came out", partial(_emps, again=True)),
        Entry("kuka", "real robot, two encoders a joint", _kuka),
        Entry("bam", "real servo", _bam),
    ]
    found += [Entry(f"rig/{k}-{s}", k, partial(_rig, kind=k, seed=s)) for s in RIG_SEEDS for k in KINDS]
    found += _floating()
    for wander, group in ((0.0, "clean"), (0.3, "wandering")):
        found += [
            Entry(f"pendulum/{group}/{s}", "", partial(_pendulum, seed=s, wander=wander)) for s in range(PENDULUMS)
        ]
    for k, plan in enumerate(planned_cases(cases, PROOF_SEED)):
        words = f"{plan[0]}: {', '.join(plan[1]) or 'nothing'} {plan[2]:g}x"
        found.append(Entry(f"proof/{k:04}", words, partial(_proof, count=cases, number=k)))
    for k, plan in enumerate(planned(DRIVES_SEED, cases)):
        concealed = ", ".join(f"{name} {size:g}x" for name, size in plan.concealed) or "nothing"
        found.append(Entry(f"drives/{k:04}", f"{plan.group}: {concealed}", partial(_drives, plan=plan, number=k)))
    if slow:
        found += [Entry(f"snare/{e}-{s}", e, partial(_snare, effect=e, seed=s)) for e in EFFECTS for s in SNARE_SEEDS]
    return found


def _bundled(folder: Path) -> Said:
    here = STUDIES / "bundled"
    return said(diagnose(load_model(here / "arm3.toml"), [here / "train.csv"], here / "holdout.csv").diagnosis)


def _emps(folder: Path, again: bool = False) -> Said:
    train, holdout = find_recording("DATA_EMPS.mat"), find_recording("DATA_EMPS_PULSES.mat")
    answer = diagnose(load_model(STUDIES / "emps" / "viscous.toml"), [train], holdout)
    if again:
        save_model(answer.model, folder / "model.toml", answer.diagnosis.sentence)
        answer = diagnose(load_model(folder / "model.toml"), [train], holdout)
    return said(answer.diagnosis)


def _kuka(folder: Path) -> Said:
    *recordings, holdout = (find_recording(f"run_{run}.mat") for run in "ABC")
    found = diagnose(load_model(STUDIES / "kuka" / "kr300.toml"), recordings, holdout).diagnosis
    mdeg = 180e3 / 3.141592653589793
    left = {f.channel: _short(mdeg * f.holdout.rms_after) for f in found.fit if f.channel.startswith("q_link")}
    # Steps of encoders and of torque have no common error.
    return {**said(found), "held_out": [None, None], "held_out_mdeg": left}


def _bam(folder: Path) -> Said:
    """As the study does; held-out errors are of the position [rad]."""
    source, decided = bam.decided_on(*read_all())
    effects = [
        {
            "name": f.name,
            "at": f.at,
            "probability": round(f.probability, 3),
            "values": {f"{f.name}.{k}": [_short(e.value), _short(e.std)] for k, e in f.parameters.items()},
            "not_told_apart": [],
        }
        for f in bam.findings(source, decided)
    ]
    errors = [_short(float(rms(x)[0])) for x in (decided.before, decided.held)]
    return {"verdict": decided.verdict, "effects": effects, "location": {}, "held_out": errors}


def _rig(folder: Path, kind: str, seed: int) -> Said:
    make_recordings(folder, kind, seed, ("train", "holdout"))
    return said(diagnose(load_model(MODEL), [folder / "train.parquet"], folder / "holdout.parquet").diagnosis)


def _floating() -> list[Entry]:
    import test_floating_recordings as tests

    turn = 2.0 * 3.141592653589793 * 0.35
    panels = tests.PANELS.format(k=12.0 * turn**2, c=12.0 * 2.0 * 0.02 * turn)
    in_mujoco: Sequence[tuple[str, str, dict[str, Any]]] = (
        ("rigid", "", {}),
        ("torque", "external_torque at base", {"torque": (0.1, -0.05, 0.2)}),
        ("friction", "coulomb_friction at shoulder", {"friction": 1.0}),
        ("panels", "flexible_appendage at base", {"hub": panels}),
    )
    in_drake: Sequence[tuple[str, str, dict[str, Any]]] = (
        ("slosh", "propellant_slosh at base", {"tank": Tank(40.0, (-0.4, 0.3, 0.5), 0.25, 0.05)}),
        ("wheel", "wheel_friction at base", {"wheel": Wheel(2, inertia=0.1, viscous=2e-3, coulomb=0.01, torque=0.2)}),
    )
    found = []
    for make, cases in ((tests.recorded, in_mujoco), (record, in_drake)):
        found += [Entry(f"floating/{k}", what, partial(_afloat, make=make, inside=x)) for k, what, x in cases]
    return found


def _afloat(folder: Path, make: Callable[..., Path], inside: dict[str, Any]) -> Said:
    train, held = (make(folder / f"{k}.csv", k, **inside) for k in (1, 2))
    return said(diagnose(model(folder), [train], held).diagnosis)


def _pendulum(folder: Path, seed: int, wander: float) -> Said:
    import pendulum

    return said(pendulum.diagnosed(folder, 5000 + seed, wander=wander))


def _proof(folder: Path, count: int, number: int) -> Said:
    attempt = proof_run.record(PROOF_SEED, count, number, folder / "case")
    answer = draw_case(planned_cases(count, PROOF_SEED)[number], PROOF_SEED, number, attempt).answer
    found = _diagnosed(folder / "case")
    return {**found, "truth": [f"{t.name} at {t.at}" for t in answer.truths]}


def _drives(folder: Path, plan: Any, number: int) -> Said:
    case = draw(plan, DRIVES_SEED, number)
    case.write(folder / "case")
    return {**_diagnosed(folder / "case"), "truth": [f"{e['law']} at {e['at']}" for e in case.truth["effects"]]}


def _diagnosed(folder: Path) -> Said:
    return said(diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis)


def _snare(folder: Path, effect: str, seed: int) -> Said:
    """Held-out errors are those of the target's motion, as shares of what the model as given leaves."""
    got = run_case(effect, seed, folder)
    before, after = got["holdout"]["pos"]
    effects = [
        {"name": name, "at": "", "probability": 1.0, "values": {}, "not_told_apart": got["merged"]}
        for name in got["named"]
    ]
    if got["found"] is not None:
        effects[got["named"].index(effect)]["values"] = {"first": [_short(got["found"]), None]}
    share = _short(after / before) if before else None
    return {"verdict": got["verdict"], "effects": effects, "location": {}, "held_out": [1.0, share]}
