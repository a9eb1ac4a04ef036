"""What moves the snare from outside: the ring's angle, and the poses of the end effector and of a moved target.

A pose handed in at the end of a step is reached smoothly: position by the cubic that takes both ends' values and
velocities (Hermite), orientation by R = R₀ exp(θ(t)) with θ such a cubic of the rotation vector. Jumps would kick the
cables, which hold their ends by position.

A path is one row of 32 numbers: start, duration, then position, velocity at the start and at the end, R₀ (9), θ at the
end, and θ's rates at start and end. A frame, its value at a time, is a (6, 3) array: position, velocity, angular
velocity, rotation matrix.
"""

from dataclasses import dataclass
from math import atan2, cos, sin

import numpy as np
from scipy.spatial.transform import Rotation

from .vector import add_scaled, compiled, cross, length, rotate_back, row, scale

PATH_SIZE = 32


@dataclass(frozen=True)
class Pose:
    """Pose and twist of a body in the world.

    Parameters
    ----------
    position, velocity, angular_velocity : array (3,)
        [m, m/s, rad/s]
    rotation : array (3, 3)
    """

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray

    def after(self, duration: float) -> "Pose":
        """Where it is after moving on with its twist for a time [s]."""
        turn = Rotation.from_rotvec(np.asarray(self.angular_velocity) * duration).as_matrix()
        position = np.asarray(self.position) + np.asarray(self.velocity) * duration
        return Pose(position, turn @ self.rotation, self.velocity, self.angular_velocity)

    def frame(self) -> np.ndarray:
        """As a (6, 3) array."""
        frame = np.empty((6, 3))
        frame[0], frame[1], frame[2] = self.position, self.velocity, self.angular_velocity
        frame[3:] = self.rotation
        return frame

    @staticmethod
    def of_frame(frame: np.ndarray, origin: np.ndarray) -> "Pose":
        """From a (6, 3) array whose position is from an origin [m]."""
        return Pose(frame[0] + origin, frame[3:].copy(), frame[1].copy(), frame[2].copy())


@compiled
def _exponential(theta, turn, right):
    """Write exp(θ) and its right Jacobian for a rotation vector θ."""
    angle = length(theta)
    if angle < 1e-4:
        s, v, w = 1 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    else:
        s, v, w = sin(angle) / angle, (1 - cos(angle)) / angle**2, (angle - sin(angle)) / angle**3
    for i in range(3):
        for j in range(3):
            square = theta[i] * theta[j] - (angle**2 if i == j else 0.0)
            turn[i, j] = v * square + (1.0 if i == j else 0.0)
            right[i, j] = w * square + (1.0 if i == j else 0.0)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turn[i, j] -= s * theta[k]
        turn[j, i] += s * theta[k]
        right[i, j] += v * theta[k]
        right[j, i] -= v * theta[k]


@compiled
def _logarithm(start, end):
    """Rotation vector of R_startᵀ R_end, for angles short of half a turn."""
    relative = start.T @ end
    axis = (relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1])
    sine = 0.5 * length(axis)
    angle = atan2(sine, 0.5 * (relative[0, 0] + relative[1, 1] + relative[2, 2] - 1.0))
    return scale(0.5 if sine < 1e-9 else 0.5 * angle / sine, axis)


@compiled
def go_on(frame, duration, moved):
    """Write where a frame is after moving on with its twist for a time [s]."""
    turn, right = np.empty((3, 3)), np.empty((3, 3))
    _exponential(scale(duration, row(frame, 2)), turn, right)
    moved[3:6] = turn @ frame[3:6]
    for k in range(3):
        moved[0, k] = frame[0, k] + duration * frame[1, k]
        moved[1, k] = frame[1, k]
        moved[2, k] = frame[2, k]


@compiled
def fill_path(time, duration, start, end, path):
    """Write the path between two frames."""
    path[0], path[1] = time, duration
    path[2:5], path[5:8] = start[0], start[1]
    path[8:11], path[11:14] = end[0], end[1]
    path[14:23] = start[3:6].copy().reshape(9)
    theta = _logarithm(start[3:6], end[3:6])
    first = rotate_back(start[3:6], row(start, 2))
    rate = rotate_back(end[3:6], row(end, 2))
    # θ̇ at the end from the body's rate: inverse of the right Jacobian of exp
    angle = length(theta)
    factor = 1 / 12 + angle**2 / 720
    if angle > 1e-2:
        factor = 1 / angle**2 - (1 + cos(angle)) / (2 * angle * sin(angle))
    turned = cross(theta, rate)
    last = add_scaled(add_scaled(rate, 0.5, turned), factor, cross(theta, turned))
    for k in range(3):
        path[23 + k], path[26 + k], path[29 + k] = theta[k], first[k], last[k]


