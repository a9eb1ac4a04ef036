"""The Python calls: what they take, what they give back, how it shows itself, and what stays unloaded."""

import dataclasses
import doctest
import inspect
import json
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr
from diagnoses import unbroken
from pages import Page

import snarelab
from snarelab.cli import _parser, main
from snarelab.identification import from_python

BUNDLED = Path(__file__).resolve().parents[2] / "studies" / "bundled"


def shown(result):
    page = Page(result._repr_html_())
    assert page.loaded() == []
    return page.text


@pytest.fixture(scope="module")
def fitted():
    return snarelab.identify(BUNDLED / "arm3.toml", [BUNDLED / "train.csv"], holdout=BUNDLED / "holdout.csv")


@pytest.mark.slow
@pytest.mark.usefixtures("each_diagnosis_once")
def test_examples_in_docstrings_run(tmp_path, monkeypatch):
    """The example of `diagnose` leaves a model file and a result that the rest is read from."""
    monkeypatch.chdir(tmp_path)
    before = from_python.diagnose
    kept = []

    def diagnose(*arguments, **named):
        kept.append(before(*arguments, **named))
        return kept[-1]

    runner = doctest.DocTestRunner()
    tests = doctest.DocTestFinder().find(from_python, globs={})
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(from_python, "diagnose", diagnose)
        for test in tests:
            runner.run(test)
    assert runner.failures == 0
    assert runner.tries >= 18
    (found,) = kept
    assert snarelab.load_model(tmp_path / "arm3-new.toml").values == pytest.approx(found.model.values)
    found.write_report(tmp_path / "report.html")
    assert found.sentence.split(",")[0] in (tmp_path / "report.html").read_text(encoding="utf-8")
    text = str(found)
    assert text.startswith(found.sentence)
    assert all(f"{effect.at} " in text for effect in found.effects)
    assert "probability" in text
    page = shown(found)
    assert "missing physics" in page
    assert "What is missing" in page
    assert all(unbroken(effect.evidence) in page for effect in found.effects)
    assert json.loads(json.dumps(found.to_json()))["verdict"] == found.verdict
    assert sum(f.holdout.rms_after < f.holdout.rms_before for f in found.fit) == 3


def test_results_are_frozen(fitted):
    with pytest.raises(dataclasses.FrozenInstanceError):
        fitted.condition = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        fitted.parameters[0].value = 1.0


def test_identify_says_what_the_command_says(fitted, capsys, tmp_path):
    given = [BUNDLED / "arm3.toml", BUNDLED / "train.csv", "--holdout", BUNDLED / "holdout.csv"]
    assert main(["identify", *map(str, given), "--json", str(tmp_path / "out.json")]) == 0
    assert capsys.readouterr().out.strip() == str(fitted)
    assert json.loads((tmp_path / "out.json").read_text()) == fitted.to_json()
    page = shown(fitted)
    assert "viscous friction" in page
    assert "tau.joint3" in page


def test_tables_in_memory_give_what_files_give(fitted, tmp_path):
    model = snarelab.load_model(BUNDLED / "arm3.toml")
    frame, dataset = pd.read_csv(BUNDLED / "train.csv"), snarelab.read_recording(BUNDLED / "holdout.csv")
    assert isinstance(dataset, xr.Dataset)
    again = snarelab.identify(model, frame, holdout=[dataset])
    assert str(again) == str(fitted)
    again.save_model(tmp_path / "new.toml")
    run = snarelab.simulate(tmp_path / "new.toml", dataset)
    known = snarelab.simulate(fitted.model, BUNDLED / "holdout.csv")
    xr.testing.assert_allclose(run, known.drop_attrs(), rtol=1e-12)


@pytest.mark.parametrize("call", [snarelab.diagnose, snarelab.identify])
def test_a_holdout_that_is_fitted_too_is_refused(call):
    frame = pd.read_csv(BUNDLED / "train.csv")
    with pytest.raises(snarelab.InputError, match=r"recording 1: the holdout is also a recording to fit"):
        call(BUNDLED / "arm3.toml", frame, holdout=frame)
    with pytest.raises(snarelab.InputError, match=r"recording 2: the holdout is also .* byte for byte recording 1;"):
        call(BUNDLED / "arm3.toml", frame, holdout=frame.copy())


@pytest.mark.parametrize("call", [snarelab.diagnose, snarelab.identify])
def test_processes_are_for_captures(call):
    with pytest.raises(snarelab.InputError, match=r"arm3.toml: jobs = 2; only captures .* leave it out"):
        call(BUNDLED / "arm3.toml", BUNDLED / "train.csv", holdout=BUNDLED / "holdout.csv", jobs=2)


