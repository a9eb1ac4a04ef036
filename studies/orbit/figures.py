"""Figures of the two captures in orbit."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...models.inertia import Array
from ...report.drawing import AFTER, BEFORE, GREY, MEASURED, SHADE, drawing, line, margins, svg
from ..page import Picture
from .axes import panels, plain
from .ledger import WINDOW, Momentum
from .map import LEVELS, STIFFNESSES, Cell
from .setting import OrbitCapture

PAPER_CONTACT, PAPER_Y, PAPER_Z = 7.0, 0.005, 0.010
"""First contact [s], and below what both radial displacements end [m] (Li et al., figure 10 and its text)."""


def displacement(capture: OrbitCapture, reference: OrbitCapture) -> Picture:
    """Like the paper's figure 10."""
    with drawing():
        figure, axes = plain(3.2)
        for axis, name, colour, bar in ((1, "y", AFTER, PAPER_Y), (2, "z", BEFORE, PAPER_Z)):
            line(axes, capture.times, 1e3 * capture.relative[:, axis], colour, 1.6, f"{name}, co-simulated")
            line(axes, reference.times, 1e3 * reference.relative[:, axis], MEASURED, 0.7)
            axes.plot(
                [9.6, 10.5], [1e3 * bar] * 2, color=colour, linestyle="--", linewidth=1.0, label=f"paper: {name} below"
            )
        axes.plot([], [], color=MEASURED, linewidth=0.7, label="one system")
        axes.axvline(PAPER_CONTACT, color=MEASURED, linewidth=0.8, linestyle=":")
        axes.text(PAPER_CONTACT - 0.05, 0.5, "paper: first contact, about 7 s", rotation=90, ha="right", fontsize=8)
        axes.set(xlabel="time [s]", ylabel="pin from the effector's axis [mm]")
        axes.legend(ncols=2, loc="lower left")
        caption = "Radial displacement of the pin's foot in the end effector's frame, as in the paper's figure 10."
        return Picture(svg(figure), "Radial displacements over time", caption)


def forces(capture: OrbitCapture, reference: OrbitCapture) -> Picture:
    """Force on the end effector, both ways."""
    with drawing():
        figure, axes = panels(3, 5.0)
        for axis, panel in enumerate(axes):
            for who, colour, width in ((capture, AFTER, 1.6), (reference, MEASURED, 0.7)):
                middles, force = who.mean_force(WINDOW, 0.01)
                line(panel, middles, force[:, axis], colour, width, "co-simulated" if who is capture else "one system")
            panel.set(ylabel=f"{'xyz'[axis]} [N]")
        axes[0].legend(loc="upper left")
        return Picture(svg(figure), "Force over time", "Force on the end effector, world frame, averaged over 50 ms.")


def base_motion(capture: OrbitCapture) -> Picture:
    """Where the base goes and turns to."""
    with drawing():
        figure, axes = panels(2, 4.0)
        for axis, colour in enumerate((MEASURED, BEFORE, AFTER)):
            name = "xyz"[axis]
            line(axes[0], capture.times, 1e3 * (capture.base[:, 0, axis] - capture.base[0, 0, axis]), colour, 1.2, name)
            line(axes[1], capture.times, 1e6 * capture.base[:, 2, axis], colour, 1.2, name)
        axes[0].set(ylabel="base moved [mm]")
        axes[1].set(ylabel="base turns [µrad/s]")
        axes[0].legend(loc="upper left")
        return Picture(
            svg(figure), "Base motion over time", "Motion of the 40 t base: its frame's origin, and its rate."
        )


def ledgers(capture: OrbitCapture, energies: Mapping[str, Array], momentum: Momentum) -> list[Picture]:
    """Energy shares, and the momentum's with the total's change."""
    colours = (MEASURED, BEFORE, SHADE, "#009E73", AFTER, "#E69F00", GREY, "#CC79A7", "#CC1111")
    shown = {"motor and cables' strain": energies["motor"] - energies["cables, strain"]}
    shown |= {name: values for name, values in energies.items() if name not in ("motor", "cables, strain")}
    with drawing():
        figure, axes = plain(3.6)
        for (name, values), colour in zip(shown.items(), colours, strict=True):
            line(axes, capture.times, 1e3 * values, colour, 2.0 if colour == MEASURED else 1.1, name)
        axes.set(xlabel="time [s]", ylabel="energy [mJ]")
        axes.legend(ncols=2, loc="upper left", fontsize=7.5)
        text = (
            "What the ring's motor and the cables, which straighten, have handed on, and where it is. The residual is "
            f"what is left unexplained, {1e3 * np.abs(energies['residual']).max():.2g} mJ at most."
        )
        pictures = [Picture(svg(figure), "Energies over time", text)]
    with drawing():
        figure, axes = panels(2, 4.2)
        shares = (("base and arm", momentum.arm, AFTER), ("cables and target", momentum.snare, BEFORE))
        for name, values, colour in shares:
            for axis in range(3):
                line(axes[0], capture.times, values[:, axis], colour, 1.2, name if axis == 0 else "")
        total = momentum.arm + momentum.snare
        change = np.abs(total - total[0]).reshape(-1, 2, 3)
        for row, (name, colour) in enumerate((("linear", AFTER), ("angular", BEFORE))):
            share = np.linalg.norm(change[:, row], axis=1) / momentum.scale[row]
            line(axes[1], capture.times, np.maximum(share, 1e-18), colour, 1.0, name)
        axes[0].set(ylabel="linear momentum [N·s]")
        axes[1].set(ylabel="change of the total [1]", yscale="log", ylim=(1e-19, 1e-5))
        exponents = range(-18, -5, 4)
        axes[1].set_yticks([10.0**k for k in exponents], [f"1e{k}" for k in exponents])
        axes[1].minorticks_off()
        for panel in axes:
            panel.legend(loc="upper left")
        text = "Above: x, y and z of what each has. Below: change of the total over what was exchanged at most."
        pictures.append(Picture(svg(figure), "Momentum over time", text))
    return pictures


def passive_map(cells: Sequence[Cell]) -> Picture:
    """End point against friction and stiffness."""
    with drawing():
        figure = Figure(figsize=(9.0, 3.0))
        all_axes: list[Axes] = list(figure.subplots(1, 3))
        shown = (
            ("final_y", "final y [mm]", PAPER_Y),
            ("final_z", "final z [mm]", PAPER_Z),
            ("peak_force", "peak [N]", 0),
        )
        for axes, (name, label, bar) in zip(all_axes, shown, strict=True):
            for stiffness, colour in zip(STIFFNESSES, (AFTER, BEFORE), strict=True):
                row = [c for c in cells if c.stiffness == stiffness]
                factor = 1.0 if name == "peak_force" else 1e3
                values = [factor * getattr(c, name) for c in row]
                axes.plot(
                    [c.level for c in row], values, "o-", color=colour, markersize=4, label=f"{stiffness:g} N·m/rad"
                )
            if bar:
                axes.axhspan(-1e3 * bar, 1e3 * bar, color=GREY, alpha=0.18, linewidth=0)
            axes.set(xscale="log", xlabel="friction of a joint [N·m]", ylabel=label)
            axes.set_xticks(LEVELS, [f"{x:g}" for x in LEVELS])
            axes.minorticks_off()
        all_axes[0].legend(fontsize=7.5)
        figure.subplots_adjust(**margins(figure, 0.7, 0.1, 0.5, 0.15), wspace=0.3)
        text = "End point and peak force by joint friction and stiffness; grey: inside the paper's figures."
        return Picture(svg(figure), "End point against joint friction and stiffness", text)