@compiled
def frame_at(path, time, frame):
    """Write position, velocity, angular velocity and rotation at a time [s] into a (6, 3) frame."""
    size = path[1]
    u = (time - path[0]) / size
    a, b, c, d = 1 - 3 * u * u + 2 * u**3, u * (1 - u) ** 2 * size, u * u * (3 - 2 * u), u * u * (u - 1) * size
    a1, b1, c1, d1 = 6 * u * (u - 1) / size, 1 - 4 * u + 3 * u * u, 6 * u * (1 - u) / size, u * (3 * u - 2)
    for k in range(3):
        frame[0, k] = a * path[2 + k] + b * path[5 + k] + c * path[8 + k] + d * path[11 + k]
        frame[1, k] = a1 * path[2 + k] + b1 * path[5 + k] + c1 * path[8 + k] + d1 * path[11 + k]
    theta = (
        b * path[26] + c * path[23] + d * path[29],
        b * path[27] + c * path[24] + d * path[30],
        b * path[28] + c * path[25] + d * path[31],
    )
    rate = (
        b1 * path[26] + c1 * path[23] + d1 * path[29],
        b1 * path[27] + c1 * path[24] + d1 * path[30],
        b1 * path[28] + c1 * path[25] + d1 * path[31],
    )
    turn, right = np.empty((3, 3)), np.empty((3, 3))
    _exponential(theta, turn, right)
    for i in range(3):
        for j in range(3):
            frame[3 + i, j] = 0.0
            for k in range(3):
                frame[3 + i, j] += path[14 + 3 * i + k] * turn[k, j]
    for i in range(3):
        frame[2, i] = 0.0
        for j in range(3):
            for k in range(3):
                frame[2, i] += frame[3 + i, j] * right[j, k] * rate[k]


@compiled
def ring_motion(time, rate, travel, ramp):
    """Angle [rad] and rate [rad/s] of the ring: it starts and stops with a smooth ramp of the rate, u²(3 − 2u).

    Both ramps take the time `ramp`; a ramp covers rate·ramp/2, so that the ring stops at `travel` exactly.
    """
    stop = travel / rate  # when the ramp down starts; it ends at stop + ramp
    if time <= 0.0:
        return 0.0, 0.0
    u = min(time / ramp, 1.0)
    angle = rate * (ramp * (u**3 - 0.5 * u**4) + max(time - ramp, 0.0))
    now = rate * u * u * (3 - 2 * u)
    if time > stop:
        d = min((time - stop) / ramp, 1.0)
        angle -= rate * (ramp * (d**3 - 0.5 * d**4) + max(time - stop - ramp, 0.0))
        now -= rate * d * d * (3 - 2 * d)
    return angle, now


@compiled
def ring_ends(frame, radius, height, direction, angle, rate, points, speeds):
    """Write the cable ends (cable, ring; x, y, z) in the world, and their velocities: (6, 3) arrays.

    `frame` is the end effector's; rows are cable 0 fixed, cable 0 rotating, cable 1 fixed and so on.
    """
    third = 2.0943951023931953  # 2π/3
    for cable in range(3):
        azimuth = third * (1 - cable)
        for ring in range(2):
            turned = azimuth + ring * direction * (third + angle)
            arm = (ring * height, radius * cos(turned), radius * sin(turned))
            swing = (0.0, -ring * direction * rate * arm[2], ring * direction * rate * arm[1])
            line = 2 * cable + ring
            for i in range(3):
                points[line, i] = frame[0, i]
                speeds[line, i] = frame[1, i]
                for k in range(3):
                    points[line, i] += frame[3 + i, k] * arm[k]
                    speeds[line, i] += frame[3 + i, k] * swing[k]
            world = (
                points[line, 0] - frame[0, 0],
                points[line, 1] - frame[0, 1],
                points[line, 2] - frame[0, 2],
            )
            speeds[line, 0] += frame[2, 1] * world[2] - frame[2, 2] * world[1]
            speeds[line, 1] += frame[2, 2] * world[0] - frame[2, 0] * world[2]
            speeds[line, 2] += frame[2, 0] * world[1] - frame[2, 1] * world[0]
