"""An arm on a floating or fixed base as a participant: wrenches at tip and mount in, motion of tip, joints, base out.

Its steps are those of `FloatingMotion`: error-controlled, in C, and a function of the saved state alone, so that
restore and repeat is exact.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...models.dormand_prince import StepFault
from ...models.floating.arm import FloatingArm
from ...models.floating.joint_drive import Drive
from ...models.floating.motion import FloatingMotion
from ...recordings.signals import pose_texts
from ..participant import Participant, StepError, Variable

_AXES = "xyz"


class FloatingArmParticipant(Participant):
    """One arm, its joints under a servo or passive.

    Inputs: ``force.tip.*``, ``torque.tip.*`` at the tip in the world frame, the same of ``mount`` where the arm has
    one, ``target.<joint>`` of the servo, and ``servo``: 1, or 0 for motors off. Outputs, in the world frame: pose and
    twist of the tip, of the base, and of the mount; ``q.<joint>``, ``qd.<joint>``, and the momentum of base and arm
    about the world's origin. Parameters: gains and effects by the names of `Drive`.

    Parameters
    ----------
    arm : FloatingArm
    drive : Drive, optional
        Servo and effects; none: joints without any torque.
    q : array (J,), optional
        Joint positions at the start [rad or m]; the servo's target until another comes in.
    qd : array (J,), optional
        Joint rates at the start [rad/s or m/s]; none: at rest.
    position, quaternion, momentum : arrays (3,), (4,), (6,)
        The base's pose and the momentum of base and arm at the start, as in `FloatingMotion.start`.
    servo : bool
        Whether the motors are on until an input says otherwise.
    impulses : bool
        True: wrenches come in as what they have summed up to since the start, ``impulse.tip.*`` and
        ``angular_impulse.tip.*`` [N·s, N·m·s]. A step applies, evenly, what is new at its end, so that momentum is
        handed over whole whatever an extrapolation got wrong on the way.
    name : str
    """

    can_restore = True
    input_order = 2

    def __init__(
        self,
        arm: FloatingArm,
        drive: Drive | None = None,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        momentum: ArrayLike = (0.0,) * 6,
        servo: bool = True,
        impulses: bool = False,
        name: str = "arm",
    ) -> None:
        """Write and compile the equations; raises InputError as `FloatingMotion` does."""
        self.name = name
        self._motion = FloatingMotion(arm, drive)
        self._start = self._motion.start(q, qd, position, quaternion, momentum)
        self._n_wrenches, self._impulses = self._motion.n_wrenches, impulses
        at_first = self._motion.joints(self._start[None])[0][0]
        self._first = np.concatenate([np.zeros(self._n_wrenches), at_first, [float(servo)]])
        joints = [(joint.name, "rad" if joint.kind == "revolute" else "m") for joint in arm.tree.joints]
        values = _shown(self._motion, self._start)
        self.variables = (
            *(
                Variable(
                    key,
                    "parameter",
                    self._motion.units[key],
                    value,
                    minimum=0.0 if key.startswith("servo") else -np.inf,
                )
                for key, value in self._motion.parameters.items()
            ),
            *_inputs(joints, self._first, arm.mount is not None, impulses),
            *_outputs(joints, values, arm.mount is not None),
        )
        self._inputs, self._rates = self._first.copy(), np.zeros((2, len(self._first)))
        self._state, self._time, self._size, self._values = self._start.copy(), 0.0, 1e-3, {}
        self._applied = np.zeros(self._n_wrenches)

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Go to the start, with parameters by name; raises InputError for one that is unknown or out of bounds."""
        given = {key: float(value) for key, value in (parameters or {}).items()}
        self._motion.check(given)
        self._values, self._time, self._size = given, time, 1e-3
        self._state, self._inputs = self._start.copy(), self._first.copy()
        self._rates, self._applied = np.zeros((2, len(self._first))), np.zeros(self._n_wrenches)

    def set_inputs(self, values: np.ndarray) -> None:
        """Take wrench, targets and the servo's switch; they are held until set again."""
        self._inputs = np.array(values, float)
        if self._inputs.shape != self._first.shape:
            raise InputError(f"{self.name}: {self._inputs.shape} inputs given; give ({len(self._first)},)")
        self._rates = np.zeros_like(self._rates)

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Let wrench and targets move along a parabola during the step; the switch stays."""
        self._rates = np.array([first, second], float)

    def step(self, time: float, size: float) -> None:
        """Advance; a fault leaves the state unchanged."""
        if not np.isfinite(self._inputs).all() or not np.isfinite(self._rates).all():
            broken = ~np.isfinite(self._inputs) | ~np.isfinite(self._rates).all(axis=0)
            what = self.names("input")[int(np.flatnonzero(broken)[0])]
            raise StepError(f"{self.name}: at {time:.9g} s the input {what} is not finite; look at where it comes from")
        inputs, rates, n = self._inputs, self._rates, self._n_wrenches
        reached = (inputs + rates[0] * size + 0.5 * rates[1] * size**2)[:n]
        if self._impulses:
            inputs, rates = inputs.copy(), rates.copy()
            inputs[:n], rates[:, :n] = (reached - self._applied) / size, 0.0
        try:
            end = self._motion.advance(
                time,
                self._state,
                time + size,
                min(self._size, size),
                inputs[:-1],
                rates[:, :-1],
                servo=bool(self._inputs[-1]),
                values=self._values,
            )
        except StepFault as fault:
            raise StepError(f"{self.name}: {fault}; shorten the macro step, or look at the wrench") from None
        self._state, self._time, self._size, self._applied = end.state, end.time, end.size, reached

    def outputs(self) -> np.ndarray:
        """All outputs, from the state alone."""
        return _shown(self._motion, self._state)

    def save(self) -> Any:
        """State, inputs, parameters and the next internal step."""
        inputs = self._inputs.copy(), self._rates.copy(), self._applied.copy()
        return self._state.copy(), self._time, self._size, inputs, dict(self._values)

    def restore(self, state: Any) -> None:
        """Back to a saved state."""
        x, self._time, self._size, inputs, values = state
        self._state, self._values = x.copy(), dict(values)
        self._inputs, self._rates, self._applied = (array.copy() for array in inputs)


def _axes(stem: str, unit: str, text: str) -> list[tuple[str, str, str]]:
    return [(f"{stem}.{axis}", unit, f"{text}, {axis}") for axis in _AXES]


def _inputs(joints: list[tuple[str, str]], start: np.ndarray, mounted: bool, impulses: bool) -> list[Variable]:
    shown = []
    kinds = [("impulse", "N*s"), ("angular_impulse", "N*m*s")] if impulses else [("force", "N"), ("torque", "N*m")]
    for body in ("tip", "mount") if mounted else ("tip",):
        for kind, unit in kinds:
            shown += _axes(f"{kind}.{body}", unit, f"{kind.replace('_', ' ')} on the {body}, world frame")
    shown += [
        *((f"target.{name}", unit, "where the servo moves the joint") for name, unit in joints),
        ("servo", "1", "1: motors on, 0: motors off"),
    ]
    return [Variable(name, "input", unit, float(x), text) for (name, unit, text), x in zip(shown, start, strict=True)]


def _outputs(joints: list[tuple[str, str]], start: np.ndarray, mounted: bool) -> list[Variable]:
    """In the order of `_shown`; none changes at once with an input."""
    shown = []
    bodies = [("tip", "the tip"), ("base", "the base's frame"), ("mount", "the mount")]
    for body, text in bodies if mounted else bodies[:2]:
        shown += pose_texts(body, text)
    shown += [(f"q.{name}", unit, "joint position") for name, unit in joints]
    shown += [(f"qd.{name}", f"{unit}/s", "joint rate") for name, unit in joints]
    shown += _axes("momentum.linear", "N*s", "linear momentum of base and arm, world frame")
    shown += _axes("momentum.angular", "N*m*s", "angular momentum of base and arm about the world's origin")
    return [Variable(name, "output", unit, float(x), text) for (name, unit, text), x in zip(shown, start, strict=True)]


def _shown(motion: FloatingMotion, state: np.ndarray) -> np.ndarray:
    seen = motion.observe(state)
    q, qd = motion.joints(state[None])
    parts = (seen.tip_position, seen.tip_quaternion, seen.tip_twist)
    base = (seen.base_position, seen.base_quaternion, seen.base_twist)
    mount = (seen.mount_position, seen.mount_quaternion, seen.mount_twist) if motion.arm.mount else ()
    return np.concatenate([part[0] for part in (*parts, *base, *mount, q, qd, seen.momentum)])
