"""Reads the snare after every accepted step: wrenches, sums of impulse and work, and what a history keeps."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .assembly import SnareAssembly
from .energy import KINETIC, OVERLAP, STRAIN
from .forces import measure
from .history import SnareHistory
from .line import LOCAL, line_pull

_IMPULSE = slice(0, 3)
_RING_WORK, _DAMPED, _FRICTION = 3, 4, 5
_PIN_IMPULSE, _TIME, _EFFECTOR_WORK = slice(6, 12), 12, 13


def moved(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How far a (6, 3) frame has gone [m], and how it has turned, as a small rotation vector [rad]; (6,)."""
    turn = 0.5 * np.cross(before[3:], after[3:], axis=0).sum(axis=1)
    return np.concatenate([after[0] - before[0], turn])


class Recorder:
    """Follows one assembly.

    Parameters
    ----------
    assembly : SnareAssembly
    origin : array (3,)
        Of the assembly's positions in the world [m].
    """

    def __init__(self, assembly: SnareAssembly, origin: np.ndarray) -> None:
        """Nothing recorded."""
        self._origin = origin
        self._assembly = assembly
        data = assembly.system.systemData
        self._data = data
        self._ends = data.GetObjectLTGAE(assembly.ends_object)
        self._section = np.array(assembly.parameters.section)
        self.pin_wrench = np.zeros(6)
        self.effector_wrench = np.zeros(6)
        self._energies = np.zeros(7)
        self._rates = np.zeros(12)  # time derivatives of the totals before the time
        self._totals = np.zeros(14)
        self._contacts = np.zeros((0, 6))
        self._pull, self._placed, self._frame = np.zeros((6, 3)), np.zeros((6, 3)), assembly.frame.copy()
        self.touching: tuple[int, ...] = ()
        """Cables that touch the pin, after the last step."""
        self.changed = False
        """Set once they have become others."""
        self.first_contact: float | None = None
        self.clear()

    def begin(self, time: float) -> None:
        """Take the start state."""
        self._read(time)
        self._totals[_TIME] = time

    def after_step(self, time: float) -> None:
        """Add a step to the sums by the trapezoidal rule; a second call at the same time changes nothing.

        The work of forces on what has a place is their mean over the step times the way made: the solver's velocities
        are not the means of its displacements.
        """
        step = time - self._totals[_TIME]
        if step <= 0:
            return
        before, touching = self._rates, self.touching
        wrench, pull, ends, frame = self.effector_wrench, self._pull, self._placed, self._frame
        self._read(time)
        self.changed |= self.touching != touching
        self._totals[:_TIME] += 0.5 * step * (before + self._rates)
        self._totals[_RING_WORK] -= 0.5 * np.sum((pull + self._pull) * (self._placed - ends))
        self._totals[_EFFECTOR_WORK] += 0.5 * (wrench + self.effector_wrench) @ moved(frame, self._frame)
        self._totals[_TIME] = time
        if len(self._contacts) and self.first_contact is None:
            self.first_contact = time

    def _read(self, time: float) -> None:
        a = self._assembly
        a.place(time)
        pull = self._data.GetAECoordinates()[self._ends].reshape(6, 3)  # of the cables on the rings
        wrench, self._energies, contacts, work = measure(
            self._data.GetODE2Coordinates(), self._data.GetODE2Coordinates_t(), a.fixed, a.moving, self._section,
            pull, a.ends, a.frame, a.ring_spin(),
        )  # fmt: skip
        self._pull, self._placed, self._frame = pull.copy(), a.ends.copy(), a.frame.copy()
        self.pin_wrench, self.effector_wrench = wrench[:6], wrench[6:]
        self._contacts = contacts
        rows = a.moving[2][: len(contacts), 0]
        self.touching = tuple(int(row) // (2 * a.n_elements + 2) for row in rows)
        self._rates = np.array(
            [
                *self.effector_wrench[:3],
                work,
                self._energies[3] + self._energies[4] + self._energies[5],
                self._energies[6],
                *self.pin_wrench,
            ]
        )

    def end_gap(self, time: float) -> float:
        """Largest distance of a cable end from its ring [m]; not a number where the state is not."""
        a = self._assembly
        nodes = (self._data.GetODE2Coordinates()[: a.n_cable_coordinates] + a.nodes.ravel()).reshape(a.nodes.shape)
        ends = nodes[:, [0, -1], 0].reshape(6, 3)
        a.place(time)
        return float(np.max(np.abs(ends - a.ends)))

    @property
    def pin_impulse(self) -> np.ndarray:
        """Of the cables on the pin since the start, and its moment about the pin's foot (6,) [N·s, N·m·s]."""
        return self._totals[_PIN_IMPULSE].copy()

    def energies(self) -> dict[str, float]:
        """What `SnareHistory` calls energies, now [J]."""
        totals, now = self._totals, self._energies
        return {
            "ring_work": float(totals[_RING_WORK]),
            "ring_motor": float(totals[_RING_WORK] + totals[_EFFECTOR_WORK]),
            "strain": float(now[STRAIN]),
            "kinetic": float(now[KINETIC]),
            "overlap": float(now[OVERLAP]),
            "target": self._target_energy(),
            "damped": float(totals[_DAMPED]),
            "friction": float(totals[_FRICTION]),
        }

    @property
    def overlap(self) -> float:
        """Deepest overlap of a cable with the pin [m]; 0 where none touches."""
        return float(max(-self._assembly.moving[2][: len(self._contacts), 3], default=0.0))

    def save(self) -> tuple[np.ndarray, tuple[Any, ...], float | None]:
        """Sums, what was read last, and the first contact."""
        pin = self._assembly.pin.copy()
        latest = (
            self._rates,
            self.pin_wrench,
            self.effector_wrench,
            self._energies,
            self._contacts,
            pin,
            self.touching,
            self._pull,
            self._placed,
            self._frame,
        )
        return self._totals.copy(), latest, self.first_contact

    def restore(self, totals: np.ndarray, latest: tuple[Any, ...], first_contact: float | None) -> None:
        """Take back what `save` gave."""
        self._totals[:] = totals
        self._rates, self.pin_wrench, self.effector_wrench, self._energies, self._contacts, pin = latest[:6]
        self.touching, self._pull, self._placed, self._frame = latest[6:]
        self._assembly.pin[:] = pin
        self._assembly.lift()
        self.first_contact = first_contact

    def clear(self) -> None:
        """Forget the recordings."""
        self._rows: list[dict[str, Any]] = []

    def record(self, time: float) -> None:
        """Keep what is now."""
        a = self._assembly
        coordinates = self._data.GetODE2Coordinates() + a.reference
        cables = coordinates[: a.n_cable_coordinates].reshape(a.nodes.shape)[:, :, 0]
        self._rows.append(
            {
                "time": time,
                "pin": a.pin.copy(),
                "wrench": self.effector_wrench,
                "pin_wrench": self.pin_wrench,
                "totals": self._totals.copy(),
                "energies": self._energies,
                "target": self._target_energy(),
                "ring": a.ring_at(time)[0],
                "cables": cables + self._origin,
                "ends": np.reshape(self._data.GetAECoordinates()[self._ends], (6, 3)),
                "contacts": self._contacts,
            }
        )

    def _target_energy(self) -> float:
        """Kinetic energy, spring and weight of the target [J]; 0 where it is moved from outside."""
        a, target = self._assembly, self._assembly.target
        if not a.n_pin:
            return 0.0
        rotation, velocity, spin = a.pin[3:], a.pin[1], a.pin[2]
        arm, speed = np.zeros(3), velocity
        if target.rotates:
            arm = rotation @ np.asarray(target.centre_of_mass)
            speed = velocity + np.cross(spin, arm)
        energy = 0.5 * target.mass * speed @ speed
        if target.rotates:
            energy += 0.5 * spin @ rotation @ np.asarray(target.inertia) @ rotation.T @ spin
        if target.hangs:
            energy -= target.mass * np.asarray(target.gravity) @ (a.pin[0] + arm)
        if target.umbilical:
            energy += 0.5 * target.umbilical * float(np.sum((a.pin[0] - target.position) ** 2))
        if target.clearance:
            arm = rotation @ a.line[LOCAL]
            energy += line_pull(a.line, tuple(a.pin[0] + arm), (0.0, 0.0, 0.0))[1]
        elif target.support == "spring":
            local = np.asarray(target.hang_point) if target.rotates else np.zeros(3)
            line = np.linalg.norm(a.hang_top - a.pin[0] - rotation @ local)
            energy += 0.5 * target.stiffness * (line - a.free_length) ** 2
        return float(energy)

    def history(self) -> SnareHistory:
        """Everything recorded, as arrays."""
        rows = self._rows

        def stack(name: str) -> np.ndarray:
            return np.array([r[name] for r in rows])

        times, totals, pins, energies = stack("time"), stack("totals"), stack("pin"), stack("energies")
        quaternions = Rotation.from_matrix(pins[:, 3:]).as_quat(canonical=True, scalar_first=True)
        intervals = np.diff(times, prepend=times[0])[:, None]
        wrench, pin_wrench = stack("wrench"), stack("pin_wrench")

        def mean(impulses: np.ndarray, now: np.ndarray) -> np.ndarray:
            gained = np.diff(impulses, axis=0, prepend=impulses[:1])
            return np.where(intervals > 0, gained / np.where(intervals > 0, intervals, 1.0), now)

        return SnareHistory(
            times=times,
            target_position=pins[:, 0] + self._origin,
            target_quaternion=quaternions,
            target_velocity=pins[:, 1],
            target_angular_velocity=pins[:, 2],
            force=wrench[:, :3],
            torque=wrench[:, 3:],
            mean_force=mean(totals[:, _IMPULSE], wrench[:, :3]),
            pin_force=pin_wrench[:, :3],
            pin_torque=pin_wrench[:, 3:],
            mean_pin_force=mean(totals[:, _PIN_IMPULSE][:, :3], pin_wrench[:, :3]),
            ring_angle=stack("ring"),
            cables=stack("cables"),
            end_forces=stack("ends"),
            contact_points=tuple(r["contacts"][:, :3] + self._origin for r in rows),
            contact_forces=tuple(r["contacts"][:, 3:] for r in rows),
            energies={
                "ring_work": totals[:, _RING_WORK],
                "ring_motor": totals[:, _RING_WORK] + totals[:, _EFFECTOR_WORK],
                "strain": energies[:, STRAIN],
                "kinetic": energies[:, KINETIC],
                "overlap": energies[:, OVERLAP],
                "target": stack("target"),
                "damped": totals[:, _DAMPED],
                "friction": totals[:, _FRICTION],
            },
            first_contact=self.first_contact,
        )
