"""Laws of a model's effects as expressions: parameters and hidden states go into the ledger, laws come out."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np

from ..models.axes import Place, place
from ..models.effect import Parameter, written_unit
from ..models.hidden_state import reads
from ..models.model import Model, PlacedEffect
from ..models.rig.points import far_end
from .equations import Ledger
from .symbolic import root

#: What model files call the inertial parameters of a link.
_INERTIAL = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")


class PlacedLaws:
    """The effects of one model with symbols for their parameters.

    Parameters
    ----------
    model : Model
        Its file must hold a value for every parameter.
    ledger : Ledger
        Takes parameters under the vocabulary's names, and inputs ``temp.<joint>`` where a law reads a temperature.

    Raises
    ------
    InputError
        A parameter without a value.
    """

    def __init__(self, model: Model, ledger: Ledger) -> None:
        """Register every parameter of the model's effects."""
        self._model, self._ledger = model, ledger
        self._joints = model.tree.joints[model.tree.carriers :]
        self._parameters: dict[str, dict[str, ca.SX]] = {}
        self._scales: dict[str, ca.SX] = {}
        self._temperatures: dict[int, ca.SX] = {}
        model.demand_values()
        for p in model.effects:
            self._parameters[p.key] = {x.name: self._parameter(p, x) for x in p.effect.parameters}
            j, read = self.joint_of(p), reads(p.effect)
            own = self._own(p)
            if "speed_scale" in read and own not in self._scales:
                name = f"speed_scale.{own}"
                words = "peak speed in the recordings that the model was fitted to; sets how sharp friction turns over"
                limit = self._joints[j].speed
                start = model.values.get(name, limit if 0 < limit < np.inf else 1.0)
                self._scales[own] = ledger.parameter(name, self.unit(j, "S/s"), start, words, (1e-9, np.inf))
            if "temperature" in read and j not in self._temperatures:
                self._temperatures[j] = ledger.input(f"temp.{self._name(p)}", "degC", f"temperature of {self._name(p)}")

    def at(self, *kinds: str) -> list[PlacedEffect]:
        """Placed effects that act at joints, links, sensors, ..., in the model's order."""
        return [p for p in self._model.effects if p.effect.at in kinds]

    def joint_of(self, p: PlacedEffect) -> int:
        """Index among the arm's joints of the one that an effect's place belongs to; -1 for a floating base."""
        if p.effect.at in ("sling", "suspension"):
            found = self._model.tree.link_at(p.effect.at, p.at)
            assert found is not None
            return found
        if p.effect.at in ("link", "boom", "beam", "base"):
            return self._link_of(p) - self._model.tree.carriers
        return int(self.place_of(p).channels[0])

    def place_of(self, p: PlacedEffect) -> Place:
        """The joint or axis, among the arm's joints, that an effect acts at or whose channel it reads."""
        found = place(self._model.tree, p.at.removeprefix("tau.").removeprefix("q.").removeprefix("q_link."))
        first = self._model.tree.carriers
        return replace(found, along=found.along[first:], back=found.back[first:])

    def _link_of(self, p: PlacedEffect) -> int:
        return [link.name for link in self._model.tree.links].index(p.at)

    def _name(self, p: PlacedEffect) -> str:
        return self._joints[self.joint_of(p)].name

    def _own(self, p: PlacedEffect) -> str:
        """Name of the joint, or the axis, whose speed an effect refers to."""
        return p.at if any(axis.name == p.at for axis in self._model.tree.axes) else self._name(p)

    def unit(self, joint: int, unit: str, channel: str = "") -> str:
        """A unit with the joint's torque, position and channel units written out."""
        return written_unit(unit, self._joints[joint].kind, channel)

    def signals(self, p: PlacedEffect | None = None) -> dict[str, ca.SX]:
        """Signals that depend on the place alone: time, temperature, speed scale."""
        found = {"time": self._ledger.time}
        if p is None:
            return found
        if self._own(p) in self._scales:
            found["speed_scale"] = self._scales[self._own(p)]
        if self.joint_of(p) in self._temperatures:
            found["temperature"] = self._temperatures[self.joint_of(p)]
        return found

    def of_others(self, p: PlacedEffect, q: ca.SX, qd: ca.SX) -> dict[str, ca.SX]:
        """Signals of other joints that an effect reads, from the arm's positions and rates (J,)."""
        at = [[joint.name for joint in self._joints].index(name) for name in p.effect.others]
        return {f"{name}_of_{k}": x[j] for k, j in enumerate(at, 1) for name, x in (("q", q), ("qd", qd))}

    def tell_held(self, at: str, outside: ca.SX) -> None:
        """Add the output that says where an empirical law is outside its data."""
        words = f"1 while a coordinate of the empirical law at {at} lies outside its data: its end value is held"
        self._ledger.output(f"held.{at}", "1", outside, words)

    def law(self, p: PlacedEffect, signals: Mapping[str, ca.SX]) -> ca.SX:
        """What the effect gives for signals (and states by name)."""
        return ca.vertcat(p.effect.law(signals, self._parameters[p.key]))

    def rate(self, p: PlacedEffect, signals: Mapping[str, ca.SX]) -> ca.SX:
        """Rates of the effect's hidden states."""
        assert p.effect.rate is not None
        return ca.vertcat(*p.effect.rate(signals, self._parameters[p.key]))

    def advanced(self, p: PlacedEffect, signals: Mapping[str, ca.SX], later: Mapping[str, ca.SX], h: ca.SX) -> ca.SX:
        """Hidden states h seconds on, of an effect that gives its closed solution."""
        assert p.effect.advance is not None
        return ca.vertcat(*p.effect.advance(signals, later, self._parameters[p.key], h))

    def steady(self, p: PlacedEffect, signals: Mapping[str, ca.SX]) -> ca.SX:
        """Hidden states with zero rate at given signals, or zero where they accumulate."""
        if p.effect.from_zero:
            return ca.SX.zeros(len(p.effect.states))
        x = ca.SX.sym("x", len(p.effect.states))
        return root(self.rate(p, {**signals, **dict(zip(p.effect.states, ca.vertsplit(x), strict=True))}), x)

    def link_parameters(self) -> list[ca.SX]:
        """Inertial parameters (10,) of every link, changed by the link effects as `identification` changes them."""
        tree, values = self._model.tree, self._model.values
        nominal = [ca.SX(link.phi) for link in tree.links]
        found = [
            ca.SX([values.get(f"inertia.{link.name}.{n}", v) for n, v in zip(_INERTIAL, link.phi, strict=True)])
            for link in tree.links
        ]
        for p in self.at("link"):
            k = self._link_of(p)
            tip = ca.SX(far_end(tree, k))
            found[k] = found[k] + self.law(p, {"phi": nominal[k], "tip": tip}) - nominal[k]
        return found

    def _parameter(self, p: PlacedEffect, x: Parameter) -> ca.SX:
        name, joint = f"{p.key}.{x.name}", self.joint_of(p)
        scale = self._model.values.get(f"speed_scale.{self._own(p)}") if x.relative_to == "speed" else None
        known = not x.relative_to or scale is not None
        factor = 1.0 if scale is None else scale
        low, high = (
            b * factor if known or b in (0.0, -np.inf, np.inf) else s for b, s in ((x.low, -np.inf), (x.high, np.inf))
        )
        return self._ledger.parameter(
            name,
            self.unit(joint, x.unit, p.at),
            self._model.values[name],
            f"{x.meaning}: {p.effect.sentence}",
            (low, high),
        )


def summed(weights: np.ndarray, x: ca.SX) -> ca.SX:
    """Weights (J,) times x (J,): one number, without the terms of zero weight."""
    return sum(
        (x[int(j)] if weights[j] == 1 else float(weights[j]) * x[int(j)] for j in np.flatnonzero(weights)), ca.SX(0)
    )


def identifier(name: str) -> str:
    """A model's name as the C identifier that FMI wants."""
    kept = "".join(c if c.isascii() and c.isalnum() else "_" for c in name) or "model"
    return f"_{kept}" if kept[0].isdigit() else kept
