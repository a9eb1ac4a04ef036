"""Formulas for tables: right terms where a table shows them, rivals where it does not, and files that are effects."""

import importlib.util
import json
import sys

import numpy as np
import pytest
from effect_signals import DT, signals

from bench.fmu_models import write_model
from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.formulate import FormulaChoice, TableFormula, Term, formulate_table
from snarelab.identification.formulate_file import write_effect
from snarelab.models.hidden_state import evaluate_law
from snarelab.models.table import Table


def tabulated(over, formula, ends, n=31, noise=0.01, times=""):
    """A table of a formula with a given error."""
    knots = tuple(tuple(np.linspace(low, high, n).tolist()) for low, high in ends)
    values = formula(*np.meshgrid(*map(np.array, knots), indexing="ij"))
    std = noise * np.sqrt(np.mean(values**2)) * np.ones_like(values)
    return Table(over, times, knots), values + std * np.random.default_rng(2).normal(size=values.shape), std


@pytest.mark.parametrize(
    ("over", "formula", "ends", "kinds"),
    [
        (("position",), lambda q: 2 * np.sin(2 * np.pi * q / 0.9 + 0.4), ((-1.2, 1.3),), {"wave"}),
        (("position",), lambda q: -1.5 * q**3, ((-1.2, 1.3),), {"power3"}),
        (("time",), lambda t: 3 * np.exp(-t / 7.0), ((0, 30),), {"decay"}),
        (("speed",), lambda v: 2 * np.maximum(v - 1.1, 0), ((0, 3),), {"above"}),
    ],
)
def test_the_terms_are_those_that_made_the_table(over, formula, ends, kinds):
    found = formulate_table("joint1", *tabulated(over, formula, ends))
    assert {t.kind for t in found.best.terms} - {"constant"} >= kinds
    assert found.best.share > 0.99


def test_a_product_of_two_coordinates_is_found_with_its_coefficient():
    args = tabulated(("position", "position of b"), lambda x, y: 0.7 * x * y, ((-1, 1), (-2, 1)), 9)
    found = formulate_table("joint1", *args)
    at = [t.kind for t in found.best.terms].index("product")
    assert found.best.values[at][0] == pytest.approx(0.7, rel=0.1)


def test_what_a_coarse_table_cannot_tell_apart_has_rivals():
    """Half a wave with an error of 30 % is a parabola as well."""
    args = tabulated(("position",), lambda q: np.cos(q), ((-1.0, 1.0),), 9, 0.3)
    assert formulate_table("joint1", *args).rivals


