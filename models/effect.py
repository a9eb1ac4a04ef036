"""What an effect is: named parameters and one CasADi law, shared by fit, simulation and FMU.

An effect is one file in ``models/effects`` that ends in ``EFFECT = Effect(...)``. Its law is written once, for one
place (a joint, a link, a sling, a sensor channel) and one instant, in CasADi symbols:

- ``at="joint"``: the torque [N·m or N] that the drive must supply on top of the rigid body's.
- ``at="link"``: the link's ten inertial parameters about its own frame, changed.
- ``at="sensor"``: what the channel reads, given the true value; of one that leads, the true value, given the reading.
- On a suspension rig: ``at="sling"``, the wrench (6,) on the arm at the sling's hang point, force [N] and moment [N·m]
  in the world frame; ``at="slide"``, the friction force [N] at the slides that a joint moves; ``at="boom"``, for
  torsion and for bending of a link (2,), the upward force per lever [N/m] on the slings beyond it;
  ``at="suspension"``, the force [N/m] that every sling loses per rise of its hang point. The rig's geometry gives the
  torque of each at every joint.
- On an arm without slings: ``at="beam"``, how far the far end of a link turns (9,): about its length and two axes
  across it, the angles [rad], their rates and their accelerations.
- On a free-floating arm: ``at="base"``, the wrench (6,) on the base, force [N] and moment [N·m] about the origin of its
  frame, in its own axes.
- In a docking: ``at="carriage"``, the friction force [N] on the carriage; ``at="grooves"``, the friction force (2,) on
  a flank along both tangents [N], which opposes the slip; ``at="groove"``, the lateral shift of one groove [m];
  ``at="latches"``, a force (3,) on each ball in addition to its latch's without the effect, in the target's axes [N].
- In a snare: ``at="pin"``, a force [N] at each contact of a cable with the pin; ``at="cables"``, a force [N] or moment
  [N·m] inside all cables; ``at="target"``, the force (3,) on the target [N]. The snare's engine has the same laws
  compiled (``models/snare``), at places that no recording shows.

Hidden state (a spring's twist, a delayed signal) is a system of ordinary differential equations: ``states`` names it,
``rate`` is its right-hand side, and the law may read it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca

Symbols = Mapping[str, ca.SX]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Parameters
    ----------
    name : str
        Field's word, snake_case; with the effect's name and place it is unique in a model.
    unit : str
        Unit with ``T`` for the joint's torque unit (N·m or N), ``S`` for its position unit (rad or m) and ``U`` for the
        unit of a sensor's channel, for example ``"T*s/S"`` for a viscous coefficient; pint's spelling otherwise.
    zero : float
        The value at which the effect vanishes (an amplitude), or a usual value (a shape).
    low, high : float
        Physical bounds. ``-inf`` and ``inf`` where there are none.
    meaning : str
        Meaning of the number, in a few words.
    grid : tuple of float
        Empty for an amplitude. For a shape parameter (in which the law is nonlinear): starting values over the range
        of real hardware, relative to the scale named by ``relative_to`` if that is set.
    relative_to : "", "speed", "travel", "place", "torque", "rate" or "per_torque"
        Unit of the bounds' finite ends and of the grid: the joint's peak speed, its travel, its peak torque,
        peak torque per travel, or one over its peak torque; "" for absolute numbers in SI units. "place": a position,
        from the middle of the travel on, in travels: the ends are at -0.5 and 0.5.
    periodic_over : str
        Of a shape that is the length of a wave: the signal that the law repeats over. Where a residual is at hand, the
        starting values are the peaks of its periodogram over that signal, and not the grid.
    alone : bool
        False where this parameter alone would be another effect: a spring's rest torque alone is a bias.
    """

    name: str
    unit: str
    meaning: str
    zero: float = 0.0
    low: float = float("-inf")
    high: float = float("inf")
    grid: tuple[float, ...] = ()
    relative_to: Literal["", "speed", "travel", "place", "torque", "rate", "per_torque"] = ""
    periodic_over: str = ""
    alone: bool = True


