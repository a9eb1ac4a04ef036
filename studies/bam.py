"""A position servo with a pendulum (BAM, XL330): what Coulomb and viscous friction leave out, from its positions alone.

Twelve recordings at controller gains of 100, 200 and 800 are fitted; the four at gain 400 are locked away, and the
position is predicted there in closed loop. Recordings: Duclusaud et al. (2025), looked for in ``$SNARELAB_RECORDINGS``,
beside the project, and at their publisher.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..exit_status import status_of
from ..models.effect import written_unit
from ..models.effects import effects
from ..models.model import PlacedEffect
from ..models.model_file import load_model
from ..models.model_write import save_model
from ..recordings import find_recording
from ..recordings.find import SHA256
from ..report.words import percent
from .bam_figures import explained, positions
from .bam_naming import START, LawTrial, Round, ServoFit, Values, fit, name_missing, rms
from .bam_servo import DUTY, MOTOR, ServoRun, position_error, read_run
from .outcome import FOLDER, Quantity, table, write_result
from .page import Picture, Section, write_page

HERE = Path(__file__).parent
HELD_OUT = 400.0
"""Controller gain whose recordings are held out, as in the publication."""

PROVED = 0.05
"""A step is confirmed if without it the held-out recordings' squared error is so much higher."""

CHECK = {"coulomb_and_viscous": 0.0623, "load_dependent_friction": 0.0476, "stribeck_friction": 0.0425}
"""[rad] Held-out error of an independent check; each line has what stands above it."""

