"""The notebooks of the pages: small, whole, linked, and what they show is what a run gives today."""

import json
import re
import runpy
from pathlib import Path

import nbformat
import numpy as np
import pandas as pd
import pytest
from documentation import DOCS, README, read

pytest.importorskip("nbclient", reason="no nbclient: pip install '.[dev]'")
from nbclient.exceptions import CellExecutionError

NOTEBOOKS = sorted(DOCS.glob("*.ipynb"))
LARGEST = 500_000
"""[bytes] of a notebook with its outputs."""


def run(path):
    return runpy.run_path(str(DOCS / "run_notebooks.py"))["run"](path)


def texts(notebook):
    """What its cells show as plain text, one string a cell."""
    shown = []
    for cell in notebook.cells:
        outputs = cell.get("outputs", [])
        shown.append("".join(o.get("text", "") + o.get("data", {}).get("text/plain", "") for o in outputs))
    return shown


def told(notebook):
    """Verdicts, names and places: first sentences and steps of what was printed, numbers taken out."""
    lines = [line for text in texts(notebook) for line in text.splitlines()]
    kept = [line for line in lines if re.match(r"The model |Something is|  \+ |Nothing in", line)]
    return [re.sub(r" +", " ", re.sub(r"(?<![a-z])[\d.]+", "#", line)) for line in kept]


def test_both_are_there():
    assert [path.stem for path in NOTEBOOKS] == ["notebook-arm", "notebook-capture"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_small_whole_and_linked(path):
    assert path.stat().st_size < LARGEST
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == [*range(1, len(code) + 1)]  # run once, in order
    assert all(cell.outputs for cell in code)
    kinds = {output.output_type for cell in code for output in cell.outputs}
    assert kinds <= {"execute_result", "display_data", "stream"}
    assert any(line.startswith("The model leaves out") for line in told(notebook))
    assert path.stem in read(DOCS / "index.md").split()
    assert f"(docs/{path.name})" in read(README)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_links_and_files_named_are_there(path):
    text = "\n".join(cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown")
    for target in re.findall(r"\]\(([^)\s#]+)", text):
        assert (DOCS / target).is_file(), target
    for name in re.findall(r"`([\w/]+\.py)`", text):
        assert (DOCS.parent / name).is_file(), name


def test_the_capture_was_not_made_by_what_explains_it():
    """Its recordings are MuJoCo's: the generator's first rows are those that are stored, within the noise."""
    folder = Path(DOCS).parent / "studies" / "bundled"
    made = runpy.run_path(str(folder / "generate_capture.py"))
    assert read(folder / "capture.toml") == made["MODEL"]
    assert json.loads(read(folder / "capture_answer.json")) == made["ANSWER"]
    target = made["starts"](np.random.default_rng(made["SEED"]))
    seen = made["simulate"](made["SnareParameters"](), target, made["Truth"](friction=made["FRICTION"]), 0.1)
    stored = pd.read_csv(folder / "capture_first.csv")
    late = stored.time[stored.time <= 0.1]
    for i, axis in enumerate("xyz"):
        there = np.interp(late, seen.time, seen.position[:, i])
        assert np.abs(there - stored[f"pos.target.{axis}"][: len(late)]).max() < 6 * 1e-4  # of 0.1 mm noise


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_says_what_is_stored(path):
    stored = nbformat.read(path, as_version=4)
    fresh = run(path)  # a cell that fails raises
    assert told(fresh) == told(stored), f"{path.name} is stale: run python docs/run_notebooks.py {path.stem}"
    assert [bool(text) for text in texts(fresh)] == [bool(text) for text in texts(stored)]


@pytest.mark.slow
def test_a_cell_that_fails_is_noticed(tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1 / 0")])
    nbformat.write(notebook, tmp_path / "broken.ipynb")
    with pytest.raises(CellExecutionError, match="ZeroDivisionError"):
        run(tmp_path / "broken.ipynb")


def test_another_name_or_verdict_is_noticed():
    notebook = nbformat.read(NOTEBOOKS[0], as_version=4)
    before = told(notebook)
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "text/plain" in data:
                data["text/plain"] = data["text/plain"].replace("18.18", "18.17").replace("Stribeck", "quadratic")
    after = told(notebook)
    assert [line for line, other in zip(before, after, strict=True) if line != other] == [before[1]]