def written_unit(unit: str, joint: Literal["revolute", "prismatic"] = "revolute", channel: str = "") -> str:
    """A parameter's unit with T, S and U written out for a kind of joint and the channel that a sensor reads."""
    torque, position = ("N", "m") if joint == "prismatic" else ("N*m", "rad")
    reading = position if channel.startswith(("q.", "q_link.")) else torque
    whole = unit.replace("/T", "/(T)") if "*" in torque else unit
    return "".join({"T": torque, "S": position, "U": reading}.get(c, c) for c in whole)


@dataclass(frozen=True)
class Effect:
    """A named piece of physics: where it acts, what it is, and its law.

    Parameters
    ----------
    name : str
        The vocabulary's word; also the file's name.
    family : str
        Heading of the vocabulary it stands under.
    at : "joint", "link", "sensor", "sling", "slide", "boom", "suspension", "beam", "base", "pin", "cables",
        "target", "carriage", "grooves", "groove" or "latches"
        Where it acts; a slide goes by the name of its joint, a boom by that of its link.
    sentence : str
        What a test engineer would say: "friction that does not depend on speed".
    equation, source : str
        The law in one line, and who gave it (author, year).
    parameters : tuple of Parameter
        In the law's order.
    law : callable
        ``law(s, p) -> ca.SX``. ``s`` maps signal names to symbols, ``p`` parameter names to symbols.
        Joint signals: ``q qd qdd`` [S, S/s, S/s²], ``load`` [T] the rigid-body torque at the joint, ``inertia``
        [T·s²/S] the joint's own entry of the mass matrix, ``time`` [s], ``temperature`` [°C],
        ``speed_scale`` [S/s] the joint's peak speed in the recordings that the model was fitted to, saved with the
        model. Link: ``s["phi"]``, 10 numbers (m, m·cx, m·cy, m·cz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) about the link's
        frame, and ``s["tip"]``, 3 numbers [m]: the next joint's origin, or the centre of mass of a last link;
        returns 10. Sensor: ``value`` (true value), ``time``, and the joint signals of its joint. Sling: ``velocity``
        (3 numbers [m/s], of the hang point), ``weight`` and ``tension`` [N] in balance, ``time``. Slide: the signals of
        its joint. Boom: ``spread``, the sum of squared levers of the slings beyond it [m²], in torsion and in bending.
        Beam: ``moment`` (3 numbers [N·m]) that the link transmits to all beyond it, about its length and two axes
        across it, and ``inertia_beyond`` (9 numbers [kg·m²], by columns) of that about them, ``time``.
        Base: ``spin`` [rad/s], ``spin_rate`` [rad/s²], ``acceleration`` [m/s²] (of the frame's origin), the spin gained
        since the start ``spin_gained`` and the angular ``impulse`` that wheels were told to give by now [N·m·s], 3
        numbers each in the base's axes, and ``time``. Pin: ``overlap`` [m] and its rate ``approach`` [m/s], the
        ``elastic_force`` and ``normal_force`` [N], ``slip`` of the cable against the pin (3 numbers [m/s]) and the
        ``slip_velocity`` [m/s] below which friction is smooth. Cables: ``bending_stiffness`` [N·m²] and
        ``curvature_rate`` [1/(m·s)]. Target: ``displacement`` since the start (3 numbers [m]). Carriage: rate ``qd``
        [m/s], what the cables and bumpers take of the motor ``load`` [N], the ``slip_velocity`` [m/s] below which
        friction is smooth, ``time``. Grooves: ``normal_force`` [N] of a flank, ``presliding`` along both tangents, as a
        share of where it slides. Groove: ``across``, the ball's lateral distance [m]. Latches: how far a ball is
        ``drawn`` from where its latch took hold (3 numbers [m]), the latch's ``stiffness`` [N/m] and ``preload`` [N],
        and the time ``since`` it began to close [s].
        A state is read as ``s[state_name]``.
    states : tuple of str
        Names of hidden states, all starting at rest (zero rate), or from zero.
    rate : callable or None
        ``rate(s, p) -> list of ca.SX``, the states' time derivatives.
    advance : callable or None
        ``advance(s, later, p, h) -> list of ca.SX``: the states a sample later, h seconds on, where the rate has
        a closed solution between samples; ``later`` are the signals then. None integrates the rate.
    from_zero : bool
        True where the states accumulate, and so start from zero.
    leads : bool
        Sensor effects only, and of torque channels alone: True where the channel is ahead of its joint, as a command is
        ahead of the torque that a drive delivers. The law gives what the joint gets, from what the channel reads. A
        simulation puts it between the torque input and the joint; a fit, which knows the torque that the motion needs
        and asks for the reading, follows the states in reverse time.
    acts_on : "torque" or "position"
        Joint effects: the law gives a torque at the joint, or a displacement of the link behind the joint (a vector:
        displacement, its rate, its second rate), which changes the torque of every joint. A beam's gives such
        displacements.
    neighbours : "", "too" or "only"
        Joint effects only: whether a search tries the effect along the sum and the difference of two joints of
        which one carries the other; "too": also at every joint, "only": at no joint.
    others : tuple of str
        Joint effects only: other joints that the law reads; position and rate of the first are ``s["q_of_1"]`` and
        ``s["qd_of_1"]``.
    dissipates : bool
        True where the law's power ``qd * torque`` can never be negative; a test checks this.
    contains : tuple of str
        Simpler effects that are special cases of this one. A search names the simpler one first, and this one only for
        what the simpler one leaves (the principle of marginality: Nelder 1977).
    series : bool
        Joint effects only: True where the law is a term of a series. Where a model has a term, a search tries one more
        of the same law at the same place, by the names that `term` gives.
    exclusive : bool
        True where only one of the amplitudes can be there: a stop is above its place or below it.
    at_rest : bool
        True where the effect shows mainly near rest. It must pass in motion like any other. But the share of the
        residual that makes it worth a name includes samples near rest, and its columns come from the measured motion,
        not from the instrument motion.
    remembers : bool
        True where friction near rest depends on where the joint turned. Samples near rest count for such an effect if
        it explains most of the remaining residual.
    exceeds_at_rest : bool
        True where the effect raises friction near rest above its level in motion. Samples near rest count for such an
        effect: a joint that sticks stays below the level. All other effects are compared in motion only.
    elsewhere : Effect or None
        The law under the same name on a tree that has no place of the kind ``at``; None where there is none.
    experiment : str
        The motion or measurement that shows this effect apart from others, as an instruction: "move {at} slowly ...".
    """

    name: str
    family: str
    at: Literal[
        "joint", "link", "sensor", "sling", "slide", "boom", "suspension", "beam", "base", "pin", "cables",
        "target", "carriage", "grooves", "groove", "latches",
    ]  # fmt: skip
    sentence: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    law: Callable[[Symbols, Symbols], ca.SX]
    states: tuple[str, ...] = ()
    rate: Callable[[Symbols, Symbols], list[ca.SX]] | None = None
    advance: Callable[[Symbols, Symbols, Symbols, ca.SX], list[ca.SX]] | None = None
    from_zero: bool = False
    leads: bool = False
    acts_on: Literal["torque", "position"] = "torque"
    neighbours: Literal["", "too", "only"] = ""
    others: tuple[str, ...] = ()
    dissipates: bool = False
    contains: tuple[str, ...] = ()
    series: bool = False
    exclusive: bool = False
    at_rest: bool = False
    remembers: bool = False
    exceeds_at_rest: bool = False
    elsewhere: "Effect | None" = None
    experiment: str = ""


def term(effect: Effect, number: int) -> Effect:
    """A further term of a series, from the second on: the same law and parameters as ``name_2``, ``name_3``, ..."""
    return replace(effect, name=f"{effect.name}_{number}")
