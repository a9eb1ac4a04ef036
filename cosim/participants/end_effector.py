"""Arm, carriage, docking, latches and target as one participant: the snare's impulses and commands in, motion out."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...models.docking.groove import BALLS
from ...models.docking.motion import COMMANDS, ENERGIES, OPEN, DockingMotion, Inputs
from ...models.docking.parameters import DockingParameters
from ...models.dormand_prince import StepFault
from ...models.floating.arm import FloatingArm
from ...models.floating.joint_drive import Drive
from ...models.snare.parameters import WIDE_RING, SnareParameters
from ...models.snare.target import Target
from ...recordings.signals import pose_texts
from ..participant import Participant, StepError, Variable

_AXES = "xyz"
_IMPULSES = [
    (f"{kind}.{body}.{axis}", unit)
    for body in ("carriage", "pin")
    for kind, unit in (("impulse", "N*s"), ("angular_impulse", "N*m*s"))
    for axis in _AXES
]
_COMMANDS = {
    "speed": ("m/s", "wanted speed of the carriage, positive as it retracts"),
    "motor": ("1", "1: the carriage's motor on, 0: off"),
    "brake": ("1", "1: the carriage's brake on, 0: off"),
    "latch": ("1", "1: the latches close, 0: open"),
    "servo": ("1", "1: the joints are held where they are, 0: motors off"),
}
_BODIES = {"carriage": "the carriage", "pin": "the pin's foot", "tip": "the tip", "base": "the base's frame"}
_SHOWN = (
    ("travel", "m", "travel of the carriage, positive as it retracts"),
    ("rate", "m/s", "its rate"),
    ("force.motor", "N", "of the carriage's motor, from its current"),
    ("gap", "m", "largest axial distance of a ball from its seat"),
    ("switches", "1", "balls that are in their seats"),
    ("closed", "1", "latches that are closed"),
    ("enclosed", "1", "1 where the pin passes inside half the rings' radius"),
    ("touching", "1", "contacts of balls and bumpers"),
)

_STATIC = ("kinetic", "stored", "suspension")
_COUNTS = ("switches", "closed", "enclosed", "touching")


class EndEffectorParticipant(Participant):
    """An arm with the rigid half of an end effector, and what it docks to.

    Inputs: impulses of the cables on carriage and pin since the start (as `FloatingArmParticipant` takes them), and the
    commands ``speed``, ``motor``, ``brake``, ``latch``, ``servo``. Outputs, in the world frame: pose and twist of
    carriage, pin, tip and base; ``q.*``, ``qd.*``; what a control program reads (``travel``, ``force.motor``, ``gap``,
    ``switches`` ...); ``normal.1`` to ``normal.6`` of the flanks, ``off.<ball>.axial`` and ``.lateral``; wrenches on
    the end effector in its own axes about the tip, ``force.docking.*`` and, cables included, ``force.wrist.*``; momenta
    and ``energy.*``.

    Parameters
    ----------
    arm, target, drive, parameters :
        As of `DockingMotion`.
    q, qd : array (J,)
        Of the arm's joints at the start [rad, rad/s].
    momentum : array (6,)
        Of base and arm at the start, about the world's origin.
    snare : SnareParameters
        Whose rings and pin decide whether the pin is enclosed.
    values : mapping
        Parameters of the joints' drive.
    name : str
    """

    can_restore = True
    input_order = 2

    def __init__(
        self,
        arm: FloatingArm,
        target: Target,
        drive: Drive,
        q: ArrayLike,
        qd: ArrayLike,
        momentum: ArrayLike,
        parameters: DockingParameters | None = None,
        snare: SnareParameters = WIDE_RING,
        values: Mapping[str, float] | None = None,
        name: str = "effector",
    ) -> None:
        """Write and compile the equations."""
        self.name = name
        self.motion = DockingMotion(arm, target, drive, parameters or DockingParameters())
        self._snare, self._values = snare, dict(values or {})
        self._start = self.motion.start(q, qd, momentum)
        joints = [joint.name for joint in arm.tree.joints]
        self._n_arm = len(joints)
        self._parameters = self.motion.parameters.values()
        self.variables = (
            *(
                Variable(d.name, "parameter", d.unit, d.value, f"{d.kind}: {d.source}")
                for d in self.motion.parameters.dimensions()
            ),
            *(
                Variable(n, "input", unit, 0.0, f"{n.split('.')[0]} of the cables since the start")
                for n, unit in _IMPULSES
            ),
            *(Variable(n, "input", unit, 0.0, text) for n, (unit, text) in _COMMANDS.items()),
        )
        self._reset(0.0)
        self.variables += tuple(self._outputs(joints))

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Go to the start, with parameters by name; raises InputError for one that is unknown or out of range."""
        self._parameters = self.start_parameters(parameters)
        self._reset(time)

    def _reset(self, time: float) -> None:
        p = self.motion.parameters.with_values(**self._parameters)
        self._constants = self.motion.values(p, self._values)
        self._state, self._time, self._size = self._start.copy(), time, 1e-4
        self._inputs, self._applied = np.zeros(len(_IMPULSES) + len(_COMMANDS)), np.zeros(12)
        self._rates = np.zeros((2, 12))
        self._latch_time, self._braked, self._latched = OPEN, 0.0, np.zeros(3 * BALLS)
        self._targets, self._before = np.zeros(self._n_arm + 1), np.zeros(len(_COMMANDS))
        self._held = self._vector(np.zeros(12))

    def set_inputs(self, values: np.ndarray) -> None:
        """Take impulses and commands."""
        self._inputs = np.array(values, float)
        self._rates = np.zeros((2, 12))

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Say what the impulses will be at the step's end; commands are held."""
        self._rates = np.array([first[:12], second[:12]], float)

    def _vector(self, wrenches: np.ndarray) -> np.ndarray:
        c = dict(zip(_COMMANDS, self._inputs[12:], strict=True))
        given = {**c, "latch_time": self._latch_time}
        inputs = Inputs(
            wrenches[:6], wrenches[6:], np.array([given[key] for key in COMMANDS]), self._braked, self._latched,
            self._targets,
        )  # fmt: skip
        return np.concatenate([inputs.vector(), self._constants])

    def step(self, time: float, size: float) -> None:
        """Advance; the impulses' increments are applied evenly. A fault leaves the state unchanged."""
        broken = ~np.isfinite(self._inputs)
        broken[:12] |= ~np.isfinite(self._rates).all(axis=0)
        if broken.any():
            what = self.names("input")[int(np.flatnonzero(broken)[0])]
            raise StepError(f"{self.name}: at {time:.9g} s the input {what} is not finite; look at where it comes from")
        self._take_commands(time)
        impulses = self._inputs[:12] + self._rates[0] * size + 0.5 * self._rates[1] * size**2
        held = self._vector((impulses - self._applied) / size)
        try:
            end = self.motion.advance(time, self._state, time + size, min(self._size, size), held)
        except StepFault as fault:
            raise StepError(f"{self.name}: {fault}; shorten the macro step, or look at the impulses") from None
        self._state, self._time, self._size = end.state, end.time, end.size
        self._applied, self._held = impulses.copy(), held

    def _take_commands(self, time: float) -> None:
        """Keep what brake, latches and servo hold from the moment on when they are told to."""
        now = self._inputs[12:]
        _, _, brake, latch, servo = now > 0.5
        was = self._before > 0.5
        q = self._state[self.motion.where["q"]]
        if brake and not was[2]:
            # The brake is wound up with the motor's load before the current is cut.
            load = float(self.motion.observe(time, self._state, self._held)["motor_force"][0])
            self._braked = float(q[-1]) + load / self._parameters["brake_stiffness"]
        if latch and not was[3]:
            self._latch_time = time
            self._latched = self.motion.observe(time, self._state, self._held)["balls"]
        if not latch:
            self._latch_time = OPEN
        if servo and not was[4]:
            self._targets = q.copy()
        self._before = now.copy()

    def _outputs(self, joints: list[str]) -> list[Variable]:
        shown = zip(self._names_shown(joints), self._read(0.0, self._start, self._held), strict=True)
        return [
            Variable(name, "output", unit, float(value), text, discrete=name in _COUNTS)
            for (name, unit, text), value in shown
        ]

    def _names_shown(self, joints: list[str]) -> list[tuple[str, str, str]]:
        shown = []
        for body, text in _BODIES.items():
            shown += pose_texts(body, text)
        shown += [(f"q.{name}", "rad", "joint position") for name in joints]
        shown += [(f"qd.{name}", "rad/s", "joint rate") for name in joints]
        for who, text in (("", "base and arm"), (".target", "a floating target")):
            shown += [(f"momentum{who}.linear.{a}", "N*s", f"linear momentum of {text}") for a in _AXES]
            shown += [
                (f"momentum{who}.angular.{a}", "N*m*s", f"angular momentum of {text} about the world's origin")
                for a in _AXES
            ]
        shown += list(_SHOWN)
        shown += [(f"normal.{i + 1}", "N", "normal force of a flank") for i in range(2 * BALLS)]
        shown += [
            (f"off.{i + 1}.{way}", "m", f"{way} distance of a ball from its seat")
            for i in range(BALLS)
            for way in ("axial", "lateral")
        ]
        for what, text in (("docking", "of the docking on the end effector"), ("wrist", "of docking and cables")):
            shown += [(f"force.{what}.{a}", "N", f"{text}, its axes") for a in _AXES]
            shown += [(f"torque.{what}.{a}", "N*m", f"{text}, about the tip, its axes") for a in _AXES]
        shown += [(f"energy.{name}", "J", name.replace("_", " ")) for name in (*_STATIC, *ENERGIES)]
        return shown

    def outputs(self) -> np.ndarray:
        """All outputs."""
        return self._read(self._time, self._state, self._held)

    def _read(self, time: float, state: np.ndarray, held: np.ndarray) -> np.ndarray:
        m = self.motion
        o = m.observe(time, state, held)
        q, qd = state[m.where["q"]], state[m.where["qd"]]
        off = o["off"].reshape(BALLS, 2)
        seated = np.abs(off).max(axis=1) < self._parameters["switch_travel"]
        closed = BALLS * float(o["engaged"][0] >= 1)
        touching = float(np.sum(o["normal"] > 0) + (o["bumper"][0] > 0))
        return np.concatenate(
            [
                *(o[body] for body in _BODIES), q[:-1], qd[:-1], o["momentum"], o["target_momentum"],
                [q[-1], qd[-1], o["motor_force"][0], -off[:, 0].min(), seated.sum(), closed,
                 self._enclosed(o), touching],
                o["normal"], o["off"], o["docking"], o["wrist"], *(o[name] for name in _STATIC),
                state[m.where["energies"]],
            ]
        )  # fmt: skip

    def _enclosed(self, o: dict[str, np.ndarray]) -> float:
        """Whether the pin's axis crosses the rings' middle plane, on its length, near their axis."""
        rotation, pin = _matrix(o["carriage"][3:7]), _matrix(o["pin"][3:7])
        foot = rotation.T @ (o["pin"][:3] - o["carriage"][:3])
        along = rotation.T @ -pin[:, 0]
        if abs(along[0]) < 1e-6:
            return 0.0
        reach = (self._snare.ring_distance / 2 - foot[0]) / along[0]
        at = foot + reach * along
        return float(0 < reach < self._snare.pin_length and np.hypot(at[1], at[2]) < self._snare.ring_radius / 2)

    def save(self) -> Any:
        """State, inputs, and what brake, latches and servo hold."""
        kept = self._latch_time, self._braked, self._latched.copy(), self._targets.copy(), self._before.copy()
        inputs = self._inputs.copy(), self._applied.copy(), self._held.copy(), self._rates.copy()
        return self._state.copy(), self._time, self._size, inputs, kept, dict(self._parameters)

    def restore(self, state: Any) -> None:
        """Back to a saved state, bit for bit."""
        x, self._time, self._size, inputs, kept, self._parameters = state
        self._state = x.copy()
        self._inputs, self._applied, self._held, self._rates = (a.copy() for a in inputs)
        self._latch_time, self._braked = kept[:2]
        self._latched, self._targets, self._before = (a.copy() for a in kept[2:])


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
