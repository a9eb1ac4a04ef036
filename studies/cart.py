"""A cart on a belt whose makers name friction by direction and place: do the recordings say so?

Four runs of one test are fitted, those of another held out. Recordings: N. Skov, masterThesisMatlab (commit
0e2c7253), looked for in ``$SNARELAB_RECORDINGS``, beside the project, and at their publisher.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from ..exit_status import status_of
from ..identification.diagnose import Answer
from ..identification.identify import Identification, identify
from ..models.model_file import load_model
from ..recordings import find_recording
from .foreign import Machine, alike, run
from .outcome import Quantity, interval
from .page import Section

HERE = Path(__file__).parent
MODEL = HERE / "cart" / "cart.toml"
RUNS = tuple(f"0m{k}5.csv" for k in (0, 1, 3, 6))
"""Their starts are 0.1, 0.2 and 0.3 m apart; all files start a multiple of 0.1 m apart."""
MASS = 6.28
"""[kg] The makers'."""


def main() -> int:
    """Run the study; leaves page, numbers and the improved model in ``build/studies/cart``."""
    try:
        train, holdout = (
            [str(find_recording(f"{test}/{name}")) for name in RUNS] for test in ("cartTest2", "cartTest3")
        )
    except InputError as error:
        print(f"The cart's recordings cannot be had: {error}", file=sys.stderr)
        return 2
    run(Machine("cart", "A cart on a belt", MODEL, train, holdout, sections), lambda _: mass(train))
    return 0


def mass(train: Sequence[str]) -> list[Quantity]:
    """The mass of the initial model, identified beside its friction, and the makers'."""
    found = identify(replace(load_model(MODEL), inertia="free"), train)
    assert isinstance(found, Identification)
    i = next(i for i, s in enumerate(found.fit.assembly.slots) if s.key == "inertia.body.mass")
    value, std = float(found.fit.theta[i]), float(found.fit.std[i])
    return [Quantity("mass", "kg", value, "predicted", MASS, *interval(value, std))]


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
                "The drive is a relay: it reverses its force at the same distance from where a run starts. So would a "
                "force that repeats with position: beside it a free mass can be anything. The diagnosis therefore "
                "takes the makers' mass. A wrong mass and a wrong motor constant, a gain of its channel, are one. "
                "Identified beside viscous friction alone, the mass is as good as the constant that the makers give.",
            ],
        ),
    ]


if __name__ == "__main__":
    sys.exit(status_of(main))
