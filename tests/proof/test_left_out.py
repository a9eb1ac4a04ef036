"""Calibration of a generator by the map of the others: small where all are alike, the whole error where one is not."""

import json

import numpy as np
import pytest

from proof.bars_table import BESIDE
from proof.counting import Row
from proof.drives.table import figures
from proof.left_out import calibration, of_files
from proof.register import BARS


def drawn(generator, seed, level, count=2000):
    """Names right with a probability of 1 / (1 + exp(-(level + log(1 + gain)))); the other evidence says nothing."""
    rng = np.random.default_rng(seed)
    gain = rng.exponential(6.0, count)
    p = 1 / (1 + np.exp(-(level + np.log1p(gain))))
    return [Row(g, 3.0, 0.5, bool(r), generator) for g, r in zip(gain, rng.random(count) < p, strict=True)]


def test_machines_that_are_alike_predict_each_other():
    found = calibration({name: drawn(name, seed, -1.0) for seed, name in enumerate("abc")})
    assert all(f["value"] < 0.04 and f["cases"] == 2000 for f in found.values())


def test_one_that_is_never_right_is_off_by_all_that_the_others_promise():
    rows = {name: drawn(name, seed, -1.0) for seed, name in enumerate("ab")}
    never = [r._replace(right=False, generator="c") for r in drawn("c", 2, -1.0)]
    promised = np.mean([r.right for r in drawn("c", 3, -1.0)])
    assert calibration(rows | {"c": never})["c"]["value"] == pytest.approx(promised, abs=0.04)


def test_alone_there_is_none(tmp_path):
    assert calibration({"a": drawn("a", 0, 0.0, 20)})["a"] == {"value": None, "cases": 20}
    assert calibration({"a": [], "b": drawn("b", 0, 0.0, 20)})["a"] == {"value": None, "cases": 0}
    (tmp_path / "a.jsonl").write_text(json.dumps({"case": "0000", "effects": []} | LINE) + "\n")
    assert of_files({"a": tmp_path / "a.jsonl"}) == {"a": {"value": None, "cases": 0}}


LINE = {
    "verdict": "adequate",
    "seconds": 1.0,
    "location": {},
    "truth": {
        "generator": "a",
        "group": "clean",
        "disturbance": {"kind": "white"},
        "effects": [],
        "background": [],
        "known": {},
    },
}


def test_bars_beside_the_registered_ones_are_of_figures_that_there_are():
    counted = {f.name for f in figures([])}
    assert [name for name in BESIDE if name not in counted] == [
        "calibration error of names told, by a map of the other generators"
    ]
    assert [name for name in BESIDE if name in BARS] == ["true values of right names within two deviations"]
