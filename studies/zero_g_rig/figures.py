"""The study's figures: the paper's 3, 4, 10 and 11, and friction curves with their bands."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.drawing import AFTER, BEFORE, GREY, MEASURED, SHADE, drawing, line, svg
from ..page import Picture
from .friction import Curve

Array = NDArray[np.float64]


def sequence(time: Array, q: Array) -> Picture:
    """Joint angles over time, like the paper's figure 3; time (n,), q (n, 7)."""
    with drawing():
        figure = Figure(figsize=(9.0, 3.0), layout="constrained")
        axes = figure.subplots()
        colours = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
        for k, colour in enumerate(colours):
            line(axes, time, q[:, k], colour, 1.1, f"joint {k + 1}")
        axes.set(xlabel="time [s]", ylabel="angle [rad]")
        axes.legend(ncols=7, loc="upper center", bbox_to_anchor=(0.5, 1.16))
        picture = svg(figure)
    return Picture(picture, "Angle of the seven joints over time.", "The motion, like the paper's figure 3.")


def torques(time: Array, measured: Array, models: Mapping[str, Array], caption: str) -> Picture:
    """Measured and modelled torque of joints 1 to 7, like the paper's figures 4 and 10; each array (n, 7)."""
    with drawing():
        figure = Figure(figsize=(9.0, 9.5), layout="constrained")
        axes = figure.subplots(7, 1, sharex=True)
        for k, at in enumerate(axes):
            line(at, time, measured[:, k], MEASURED, 0.9, "measured" if k == 0 else "")
            for (label, modelled), colour in zip(models.items(), (BEFORE, AFTER), strict=False):
                line(at, time, modelled[:, k], colour, 0.9, label if k == 0 else "")
            at.set_ylabel(f"joint {k + 1}\n[N·m]")
        axes[-1].set_xlabel("time [s]")
        figure.legend(ncols=3, loc="outside upper center")
        picture = svg(figure)
    return Picture(picture, f"Torque of joints 1 to 7, measured and {', '.join(models)}, over time.", caption)


def errors(joints: Sequence[str], steps: Mapping[str, Array], caption: str) -> Picture:
    """Mean torque error of every joint, one bar a model, like the paper's figure 11; each array (7,)."""
    with drawing():
        figure = Figure(figsize=(9.0, 3.2), layout="constrained")
        axes = figure.subplots()
        width = 0.8 / len(steps)
        for k, ((label, values), colour) in enumerate(zip(steps.items(), (GREY, BEFORE, AFTER), strict=False)):
            axes.bar(
                np.arange(len(joints)) + (k - (len(steps) - 1) / 2) * width, values, width, color=colour, label=label
            )
        axes.set_xticks(np.arange(len(joints)), joints)
        axes.set(ylabel="mean error [N·m]", yscale="log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.legend(ncols=3, loc="upper right")
        picture = svg(figure)
    return Picture(picture, "Bars of the mean torque error of each joint under each model.", caption)


def friction(drawn: Sequence[Curve], truth: Mapping[str, Array]) -> Picture:
    """Identified friction curves with 2σ bands, and the plant's own steady friction (n_speeds,) [N]."""
    with drawing():
        figure = Figure(figsize=(9.0, 5.2), layout="constrained")
        axes = figure.subplots(2, 4).ravel()
        for at, curve in zip(axes, drawn, strict=False):
            for way in (curve.speed < 0, curve.speed > 0):
                speed, force, band = curve.speed[way], curve.force[way], 2 * curve.std[way]
                at.fill_between(speed, force - band, force + band, color=SHADE, alpha=0.5, linewidth=0)
                at.plot(speed, force, color=AFTER, linewidth=1.2)
                at.plot(speed, truth[curve.joint][way], color=MEASURED, linewidth=0.9, linestyle="--")
            at.set_title(curve.joint)
        for at in axes[len(drawn) :]:
            at.set_axis_off()
        figure.supxlabel("joint speed [rad/s]")
        figure.supylabel("force at a contact [N]")
        picture = svg(figure)
    return Picture(
        picture,
        "Friction force over speed of each joint's slide: identified, with a band, and true.",
        "Friction at the slides over the speeds travelled: identified (blue, with 2σ band), the plant's own (dashed).",
    )
