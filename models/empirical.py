"""``empirical``: an effect that is a table, for physics without a name; its values are its parameters.

It is no file of the vocabulary, which lists laws that can be looked for: tables come from a diagnosis, or from the
``[[empirical]]`` entries of a model file. Apart from that it is an effect like any other: a law in CasADi, linear in
its parameters, at a joint. Several tables at one joint add up.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from .axes import neighbours
from .effect import Effect, Parameter, Symbols
from .effects._direction import direction
from .model import PlacedEffect
from .table import FEWEST, MOST, OTHERS, OWN, TIMES, Table, cardinal, is_coordinate
from .tree import Tree

NAME = "empirical"

LIKELIHOOD = ("score", "curvature")
"""What a fit's recordings alone say of a table's values v, ``score v - v curvature v / 2`` in log density; of the
curvature the lower triangle by rows."""

_KEYS = ("at", "over", "times", "knots", "values", "std", *LIKELIHOOD)
_EVEN = 1e-6  # of a step: knots that differ from even steps by rounding


@dataclass(frozen=True)
class TableLaw:
    """The sum of some tables as a law; ``others`` are the joints that they read besides their own."""

    tables: tuple[Table, ...]
    others: tuple[str, ...]

    def __call__(self, s: Symbols, p: Symbols) -> ca.SX:
        """Torque [T]: of each table its value at the coordinates, times its factor."""
        total = ca.SX(0)
        for t in self.tables:
            parts = [
                ca.vertcat(*cardinal(self._coordinate(s, name), knots, ca.fmax, ca.fmin))
                for name, knots in zip(t.over, t.knots, strict=True)
            ]
            values = ca.vertcat(*(p[name] for name in t.names))
            if len(parts) == 1:
                value = ca.dot(parts[0], values)
            else:
                value = ca.dot(parts[0], ca.reshape(values, t.shape[1], t.shape[0]).T @ parts[1])
            total += value * _factor(s, t.times)
        return total

    def read(self, s: Symbols) -> list[ca.SX]:
        """Coordinates of the one table, and the factor of its value."""
        (t,) = self.tables
        return [*(self._coordinate(s, name) for name in t.over), _factor(s, t.times)]

    def held(self, s: Symbols) -> ca.SX:
        """1 where a coordinate lies outside its knots, so that a table is held at its end; 0 inside."""
        outside = ca.SX(0)
        for t in self.tables:
            for name, knots in zip(t.over, t.knots, strict=True):
                x = self._coordinate(s, name)
                outside = ca.logic_or(outside, ca.logic_or(x < knots[0], x > knots[-1]))
        return outside

    def _coordinate(self, s: Symbols, name: str) -> ca.SX:
        if name == "speed":
            return ca.fabs(s["qd"])
        own = {"position": "q", "load": "load", "time": "time", "distance travelled": "travelled"}
        if name in own:
            return s[own[name]]
        quantity, joint = next((q, name.removeprefix(x)) for q, x in zip(("q", "qd"), OTHERS, strict=True) if x in name)
        return s[f"{quantity}_of_{self.others.index(joint) + 1}"]


def _factor(s: Symbols, times: str) -> ca.SX:
    if times == "speed":
        return s["qd"] / s["speed_scale"]
    if not times:
        return ca.SX(1)
    drives = s["load"] * s["qd"] > 0
    part = {"direction": ca.SX(1), "driving": drives, "braking": 1 - drives}[times]
    return direction(s) * part


def _travelling(s: Symbols, _: Symbols) -> list[ca.SX]:
    return [ca.fabs(s["qd"])]


def empirical_effect(tables: Iterable[Table]) -> Effect:
    """The effect of some tables; equal tables make equal effects."""
    tables = tuple(tables)
    others = tuple(dict.fromkeys(joint for t in tables for joint in t.others))
    travels = any("distance travelled" in t.over for t in tables)
    over = ", and ".join(t.words for t in tables)
    return Effect(
        name=NAME,
        family="no name",
        at="joint",
        sentence=f"a torque without a name, tabulated over {over}",
        equation=f"table of {over}",
        source="cubic convolution: Keys (1981)",
        parameters=tuple(
            Parameter(name, "T", f"value of the table over {t.words}") for t in tables for name in t.names
        ),
        law=TableLaw(tables, others),
        states=("travelled",) if travels else (),
        rate=_travelling if travels else None,
        from_zero=travels,
        others=others,
        experiment="move {at} through the whole range of its coordinates, once more and in another order",
    )


_SIGNALS = ("q", "qd", "load", "time", "travelled", "speed_scale")


@functools.cache
def read_along(over: tuple[str, ...], times: str) -> ca.Function:
    """Coordinates and factor of a table as its law reads them: of ``q qd load time travelled speed_scale`` and, for
    each other joint, ``q_of_1 qd_of_1`` and so on; all in rows of samples."""
    law = TableLaw((Table(over, times, ((0.0,),) * len(over)),), Table(over, times, ()).others)
    names = [*_SIGNALS, *(f"{x}_of_{k}" for k in range(1, len(law.others) + 1) for x in ("q", "qd"))]
    s = {name: ca.SX.sym(name) for name in names}
    return ca.Function("read", list(s.values()), law.read(s), names, [*(f"x{k}" for k in range(len(over))), "factor"])


def placed_tables(at: str, tables: Sequence[Table]) -> PlacedEffect:
    """An effect of some tables at a joint; its values are held in fits, for a smooth curve can mimic most laws."""
    effect = empirical_effect(tables)
    return PlacedEffect(effect, at, tuple(p.name for p in effect.parameters))


def tables_of(effect: Effect) -> tuple[Table, ...]:
    """Its tables; none of an effect of the vocabulary."""
    return effect.law.tables if isinstance(effect.law, TableLaw) else ()


def table_values(table: Table, at: str, known: Mapping[str, float], what: str = "") -> np.ndarray:
    """Values of a table at a joint among a model's, in the table's shape; ``what``: of its ``std`` instead."""
    stem = f"{what}{NAME}.{at}."
    return np.array([known[stem + name] for name in table.names]).reshape(table.shape)


def likelihood_values(table: Table, at: str, curvature: np.ndarray, score: np.ndarray) -> dict[str, float]:
    """What recordings say of a table's values, as values of a model: curvature (k, k) and score (k,)."""
    lower = curvature[np.tril_indices(len(score))]
    found = {f"score.{NAME}.{at}.{name}": float(x) for name, x in zip(table.names, score, strict=True)}
    stem = f"curvature.{NAME}.{at}.{table.names[0]}"
    return found | {f"{stem}.{k}": float(x) for k, x in enumerate(lower)}


