"""Formulas for tables: right terms where a table shows them, rivals where it does not, and files that are effects."""

import importlib.util
import json
import sys

import numpy as np
import pytest
from effect_contract import check_derivatives, check_metadata, check_recovery, check_zero
from effect_references import Reference
from effect_signals import DT, signals

from bench.fmu_models import write_model
from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.formula_terms import Term
from snarelab.identification.formulate import FormulaChoice, TableFormula, formulate_table
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


def test_two_powers_are_found_that_no_one_power_leads_to():
    """q^5 less the line that a named spring took: a line, a cube and a sine each explain most of it alone."""
    found = formulate_table("joint1", *tabulated(("position",), lambda q: q**5 - 2 * q, ((-1.6, 1.4),)))
    assert found.best.words(found.table).count("position") == 2
    assert {t.kind: float(v[0]) for t, v in zip(found.best.terms, found.best.values, strict=True)} == pytest.approx(
        {"power1": -2.0, "power5": 1.0}, rel=0.05
    )
    assert found.certain


@pytest.mark.parametrize(
    "law", [lambda q: np.tanh(q / 0.25), lambda q: np.exp(-(((q - 0.2) / 0.12) ** 2)) * np.sin(17 * (q - 0.2))]
)
def test_a_law_outside_the_dictionary_is_not_certain(law):
    found = formulate_table("joint1", *tabulated(("position",), law, ((-1.2, 1.3),)))
    assert not found.certain
    assert found.none > found.best.probability
    assert "no formula of the dictionary is right: keep the table" in str(found)


def test_what_recordings_cannot_tell_a_formula_does_not_say():
    """Samples of a wave beside a line of unknown slope, by least squares: the curvature does not know the line."""
    rng, q = np.random.default_rng(4), np.linspace(-1, 1, 2000)
    table = Table(("position",), "", (tuple(np.linspace(-1, 1, 35).tolist()),))
    line, torque = q / np.linalg.norm(q), 0.8 * np.cos(9 * q) + 7.0 * q + 0.5 * rng.normal(size=2000)
    columns = table.weights([q])
    columns -= np.outer(line, line @ columns)
    curvature, score = columns.T @ columns / 0.25, columns.T @ torque / 0.25
    shrunk = np.asarray(np.linalg.solve(curvature + np.eye(35), score), float)
    found = formulate_table("joint1", table, shrunk, None, (curvature, score))
    assert [t.kind for t in found.best.terms] == ["wave"]
    assert np.hypot(*found.best.values[0]) == pytest.approx(0.8, rel=0.1)
    assert found.best.terms[0].shape == pytest.approx(2 * np.pi / 9, rel=0.03)
    assert found.certain


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
    formula = TableFormula((term,), (np.array(values),), 1.0, 0.0, 1.0)
    return FormulaChoice("joint1", Table(over, times, knots), formula, (), 0.0)


@pytest.mark.parametrize(
    ("over", "times", "ends", "truth", "law"),
    [
        (
            ("position",),
            "direction",
            ((-1.4, 1.3),),
            {"cosine_1": 1.1, "sine_1": -1.7, "period_1": 0.9},
            lambda s, a, b, period: (
                np.sign(s["qd"]) * np.hypot(a, b) * np.cos(2 * np.pi * s["q"] / period - np.arctan2(b, a))
            ),
        ),
        (
            ("position",),
            "",
            ((-1.4, 1.3),),
            {"coefficient_1": -3.0, "coefficient_2": 2.0},
            lambda s, line, fifth: s["q"] * (line + fifth * np.square(np.square(s["q"]))),
        ),
        (
            ("time",),
            "direction",
            ((0.0, 8.0),),
            {"level_1": 1.5, "decay_1": 2.2},
            lambda s, level, decay: level * np.power(2.0, -s["time"] / (decay * np.log(2))) * np.sign(s["qd"]),
        ),
        (
            ("speed",),
            "direction",
            ((0.0, 4.0),),
            {"slope_1": 2.0, "threshold_1": 1.1},
            lambda s, slope, threshold: np.where(
                np.abs(s["qd"]) > threshold, np.sign(s["qd"]) * slope * (np.abs(s["qd"]) - threshold), 0.0
            ),
        ),
        (
            ("position", "load"),
            "",
            ((-1.4, 1.3), (-30.0, 30.0)),
            {"product_1": 0.3},
            lambda s, product: product * s["q"] * s["load"],
        ),
    ],
    ids=["ripple of friction", "hardening spring", "warming", "speed limit", "load times position"],
)
def test_a_formulas_file_keeps_the_contract_of_effects(tmp_path, over, times, ends, truth, law):
    """A table of a closed form is formulated, written and held to what every effect is held to."""
    reads = {"position": "q", "time": "time", "speed": "qd", "load": "load"}

    def tabled(*x):
        return law({"qd": np.ones_like(x[0])} | dict(zip((reads[c] for c in over), x, strict=True)), *truth.values())

    path = tmp_path / "my_law.py"
    write_effect(
        formulate_table("joint1", *tabulated(over, tabled, ends, 31 if len(over) == 1 else 9, times=times)), path
    )
    effect = loaded(path)
    check_metadata(effect)
    check_derivatives(effect)
    check_zero(effect)
    check_recovery(effect, Reference(truth, law))


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
