"""The snare as a participant: poses and twists of end effector and pin in, wrenches on both and the ring's angle out.

Between macro steps the bodies moved from outside go on along a smooth path (see `snarelab.models.snare.drive`), which
ends where the inputs put them: with derivatives, at pose + twist·H + … from the start of the step; with held inputs,
which stand for the middle of the step, at pose + twist·H/2.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...models.snare.assembly import Drive
from ...models.snare.drive import Pose
from ...models.snare.model import Accuracy, SnareModel, SnareStepError
from ...models.snare.parameters import SnareParameters
from ...models.snare.target import Target, unit_quaternion
from ...recordings.signals import pose_texts
from ..participant import Participant, StepError, Variable

_POSE_SIZE = 13
_LOWEST = {
    item.name: {"> 0": 1e-12, ">= 0": 0.0}[item.metadata["allowed"]]
    for item in fields(SnareParameters)
    if item.metadata["allowed"] in ("> 0", ">= 0")
}
_BODIES = {"effector": "the end effector", "pin": "the pin's foot"}


class SnareParticipant(Participant):
    """A snare whose end effector, and whose target where its support is ``moved``, are moved by others.

    Inputs, in the world frame: ``pos.effector.*``, ``quat.effector.*`` (w first), ``vel.effector.*``,
    ``omega.effector.*``, and the same of ``pin`` (its foot) for a moved target. Outputs: ``force.effector.*`` and
    ``torque.effector.*`` of the snare on the end effector about its origin, ``force.pin.*`` and ``torque.pin.*`` of the
    cables on the pin about its foot, ``angle.ring``, and the pose and twist of a pin that is not moved. Parameters: the
    fields of `SnareParameters`.

    Parameters
    ----------
    parameters : SnareParameters
    target : Target
    accuracy : "default", "fine" or Accuracy
    effector : Pose or None
        Start of the end effector; None: at the origin, at rest. Inputs set before the first step come before it.
    name : str
    """

    can_restore = True
    input_order = 2

    def __init__(
        self,
        parameters: SnareParameters | None = None,
        target: Target | None = None,
        accuracy: Literal["default", "fine"] | Accuracy = "default",
        effector: Pose | None = None,
        name: str = "snare",
    ) -> None:
        """Describe the variables; the model is built at the first step."""
        self.name = name
        self._default = parameters or SnareParameters()
        self._given = self._default
        self._target = target or Target("moved")
        self._accuracy: Literal["default", "fine"] | Accuracy = accuracy
        self._moves_target = self._target.support == "moved"
        start = effector or Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
        bodies = [("effector", _values(start))]
        pin = np.concatenate(
            [self._target.position, self._target.orientation, self._target.velocity, self._target.angular_velocity]
        )
        if self._moves_target:
            bodies.append(("pin", pin))
        outputs = [
            Variable(
                f"{kind}.{body}.{axis}",
                "output",
                unit,
                0.0,
                f"{kind} of the cables on {_BODIES[body]}, world frame, {axis}",
            )
            for body in ("effector", "pin")
            for kind, unit in (("force", "N"), ("torque", "N*m"))
            for axis in "xyz"
        ]
        outputs.append(
            Variable("angle.ring", "output", "rad", 0.0, "angle of the rotating ring, positive as it closes")
        )
        if not self._moves_target:
            outputs += _pose_variables("pin", "output", pin)
        self.variables = (
            *(
                Variable(
                    item.name,
                    "parameter",
                    item.unit,
                    item.value,
                    f"{item.name.replace('_', ' ')}; {item.kind}: {item.source}",
                    _LOWEST.get(item.name, -np.inf),
                )
                for item in self._default.dimensions()
            ),
            *(variable for body, values in bodies for variable in _pose_variables(body, "input", values)),
            *outputs,
        )
        self._inputs = np.concatenate([values for _, values in bodies])
        self._first = self._inputs.copy()
        self._rates: np.ndarray | None = None
        self._model: SnareModel | None = None
        self._drive: Drive | None = None  # the parameters' ramp
        self._built_at = self._first
        self._start = 0.0

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Forget the past; raises InputError for an unknown parameter, or one out of range."""
        self._given = self._default.with_values(**{key: float(value) for key, value in (parameters or {}).items()})
        self._inputs, self._rates = self._first.copy(), None
        self._model, self._start = None, time

    def set_inputs(self, values: np.ndarray) -> None:
        """Take poses and twists; before the first step they are where the bodies start."""
        values = np.array(values, dtype=float)
        if values.shape != self._first.shape:
            raise InputError(f"{self.name}: {values.shape} inputs given; give ({len(self._first)},)")
        self._inputs, self._rates = values, None

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Derivatives of the twists say how the step's end is reached; those of poses are the twists themselves."""
        self._rates = np.array([first, second], dtype=float)

    def step(self, time: float, size: float) -> None:
        """Advance; where the solver does not converge the model stays where it was."""
        if not np.isfinite(self._inputs).all():
            broken = self.names("input")[int(np.flatnonzero(~np.isfinite(self._inputs))[0])]
            raise StepError(
                f"{self.name}: at {time:.9g} s the input {broken} is not finite; look at where it comes from"
            )
        model = self._built()
        try:
            model.move_effector(self._end_pose(0, size))
            if self._moves_target:
                model.move_target(self._end_pose(1, size))
            model.step(size)
        except (SnareStepError, InputError) as fault:
            raise StepError(f"{self.name}: {fault}") from None

    def _end_pose(self, body: int, size: float) -> Pose:
        """Where a body will be, and how it will move, at the end of a step."""
        here = slice(_POSE_SIZE * body, _POSE_SIZE * (body + 1))
        start = _pose(self._inputs[here], self.name)
        if self._rates is None:
            return start.after(size / 2)
        first, second = self._rates[:, here].reshape(2, _POSE_SIZE)
        way = [np.zeros(3), np.zeros(3)]
        twist = [np.zeros(3), np.zeros(3)]
        for part, (value, entry) in enumerate(
            ((start.velocity, slice(7, 10)), (start.angular_velocity, slice(10, 13)))
        ):
            way[part] = value * size + first[entry] * size**2 / 2 + second[entry] * size**3 / 6
            twist[part] = value + first[entry] * size + second[entry] * size**2 / 2
        turn = Rotation.from_rotvec(way[1]).as_matrix()
        return Pose(start.position + way[0], turn @ start.rotation, twist[0], twist[1])

    def _built(self) -> SnareModel:
        """The model; at first, with the bodies where the inputs say."""
        if self._model is None:
            effector = _pose(self._inputs[:_POSE_SIZE], self.name)
            target = self._target
            if self._moves_target:
                x = self._inputs[_POSE_SIZE:]
                target = Target(
                    "moved",
                    position=x[:3].tolist(),
                    orientation=x[3:7].tolist(),
                    velocity=x[7:10].tolist(),
                    angular_velocity=x[10:13].tolist(),
                )
            self._model = SnareModel(self._given, target, self._accuracy, effector, self._start, self._drive)
            self._built_at = self._inputs.copy()
        return self._model

    def outputs(self) -> np.ndarray:
        """Wrenches, the ring's angle, and the pin's motion where it is the model's."""
        model = self._built()
        pin, effector = model.wrenches()
        values = [effector, pin, [model.ring_angle]]
        if not self._moves_target:
            values.append(_values(model.target_pose()))
        return np.concatenate(values)

    def save(self) -> Any:
        """The model's state, the inputs, and what the model was built from."""
        state = self._built().save()
        return state, self._inputs.copy(), self._rates, self._built_at, self._given, self._start

    def restore(self, state: Any) -> None:
        """Back to a saved state, bit for bit."""
        model, inputs, rates, built_at, given, start = state
        same = self._model is not None and np.array_equal(built_at, self._built_at)
        if not same or given != self._given or start != self._start:
            self._model, self._inputs, self._given, self._start = None, built_at.copy(), given, start
        self._built().restore(model)
        self._inputs, self._rates = inputs.copy(), rates


def _pose(values: np.ndarray, name: str) -> Pose:
    quaternion = unit_quaternion(values[3:7], f"{name}: an input quaternion")
    rotation = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    return Pose(values[:3], rotation, values[7:10], values[10:13])


def _values(pose: Pose) -> np.ndarray:
    quaternion = Rotation.from_matrix(pose.rotation).as_quat(canonical=True, scalar_first=True)
    return np.concatenate([pose.position, quaternion, pose.velocity, pose.angular_velocity])


def _pose_variables(body: str, causality: Any, values: np.ndarray) -> list[Variable]:
    described = pose_texts(body, _BODIES[body])
    return [
        Variable(key, causality, unit, float(value), words)
        for (key, unit, words), value in zip(described, values, strict=True)
    ]
