"""ETS-VII moves its arm and its base answers: the run of Wang, Luo and Ma (2011).

Six joints go from zero to 0.1 ... 0.6 rad in 25 s under a proportional-derivative servo, base floating, no gravity. The
paper's gains are lost in the scan; here they are omega² and 2 omega times the joint's own generalised inertia at the
start, with omega = 1 rad/s. The run is `FloatingMotion`'s; Drake repeats it by its own equations.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from pydrake.geometry import Box, Sphere

from ..exit_status import status_of
from ..models.floating.arm import FloatingArm
from ..models.floating.dynamics import (
    base_twist,
    generalized_inertia,
    generalized_jacobian,
    in_world,
    link_origins,
    tip_jacobians,
    tip_pose,
    world_momentum,
)
from ..models.floating.ets_vii import ets_vii
from ..models.floating.joint_drive import Drive
from ..models.floating.motion import FloatingMotion
from ..models.floating.plant import FloatingPlant, PlantRun
from ..models.inertia import Array, to_central
from ..report.drawing import AFTER, BEFORE, MEASURED, drawing, line, margins, svg
from ..report.playback import Playback
from ..report.words import percent
from .outcome import Quantity, table, write_result
from .page import Picture, Section, write_page

STUDY = "free-floating"
TARGET = np.arange(1, 7) / 10  # rad
DURATION, OMEGA, SAMPLE = 25.0, 1.0, 0.01  # s, rad/s, s
LONGEST = 0.05
"""Longest step [s] of the run that is drawn; the timed run takes as long ones as the tolerance of 1e-8 allows."""
DRAKE_LONGEST = 0.005
"""Longest step [s] with which Drake's momentum is held against a bar of 1e-12."""

PAPER_PEAK = 3e-3
"""Peak base rate [rad/s] that the paper's text gives; the exponent is lost in the scan and follows from the gains."""

BODY = (2.6, 2.0, 2.3)  # m, for the picture only


def main() -> int:
    """Run the study; leaves page and numbers in ``build/studies/free-floating``."""
    begun = time.monotonic()
    arm = ets_vii()
    run = simulate(arm)
    print(f"{', '.join(arm.unphysical())} of ETS-VII: physically impossible inertias, kept as published", flush=True)
    quantities = measure(arm, run)
    n = {q.name: q.ours for q in quantities if isinstance(q.ours, float)}
    found = (
        f"Six joints that move by up to 0.6 rad turn the base at up to {1e3 * n['peak_base_rate']:.2f}·10⁻³ rad/s, "
        f"in proportion to the servo's bandwidth (here {OMEGA:g} rad/s); leaving the base's motion out would put the "
        f"tip's velocity wrong by {percent(n['tip_error_without_base'])}."
    )
    write_page(STUDY, "ETS-VII, six joints, base floating", found, quantities, _sections(arm, run), _playback(arm, run))
    path = write_result(STUDY, quantities, time.monotonic() - begun, {"found": found, "published_as_is": True})
    print(f"{table(quantities)}\n\n{found}\nReport: {(path.parent / 'report.html').resolve()}")
    return 0


def gains(arm: FloatingArm, omega: float = OMEGA) -> tuple[Array, Array]:
    """Stiffness and damping (J,) [N·m/rad, N·m·s/rad]: a joint by itself is critically damped at ``omega`` [rad/s]."""
    own = np.diag(generalized_inertia(arm, np.zeros((1, arm.n_joints)))[0])
    return omega**2 * own, 2 * omega * own


def simulate(arm: FloatingArm, omega: float = OMEGA, longest: float = LONGEST, tolerance: float = 1e-8) -> PlantRun:
    """The published run at the steps taken, first sample included."""
    motion = FloatingMotion(arm, Drive(*gains(arm, omega)), tolerance)
    return _logged(motion, longest)


