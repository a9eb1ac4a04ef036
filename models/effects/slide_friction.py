"""Slide friction: a hang unit rubs on its slide as the joint turns, and loads every joint before it too.

The law is Makkar's, with a force for a torque and the joint's own speed. Where the contacts are decides what the force
does: the joint itself feels it on the slide's radius, every joint before it the moment about its own axis.
"""

from dataclasses import replace

from ..effect import Effect
from .makkar_friction import EFFECT as MAKKAR

EFFECT = Effect(
    name="slide_friction",
    family="suspension rig",
    at="slide",
    sentence="friction at the hang unit's slide, felt by this joint and by every joint before it",
    equation="force at each contact: stribeck_level * (tanh(qd/stribeck_speed)"
    " - tanh(qd/(stribeck_ratio*stribeck_speed))) + coulomb_level * tanh(qd/coulomb_speed) + viscous_coefficient * qd;"
    " torque: its moment about each axis",
    source="Makkar, Dixon, Sawyer and Hu (2005); Tian, Tang, Dai and Li (eqs. 11, 13-16)",
    parameters=tuple(replace(p, unit=p.unit.replace("T", "N")) for p in MAKKAR.parameters),
    law=MAKKAR.law,
    dissipates=True,
    experiment="move {at} alone, to and fro at several steady speeds, and read the torque of every joint before it too",
)
