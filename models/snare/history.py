"""What a run of the snare leaves behind: everything that was recorded, as arrays."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SnareHistory:
    """Recordings of one run, all in the world frame.

    Parameters
    ----------
    times : array (n_times,)
        [s]
    target_position, target_velocity, target_angular_velocity : arrays (n_times, 3)
        Of the pin's foot [m, m/s], and the target's rate [rad/s].
    target_quaternion : array (n_times, 4)
        w first.
    force, torque : arrays (n_times, 3)
        Of the snare on the end effector's root, about its origin: what a sensor there shows [N, N·m].
    mean_force : array (n_times, 3)
        `force` averaged since the time before [N].
    pin_force, pin_torque : arrays (n_times, 3)
        Of the cables on the target, about the pin's foot [N, N·m].
    mean_pin_force : array (n_times, 3)
        `pin_force` averaged since the time before [N].
    ring_angle : array (n_times,)
        [rad]
    cables : array (n_times, 3, n_nodes, 3)
        Positions of the cables' nodes [m].
    end_forces : array (n_times, 6, 3)
        Of the cables on the rings [N]: cable 0 at the fixed ring, at the rotating one, cable 1 and so on.
    contact_points, contact_forces : tuples of arrays (n_contacts, 3)
        One entry a time: where the cables touch the pin [m], and the force on the cable there [N].
    energies : dict of arrays (n_times,)
        [J]: ``ring_work`` (of the rings on the cables since the start), ``ring_motor`` (the part of it that turning
        the ring took; the rest came with the end effector), ``strain``, ``kinetic`` (cables), ``overlap`` (elastic, in
        contacts), ``target`` (motion, spring and weight, from the start), ``damped`` (in cables and contacts) and
        ``friction``, both lost since the start.
    first_contact : float or None
        When a cable first touched the pin [s]; None if never.
    """

    times: np.ndarray
    target_position: np.ndarray
    target_quaternion: np.ndarray
    target_velocity: np.ndarray
    target_angular_velocity: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    mean_force: np.ndarray
    pin_force: np.ndarray
    pin_torque: np.ndarray
    mean_pin_force: np.ndarray
    ring_angle: np.ndarray
    cables: np.ndarray
    end_forces: np.ndarray
    contact_points: tuple[np.ndarray, ...]
    contact_forces: tuple[np.ndarray, ...]
    energies: dict[str, np.ndarray]
    first_contact: float | None

    @property
    def energy_residual(self) -> np.ndarray:
        """Ring work less everything that it can have become, shape (n_times,) [J]."""
        e = self.energies
        stored = sum(e[name] - e[name][0] for name in ("strain", "kinetic", "overlap", "target"))
        return e["ring_work"] - stored - e["damped"] - e["friction"]
