"""The zero-gravity rig study, whole: rigid model, friction, what is left, and what it is (Tian, Tang, Dai and Li).

The paper stops at joint 2, whose torque friction does not explain. Its rig is rebuilt here as an independent plant in
another engine, with a twisted boom on slings that keep their height; the plant's answer is sealed before the tool
starts, and opened only to score.
"""

import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...exit_status import status_of
from ...identification.diagnose import diagnose
from ...identification.diagnosis import Diagnosis
from ...identification.report.page import write_report
from ...models.model_file import load_model
from ...models.model_write import save_model
from ...models.rig.rig import built_in_rig
from ...progress import stages
from ...report.provenance import provenance
from ...report.words import percent
from ..outcome import FOLDER, Quantity, table, write_json, write_result
from ..page import Clock, Section, write_page
from . import figures
from .explain import alike_in_words, remedy, suspected_boom, tell_apart
from .flight import TORQUE_LIMIT, Flight, flight_arm
from .motion import TRAIN
from .recordings import make_recordings, open_answer
from .scene import FASTER, rig_scene
from .score import Score, score, true_curves
from .study import MODEL, Friction, friction_study
from .unloading import printed_law, registered_law, unit_forces, unloading_ratio

Array = NDArray[np.float64]

STUDY = "zero-g-rig"
CONCEALED = "link_torsion"


def main() -> int:
    """Run the study; leaves report, numbers, recordings and the improved model in ``build/studies/zero-g-rig``.

    Status 1 where the diagnosis did not name what the plant conceals, at its place, or named anything else beside it.
    """
    begun, folder = time.monotonic(), FOLDER / STUDY
    say("The plant, in another engine, makes two recordings ...")
    digest = make_recordings(folder, CONCEALED, seed=0)
    say(f"What it conceals is sealed; SHA-256 {digest}")
    train, holdout = folder / "train.parquet", folder / "holdout.parquet"
    model = load_model(MODEL)
    friction = friction_study(model, train, holdout, stages(say))
    say("A flight arm without sensors, on the same rig ...")
    flown = flight_arm(model, friction, folder, CONCEALED)
    say(
        f"{error_table(friction)}\nDiagnosing the remaining residual, with {holdout.name} as the held-out recording ..."
    )
    answer = diagnose(model, [train], holdout, progress=stages(say))
    found = answer.diagnosis
    boom = suspected_boom(built_in_rig(), found)
    pairs = tell_apart(built_in_rig(), friction, boom)
    words = alike_in_words(pairs)
    truth = open_answer(folder, digest)
    result = score(truth, found, friction.curves)
    quantities = [*numbers(friction, found, result), *leftovers(friction, flown)]
    sentence = f"{found.sentence} {remedy(pairs, boom)}"
    save_model(answer.model, folder / "model.toml", sentence)
    write_json(folder / "diagnosis.json", found.to_json())
    write_report(found, folder / "diagnosis.html", provenance(f"make study-{STUDY}", [("Model", MODEL)]))
    write_page(
        STUDY,
        "Zero-gravity rig: friction, and what it does not explain",
        sentence,
        quantities,
        [*sections(friction, found, words, truth), *paper_sections(friction, flown)],
        rig_scene(built_in_rig(), friction.train.time, friction.train.q).html(),
        f"The training recording, {FASTER:g} times as fast: arm, joints, slings and the carriages above them. Drag to "
        "turn, scroll to come closer, right button to shift.",
        Clock(float(friction.train.time[0]), FASTER),
    )
    write_result(
        STUDY,
        quantities,
        time.monotonic() - begun,
        {
            "sealed": digest,
            "concealed": truth["effect"],
            "score": vars(result),
            "hang_units": unit_forces(built_in_rig()),
            "told_apart": [vars(p) for p in pairs],
            "curves": [{"joint": c.joint, "carried": c.carried, "not_carried": c.not_carried} for c in friction.curves],
        },
    )
    say(f"\n{table(quantities)}\n\n{sentence}\n" + "\n".join(words))
    say(f"The answer, opened now: {truth['effect']}, {truth['beside']}\nReport: {(folder / 'report.html').resolve()}")
    if not result.placed:
        print("the diagnosis did not name what the plant conceals at its place", file=sys.stderr)
        return 1
    if result.wrong:
        print(f"the diagnosis named {result.wrong} effects that the plant does not have", file=sys.stderr)
        return 1
    return 0


def say(text: str) -> None:
    """A line on the terminal, at once."""
    print(text, flush=True)


def error_table(friction: Friction) -> str:
    """Mean torque error of each joint: rigid, friction tip to base, friction jointly; training and held-out."""
    lines = [f"  {'mean error [N·m]':<22}" + "".join(f"{f'joint {k + 1}':>10}" for k in range(7))]
    for role, traces in (("training", friction.train), ("held-out", friction.holdout)):
        steps = (("rigid", traces.rigid), ("tip to base", traces.tip_to_base), ("jointly", traces.friction))
        for name, modelled in steps:
            lines.append(f"  {f'{role}, {name}':<22}" + "".join(f"{x:>10.3f}" for x in traces.error(modelled)))
    return "\n".join(lines)


def numbers(friction: Friction, found: Diagnosis, result: Score) -> list[Quantity]:
    """The study's quantities. The paper claims more than half on all joints but 2 and 6."""
    share = friction.train.reduction
    quantities = [
        Quantity(f"error_reduction.joint{k + 1}", "1", float(x), "predicted", None if k in (1, 5) else 0.5)
        for k, x in enumerate(share)
    ]
    for joint in ("joint2", "joint6"):
        before, after = after_diagnosis(found, f"tau.{joint}")
        quantities.append(Quantity(f"holdout_reduction.{joint}", "1", 1.0 - after / before, "reference"))
    named = [f"{e.name} at {e.at}" for e in found.effects] or [found.verdict]
    return [
        *quantities,
        Quantity("named", "", ", ".join(named), "reference"),
        Quantity("named_rightly", "1", float(result.placed), "reference"),
        Quantity("named_wrongly", "1", float(result.wrong), "reference"),
        Quantity("friction_band_coverage", "1", result.coverage, "reference"),
    ]


