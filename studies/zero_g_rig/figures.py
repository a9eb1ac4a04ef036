"""The study's figures: the paper's 3, 4, 10 and 11, and friction curves with their bands."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.drawing import AFTER, BEFORE, GREY, MEASURED, SHADE, drawing, line, svg
from ..page import Picture
from .friction import SlideFrictionCurve

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


def printed(speed: Array, parts: Mapping[str, Array]) -> Picture:
    """The friction law with the paper's printed parameters, and its three parts, like the paper's figure 5."""
    with drawing():
        figure = Figure(figsize=(9.0, 3.0), layout="constrained")
        axes = figure.subplots()
        for (name, values), colour in zip(parts.items(), (MEASURED, BEFORE, AFTER, GREY), strict=True):
            line(axes, speed, values, colour, 1.4 if name == "f" else 1.0, name)
        axes.set(xlabel="joint speed [rad/s]", ylabel="f [printed unit]")
        axes.legend(ncols=4, loc="lower right")
        picture = svg(figure)
    text = "The law of equation 11 with its printed parameters, like the paper's figure 5: f = f1 + f2 + f3."
    return Picture(picture, "Friction over speed: the printed law and its three parts.", text)


def joint_1_while_3_starts(time: Array, q: Array, measured: Array, starts: Mapping[str, float]) -> Picture:
    """Torque of joint 1, and the angles of joints 1 and 3, where either starts, like the paper's figure 6."""
    first, last = min(starts.values()) - 8.0, max(starts.values()) + 20.0
    here = (time >= first) & (time <= last)
    with drawing():
        figure = Figure(figsize=(9.0, 3.4), layout="constrained")
        axes, angles = figure.subplots(2, 1, sharex=True)
        line(axes, time[here], measured[here, 0], MEASURED, 0.9, "joint 1, measured")
        for k, colour in ((0, AFTER), (2, BEFORE)):
            line(angles, time[here], q[here, k], colour, 1.2, f"joint {k + 1}")
        for name, begin in starts.items():
            for panel in (axes, angles):
                panel.axvline(begin, color=GREY, linestyle=":", linewidth=0.9)
            axes.text(begin, 1.0, f" {name} starts", transform=axes.get_xaxis_transform(), va="top", fontsize=7.5)
        axes.set(ylabel="torque [N·m]")
        angles.set(xlabel="time [s]", ylabel="angle [rad]")
        angles.legend(loc="upper left")
        picture = svg(figure)
    text = "Joint 1 bears the friction of joint 3's slide as joint 3 starts, and then its own: the paper's figure 6."
    return Picture(picture, "Torque of joint 1 and angles of joints 1 and 3 over time.", text)


def flight(time: Array, measured: Array, predicted: Array, band: Array) -> Picture:
    """A flight arm's torques: predicted with their band, and the simulated arm's; arrays (n, 7), band (7,)."""
    with drawing():
        figure = Figure(figsize=(9.0, 9.5), layout="constrained")
        axes = figure.subplots(7, 1, sharex=True)
        for k, at in enumerate(axes):
            at.fill_between(
                time, predicted[:, k] - band[k], predicted[:, k] + band[k], color=SHADE, alpha=0.5, linewidth=0
            )
            line(at, time, measured[:, k], MEASURED, 0.7, "flight arm" if k == 0 else "")
            line(at, time, predicted[:, k], AFTER, 1.0, "predicted" if k == 0 else "")
            at.set_ylabel(f"joint {k + 1}\n[N·m]")
        axes[-1].set_xlabel("time [s]")
        figure.legend(ncols=2, loc="outside upper center")
        picture = svg(figure)
    text = (
        "A flight arm without sensors on the same rig: predicted torque with its band, and what a simulated one bears."
    )
    return Picture(picture, "Predicted and simulated torque of a flight arm's joints over time.", text)


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


def friction(drawn: Sequence[SlideFrictionCurve], truth: Mapping[str, Array]) -> Picture:
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
