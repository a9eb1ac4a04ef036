"""A position servo by an engine of its own: bristles (Canudas de Wit et al. 1995) and leapfrog steps."""

from dataclasses import dataclass
from math import copysign, exp, pi, sin

import numpy as np

from snarelab.models.servo_loop import ServoRun

MASS, LENGTH, VOLTS, GRAVITY = 0.49, 0.1, 7.4, 9.80665
ARM = MASS * LENGTH**2
PERIOD, STEP, SUBSTEPS = 0.005, 2 * np.pi / 4096, 25
"""[s], [rad] Of the samples and of the encoder."""
BRISTLE = 2e-5
"""[rad] Travel over which friction builds up. At a tenth of the encoder's step the servo would stop 0.8 mrad
elsewhere than with dry friction, which no law without memory tells."""


@dataclass(frozen=True)
class LugreServo:
    """Motor [N·m/V, V·s/rad, kg·m²], viscous [N·m·s/rad] and dry friction [N·m], friction's share of the load, drag
    [N·m·s²/rad²], and a torque [N·m] that ripples once in half a radian."""

    torque_per_volt: float = 0.08
    back_emf: float = 0.38
    rotor: float = 0.0015
    viscous: float = 0.006
    level: float = 0.01
    load_share: float = 0.0
    drag: float = 0.0
    ripple: float = 0.0

    def acceleration(self, q, v, z, volts):
        """[rad/s²] With bristles bent by a share z of where they slip."""
        weight = MASS * GRAVITY * LENGTH * sin(q)
        drive = self.torque_per_volt * (volts - self.back_emf * v) - weight - self.level * z
        drive -= self.viscous * v + self.drag * v * abs(v) + self.ripple * sin(4 * pi * q)
        # The gear's loss goes by the torque it carries, which the loss itself changes: one of two signs holds.
        for sign in (1.0, -1.0):
            a = (drive - sign * self.load_share * z * weight) / (ARM * (1 + sign * self.load_share * z) + self.rotor)
            if sign * (ARM * a + weight) >= 0:
                break
        return a

    def recorded(self, goal, gain, seed=0, duration=5.0):
        """A recording; ``goal`` is a function of time [rad], ``gain`` [1/rad] duty for an error."""
        time = np.arange(0.0, duration, PERIOD)
        goals, (q, v, z), h, seen = goal(time), (0.0, 0.0, 0.0), PERIOD / SUBSTEPS, []
        for target in goals.tolist():
            seen.append(q)
            for _ in range(SUBSTEPS):
                v += 0.5 * h * self.acceleration(q, v, z, VOLTS * min(max(gain * (target - q), -1.0), 1.0))
                q += h * v
                way = copysign(1.0, v)
                z = way + (z - way) * exp(-abs(v) * h / BRISTLE)
                v += 0.5 * h * self.acceleration(q, v, z, VOLTS * min(max(gain * (target - q), -1.0), 1.0))
        noise = np.random.default_rng(seed).standard_normal(len(time))
        position = STEP * np.round((np.array(seen) + 0.3 * STEP * noise) / STEP)
        ones = np.ones(len(time))
        return ServoRun(f"seed {seed}", gain, MASS, LENGTH, time, position, goals, ones, VOLTS * ones)


GOALS = (
    lambda t: 1.2 * np.sin(3 * t) * np.sin(0.7 * t),
    lambda t: 0.9 * np.sin(1.1 * t * t),
    lambda t: 0.7 * np.sin(1.3 * t + 0.5) - 0.7 * np.sin(0.5) + 0.3 * np.sin(4.1 * t),
)
GAINS = (0.6, 1.2, 0.6, 0.9)


def recordings(servo):
    """Three to fit, and one at another gain."""
    runs = [servo.recorded(GOALS[i % 3], gain, i) for i, gain in enumerate(GAINS)]
    return runs[:3], runs[3:]
