"""A position servo with a pendulum (BAM, XL330): what Coulomb and viscous friction leave out, from its positions alone.

Twelve recordings at controller gains of 100, 200 and 800 are fitted; the four at gain 400 are held out, and the
position is predicted there in closed loop. Recordings: Duclusaud et al. (2025), looked for in ``$SNARELAB_RECORDINGS``,
beside the project, and at their publisher.
"""

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..exit_status import status_of
from ..identification.diagnosis import Estimate, Finding
from ..identification.servo.source import Servos, plain, start
from ..identification.sources.answer import estimates, finding, with_found
from ..identification.sources.decide import SourceDecision, decide
from ..identification.sources.own import settled
from ..identification.sources.source import ModelPoint
from ..identification.sources.stages import stages
from ..identification.sources.weigh import covariances
from ..models.model_file import load_model
from ..models.model_write import save_model
from ..models.servo_loop import DRIVE
from ..report.words import percent, words
from .bam_figures import explained, positions
from .bam_recordings import BamRun, duty_error, position_error, read_all
from .outcome import FOLDER, Quantity, interval, table, write_result
from .page import Picture, Section, write_page

MODEL = Path(__file__).parent / "bam" / "servo.toml"
JOINT = "servo"

START = {
    "servo_drive.torque_per_volt": 0.08,
    "servo_drive.back_emf": 0.36,
    "servo_drive.zero": 0.02,
    "rotor_inertia.inertia": 1.5e-3,
    "viscous_friction.coefficient": 0.01,
    "coulomb_friction.level": 0.01,
}
"""Where the fit of Coulomb and viscous friction and of the motor starts."""

CHECK = {"coulomb_and_viscous": 0.0623, "load_dependent_friction": 0.0476, "stribeck_friction": 0.0425}
"""[rad] Held-out error of an independent check; each line has what stands above it."""

PUBLISHED = {
    "servo_drive.torque_per_volt": 0.32321138819018436 / 4.7636501514851926,
    "servo_drive.back_emf": 0.32321138819018436,
    "servo_drive.zero": 0.01795252374733891,
    "rotor_inertia.inertia": 0.001643216859746982,
    "coulomb_friction.level": 0.0069659724474934286,
    "viscous_friction.coefficient": 0.010494765451601431,
}
"""The publishers' own Coulomb and viscous model of this servo (M1)."""

DOCUMENTED = ("stribeck_friction", "load_dependent_friction", "quadratic_friction")
"""What the publishers say is missing from Coulomb and viscous friction."""


def main() -> int:
    """Run the study; leaves report, numbers and a model file in ``build/studies/bam``."""
    begun = time.monotonic()
    try:
        train, held = read_all()
    except InputError as error:
        print(f"The servo's recordings cannot be had: {error}", file=sys.stderr)
        return 2
    source, decided = decided_on(train, held, lambda text: print(f"  {text}", flush=True))
    lines = steps(source, decided)
    found = sentence(decided, lines)
    quantities = numbers(source, decided, lines)
    write_page("bam", "XL330 servo with a pendulum", found, quantities, sections(held, decided))
    extra = {"steps": lines, "candidates": candidates(decided), "not_confirmed": [
        n.placed.effect.name for n in decided.rejected]}  # fmt: skip
    write_result("bam", quantities, time.monotonic() - begun, extra)
    save(decided.train.at, found)
    print(f"{table(quantities)}\n\n{found}\nReport: {(FOLDER / 'bam' / 'report.html').resolve()}")
    return 0


def decided_on(
    train: Sequence[BamRun], held: Sequence[BamRun], progress: Callable[[str], None] = lambda _: None
) -> tuple[Servos, SourceDecision]:
    """What Coulomb and viscous friction, fitted first, leave out of the recordings."""
    model = load_model(MODEL)
    begin = start(JOINT, model.effects, START)
    source = Servos(JOINT, train, held)
    return source, decide(source, settled(source, model, begin, progress), progress)


def estimated(source: Servos, decided: SourceDecision) -> dict[str, dict[str, Estimate]]:
    """Every parameter with its deviation, by the effect's key."""
    return estimates(source, decided.given, decided.train, covariances(decided.found.weighed))


def findings(source: Servos, decided: SourceDecision) -> list[Finding]:
    """The names with their probabilities."""
    own, found = estimated(source, decided), []
    for n in decided.best.names:
        with_, without = (
            np.concatenate(x.residuals) for x in (decided.held, decided.best.missed[n.placed.key].fit.held)
        )
        share = max(0.0, 1 - float(np.mean(with_**2) / np.mean(without**2)))
        found.append(finding(decided, n, own[n.placed.key], n.placed.effect.sentence, share))
    return found


def steps(source: Servos, decided: SourceDecision) -> list[dict[str, Any]]:
    """Mean absolute position error [rad] after each law, fitted and held out."""
    train, held = ([source.runs[i] for i in some] for some in (source.train, source.held))
    return [
        {"label": label, "train": position_error(train, v), "holdout": position_error(held, v)}
        for label, own, _ in stages(source, decided, "Coulomb and viscous")
        for v in [plain(own.at.all_values)]
    ]