def likelihood_of(table: Table, at: str, known: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray] | None:
    """Curvature (k, k) and score (k,) of a table's values, where a model has them."""
    n, stem = len(table.names), f"curvature.{NAME}.{at}.{table.names[0]}"
    if f"{stem}.0" not in known:
        return None
    curvature = np.zeros((n, n))
    curvature[np.tril_indices(n)] = [known[f"{stem}.{k}"] for k in range(n * (n + 1) // 2)]
    return curvature + np.tril(curvature, -1).T, table_values(table, at, known, "score.").ravel()


def of_a_table(key: str) -> bool:
    """Does a model's value belong to a table's entry?"""
    return key.startswith((f"{NAME}.", *(f"{what}.{NAME}." for what in ("std", *LIKELIHOOD))))


def read_empirical(
    path: Path, raw: Mapping[str, Any], tree: Tree, system: str
) -> tuple[tuple[PlacedEffect, ...], dict[str, float]]:
    """The key ``empirical`` of a model file: effects, and their values by key, with deviations as ``std.<key>``.

    Raises
    ------
    InputError
        An entry that is no table, names no joint or coordinate, or whose knots and numbers do not fit each other.
    """
    entries = raw.get(NAME, [])
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise InputError(f"{path}: {NAME} = {entries!r}; allowed are tables headed [[{NAME}]]")
    if entries and system not in ("arm", "zero_g_rig", "free_floating_arm"):
        raise InputError(f"{path}: [[{NAME}]] belongs to a system with joints, not to {system!r}; take it out")
    joints = [joint.name for joint in tree.joints[tree.carriers :]]
    axes = [axis.name for axis in (*tree.axes, *neighbours(tree, tree.carriers))]
    found: dict[str, list[Table]] = {}
    values: dict[str, float] = {}
    for number, entry in enumerate(entries, 1):
        where = f"{path}: [[{NAME}]] {number}"
        for key in entry:
            if key not in _KEYS:
                raise InputError(f"{where} has {key!r}; allowed are {', '.join(_KEYS)}")
        at = entry.get("at")
        if at not in (*joints, *axes):
            raise InputError(f"{where}: at = {at!r}; this model has {', '.join(joints)}")
        table = _table(where, entry, joints)
        if table.words in [t.words for t in found.get(at, ())]:
            raise InputError(f"{where}: a table over {table.words} at {at} stands there already; keep one")
        found.setdefault(at, []).append(table)
        for what, key in (("", "values"), ("std.", "std")):
            if key == "std" and key not in entry:
                continue
            numbers = np.array(_numbers(where, key, entry.get(key), len(table.shape)), float)
            if numbers.shape != table.shape:
                raise InputError(
                    f"{where}: {key} has {_size(numbers.shape)} numbers, knots ask for {_size(table.shape)}"
                )
            if key == "std" and (numbers < 0).any():
                raise InputError(f"{where}: std = {numbers.min():g}; allowed are numbers from 0 up")
            values |= {f"{what}{NAME}.{at}.{name}": float(v) for name, v in zip(table.names, numbers.flat, strict=True)}
        values |= _likelihood(where, entry, at, table)
    return tuple(placed_tables(at, tables) for at, tables in found.items()), values


def _likelihood(where: str, entry: Mapping[str, Any], at: str, table: Table) -> dict[str, float]:
    n = len(table.names)
    found = {key: _numbers(where, key, entry[key], 1) for key in LIKELIHOOD if key in entry}
    for key, size in zip(LIKELIHOOD, (n, n * (n + 1) // 2), strict=True) if found else ():
        if len(found.get(key, ())) != size:
            raise InputError(f"{where}: {key} has {len(found.get(key, ()))} numbers, knots ask for {size}; or leave "
                             f"{' and '.join(LIKELIHOOD)} out")  # fmt: skip
    if not found:
        return {}
    curvature = np.zeros((n, n))
    curvature[np.tril_indices(n)] = found["curvature"]
    return likelihood_values(table, at, curvature, np.array(found["score"], float))


def _table(where: str, entry: Mapping[str, Any], joints: Sequence[str]) -> Table:
    over: Any = entry.get("over")
    times = entry.get("times", "")
    good = isinstance(over, list) and 1 <= len(over) <= 2 and all(isinstance(c, str) and is_coordinate(c) for c in over)
    if not good or len(set(over)) < len(over):
        allowed = ", ".join([*OWN, *(f"{start}JOINT" for start in OTHERS)])
        raise InputError(f"{where}: over = {over!r}; allowed is a list of one or two of {allowed}")
    if times not in TIMES:
        raise InputError(f"{where}: times = {times!r}; allowed are {', '.join(filter(None, TIMES))}, or leave it out")
    knots = _numbers(where, "knots", entry.get("knots"), 2)
    if len(knots) != len(over):
        raise InputError(f"{where}: knots has {len(knots)} rows; one a coordinate is allowed, {len(over)} here")
    for row in knots:
        steps = np.diff(row)
        if len(row) < FEWEST or not (steps > 0).all() or np.ptp(steps) > _EVEN * (row[-1] - row[0]):
            raise InputError(f"{where}: knots = {row!r}; allowed are {FEWEST} or more in even, rising steps")
    table = Table(tuple(over), times, tuple(tuple(map(float, row)) for row in knots))
    if len(table.names) > MOST:
        raise InputError(f"{where}: knots ask for {len(table.names)} values; allowed are {MOST} at most")
    for other in table.others:
        if other not in joints:
            raise InputError(f"{where}: over names {other!r}; this model has {', '.join(joints)}")
    return table


def _numbers(where: str, key: str, given: Any, depth: int) -> list[Any]:
    """A list of finite numbers, ``depth`` lists deep, each of one length but the outermost; raises InputError."""

    def good(x: Any, depth: int) -> bool:
        if depth == 0:
            return not isinstance(x, bool) and isinstance(x, int | float) and bool(np.isfinite(x))
        return isinstance(x, list) and len(x) > 0 and all(good(y, depth - 1) for y in x)

    ragged = (
        key != "knots"
        and depth == 2
        and isinstance(given, list)
        and len({len(x) for x in given if isinstance(x, list)}) > 1
    )
    if not good(given, depth) or ragged:
        words = {1: "a list of finite numbers", 2: "a list of lists of finite numbers"}[depth]
        raise InputError(f"{where}: {key} = {given!r}; allowed is {words}")
    return given


def _size(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))


def empirical_tables(placed: Iterable[PlacedEffect], known: Mapping[str, float]) -> list[dict[str, Any]]:
    """The entries ``[[empirical]]`` of a model file, for effects and the values known of them."""
    made = []
    for p in placed:
        for t in tables_of(p.effect):
            entry: dict[str, Any] = {"at": p.at, "over": list(t.over)}
            entry |= {"times": t.times} if t.times else {}
            entry |= {"knots": [list(k) for k in t.knots], "values": table_values(t, p.at, known).tolist()}
            if f"std.{NAME}.{p.at}.{t.names[0]}" in known:
                entry["std"] = table_values(t, p.at, known, "std.").tolist()
            seen = likelihood_of(t, p.at, known)
            if seen is not None:
                entry |= {"score": seen[1].tolist(), "curvature": seen[0][np.tril_indices(len(seen[1]))].tolist()}
            made.append(entry)
    return made