def test_a_mistake_names_the_table_and_not_where_it_was_put():
    frame = pd.read_csv(BUNDLED / "train.csv").rename(columns={"q.joint2": "q.joint22"})
    with pytest.raises(snarelab.InputError, match=r"^recording 1:.*q\.joint2") as caught:
        snarelab.identify(BUNDLED / "arm3.toml", frame)
    assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(snarelab.InputError, match="recording 1: is a int; give a path"):
        snarelab.identify(BUNDLED / "arm3.toml", [3])  # pyright: ignore[reportArgumentType]
    with pytest.raises(snarelab.InputError, match="recordings: none is given"):
        snarelab.identify(BUNDLED / "arm3.toml", [])
    mixed = pd.DataFrame({"time": [0.0, 0.1], "q.joint1": [1.0, "stuck"]})
    with pytest.raises(snarelab.InputError, match=r"recording 1: is no table of numbers.*stuck"):
        snarelab.identify(BUNDLED / "arm3.toml", mixed)


def test_public_names_are_typed_documented_and_listed():
    assert set(snarelab.__all__) <= set(dir(snarelab))
    for name in snarelab.__all__:
        value = getattr(snarelab, name)
        assert inspect.getdoc(value)
        if inspect.isfunction(value) and value.__module__ == from_python.__name__:
            signature = inspect.signature(value)
            assert signature.return_annotation is not inspect.Parameter.empty
            for parameter in signature.parameters.values():
                assert parameter.annotation is not inspect.Parameter.empty
                assert f"    {parameter.name} : " in (value.__doc__ or ""), f"{name}: {parameter.name} not described"
    with pytest.raises(AttributeError, match="no attribute 'diagnosis'; it has"):
        snarelab.diagnosis  # noqa: B018  the look-up alone must raise


COMMANDS = ("check", "identify", "diagnose", "simulate", "formulate", "export", "cosim", "tolerance", "completion")


def test_commands_whose_help_is_tried_are_all():
    (choices,) = (action.choices for action in _parser()._actions if isinstance(action.choices, dict))
    assert set(COMMANDS) == set(choices)


@pytest.mark.parametrize("words", [["--help"], *([command, "--help"] for command in COMMANDS), ["completion", "bash"]])
def test_help_loads_neither_numbers_nor_engines(words):
    """It comes within 0.3 s on two cores of 2 GHz; NumPy alone takes a third of that."""
    heavy = "numpy", "casadi", "pydrake", "exudyn", "pandas", "xarray", "scipy", "matplotlib", "numba", "dask"
    check = f"import sys, atexit; atexit.register(lambda: print(*sorted({set(heavy)!r} & set(sys.modules))))"
    command = [sys.executable, "-c", f"{check}; from snarelab.cli import main; main({words})"]
    out = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "usage: snarelab" in out.stdout or "completion" in words
    assert out.stdout.splitlines()[-1] == ""


def test_import_loads_no_engine():
    """Half a second of processor time is the promise; none of the heavy packages is what keeps it."""
    heavy = "numpy", "casadi", "pydrake", "exudyn", "pandas", "xarray", "scipy", "matplotlib", "numba", "dask"
    check = f"import sys, atexit; atexit.register(lambda: print(*sorted({set(heavy)!r} & set(sys.modules)), time()))"
    command = [sys.executable, "-c", f"from time import process_time as time; {check}; import snarelab"]
    started = time.monotonic()
    out = subprocess.run(command, capture_output=True, text=True, check=True)
    *loaded, seconds = out.stdout.splitlines()[-1].split()
    assert loaded == []
    assert float(seconds) < 0.5, f"{seconds} s of processor time, {time.monotonic() - started:.2f} s in all"


def test_lists_in_the_cells_of_a_table_are_columns_of_it(tmp_path):
    """What a robot logs as one list a row, from memory as from a file."""
    files = Path(str(snarelab.__file__)).parent / "studies" / "bundled"
    plain = pd.read_csv(files / "train.csv")
    joints = ("joint1", "joint2", "joint3")
    lists = pd.DataFrame({"time": plain["time"]})
    lists["positions"] = list(plain[[f"q.{j}" for j in joints]].to_numpy())
    lists["torques"] = [json.dumps(list(row)) for row in plain[[f"tau.{j}" for j in joints]].to_numpy()]
    text = (files / "arm3.toml").read_text().replace("arm3.urdf", str(files / "arm3.urdf"))
    model = tmp_path / "lists.toml"
    signals = [
        f'"{f}.{j}" = "{n}[{k}]"' for f, n in (("q", "positions"), ("tau", "torques")) for k, j in enumerate(joints)
    ]
    model.write_text(text + "\n[signals]\n" + "\n".join(signals) + "\n")
    one = snarelab.identify(files / "arm3.toml", plain).parameters
    two = snarelab.identify(model, lists).parameters
    assert [p.value for p in two] == pytest.approx([p.value for p in one], rel=1e-9)
    lists["positions"] = [row[: 2 if k == 7 else 3] for k, row in enumerate(lists["positions"])]
    with pytest.raises(
        snarelab.InputError, match=r"recording 1: column 'positions\[0\]' .*as many numbers in every row"
    ):
        snarelab.identify(model, lists)
