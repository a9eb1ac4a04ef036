"""A Stäubli TX40, whose sixth motor turns with two joints: is the coupling of its wrist seen?

The first half of the publishers' nine seconds is fitted, the second, up to where the arm stops, is held out: at rest no
law of friction says what a joint holds. Recordings: figaroh-examples (commit c0b5c7f0), looked for in
``$SNARELAB_RECORDINGS``, beside the project, and at their publisher.
"""

import sys
from pathlib import Path

from ..errors import InputError
from ..exit_status import status_of
from ..identification.diagnose import Answer
from ..recordings import find_recording
from ..report.words import words
from .foreign import Machine, alike, run
from .outcome import Quantity, interval
from .page import Section

HERE = Path(__file__).parent

MAKERS = {"viscous_friction.coefficient": 0.616, "coulomb_friction.level": 1.95, "rotor_inertia.inertia": 0.00964}
"""[N·m·s/rad, N·m, kg·m²] Friction and inertia of motor 6: ``fvm6``, ``fsm6`` and ``Iam6`` of the makers' model."""

TRAIN, HOLDOUT = "0:4.5", "4.5:7.45"
"""[s] The motion's halves; the arm stands from 7.45 s on."""


def main() -> int:
    """Run the study; leaves page, numbers and the improved model in ``build/studies/tx40``."""
    try:
        positions, currents = find_recording("pos_read_data.csv"), find_recording("curr_data.csv")
        if positions.parent != currents.parent:
            raise InputError(f"{positions} and {currents} stand in two folders; put both into one")
    except InputError as error:
        print(f"The TX40 recordings cannot be had: {error}", file=sys.stderr)
        return 2
    model = HERE / "tx40" / "tx40.toml"
    halves = [f"{positions}@{part}" for part in (TRAIN, HOLDOUT)]
    run(Machine("tx40", "Stäubli TX40: a coupled wrist", model, halves[:1], halves[1:], sections), coupling)
    return 0


def coupling(answer: Answer) -> list[Quantity]:
    """What was found at motor 6 beside the makers' values."""
    return [
        Quantity(
            f"motor6.{e.name}.{name}",
            p.unit,
            p.value,
            "predicted" if f"{e.name}.{name}" in MAKERS else "reference",
            MAKERS.get(f"{e.name}.{name}"),
            *interval(p.value, p.std),
        )
        for e in answer.diagnosis.effects
        if e.at == "motor6"
        for name, p in e.parameters.items()
    ]


def sections(answer: Answer) -> list[Section]:
    """What the makers say, what we say, and what cannot be told apart."""
    at_motor = [words(e.name) for e in answer.diagnosis.effects if e.at == "motor6"]
    seen = f"At motor 6 the diagnosis names {' and '.join(at_motor)}." if at_motor else "At motor 6 nothing is named."
    return [
        Section(
            "What the makers say",
            [
                "Motor 6 turns with joint 5 and joint 6, so that its friction and its rotor load both: their "
                "configuration has fvm6 = 0.616 N·m·s/rad, fsm6 = 1.95 N·m and Iam6 = 0.00964 kg·m². Zeros "
                "of joints 2 and 3 are a quarter turn off, and currents count as torques of the motors.",
                "The model file has the motors, the ratios and these zeros. The positions are radians of the motor, "
                "not degrees: the first sample of joint 2 is 50.265, which is π/2 times its ratio of 32.",
            ],
        ),
        Section("What we say", [seen]),
        Section(
            "What cannot be told apart",
            [
                alike(answer),
                "What stands as motor 5 is joint 5 itself: only motor 6 is a place of its own. A friction that every "
                "joint has by itself is fitted beside it from the beginning.",
            ],
        ),
    ]


if __name__ == "__main__":
    sys.exit(status_of(main))
