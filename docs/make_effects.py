"""The page of effects, written from the effects themselves; `make_pages.py` puts it in its place."""

import json
import re
from collections.abc import Iterable
from pathlib import Path

from snarelab.models.effect import Effect, Parameter
from snarelab.models.effects import FAMILIES, effects

HEAD = """\
# Effects

An effect is a piece of physics with a name, a place and a law. The same name is used in model files, in the code, in
results and in reports. This page is written from the code by `python docs/make_pages.py`.

- *Where* is the kind of place that an effect acts at. A *joint* or a *link* is named as in the URDF. A *sensor* is a
  channel, such as `tau.joint1`.
- A joint effect gives the torque that the drive must supply on top of the rigid body's. A link effect changes the
  link's ten inertial parameters `phi`. A sensor effect turns the true value into what the channel reads.
- On a suspension rig (`system = "zero_g_rig"`) there are four more places. A *sling* has the name that the model file
  gives it; its effect is a force and moment on the arm at the hang point, z up. A *slide* has the name of the joint
  that moves it; its effect is a friction force at the contacts. A *boom* is a link with slings beyond it, and has the
  link's name. `slings` is the whole suspension, for what all slings do alike. The rig's geometry gives the torque of
  each effect at every joint that it can turn.
- On an arm without slings a *beam* is a link that carries one joint some way from its own, and has the link's name. Its
  effect is how far the far end turns about three axes; the tree with virtual joints there gives what every joint feels,
  to first order. `link_torsion` and `link_bending` have a law for booms and one for beams: the arm decides which holds.
- On a free-floating arm (`system = "free_floating_arm"`) an effect at the *base* is a force and moment on the base, in
  the base's axes, about the origin of its frame.
- In a capture (`system = "snare_capture"`) effects of the contact act at the *pin*, effects of the cables themselves at
  the *cables*, and effects that hold the target back at the *target*. All are simulated with the snare.
- In a docking test (`system = "docking"`) effects act at the *carriage*, at all *grooves*, at one *groove* (`groove1`
  to `groove3`) or at the *latches*. All are simulated with the docking. There the values at which an amplitude is tried
  are its grid.
- Units are those of a rotary joint. For a sliding joint read N for N·m, and m for rad. U is the channel's own unit.
- `q`, `qd` and `qdd` are the joint's position, speed and acceleration. `load` is the rigid-body torque at the joint,
  from the model. `sgn` is the direction of motion, smoothed over 0.1 % of the joint's peak speed.
- *Shape* marks a parameter in which the law is nonlinear. Its starting values come from a grid, or,
  for the length of a wave, from a periodogram.
- A *series* may act more than once at a place: its further terms have its name and a number from 2 on
  (`torque_ripple_2`). The next is tried where a model has those before it.
- An effect *contains* its special cases. They are named first; the containing effect is named only for what they leave.

How to add an effect: [adding-an-effect.md](adding-an-effect.md).
"""

CONFUSIONS = """\
## What each is confused with

The share of an effect's torque that another effect at the same joint can reproduce, after a refit of viscous and
Coulomb friction. Shares of 80 % and more are listed. `python docs/make_confusions.py` computes them along the bundled
recording. Other motions separate other pairs: a diagnosis uses its own recordings, and names the rivals that are not
separable there. Effects of suspension rigs, floating bases, snares and dockings are not in the table.

`link_torsion` and `link_bending` have no row. Booms are not measured, and of the bundled arm's beams `link2` alone is
compared, with the joint before it. There no effect makes 80 % of either, nor either of any effect; but a beam looks
like elasticity of the joint beyond it as well. Nor has an effect at an axis a row, but for `joint_spring`, which acts
at no single joint: what an axis looks like depends on which joints it combines.

| effect | looks like |
| --- | --- |
"""

EXPERIMENTS = """\
## An experiment for each

The motion or measurement that separates the effect from others. Reports propose it where two effects are not separable.
*X* stands for the effect's place.

| effect | experiment |
| --- | --- |
"""


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    for family in FAMILIES:
        members = [e for e in effects().values() if e.family == family]
        parts.append(f"## {family[:1].upper()}{family[1:]}\n")
        heads = "| effect, where, source | law, parameters |\n| --- | --- |"
        laws = _laws(members)
        parts.append("\n".join([heads, *map(_row, laws)]) + "\n")
    parts.append(CONFUSIONS + "\n".join(_confusions()) + "\n")
    parts.append(EXPERIMENTS + "\n".join(map(_experiment, _laws(effects().values()))) + "\n")
    return "\n".join(parts)


def families() -> str:
    """The README's table: what can be named."""
    rows = [
        _cells(family, " ".join(f"`{e.name}`" for e in effects().values() if e.family == family)) for family in FAMILIES
    ]
    return "\n".join([_cells("family", "can be named"), _cells("---", "---"), *rows]) + "\n"


def _laws(members: Iterable[Effect]) -> list[Effect]:
    """Every law, where an effect has two one after the other."""
    return [law for e in members for law in (e, e.elsewhere) if law]


def _row(effect: Effect) -> str:
    contains = f"<br>Contains {', '.join(f'`{name}`' for name in effect.contains)}." if effect.contains else ""
    law = f"`{effect.equation}`{', series' if effect.series else ''}{contains}"
    parameters = "<br>".join(map(_parameter, effect.parameters))
    what = f"`{effect.name}`<br>{effect.sentence}<br>Where: {effect.at}<br>Source: {effect.source}"
    return _cells(what, f"{law}<br>{parameters}")


def _parameter(p: Parameter) -> str:
    unit = re.sub(r"\bT\b", "N·m", re.sub(r"\bS\b", "rad", p.unit.replace("/T", "/(T)")))
    unit = unit.replace("*", "·").replace("^2", "²").replace("^3", "³")
    shape = ", shape" if p.grid else ""
    return f"`{p.name}` [{'–' if unit == '1' else unit}]{shape}: {p.meaning}"


def _confusions() -> list[str]:
    """A row for each effect of an arm, in the page's order."""
    measured = json.loads(Path(__file__).with_name("confusions.json").read_text(encoding="utf-8"))
    rows = []
    for name, effect in effects().items():
        if effect.at in ("joint", "link", "sensor"):
            others = measured.get(name)
            alike = [f"`{other}` {100 * share:.0f} %" for other, share in (others or {}).items()]
            rows.append(_cells(f"`{name}`", ", ".join(alike) or ("none" if others == {} else "not measured yet")))
    return rows


def _experiment(effect: Effect) -> str:
    where = f" at a {effect.at}" if effect.at in ("boom", "beam") else ""  # one name, two laws
    return _cells(f"`{effect.name}`{where}", effect.experiment.format(at="*X*"))


def _cells(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
