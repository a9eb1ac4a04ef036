"""Two coupled oscillators: error, order and stability of every way to couple them, against the exact solution.

The system is that of `bench/two_masses.py`; the left mass starts at 1 m. Ten seconds. As a script it draws the figures
of the documentation: ``python bench/cosim_accuracy.py docs``.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

sys.path.append(str(Path(__file__).resolve().parents[1]))

from bench.two_masses import CONNECTIONS, SECONDS, Panel, error_figure, largest_error, plain_ticks, slopes
from snarelab.cosim.iteration import Iteration
from snarelab.cosim.master import HoldName, Master, Scheme
from snarelab.cosim.participant import StepError
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.system import System
from snarelab.report.drawing import drawing, svg

HOLDS: tuple[HoldName, ...] = ("constant", "midpoint", "linear", "quadratic")
SCHEMES: tuple[Scheme, ...] = ("jacobi", "gauss_seidel")
_CLASSES = ("#56B4E9", "#D55E00", "#000000")


def error(step: float, scheme: Scheme = "jacobi", hold: HoldName = "midpoint", iterate: bool = False) -> float:
    """Largest position error [m] of either mass over ten seconds."""
    halves = {"left": LeftOscillator(), "right": RightOscillator()}
    master = Master(System(halves, CONNECTIONS), step, scheme=scheme, hold=hold, iterate=iterate)
    return largest_error(master.run(SECONDS).recording)


def orders(steps: Sequence[float], scheme: Scheme, hold: HoldName, iterate: bool) -> tuple[list[float], list[float]]:
    """Errors [m] at these macro steps [s], and the observed orders between them."""
    errors = [error(step, scheme, hold, iterate) for step in steps]
    return errors, slopes(steps, errors)


def growth(
    stiffness: float, mass: float, scheme: Scheme = "jacobi", hold: HoldName = "midpoint", iterate: bool = False
) -> float:
    """Growth of the motion a macro step; above 1 the coupling is unstable, as the system itself is damped.

    Parameters
    ----------
    stiffness : float
        Of the coupling, as H²·kc/m1, with H the macro step and m1 the left mass.
    mass : float
        Of the right half, m2/m1.
    """
    n = 240
    # Each half steps finely by itself: what is unstable then is the coupling.
    halves = {"left": LeftOscillator(substeps=64), "right": RightOscillator(substeps=64)}
    parameters = {
        "left.stiffness": 0.01,
        "right.stiffness": 0.01,
        "right.mass": mass,
        "right.coupling_stiffness": stiffness,
        "left.damping": 0.02,
        "right.damping": 0.02 * mass,
    }
    system = System(halves, CONNECTIONS, parameters=parameters)
    solver = Iteration(tolerance=1e-6) if iterate else False
    master = Master(system, 1.0, scheme=scheme, hold=hold, iterate=solver)
    largest = np.zeros(n)
    for k in range(n):
        try:
            master.step()
        except StepError:
            return np.inf
        largest[k] = max(abs(master.value("left.x")), abs(master.value("right.x")))
        if largest[k] > 1e6:
            return float(largest[k] ** (1.0 / (k + 1)))
    third = n // 3
    return float((largest[-third:].max() / largest[third : 2 * third].max()) ** (1.0 / third))


def order_figure() -> bytes:
    """Error over macro step, explicit and iterated, as SVG."""
    steps = [0.04, 0.02, 0.01, 0.005]
    kinds: tuple[tuple[str, Scheme, bool], ...] = (
        ("Jacobi", "jacobi", False),
        ("Gauss-Seidel", "gauss_seidel", False),
        ("iterated", "jacobi", True),
    )
    panels: list[Panel] = [
        (title, "macro step [s]", steps, {hold: orders(steps, scheme, hold, iterate)[0] for hold in HOLDS})
        for title, scheme, iterate in kinds
    ]
    return error_figure(panels)


def stability_figure() -> bytes:
    """Where the explicit master is stable, over coupling stiffness and mass ratio, as SVG."""
    stiffness, mass = np.logspace(-2, 1, 13), np.logspace(-1, 1, 9)
    with drawing():
        figure, axes = plt.subplots(2, 3, figsize=(8.4, 5.2), sharex=True, sharey=True, layout="constrained")
        for row, scheme in zip(axes, SCHEMES, strict=True):
            for panel, hold in zip(row, ("constant", "midpoint", "quadratic"), strict=True):
                grid = [[_class(k, m, scheme, hold) for k in stiffness] for m in mass]
                colours = ListedColormap(_CLASSES)
                panel.pcolormesh(
                    stiffness, mass, np.array(grid), cmap=colours, vmin=0, vmax=2, shading="nearest", rasterized=True
                )
                panel.set(xscale="log", yscale="log", title=f"{scheme.replace('_', '-')}, {hold}")
        for panel in axes[-1]:
            panel.set_xlabel("coupling stiffness H²·kc/m1")
        for panel in axes[:, 0]:
            panel.set_ylabel("mass ratio m2/m1")
        for panel in axes.flat:
            plain_ticks(panel, [0.01, 0.1, 1, 10])
        words = ("stable without iteration", "stable with iteration only", "unstable")
        patches = [Patch(facecolor=colour, label=word) for colour, word in zip(_CLASSES, words, strict=True)]
        figure.legend(handles=patches, loc="outside upper center", ncols=3)
        picture = svg(figure)
        plt.close(figure)
    return picture


def _class(stiffness: float, mass: float, scheme: Scheme, hold: HoldName) -> int:
    """0 stable without iteration, 1 with it only, 2 not at all."""
    if growth(stiffness, mass, scheme, hold) <= 1:
        return 0
    return 1 if growth(stiffness, mass, scheme, hold, iterate=True) <= 1 else 2


def main() -> None:
    """Write both figures into the folder given."""
    folder = Path(sys.argv[1])
    (folder / "cosimulation-order.svg").write_bytes(order_figure())
    (folder / "cosimulation-stability.svg").write_bytes(stability_figure())


if __name__ == "__main__":
    main()