def sentence(decided: SourceDecision, lines: Sequence[Mapping[str, Any]]) -> str:
    """The verdict."""
    before, after = (lines[k]["holdout"] for k in (0, -1))
    if not decided.best.names:
        return f"Coulomb and viscous friction are adequate: the held-out position error is {1e3 * before:.1f} mrad."
    names = " and ".join(words(n.placed.effect.name) for n in decided.best.names)
    return (
        f"The model leaves out {names}. With that added, the position error at the gain that the fit never saw falls "
        f"from {1e3 * before:.1f} to {1e3 * after:.1f} mrad, by {percent(1 - after / before)}."
    )


def numbers(source: Servos, decided: SourceDecision, lines: Sequence[Mapping[str, Any]]) -> list[Quantity]:
    """Held-out position errors beside the check's, and what was named.

    The source was built with all recordings in sight: what was named counts as calibrated.
    """
    runs = [r for r in source.runs if isinstance(r, BamRun)]
    names = [n.placed.effect.name for n in decided.best.names]
    first, last = lines[0], lines[-1]
    publishers = position_error([source.runs[i] for i in source.held], PUBLISHED)
    quantities = [
        Quantity("named", "", ", ".join(names) or "nothing", "calibrated"),
        Quantity("documented", "", ", ".join(x for x in names if x in DOCUMENTED) or "nothing", "reference"),
        Quantity("error.publishers_parameters", "rad", publishers, "reference"),
        Quantity("error.coulomb_and_viscous", "rad", first["holdout"], "predicted", CHECK["coulomb_and_viscous"]),
    ]
    for name, line in zip(dict.fromkeys(names), lines[1:], strict=True):
        quantities.append(Quantity(f"error.{name}", "rad", line["holdout"], "predicted", CHECK.get(name)))
    quantities += [
        Quantity(f"probability.{f.name}", "1", f.probability, "calibrated") for f in findings(source, decided)
    ]
    quantities += [
        Quantity("error_reduction", "1", 1 - last["holdout"] / first["holdout"], "calibrated"),
        Quantity("fitted_error.coulomb_and_viscous", "rad", first["train"], "reference"),
        Quantity("fitted_error.named", "rad", last["train"], "reference"),
        Quantity("duty_law_rms", "1", duty_error(runs), "reference"),
    ]
    for key, own in estimated(source, decided).items():
        for name, e in own.items():
            at = f"{key.partition('.')[0]}.{name}"
            quantities.append(Quantity(at, e.unit, e.value, "reference", None, *interval(e.value, e.std)))
    return quantities


def candidates(decided: SourceDecision) -> list[dict[str, Any]]:
    """Each law by itself on top of Coulomb and viscous friction: log posterior odds, share of the whitened residual."""
    return [{"name": t.placed.effect.name, "log_odds": t.odds, "explained": t.explained} for t in decided.found.trials]


def sections(held: Sequence[BamRun], decided: SourceDecision) -> list[Section]:
    """What is drawn, and what was not named."""
    before, after = (plain(x.at.all_values) for x in (decided.found.first.train, decided.train))
    lines = [
        f"{t.placed.effect.name.replace('_', ' ').capitalize()}: log posterior odds {t.odds:.0f}."
        for t in decided.found.trials
    ]
    names = {n.placed.key for n in decided.best.names}
    lines += [
        f"{n.placed.effect.name.replace('_', ' ').capitalize()} was found too; the held-out gain did not confirm it."
        for n in decided.rejected
        if n.placed.key not in names
    ]
    lines += [
        f"Without {words(n.placed.effect.name)} the held-out gain loses "
        f"{decided.best.missed[n.placed.key].sure:.1f} standard errors."
        for n in decided.best.names
    ]
    by_run = [
        f"{run.trajectory.replace('_', ' ')}: {1e3 * position_error([run], before):.0f} to "
        f"{1e3 * position_error([run], after):.0f} mrad"
        for run in held
    ]
    pictures = [
        Picture(
            positions(held, before, after),
            "Position over time of four recordings at gain 400: measured, with Coulomb and viscous friction, and with "
            "what was named.",
            "Gain 400, which is held out. Simulated in closed loop from the first position; only goals and supply "
            "are taken from the recording.",
        ),
        Picture(
            explained(decided.found.trials, [n.placed.effect.name for n in decided.best.names]),
            "Share of the whitened residual that each law explains.",
            "First round: each law alone beside Coulomb and viscous friction.",
        ),
    ]
    return [
        Section("On the held-out gain", [f"Mean absolute error, {'; '.join(by_run)}."], pictures[:1]),
        Section("What each law explains", lines, pictures[1:]),
    ]


def save(at: ModelPoint, note: str) -> None:
    """Write the model file with what was found; the motor's constants and the encoder's zero have no place in it."""
    save_model(with_found(load_model(MODEL), at.without(f"{DRIVE.name}.{JOINT}")), FOLDER / "bam" / "model.toml", note)


if __name__ == "__main__":
    sys.exit(status_of(main))
