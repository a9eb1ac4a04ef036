"""Make the bundled captures again: ``python studies/bundled/generate_capture.py [FOLDER]`` (needs mujoco; minutes).

The built-in snare closes on a pin that hangs on a spring, from two start poses, as rods in MuJoCo (`bench.snare_rods`):
another engine, another model of cable and contact than the one that explains them. Noise is that of
`bench.snare_concealed`: motion capture, load cell, encoder of the ring.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.append(str(Path(__file__).resolve().parents[2]))

from bench.snare_concealed import write
from bench.snare_rods import Truth, moved, simulate
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

SEED = 34
DURATION = 8.0
FRICTION = 0.2
ROLES = ("first", "second")

MODEL = """\
name = "capture"
system = "snare_capture"
effects = []                # today's simulation: no friction between cables and pin

[capture]                   # what the rig's drawings say [m, kg]
ring_radius = 0.127
pin_radius = 0.0075
mass = 25.0
"""

ANSWER = {
    "effects": [
        {"name": "contact_friction", "at": "pin", "parameters": {"coefficient": {"value": FRICTION, "unit": "1"}}}
    ]
}


def starts(rng: np.random.Generator) -> Target:
    """The ground test's target, up to 12 mm beside its usual place in y and z."""
    return moved(Target("spring"), np.array([0.0, *rng.uniform(-0.012, 0.012, 2)]))


def main(folder: Path) -> None:
    """Write model, both captures and the answer."""
    rng = np.random.default_rng(SEED)
    (folder / "capture.toml").write_text(MODEL, encoding="utf-8")
    for role in ROLES:
        path, target = folder / f"capture_{role}.csv", starts(rng)
        write(path, simulate(SnareParameters(), target, Truth(friction=FRICTION), DURATION), target, rng)
        pd.read_csv(path).to_csv(path, index=False, float_format="%.6g")
    (folder / "capture_answer.json").write_text(json.dumps(ANSWER, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
