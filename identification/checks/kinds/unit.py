"""A column in another unit than the one in which it is read: degrees, N·cm, currents, motor-side torques."""

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading

_ANGLES = ((np.pi / 180, "deg", "degrees"), (1e-3, "mrad", "milliradians"), (2 * np.pi, "turn", "turns"))
_LENGTHS = ((1e-3, "mm", "millimetres"), (1e-2, "cm", "centimetres"), (0.0254, "inch", "inches"))
_BACK = ((180 / np.pi, "", "radians, and what read them took them for degrees"),)
_MOMENTS = (
    (1e-2, "N*cm", "N·cm"),
    (1e-3, "N*mm", "N·mm"),
    (1e3, "kN*m", "kN·m"),
    (9.80665, "kgf*m", "kgf·m"),
    (9.80665e-2, "kgf*cm", "kgf·cm"),
)
_FORCES = ((1e3, "kN", "kN"), (9.80665, "kgf", "kgf"), (1e-3, "mN", "mN"))
_POWERS = tuple((10.0**k, "", f"a unit of 1e{k:+d}") for k in (-1, 1, 2))

APART = 4.0
"""Least factor, either way, by which a torque of unknown unit must be off: less may be a gain or wrong masses."""


def readings(case: CheckCase) -> list[Reading]:
    """One column, or all of a kind, times each factor that people mistake; and one torque, or all, times any."""
    joints, n = case.tree.joints, len(case.joints)
    found: list[Reading] = []
    for family in ("q", "tau"):
        tables = [_table(family, joint.kind) for joint in joints]
        groups: list[tuple[int, ...]] = [(j,) for j in case.doubtful] if n > 1 else []
        for kind in ("revolute", "prismatic"):
            alike = tuple(j for j in range(n) if joints[j].kind == kind)
            if alike:
                groups.append(alike)
        for group in groups:
            for factor, unit, words in tables[group[0]]:
                found.append(_scaled(case, family, group, factor, unit, words))
    return found + _any_factor(case)


def _table(family: str, kind: str) -> tuple[tuple[float, str, str], ...]:
    if family == "q":
        return _ANGLES + _BACK if kind == "revolute" else _LENGTHS
    return (_MOMENTS if kind == "revolute" else _FORCES) + _POWERS


def _scaled(case: CheckCase, family: str, group: tuple[int, ...], factor: float, unit: str, words: str) -> Reading:
    names = [f"{family}.{case.joints[j]}" for j in group]
    mends = [case.mends.scaled(name, factor, unit) for name in names]
    what = names[0] if len(names) == 1 else f"{family} of all {len(names)} joints"
    made = case.reading("unit", names, f"{what} is in {words} (times {factor:.6g})", mends)
    scale = np.ones(len(case.joints))
    scale[list(group)] = factor
    return made.but(factor=scale) if family == "q" else made.but(torque_factor=scale)


def _any_factor(case: CheckCase) -> list[Reading]:
    """Torques times what brings them nearest to the rigid body's: currents, or torques before a gear."""
    regressor = case.grounds.body.regressor(case.samples.q, case.samples.qd, case.samples.qdd)
    own, tau = regressor @ case.tree.phi, case.samples.tau
    n = len(case.joints)
    groups = [(j,) for j in case.doubtful] + ([tuple(range(n))] if n > 1 else [])
    found = []
    for group in groups:
        columns = list(group)
        across = np.sum(tau[:, columns] * own[:, columns], axis=0) / np.sum(tau[:, columns] ** 2 + 1e-300, axis=0)
        factor = float(np.median(across))
        if not np.isfinite(factor) or 1 / APART < abs(factor) < APART or factor <= 0:
            continue
        names = [f"tau.{case.joints[j]}" for j in group]
        what = names[0] if len(names) == 1 else f"tau of all {n} joints"
        scale = np.ones(n)
        scale[columns] = factor
        found.append(
            case.reading(
                "unit",
                names,
                f"{what} is in a unit of its own, such as a current's or a motor's before its gear "
                f"(times about {factor:.3g})",
                [case.mends.scaled(name, factor) for name in names],
            ).but(torque_factor=scale, free=2, rarer=-2.0)
        )
    return found


KIND = Kind("unit", "a column is in another unit than it is read in", readings)