def measure(arm: FloatingArm, run: PlantRun) -> list[Quantity]:
    """The study's numbers."""
    stiffness, damping = gains(arm)
    q, _ = run.at([24.0])
    late = (np.abs(run.q - TARGET) > 0.01 * TARGET).any(axis=1)
    still = np.einsum("nij,nj->ni", tip_jacobians(arm, run.q)[1] - generalized_jacobian(arm, run.q), run.qd)
    moving = np.einsum("nij,nj->ni", generalized_jacobian(arm, run.q), run.qd)
    peak = peak_base_rate(arm, run)
    by_omega = [peak_base_rate(arm, simulate(arm, omega)) / omega for omega in (0.5, 2.0)]
    projected = peak_base_rate(arm.projected(), simulate(arm.projected()))
    motion = FloatingMotion(arm, Drive(stiffness, damping))
    plant = FloatingPlant(arm, stiffness, damping)
    drake, fine = plant.run(TARGET, DURATION), plant.run(TARGET, DURATION, longest=DRAKE_LONGEST)
    exact = FloatingPlant(arm, stiffness, damping, accuracy=1e-12).run(TARGET, DURATION)
    return [
        Quantity("peak_base_rate", "rad/s", peak, "calibrated", PAPER_PEAK),
        Quantity("peak_base_rate_per_omega", "1", peak / OMEGA, "reference", None, min(by_omega), max(by_omega)),
        Quantity("joint_error_24s", "rad", float(np.abs(q - TARGET).max()), "predicted"),
        Quantity("settling_time", "s", float(run.time[np.flatnonzero(late)[-1] + 1]), "reference"),
        Quantity("momentum_drift", "1", drift(arm, run), "reference"),
        Quantity("real_time_factor", "1", _factor(lambda: _logged(motion, np.inf)), "reference"),
        Quantity("tip_error_without_base", "1", _largest(still[:, :3]) / _largest(moving[:, :3]), "reference"),
        Quantity("peak_change_projected", "1", projected / peak - 1, "reference"),
        Quantity("tip_difference_to_drake", "m", tip_difference(arm, run, exact), "reference"),
        Quantity("drake_real_time_factor", "1", _factor(lambda: plant.run(TARGET, DURATION)), "reference"),
        Quantity("drake_momentum_drift", "1", drift(arm, drake), "reference"),
        Quantity("drake_momentum_drift_5ms", "1", drift(arm, fine), "reference"),
    ]


def peak_base_rate(arm: FloatingArm, run: PlantRun) -> float:
    """Largest size of the base's angular velocity [rad/s], between the steps as well."""
    return _largest(_base_rate(arm, run)[1])


def drift(arm: FloatingArm, run: PlantRun) -> float:
    """Largest change of the total momentum over the largest momentum of the base alone; linear or angular, the worse.

    Worked out from the poses and velocities of all bodies, about the world's origin.
    """
    total = world_momentum(arm, run.position, run.quaternion, run.q, run.twist, run.qd)
    mass, _, inertia = to_central(arm.base)
    own = mass * run.velocity, run.twist[:, 3:] @ inertia
    change = total - total[0]
    return max(_largest(change[:, :3]) / _largest(own[0]), _largest(change[:, 3:]) / _largest(own[1]))


def tip_difference(arm: FloatingArm, run: PlantRun, other: PlantRun) -> float:
    """Distance [m] between the tips of two runs at their end."""
    places = [
        r.position[-1] + in_world(r.quaternion[[-1]], tip_pose(arm, r.q[[-1]]).translation)[0] for r in (run, other)
    ]
    return float(np.linalg.norm(places[0] - places[1]))


def _logged(motion: FloatingMotion, longest: float) -> PlantRun:
    start = motion.start()
    inputs = np.concatenate([np.zeros(6), TARGET])
    log = motion.advance(0.0, start, DURATION, 0.01, inputs, longest=longest, log=True).log
    states = np.vstack([start, log[:, 1:]])
    seen, (q, qd) = motion.observe(states), motion.joints(states)
    twist = seen.base_twist
    return PlantRun(
        np.append(0.0, log[:, 0]), seen.base_position, seen.base_quaternion, twist[:, :3], twist[:, 3:], q, qd
    )


def _factor(run: Callable[[], PlantRun]) -> float:
    """Simulated over processor time, median of seven, each step logged."""
    spent = []
    for _ in range(8):
        begun = time.process_time()
        run()
        spent.append(time.process_time() - begun)
    return DURATION / float(np.median(spent[1:]))


def _base_rate(arm: FloatingArm, run: PlantRun) -> tuple[Array, Array]:
    """Times (n,) [s] and the base's rate (n, 3) in its frame [rad/s], at zero momentum between the steps as well."""
    times = np.arange(0.0, DURATION + SAMPLE / 2, SAMPLE)
    return times, base_twist(arm, *run.at(times))[:, 3:]


