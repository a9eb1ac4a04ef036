"""A formula written as a one-file effect: its law in CasADi, parameters with units, and starts for its shapes."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import written_whole
from ..models.table import TIMES, UNITS, Table
from ..report.words import percent
from .formula_terms import Term
from .formulate import FormulaChoice

Array = NDArray[np.float64]

_SIGNALS = {"position": 's["q"]', "speed": 'ca.fabs(s["qd"])', "load": 's["load"]', "time": 's["time"]'}
_FACTORS = {"": "", "direction": " * direction(s)", "speed": ' * s["qd"] / s["speed_scale"]'}


def write_effect(found: FormulaChoice, path: Path) -> None:
    """Write a formula as a one-file effect; raises InputError where its law cannot be one."""
    table, name = found.table, path.stem
    if not name.isidentifier() or path.suffix != ".py":
        raise InputError(f"{path}: the file's name is the effect's; name it like my_effect.py")
    for c in table.over:
        if c not in _SIGNALS:
            raise InputError(f"{path}: the formula reads the {c}, and an effect's file reads its own joint's "
                             f"{', '.join(_SIGNALS)}; keep the table")  # fmt: skip
    if table.times not in _FACTORS:
        raise InputError(f"{path}: a factor{TIMES[table.times]} is not written; keep the table")
    lines, parameters = [], []
    for k, (t, values) in enumerate(zip(found.best.terms, found.best.values, strict=True), 1):
        expression, own = _written(t, table, values, k)
        lines.append(expression)
        parameters += own
    text = _FILE.format(
        name=name,
        over=table.words,
        at=found.at,
        formula=found.best.words(table),
        share=percent(found.best.share, 3),
        imports="from ._direction import direction\n" if table.times == "direction" else "",
        law=" + ".join(lines),
        factor=_FACTORS[table.times],
        parameters="\n".join(f"        {p}," for p in parameters),
    )
    with written_whole(path, "choose a folder that exists") as part:
        part.write_text(text, encoding="utf-8")


def _written(t: Term, table: Table, values: Array, k: int) -> tuple[str, list[str]]:
    """A term as code, and its parameters as code."""
    i = max(t.of, 0)
    u, unit = _SIGNALS[table.over[i]], UNITS[table.over[i]]
    if t.of < 0:
        other = _SIGNALS[table.over[1]]
        u = f"({u} {'-' if t.kind == 'difference' else '+'} {other})"
        if t.kind != "product" and UNITS[table.over[1]] != unit:
            raise InputError(f"{table.words}: a sum of {unit} and {UNITS[table.over[1]]} has no unit; keep the table")

    def amplitude(name: str, unit: str, value: float) -> str:
        return f'Parameter("{name}_{k}", "{unit}", "coefficient of term {k}; found: {value:.6g}")'

    def shape(word: str) -> str:
        span = table.knots[i][-1] - table.knots[i][0]
        relative = table.over[i] == "position" and word == "period"
        value = t.shape / span if relative else t.shape
        grid = sorted(
            {value * f for f in (0.8, 1.0, 1.25)}
            if word == "period"
            else {value - 0.1 * span, value, value + 0.1 * span}
        )
        if word == "decay":
            grid = sorted(value * f for f in (0.4, 1.0, 2.5))
        bounds = (
            f"low={min(grid) / 4:.6g}, high={4 * max(grid):.6g}"
            if word != "threshold"
            else f"low={grid[0] - span:.6g}, high={grid[-1] + span:.6g}"
        )
        numbers = ", ".join(f"{g:.6g}" for g in grid)
        to = ', relative_to="travel"' if relative else ""
        return (
            f'Parameter("{word}_{k}", "{unit}", "shape of term {k}; found: {t.shape:.6g}", '
            f"zero={grid[1]:.6g}, {bounds}, grid=({numbers}){to})"
        )

    p = f'p["{{}}_{k}"]'
    if t.kind in ("wave", "difference"):
        turn = f"2 * ca.pi * {u} / {p.format('period')}"
        code = f"{p.format('cosine')} * ca.cos({turn}) + {p.format('sine')} * ca.sin({turn})"
        return code, [amplitude("cosine", "T", values[0]), amplitude("sine", "T", values[1]), shape("period")]
    if t.kind == "product":
        code = f"{p.format('product')} * {_SIGNALS[table.over[0]]} * {_SIGNALS[table.over[1]]}"
        return code, [amplitude("product", f"T/({unit})/({UNITS[table.over[1]]})", values[0])]
    if t.kind in ("above", "below"):
        sign = (u, p.format("threshold")) if t.kind == "above" else (p.format("threshold"), u)
        return f"{p.format('slope')} * ca.fmax({sign[0]} - {sign[1]}, 0)", [
            amplitude("slope", f"T/({unit})", values[0]),
            shape("threshold"),
        ]
    if t.kind == "decay":
        return f"{p.format('level')} * ca.exp(-{u} / {p.format('decay')})", [
            amplitude("level", "T", values[0]),
            shape("decay"),
        ]
    power = int(t.kind[-1]) if t.kind.startswith("power") else 0
    plain = {"constant": "1", "size": f"ca.fabs({u})", "sign": f"ca.tanh(1e3 * {u})"}.get(t.kind, f"{u} ** {power}")
    units = {"constant": "T", "size": f"T/({unit})", "sign": "T"}.get(t.kind, f"T/({unit})^{power}")
    return f"{p.format('coefficient')} * {plain}", [amplitude("coefficient", units, values[0])]


_FILE = '''"""A formula for an empirical law over {over}, first found at {at}: {share} of its table."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
{imports}

def _law(s: Symbols, p: Symbols) -> ca.SX:
    return ({law}){factor}


EFFECT = Effect(
    name="{name}",
    family="drive train",
    at="joint",
    sentence="a torque over {over} that a formula was found for",
    equation="{formula}",
    source="snarelab formulate, sparse regression: Brunton, Proctor and Kutz (2016)",
    parameters=(
{parameters}
    ),
    law=_law,
    experiment="move {{at}} through the whole range of its coordinates, once more and in another order",
)
'''
