"""The snare: three cables that close on a pin as a ring turns, run as a whole or in macro steps.

The equations are those of Li et al. (3-D ANCF cables, Hertz contact, Coulomb friction); Exudyn holds and integrates
them. An end effector and a target may each be moved from outside: before a step, say where it will be at its end.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ...errors import InputError
from .assembly import Drive, SnareAssembly
from .contact import start_overlap
from .drive import Pose, fill_path, go_on
from .history import SnareHistory
from .parameters import SnareParameters
from .recorder import Recorder
from .ring_drive import OPEN
from .settled import settled
from .solver import SnareSolver, SolverState
from .target import Target

COLD_START = 0.1
"""How long the first steps are short [s]: a cold start at full step can go wrong without a sign of it."""
WORST_GAP = 1e-7
"""How far a cable end may be from its ring after a step [m]; the constraint is solved to rounding."""


class SnareStepError(RuntimeError):
    """A step that did not converge: time, reason and mend; the model stands where it stood before."""


@dataclass(frozen=True)
class Accuracy:
    """How finely the snare is computed.

    Parameters
    ----------
    step : float
        Time step while cables touch the pin [s]; where a contact begins or ends a fourth of it is taken, and four times
        as much where nothing touches.
    n_elements : int
        Per cable.
    cold_step : float
        Time step during the first 0.1 s [s].
    deepest : float
        Overlap of cable and pin, the element's own deflection included, above which a step counts as failed [m]; 0: as
        deep as a soft capture goes, half the cable's radius.
    """

    step: float
    n_elements: int
    cold_step: float
    deepest: float = 0.0


ACCURACIES = {"default": Accuracy(1e-3, 10, 5e-4), "fine": Accuracy(5e-4, 20, 1e-4)}
LONGEST = 0.01
"""Longest piece of a macro step that is taken in one kind of time step [s]."""
SHORT, LONG = 0.25, 4.0
"""Time steps where a contact begins or ends, and where nothing touches, over `Accuracy.step`."""


@dataclass(frozen=True)
class SnareState:
    """Everything that decides a model's future; to be treated as opaque."""

    solver: SolverState
    frames: tuple[np.ndarray, np.ndarray]
    totals: np.ndarray
    latest: tuple[Any, ...]
    first_contact: float | None


