"""What the tests of study pages show: numbers, a plot over time, and a playback."""

import numpy as np
from matplotlib.figure import Figure
from pydrake.geometry import Cylinder, Sphere

from snarelab.report.drawing import AFTER, drawing, line, svg
from snarelab.report.playback import Playback
from snarelab.studies.outcome import Quantity
from snarelab.studies.page import Picture

QUANTITIES = [
    Quantity("first_contact", "s", 2.57, "calibrated", paper=2.6, low=2.55, high=2.61),
    Quantity("final_radial_y", "m", 0.00797, "predicted", paper=0.01),
    Quantity("named", "1", "joint_elasticity at joint2, <odd>", "reference"),
]
TIMES = np.linspace(0, 4, 401)


def picture() -> Picture:
    with drawing():
        figure = Figure(figsize=(6, 2))
        line(figure.subplots(), TIMES, np.sin(TIMES), AFTER)
        return Picture(svg(figure), "A sine over time", "The sine.")


def moving() -> Playback:
    """A blue chain that stretches to the left, and a red ball that crosses and is hidden after 2 s."""
    scene = Playback(frames_per_second=10)
    reach = np.linspace(0.05, 0.3, TIMES.size)
    points = np.zeros((TIMES.size, 6, 3))
    points[:, :, 1] = reach[:, None] * np.linspace(0, 1, 6)
    scene.curve("chain", 0.01, TIMES, points, "#0000ff")
    scene.body("ball", Sphere(0.04), "#ff0000")
    scene.move("ball", TIMES, np.stack([0 * TIMES, 0.3 - 0.15 * TIMES, 0 * TIMES + 0.1], axis=-1))
    scene.show("ball", TIMES, TIMES < 2)
    scene.body("post", Cylinder(0.02, 0.2), "#00ff00")
    scene.move("post", [0.0], [[0.0, 0.0, -0.1]], [[np.cos(np.pi / 4), np.sin(np.pi / 4), 0, 0]])  # lies along y
    scene.camera([-0.6, 0, 0], [0, 0, 0])
    return scene
