"""Recordings that are spoilt, sent through a whole diagnosis: it ends with a verdict, or with one line."""

import json

import numpy as np
import pytest
from arm_commands import arguments, table, write_arm_folder

from snarelab.cli import main

SPOILT = {
    "no torque": lambda x, rng: x.assign(**{"tau.joint1": 0.0}),
    "a joint that stands": lambda x, rng: x.assign(**{"q.joint1": 0.3}),
    "moves for a moment only": lambda x, rng: x.assign(**{"q.joint1": x["q.joint1"].where(x.index % 200 < 20, 0.0)}),
    "every third torque missing": lambda x, rng: x.assign(**{"tau.joint1": x["tau.joint1"].where(x.index % 3 > 0)}),
    "a few spikes": lambda x, rng: x.assign(**{"tau.joint1": x["tau.joint1"] + 1e5 * (rng.random(len(x)) < 0.01)}),
    "milliseconds as seconds": lambda x, rng: x.assign(time=1000.0 * x["time"]),
    "seconds as milliseconds": lambda x, rng: x.assign(time=0.001 * x["time"]),
}  # fmt: skip


LONG = ("every third torque missing", "milliseconds as seconds", "a few spikes")


@pytest.mark.parametrize(
    ("fault", "which"),
    [
        *((fault, ("train", "hold")) for fault in SPOILT if fault not in LONG),
        *(pytest.param(fault, ("train", "hold"), marks=pytest.mark.slow) for fault in LONG),
        ("seconds as milliseconds", ("hold",)),
    ],
)
def test_a_spoilt_recording_ends_in_a_verdict_or_in_one_line(tmp_path, monkeypatch, capfd, fault, which):
    monkeypatch.chdir(tmp_path)
    write_arm_folder(tmp_path)
    for seed, name in enumerate(("train", "hold")):
        whole = table(seed)
        (SPOILT[fault](whole, np.random.default_rng(seed)) if name in which else whole).to_csv(
            f"{name}.csv", index=False
        )
    before = {p.name for p in tmp_path.iterdir()}
    status = main(arguments("diagnose"))
    out, error = capfd.readouterr()
    if status == 0:
        found = json.loads((tmp_path / "out.json").read_text())
        assert found["verdict"] in ("data_fault", "missing_physics", "adequate", "unknown_effect")
        numbers = [x for e in found["fit"].values() for part in ("train", "holdout") for x in e[part].values()]
        assert np.isfinite([x for x in numbers if x is not None]).all()
    else:
        assert status == 2, error
        assert out == ""
        assert error.startswith("snarelab: ")
        assert len(error.splitlines()) == 1
        assert {p.name for p in tmp_path.iterdir()} == before