def leftovers(friction: Friction, flown: Flight) -> list[Quantity]:
    """Unloading ratio of each joint, the printed law against the vocabulary's, and what a flight arm may expect."""
    t, speed = friction.train, np.linspace(-1.0, 1.0, 2001)
    ratio = unloading_ratio(built_in_rig(), t.q, t.measured, t.rigid)
    nearest = int(np.argmax(flown.loads))
    return [
        *(Quantity(f"unloading_ratio.joint{k + 1}", "1", float(x), "reference") for k, x in enumerate(ratio)),
        Quantity(
            "printed_law_deviation", "1", float(np.abs(registered_law(speed) - printed_law(speed)["f"]).max()),
            "predicted", 0.0,
        ),
        *(Quantity(f"flight_coverage.joint{k + 1}", "1", float(x), "reference") for k, x in enumerate(flown.coverage)),
        Quantity("flight_nearest_limit", "", f"joint{nearest + 1}", "reference"),
        Quantity("flight_nearest_limit_share", "1", float(flown.loads[nearest]), "reference"),
    ]  # fmt: skip


def paper_sections(friction: Friction, flown: Flight) -> list[Section]:
    """The paper's figures 5 and 6, the forces of its hang units, and the flight arm."""
    t, speed = friction.train, np.linspace(-0.3, 0.3, 1201)
    starts = {f"joint {k}": next(m.start for m in TRAIN if m.joint == k) for k in (3, 1)}
    nearest = int(np.argmax(flown.loads))
    units = [
        f"{name}: " + ", ".join(f"{key} {value:.0f} N" for key, value in forces.items())
        for name, forces in unit_forces(built_in_rig()).items()
    ]
    return [
        Section("The printed friction law", [], [figures.printed(speed, printed_law(speed))]),
        Section("Joint 1 while joint 3 starts", [], [figures.joint_1_while_3_starts(t.time, t.q, t.measured, starts)]),
        Section(
            "Forces in the hang units (equation 12)",
            ["The paper gives sums of two; each alone is for a plate and a slide that share evenly.", *units],
        ),
        Section(
            "A flight arm without sensors",
            [
                "Unloading ratio: of the moment that a joint would bear from the weight beyond it without the rig, "
                "the share that its torque does not show. The same friction predicts a flight arm of the same size "
                f"and mass. Nearest to the limit of {TORQUE_LIMIT:g} N·m (chosen) comes joint {nearest + 1}, with "
                f"{percent(flown.loads[nearest])} of it, the band included.",
            ],
            [figures.flight(flown.time, flown.measured, flown.predicted, flown.band)],
        ),
    ]


def after_diagnosis(found: Diagnosis, channel: str) -> tuple[float, float]:
    """Mean error of a channel on the held-out recording, with friction alone and with what was found [N·m]."""
    trace = next(t for t in found.traces if t.role == "holdout" and t.channel == channel)
    return (
        float(np.nanmean(np.abs(trace.measured - trace.before))),
        float(np.nanmean(np.abs(trace.measured - trace.after))),
    )


def sections(friction: Friction, found: Diagnosis, words: list[str], truth: dict[str, Any]) -> list[Section]:
    """The report: the paper's figures in its order, then what it did not have."""
    t = friction.train
    joints = [f"joint {k + 1}" for k in range(7)]
    left = np.array([after_diagnosis(found, f"tau.joint{k + 1}") for k in range(7)])
    drawn = true_curves(truth, friction.curves)
    unsure = [f"{c.joint}: {', '.join(c.not_carried)}" for c in friction.curves if c.not_carried]
    return [
        Section("The motion", pictures=[figures.sequence(t.time, t.q)]),
        Section(
            "Without friction",
            pictures=[figures.torques(t.time, t.measured, {"rigid arm": t.rigid}, "Like the paper's figure 4.")],
        ),
        Section(
            "With friction",
            [
                "Friction at the slides was fitted from the tip to the base, each joint with all beyond it known, then "
                "for all joints together.",
            ],
            [
                figures.torques(t.time, t.measured, {"with friction": t.friction}, "Like the paper's figure 10."),
                figures.errors(
                    joints,
                    {"rigid": t.error(t.rigid), "with friction": t.error(t.friction)},
                    "Mean torque error on the training recording, like the paper's figure 11.",
                ),
            ],
        ),
        Section(
            "Friction curves",
            [
                "What the recordings determine is the curve over the speeds travelled. Parameters that they do not "
                f"carry, and that are not to be read as facts: {'; '.join(unsure) or 'none'}."
            ],
            [figures.friction(friction.curves, drawn)],
        ),
        Section(
            "What friction leaves, and what it is",
            [found.sentence, found.description, "The whole diagnosis is in diagnosis.html beside this page."],
            [
                figures.errors(
                    joints,
                    {
                        "rigid": friction.holdout.error(friction.holdout.rigid),
                        "with friction": left[:, 0],
                        "with what was found": left[:, 1],
                    },
                    "Mean torque error on the held-out recording.",
                )
            ],
        ),
        Section("What these recordings cannot tell apart", words or ["Nothing among the explanations compared."]),
    ]


if __name__ == "__main__":
    sys.exit(status_of(main))
