"""Readings of a model's sensors beside the true values: outputs ``sensor.<channel>``; and what drives make of commands.

A drive's delay stands between its command, the input ``tau.<joint>``, and the joint: output ``delivered.<joint>``. What
else there is in the channel reads the command.
"""

from collections.abc import Mapping, Sequence

import casadi as ca

from .equations import Ledger
from .placed_laws import PlacedLaws


def delivered(
    laws: PlacedLaws,
    ledger: Ledger,
    command: ca.SX,
    motion: tuple[ca.SX, ca.SX],
    start: tuple[ca.SX, ca.SX],
) -> tuple[ca.SX, list[ca.SX]]:
    """Torque (J,) that the drives deliver now, and the rates of the hidden states of those that are late.

    Parameters
    ----------
    laws : PlacedLaws
    ledger : Ledger
        Takes an output for each drive that is late, and the hidden states.
    command : casadi.SX (J,)
        May depend on the motion, as a servo's does.
    motion, start : pair of casadi.SX (J,)
        Positions and rates, now and at the start; the drives have had the command of the start for ever.
    """
    torque, rates = ca.SX(command), []
    at_start = ca.substitute(command, ca.vertcat(*motion), ca.densify(ca.vertcat(*start)))
    # The reading is the last effect's; what is delivered is before the first.
    late = [p for p in laws.at("sensor") if p.effect.leads]
    for p in reversed(late):
        j, own = laws.joint_of(p), laws.signals(p)
        now, first = (
            {**own, "value": value[j], "q": q[j], "qd": qd[j]}
            for value, (q, qd) in ((torque, motion), (at_start, start))
        )
        rest = dict(zip(p.effect.states, ca.vertsplit(laws.steady(p, first)), strict=True))
        states = {name: ledger.state(x) for name, x in rest.items()}
        rates += ca.vertsplit(laws.rate(p, now | states))
        torque[j], at_start[j] = laws.law(p, now | states), laws.law(p, first | rest)
    for j, joint in {laws.joint_of(p): p.at.removeprefix("tau.") for p in late}.items():
        ledger.output(f"delivered.{joint}", laws.unit(j, "T"), torque[j], f"drive torque delivered at {joint}")
    return torque, rates


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
        Signals of each joint: ``q qd qdd load``, ``tau``, the drive's torque or its command, and ``q_link``, the link's
        position.
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
        if p.effect.leads:
            continue
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