def loaded(path):
    """The effect that a file defines, as if it stood among the others."""
    spec = importlib.util.spec_from_file_location(f"snarelab.models.effects.{path.stem}", path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    del sys.modules[spec.name]
    return module.EFFECT


def as_found(effect):
    """Its parameters as the formula has them."""
    return np.array([float(p.meaning.rpartition("found: ")[2]) for p in effect.parameters])


def chosen(over, term, values, times="", ends=((-1.0, 1.0), (-1.0, 1.0))):
    """A formula of one term, as if it had been found."""
    knots = tuple(tuple(np.linspace(low, high, 5).tolist()) for (low, high), _ in zip(ends, over, strict=False))
    formula = TableFormula((term,), (np.array(values),), 1.0, 0.0)
    return FormulaChoice("joint1", Table(over, times, knots), formula, ())


def test_the_file_is_an_effect(tmp_path):
    """It has the law that its formula says, and derivatives as the contract asks."""
    args = tabulated(("position",), lambda q: 2 * np.sin(2 * np.pi * q / 0.9), ((-1.2, 1.3),), times="direction")
    found = formulate_table("joint1", *args)
    path = tmp_path / "my_cogging.py"
    write_effect(found, path)
    effect, s = loaded(path), signals()
    numbers = as_found(effect)
    made = evaluate_law(effect, s, numbers, DT)
    moving = (np.abs(s["qd"]) > 0.01 * s["speed_scale"]) & (np.abs(s["q"]) < 1.2)
    wanted = 2 * np.sin(2 * np.pi * s["q"] / 0.9) * np.sign(s["qd"])
    assert np.sqrt(np.mean((made.values[:, 0] - wanted)[moving] ** 2)) < 0.15
    for i in range(len(numbers)):
        step = 1e-6 * np.eye(len(numbers))[i]
        ahead, behind = (evaluate_law(effect, s, np.array(numbers) + h * step, DT).values for h in (1, -1))
        np.testing.assert_allclose(made.by_parameter[:, :, i], (ahead - behind) / 2e-6, rtol=1e-4, atol=1e-4)
    assert all(p.low <= g <= p.high for p in effect.parameters for g in (*p.grid, p.zero))


@pytest.mark.parametrize(
    ("over", "term", "values", "law"),
    [
        (("load",), Term("constant", 0), [1.5], lambda s: 1.5 + 0 * s["q"]),
        (("position",), Term("size", 0), [1.5], lambda s: 1.5 * np.abs(s["q"])),
        (("position",), Term("power2", 0), [1.5], lambda s: 1.5 * s["q"] ** 2),
        (("position",), Term("above", 0, 0.2), [1.5], lambda s: 1.5 * np.maximum(s["q"] - 0.2, 0)),
        (("load",), Term("below", 0, 0.2), [1.5], lambda s: 1.5 * np.maximum(0.2 - s["load"], 0)),
        (("time",), Term("decay", 0, 3.0), [1.5], lambda s: 1.5 * np.exp(-s["time"] / 3)),
        (("position", "load"), Term("product", -1), [1.5], lambda s: 1.5 * s["q"] * s["load"]),
        (("position", "speed"), Term("power3", 1), [0.5], lambda s: 0.5 * np.abs(s["qd"]) ** 3),
    ],
)
def test_every_kind_of_term_is_written_as_it_reads(tmp_path, over, term, values, law):
    path = tmp_path / "my_law.py"
    write_effect(chosen(over, term, values), path)
    effect, s = loaded(path), signals()
    np.testing.assert_allclose(evaluate_law(effect, s, as_found(effect), DT).values[:, 0], law(s), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(
    ("found", "name", "words"),
    [
        (chosen(("position",), Term("power2", 0), [1.0]), "my law.py", "the file's name is the effect's"),
        (chosen(("position of b",), Term("power2", 0), [1.0]), "my_law.py", "reads the position of b"),
        (chosen(("position",), Term("power2", 0), [1.0], "braking"), "my_law.py", "a factor when braking"),
        (chosen(("position", "load"), Term("wave", -1, 0.5), [1.0, 2.0]), "my_law.py", "a sum of S and T has no unit"),
    ],
)
def test_what_cannot_be_a_file_is_refused_and_nothing_is_written(tmp_path, found, name, words):
    with pytest.raises(InputError, match=words):
        write_effect(found, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_command_tells_and_writes(tmp_path, capsys):
    path = write_model(tmp_path, "arm", 1, "[]", {})
    assert main(["formulate", str(path)]) == 2
    assert "no [[empirical]] table; 'snarelab diagnose --save-model'" in capsys.readouterr().err
    knots = np.linspace(-1, 1, 21)
    entry = f'[[empirical]]\nat = "joint1"\nover = ["position"]\nknots = [{knots.tolist()}]\n'
    path.write_text(path.read_text() + f"{entry}values = {(2 * knots**2).tolist()}\n")
    out = tmp_path / "my_square.py"
    assert main(["formulate", str(path), "--json", str(tmp_path / "f.json"), "--out", str(out)]) == 0
    told = json.loads((tmp_path / "f.json").read_text())["formulas"][0]
    assert told["share"] > 0.999
    assert "position^2" in told["formula"]
    assert "position^2" in capsys.readouterr().out
    assert 'name="my_square"' in out.read_text()