class SnareModel:
    """A snare with its target.

    Parameters
    ----------
    parameters : SnareParameters
    target : Target
    accuracy : "default", "fine" or Accuracy
    effector : Pose or None
        Where the end effector stands at the start; None: at the origin, at rest.
    time : float
        Start [s], 0 or later, with the snare open: the ring starts to turn at 0, or as ``drive`` says.
    drive : callable or None
        Angle [rad] and rate [rad/s] of the ring at a time, in place of the parameters' ramp; 0 at the start.

    Raises
    ------
    InputError
        For a pin that starts inside a cable, a ring that has turned at the start, and whatever parameters and target
        refuse.

    Examples
    --------
    >>> model = SnareModel(SnareParameters(), Target("pendulum"))
    >>> history = model.run(0.02, every=0.01)
    >>> history.times
    array([0.  , 0.01, 0.02])
    """

    def __init__(
        self,
        parameters: SnareParameters,
        target: Target,
        accuracy: Literal["default", "fine"] | Accuracy = "default",
        effector: Pose | None = None,
        time: float = 0.0,
        drive: Drive | None = None,
    ) -> None:
        """Settle the cables, build the system, check that the pin is clear."""
        if isinstance(accuracy, str) and accuracy not in ACCURACIES:
            raise InputError(f"snare: accuracy is '{accuracy}'; give one of {', '.join(ACCURACIES)}")
        if not time >= 0:
            raise InputError(f"snare: time is {time:g} s; start at 0 or later, the ring starts to turn at 0")
        self.parameters = parameters
        self.target = target
        self.accuracy = ACCURACIES[accuracy] if isinstance(accuracy, str) else accuracy
        start = effector or Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
        # Inside, lengths are from where the end effector starts: far from an origin, rounding would reach the forces.
        self.origin = np.array(start.position, dtype=float)
        near = replace(target, position=tuple(np.asarray(target.position) - self.origin))
        start = Pose(np.zeros(3), start.rotation, start.velocity, start.angular_velocity)
        nodes = settled(parameters, self.accuracy.n_elements) @ start.rotation.T
        self.assembly = SnareAssembly(parameters, near, nodes, start, drive)
        if abs(turned := self.assembly.ring_at(time)[0]) > OPEN:
            raise InputError(
                f"snare: at the start, {time:g} s, the ring has turned by {turned:.3g} rad; start with the snare open, "
                "at 0 s, or give a drive that turns later"
            )
        self._check_clear(nodes)
        self._start = time
        self._frames = (start.frame(), self.assembly.pin.copy())  # of effector and moved target, where they are now
        self._next = (np.empty((6, 3)), np.empty((6, 3)))
        self._given = [False, False]
        self._set_paths(time, 1.0)
        self._recorder = Recorder(self.assembly, self.origin)
        self._solver = SnareSolver(self.assembly.system, time, self._recorder.after_step)
        self._recorder.begin(time)

    def _check_clear(self, nodes: np.ndarray) -> None:
        a = self.assembly
        overlap = start_overlap(
            nodes.reshape(-1, 3), a.n_elements, a.size, a.cylinders, a.pin, self.parameters.cable_radius
        )
        if overlap > 0:
            raise InputError(
                f"snare: the pin starts {overlap * 1e3:.3g} mm inside a cable, its foot at "
                f"{np.round(a.pin[0], 4).tolist()} m; move the target or take a thinner pin"
            )

    @property
    def time(self) -> float:
        """Where the model stands [s]."""
        return self._solver.time

    def move_effector(self, pose: Pose) -> None:
        """Say where the end effector will be, and how it will move, at the end of the next step."""
        self._move(0, pose)

    def move_target(self, pose: Pose) -> None:
        """Say where a target with support ``moved`` will be, and how it will move, at the end of the next step."""
        self._move(1, pose)

    def _move(self, body: int, pose: Pose) -> None:
        self._next[body][:] = pose.frame()
        self._next[body][0] -= self.origin
        self._given[body] = True

    def step(self, size: float) -> None:
        """Advance by a macro step [s]; bodies moved from outside reach the pose given, else go on with their twist.

        Raises
        ------
        SnareStepError
            Where the solver does not converge; the model stands where it stood.
        """
        if not 0 < size < np.inf:
            raise InputError(f"snare: step is {size:g} s; give a number > 0")
        before = self.save()
        now = self.time
        self._set_paths(now, size)
        n_pieces = int(np.ceil(size / LONGEST * (1 - 1e-9)))
        for _ in range(n_pieces):
            if fault := self._go_on(size / n_pieces):
                self.restore(before)
                raise SnareStepError(
                    f"snare: step of {size:g} s at {now:g} s failed, {fault}; take a shorter step or accuracy='fine'"
                )
        for frame, reached in zip(self._frames, self._next, strict=True):
            frame[:] = reached

    def _go_on(self, size: float) -> str:
        """Advance by a piece of a macro step, again in short time steps where a contact begins or ends in it; says what
        is wrong, if anything is."""
        solver, recorder = self._solver.save(), self._recorder.save()
        touching, usual = self._recorder.touching, self.accuracy.step
        cold = self.time < self._start + COLD_START - 1e-9
        step = self.accuracy.cold_step if cold else usual if touching else usual * LONG
        self._recorder.changed = False
        fault = self._take(size, step)
        if not (fault or self._recorder.changed) or min(size, step) <= usual * SHORT:
            return fault
        self._solver.restore(solver)
        self._recorder.restore(*recorder)
        return self._take(size, usual * SHORT)

    def _take(self, size: float, step: float) -> str:
        return self._fault() if self._solver.advance(size, step) else "the solver did not converge"

    def _deepest(self) -> float:
        """Deepest overlap of a step that went well [m]: half the cable's radius; all of it on a soft pin, which gives
        way so far under pushes that strain a cable by less than a hundredth."""
        if self.accuracy.deepest > 0:
            return self.accuracy.deepest
        p, half = self.parameters, self.parameters.cable_radius / 2
        return half if p.hertz_stiffness * half**1.5 > 0.01 * p.axial_stiffness else 2 * half

    def _fault(self) -> str:
        """What is wrong with steps that converged; empty where nothing is."""
        gap = self._recorder.end_gap(self.time)
        if not gap < WORST_GAP:
            return f"cable ends left the rings by {gap:.2g} m"
        if self._recorder.overlap > self._deepest():
            return f"the pin went {self._recorder.overlap * 1e3:.2g} mm into a cable"
        return ""

    def _set_paths(self, time: float, size: float) -> None:
        """Lay the paths of both bodies to where they will be at the end of a step."""
        for body, path in enumerate((self.assembly.effector_path, self.assembly.target_path)):
            if not self._given[body]:
                go_on(self._frames[body], size, self._next[body])
            fill_path(time, size, self._frames[body], self._next[body], path)
            self._given[body] = False
        self.assembly.lift()

    def run(self, duration: float, every: float = 0.01) -> SnareHistory:
        """Advance by a duration, recording at regular times [s]; raises SnareStepError as `step` does."""
        n_steps = max(1, round(duration / every))
        self._recorder.clear()
        self._recorder.record(self.time)
        for _ in range(n_steps):
            self.step(duration / n_steps)
            self._recorder.record(self.time)
        return self._recorder.history()

    @property
    def n_contacts(self) -> int:
        """Contacts of cables and pin now."""
        return len(self._recorder.touching)

    def wrenches(self) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment [N, N·m] on the pin about its foot, and on the end effector about its origin; each (6,)."""
        return self._recorder.pin_wrench.copy(), self._recorder.effector_wrench.copy()

    def pin_impulse(self) -> np.ndarray:
        """Impulse of the cables on the pin since the start, and its moment about the foot (6,) [N·s, N·m·s]."""
        return self._recorder.pin_impulse

    def energies(self) -> dict[str, float]:
        """What `SnareHistory` calls energies, now [J]."""
        return self._recorder.energies()

    @property
    def ring_angle(self) -> float:
        """How far the ring has turned [rad]."""
        return self.assembly.ring_at(self.time)[0]

    def target_pose(self) -> Pose:
        """Where the target is, and how it moves."""
        return Pose.of_frame(self.assembly.pin, self.origin)

    def effector_pose(self) -> Pose:
        """Where the end effector is, and how it moves."""
        return Pose.of_frame(self._frames[0], self.origin)

    def save(self) -> SnareState:
        """Everything that decides the future."""
        totals, latest, first = self._recorder.save()
        frames = (self._frames[0].copy(), self._frames[1].copy())
        return SnareState(self._solver.save(), frames, totals, latest, first)

    def restore(self, state: SnareState) -> None:
        """Return to a saved state, bit for bit; also one of another model built with the same arguments."""
        self._solver.restore(state.solver)
        for frame, saved in zip(self._frames, state.frames, strict=True):
            frame[:] = saved
        self._given = [False, False]
        self._recorder.restore(state.totals, state.latest, state.first_contact)
