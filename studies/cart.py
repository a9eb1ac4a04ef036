"""A cart on a belt whose makers name friction by direction and place: do the recordings say so?

Every second run of one test is fitted, one of another is held out. Recordings: N. Skov, masterThesisMatlab (commit
0e2c7253), looked for in ``$SNARELAB_RECORDINGS``, beside the project, and at their publisher.
"""

import sys
from pathlib import Path

from ..errors import InputError
from ..exit_status import status_of
from ..identification.diagnose import Answer
from ..recordings import find_recording
from .foreign import Machine, alike, run
from .outcome import Quantity, interval
from .page import Section

HERE = Path(__file__).parent
RUNS = tuple(f"0m{k}5.csv" for k in (0, 2, 4, 6))
HELD = "cartTest3/0m25.csv"
MASS = 6.28
"""[kg] The makers'."""


def main() -> int:
    """Run the study; leaves page, numbers and the improved model in ``build/studies/cart``."""
    try:
        train = [str(find_recording(f"cartTest2/{name}")) for name in RUNS]
        holdout = str(find_recording(HELD))
    except InputError as error:
        print(f"The cart's recordings cannot be had: {error}", file=sys.stderr)
        return 2
    run(Machine("cart", "A cart on a belt", HERE / "cart" / "cart.toml", train, holdout, sections), mass)
    return 0


def mass(answer: Answer) -> list[Quantity]:
    """The mass beside the makers'."""
    return [
        Quantity("mass", m.unit, m.after, "predicted", MASS, *interval(m.after, m.std))
        for m in answer.diagnosis.moved
        if m.name == "inertia.body.mass"
    ]


def sections(answer: Answer) -> list[Section]:
    """What the makers say, what we say, and what cannot be told apart."""
    return [
        Section(
            "What the makers say",
            [
                "The makers state a mass of 6.28 kg, Coulomb friction that differs by direction and position, and no "
                "viscous friction. "
                "Force is current times 0.0934 N·m/A over a pulley of 0.028 m."
            ],
        ),
        Section("What we say", [answer.diagnosis.sentence]),
        Section(
            "What cannot be told apart",
            [
                alike(answer),
                "Masses, friction and the motor's constant can all grow together: the mass is as good as the constant "
                "that the makers give.",
            ],
        ),
    ]


if __name__ == "__main__":
    sys.exit(status_of(main))