PUBLISHED = {
    "torque_per_volt": 0.32321138819018436 / 4.7636501514851926,
    "back_emf": 0.32321138819018436,
    "rotor_inertia": 0.001643216859746982,
    "zero": 0.01795252374733891,
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
        runs = [read_run(find_recording(name)) for name in sorted(SHA256) if name.endswith(".json")]
    except InputError as error:
        print(f"The servo's recordings cannot be had: {error}", file=sys.stderr)
        return 2
    train, held = ([r for r in runs if (r.gain == HELD_OUT) == locked] for locked in (False, True))
    print("  Coulomb and viscous friction", flush=True)
    base = fit(train, START)
    rounds: list[Round] = []
    named: list[LawTrial] = []
    final, refused = base, None
    for r in name_missing(train, base, lambda text: print(f"  {text}", flush=True)):
        rounds.append(r)
        if r.named and not confirmed(final, r.named.fit, held):
            refused = r.named
            break
        if r.named:
            named.append(r.named)
            final = r.named.fit
    found = sentence(base, named, held)
    quantities = numbers(train, held, base, rounds, named)
    write_page("bam", "XL330 servo with a pendulum", found, quantities, sections(held, base, final, rounds, refused))
    extra = {"steps": steps(train, held, base, named), "rounds": [as_lines(r) for r in rounds]}
    write_result("bam", quantities, time.monotonic() - begun, extra)
    save(final.values, found)
    print(f"{table(quantities)}\n\n{found}\nReport: {(FOLDER / 'bam' / 'report.html').resolve()}")
    return 0


def confirmed(before: ServoFit, after: ServoFit, held: Sequence[ServoRun]) -> bool:
    """Whether a step makes the held-out recordings better too: without it, their squared error is 5 % higher."""
    return rms(held, before.values) ** 2 >= (1 + PROVED) * rms(held, after.values) ** 2


def sentence(base: ServoFit, named: Sequence[LawTrial], held: Sequence[ServoRun]) -> str:
    """The verdict."""
    before = position_error(held, base.values)
    if not named:
        return f"Coulomb and viscous friction are adequate: the held-out position error is {1e3 * before:.1f} mrad."
    after = position_error(held, named[-1].fit.values)
    names = " and ".join(t.name.replace("_", " ") for t in named)
    return (
        f"The model leaves out {names}. With that added, the position error at the gain that the fit never saw falls "
        f"from {1e3 * before:.1f} to {1e3 * after:.1f} mrad, by {percent(1 - after / before)}."
    )


def numbers(
    train: Sequence[ServoRun],
    held: Sequence[ServoRun],
    base: ServoFit,
    rounds: Sequence[Round],
    named: Sequence[LawTrial],
) -> list[Quantity]:
    """Held-out position errors beside the check's, and what was named.

    The rule of naming was settled with all recordings in sight: what follows from it counts as calibrated.
    """
    final = named[-1].fit if named else base
    before, after = position_error(held, base.values), position_error(held, final.values)
    quantities = [
        Quantity("named", "", ", ".join(t.name for t in named) or "nothing", "calibrated"),
        Quantity("documented", "", ", ".join(t.name for t in named if t.name in DOCUMENTED) or "nothing", "reference"),
        Quantity("error.publishers_parameters", "rad", position_error(held, PUBLISHED), "reference"),
        Quantity("error.coulomb_and_viscous", "rad", before, "predicted", CHECK["coulomb_and_viscous"]),
    ]
    for t in named:
        error = position_error(held, t.fit.values)
        quantities.append(Quantity(f"error.{t.name}", "rad", error, "predicted", CHECK.get(t.name)))
    for t in rounds[min(len(named), len(rounds) - 1)].tried:
        if t.name in DOCUMENTED and t.name not in [x.name for x in named]:
            error = position_error(held, t.fit.values)
            quantities.append(Quantity(f"error.{t.name}_not_named", "rad", error, "predicted", CHECK.get(t.name)))
    quantities += [
        Quantity("error_reduction", "1", 1 - after / before, "calibrated"),
        Quantity("fitted_error.coulomb_and_viscous", "rad", position_error(train, base.values), "reference"),
        Quantity("fitted_error.named", "rad", position_error(train, final.values), "reference"),
        Quantity("duty_law_rms", "1", duty_error([*train, *held]), "reference"),
    ]
    quantities += [Quantity(name, unit(name), value, "reference") for name, value in final.values.items()]
    return quantities


def duty_error(runs: Sequence[ServoRun]) -> float:
    """RMS of recorded duty less what the firmware's law makes of goal and position, while the drive is on [1]."""
    parts = [(np.clip(DUTY * r.gain * (r.goal - r.position), -1, 1) - r.duty)[r.on > 0.5] for r in runs]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def unit(name: str) -> str:
    """Unit of one of the servo's values."""
    effect, _, own = name.partition(".")
    if not own:
        return ("N*m/V", "V*s/rad", "kg*m^2", "rad")[MOTOR.index(name)]
    (text,) = [p.unit for p in effects()[effect].parameters if p.name == own]
    return written_unit(text)


def steps(
    train: Sequence[ServoRun], held: Sequence[ServoRun], base: ServoFit, named: Sequence[LawTrial]
) -> list[dict[str, str | float]]:
    """Mean absolute position error [rad] after each law, fitted and held out."""
    lines = [("Coulomb and viscous", base), *((f"+ {t.name}", t.fit) for t in named)]
    return [
        {"label": label, "train": position_error(train, f.values), "holdout": position_error(held, f.values)}
        for label, f in lines
    ]


def as_lines(r: Round) -> list[dict[str, Any]]:
    """A round's candidates for scripts; predicted shares and score are null where a law explained too little to try."""
    return [
        {
            "name": t.name,
            "explained": t.explained,
            "foretold": {f"{gain:g}": share for gain, share in t.forecast.items()} or None,
            "score": t.score if t.forecast else None,
            "passes": t.passes,
        }
        for t in r.tried
    ]


def sections(
    held: Sequence[ServoRun], base: ServoFit, final: ServoFit, rounds: Sequence[Round], refused: LawTrial | None
) -> list[Section]:
    """What is drawn, and what was not named."""
    words = [
        "Bars: share of the squared position error at gains 100, 200 and 800. Dots: the same at one of these gains, "
        "predicted by fits to the other two. A law is named when it explains at least 5 %, predicts more than chance "
        "over all gains, and no dot is below -5 %; of several, the one that predicts most for its number of "
        "parameters, and where that is a tie, the simplest."
    ]
    for t in rounds[0].tried:
        if t.forecast and not (rounds[0].named and t.name == rounds[0].named.name):
            worst = min(t.forecast, key=lambda gain: t.forecast[gain])
            words.append(
                f"{t.name.replace('_', ' ').capitalize()} explains {percent(t.explained)} of what is fitted; at "
                f"gain {worst:.0f}, predicted from the others, {percent(t.forecast[worst])}; score {t.score:.0f}."
            )
    if rounds[0].named:
        words.append(
            f"{rounds[0].named.name.replace('_', ' ').capitalize()} has the score {rounds[0].named.score:.0f}."
        )
    if refused:
        words.append(
            f"{refused.name.replace('_', ' ').capitalize()} passed next, but the held-out gain's error did not fall."
        )
    by_run = [
        f"{run.trajectory.replace('_', ' ')}: {1e3 * position_error([run], base.values):.0f} to "
        f"{1e3 * position_error([run], final.values):.0f} mrad"
        for run in held
    ]
    pictures = [
        Picture(
            positions(held, base.values, final.values),
            "Position over time of four recordings at gain 400: measured, with Coulomb and viscous friction, and with "
            "what was named.",
            "Gain 400, which is held out. Simulated in closed loop from the first position; only goals and supply "
            "are taken from the recording.",
        ),
        Picture(
            explained(rounds[0].tried),
            "Share of the squared position error that each law explains.",
            "First round: each law alone beside Coulomb and viscous friction, everything fitted again.",
        ),
    ]
    return [
        Section("On the held-out gain", [f"Mean absolute error, {'; '.join(by_run)}."], pictures[:1]),
        Section("What each law explains", words, pictures[1:]),
    ]


def save(values: Values, note: str) -> None:
    """Write the model file with what was found; motor constants and the encoder's zero have no place in it."""
    model = load_model(HERE / "bam" / "servo.toml")
    placed = list(model.effects)
    for name in dict.fromkeys(key.partition(".")[0] for key in values if "." in key):
        if name not in [p.effect.name for p in placed]:
            placed.append(PlacedEffect(effects()[name], "servo"))
    own = {key.replace(".", ".servo."): float(value) for key, value in values.items() if "." in key}
    own["rotor_inertia.servo.inertia"] = float(values["rotor_inertia"])
    save_model(replace(model, effects=tuple(placed), values=own), FOLDER / "bam" / "model.toml", note)


if __name__ == "__main__":
    sys.exit(status_of(main))