def _largest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())


def _sections(arm: FloatingArm, run: PlantRun) -> list[Section]:
    times, base = _base_rate(arm, run)
    q, qd = run.at(times)
    joints = (0, 2, 4), (1, 3, 5)
    with drawing():
        pictures = [
            _picture(
                times,
                q,
                joints,
                "joint angle [rad]",
                TARGET,
                "lower right",
                "The paper's figure 2: joint angles and targets.",
            ),
            _picture(
                times, qd, joints, "joint rate [rad/s]", None, "upper right", "The paper's figure 3: joint rates."
            ),
            _picture(
                times,
                base,
                ((0, 1, 2),),
                "base rate [rad/s]",
                None,
                "lower right",
                "The paper's figure 4: the base's rate.",
            ),
        ]
    unphysical = ", ".join(arm.unphysical())
    return [
        Section(
            "The run",
            [
                "Base and arm float at rest; the servo moves all six joints at once. No force acts from outside, so "
                "the momentum stays zero and the base moves against the arm.",
                f"The paper's gains are illegible. Stiffness is omega² and damping 2 omega times the joint's own "
                f"generalised inertia, omega = {OMEGA:g} rad/s: the peak base rate is proportional to omega, and a "
                f"paper that prints 3·10⁻³ rad/s needs omega = {PAPER_PEAK / peak_base_rate(arm, run) * OMEGA:.2f}. "
                "It is therefore marked as calibrated.",
                f"Parameters are kept as published, though the inertias of {unphysical} are physically impossible; the "
                "nearest possible ones change the peak by the share in the table.",
            ],
            pictures,
        ),
        Section(
            "How far to trust it",
            [
                "The run's state holds the momentum instead of the base's velocity, so the drift in the table's "
                "momentum_drift is rounding by construction. Drake integrates the base's velocity like any other: its "
                "drift at the same tolerance with free steps, and with steps of 5 ms, stands beside it. Both are of "
                "fifth order at a tolerance of 1e-8 and log every step.",
                "The tip's place at the end is compared with Drake's at a tolerance of 1e-12.",
            ],
        ),
    ]


def _picture(
    times: Array,
    values: Array,
    groups: tuple[tuple[int, ...], ...],
    label: str,
    targets: Array | None,
    place: str,
    caption: str,
) -> Picture:
    figure = Figure(figsize=(8.4, 2.9))
    panels = np.atleast_1d(figure.subplots(1, len(groups), squeeze=False)[0])
    figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.55, 0.3), wspace=0.25)
    for panel, group in zip(panels, groups, strict=True):
        for i, colour in zip(group, (MEASURED, BEFORE, AFTER), strict=True):
            line(panel, times, values[:, i], colour, 1.2, _name(i, len(groups)))
            if targets is not None:
                panel.axhline(targets[i], color=colour, linewidth=0.6, linestyle=":")
        panel.set(xlabel="time [s]", ylabel=label)
        panel.legend(loc=place)
    return Picture(svg(figure), f"{label} over time", caption)


def _name(i: int, n_groups: int) -> str:
    return f"joint {i + 1}" if n_groups > 1 else "xyz"[i]


def _playback(arm: FloatingArm, run: PlantRun) -> str:
    """Base and arm in the world."""
    times = np.arange(0.0, DURATION, 1 / 15)
    nearest = np.searchsorted(run.time, times)
    q = run.at(times)[0]
    position, quaternion = run.position[nearest], run.quaternion[nearest]
    on_base = np.concatenate([link_origins(arm, q), tip_pose(arm, q).translation[:, None]], axis=1)
    chain = np.stack([position + in_world(quaternion, on_base[:, i]) for i in range(on_base.shape[1])], axis=1)
    scene = Playback()
    scene.body("base", Box(*BODY), "#9AA3AB", 0.6)
    scene.move("base", times, position, quaternion)
    scene.curve("arm", 0.06, times, chain, AFTER)
    for i in range(chain.shape[1]):
        scene.body(f"joints/{i + 1}", Sphere(0.1), BEFORE)
        scene.move(f"joints/{i + 1}", times, chain[:, i])
    scene.camera([2.4, -3.4, 2.9], [-0.3, 0.0, 0.8])
    return scene.html()


if __name__ == "__main__":
    sys.exit(status_of(main))
