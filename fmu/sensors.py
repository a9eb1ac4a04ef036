"""Readings of a model's sensors beside the true values: outputs ``sensor.<channel>``."""

from collections.abc import Mapping, Sequence

import casadi as ca

from .equations import Ledger
from .placed_laws import PlacedLaws


def read_sensors(
    laws: PlacedLaws,
    ledger: Ledger,
    joints: Sequence[Mapping[str, ca.SX]],
    start: Mapping[str, ca.SX],
) -> list[ca.SX]:
    """Add an output for each channel with sensor effects; several of one channel read one after another.

    Parameters
    ----------
    laws : PlacedLaws
    ledger : Ledger
        Takes the outputs and the hidden states.
    joints : sequence of mapping
        Signals of each joint: ``q qd qdd load``, ``tau``, the drive's torque, and ``q_link``, the link's position.
    start : mapping of str to casadi.SX (J,)
        ``q`` and ``q_link`` at the start, which a delayed reading starts from.

    Returns
    -------
    list of casadi.SX
        Rates of the hidden states, in their order.
    """
    rates: list[ca.SX] = []
    readings: dict[str, tuple[ca.SX, ca.SX, str]] = {}  # by channel: now, at the start, unit
    for p in laws.at("sensor"):
        j = laws.joint_of(p)
        channel, own = p.at.partition(".")[0], {**joints[j], **laws.signals(p)}
        position = channel in start
        true = (own[channel], start[channel][j] if position else own[channel])
        value, first = readings.get(p.at, true)[:2]
        states: dict[str, ca.SX] = {}
        at_start: dict[str, ca.SX] = {}
        if p.effect.states:
            rest = laws.steady(p, {**own, "value": first})
            at_start = dict(zip(p.effect.states, ca.vertsplit(rest), strict=True))
            states = {name: ledger.state(x) for name, x in at_start.items()}
            rates += ca.vertsplit(laws.rate(p, {**own, "value": value, **states}))
        now = laws.law(p, {**own, "value": value, **states})
        unit = laws.unit(j, "S" if position else "T")
        readings[p.at] = now, laws.law(p, {**own, "value": first, **at_start}), unit
    for channel, (reading, _, unit) in readings.items():
        ledger.output(f"sensor.{channel}", unit, reading, f"what the sensor of {channel} reads")
    return rates
