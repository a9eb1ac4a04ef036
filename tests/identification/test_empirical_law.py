"""A law that no name stands for, closed form: its table is found, saved, simulated and exported."""

import json
import math
import warnings

import numpy as np
import pytest
from pendulum import recorded

from bench.fmu_models import Slave
from snarelab.fmu.export import export
from snarelab.identification.diagnose import diagnose
from snarelab.identification.report.page import write_report
from snarelab.identification.report.tables import drawn
from snarelab.identification.simulate import simulate
from snarelab.models.empirical import tables_of
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model


def bumps(q):
    """Two bumps of cogging, 4 and -3 N·m: no sine, no polynomial."""
    return 4.0 * math.exp(-(((q + 0.4) / 0.12) ** 2)) - 3.0 * math.exp(-(((q - 0.3) / 0.18) ** 2))


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bumps")
    model = recorded(folder, 5, law=bumps)
    answer = diagnose(model, [folder / "train.csv"], folder / "hold.csv")
    save_model(answer.model, folder / "new.toml", "found")
    return folder, answer


def test_the_table_is_the_law_and_closes_the_error(found):
    _, answer = found
    d = answer.diagnosis
    told = json.loads(json.dumps(d.to_json()))
    assert d.verdict == "unknown_effect", d.sentence
    assert [(e["name"], e["at"]) for e in told["effects"]] == [("empirical", "joint1")]
    assert "position" in told["effects"][0]["coordinates"]
    units = {"position": "rad", "speed": "rad/s", "time": "s", "load": "N*m", "distance travelled": "rad"}
    assert all(t["coordinate_units"] == [units[c] for c in t["coordinates"]] for t in told["empirical"])
    assert d.fit[0].train.rms_after < d.fit[0].train.rms_before
    # 0.3 N·m of disturbance and 0.15 N·m of noise are what an oracle that knows the law leaves, 0.34 N·m at most.
    before, after = d.fit[0].holdout.rms_before, d.fit[0].holdout.rms_after
    closed = (before**2 - after**2) / (before**2 - 0.33**2)
    assert closed > 0.8, (before, after)
    table = next(t for t in d.empirical if t.over == ("position",) and not t.times)
    q = table.knots[0]
    law = np.array([bumps(x) for x in q])
    inside = np.abs(q) < 0.8
    error = (table.value - law)[inside]
    error = error - error.mean()
    assert np.sqrt(np.mean(error**2)) < 0.25 * np.sqrt(np.mean(law[inside] ** 2))


def test_the_saved_model_simulates_what_the_diagnosis_fitted(found):
    folder, answer = found
    again = load_model(folder / "new.toml")
    assert again.values == answer.model.values
    assert [tables_of(p.effect) for p in again.effects] == [tables_of(p.effect) for p in answer.model.effects]


@pytest.mark.filterwarnings("ignore:the empirical law")
@pytest.mark.parametrize("version", [2, 3])
def test_its_fmu_reproduces_the_model(found, version):
    folder, _ = found
    wanted = simulate(load_model(folder / "new.toml"), folder / "hold.csv")
    export(str(folder / "new.toml"), version, folder / f"x{version}.fmu", inverse=True)
    s = Slave(folder / f"x{version}.fmu", folder / f"x{version}")
    rows = wanted.isel(time=slice(0, None, 40))
    for k in range(rows.sizes["time"]):
        s.set({f"{x}.joint1": float(rows[f"{x}.joint1"][k]) for x in ("q", "qd", "qdd")})
        assert s.get(["tau.joint1"])[0] == pytest.approx(float(rows["tau.joint1"][k]), rel=1e-6, abs=1e-6)
    assert s.get(["held.joint1"])[0] in (0.0, 1.0)
    s.set({"q.joint1": 40.0})
    assert s.get(["held.joint1"])[0] == 1.0
    s.close()


def test_the_report_draws_it(found):
    folder, answer = found
    write_report(answer.diagnosis, folder / "report.html")
    page = (folder / "report.html").read_text()
    assert "Empirical law at joint1 over position" in page
    assert "Outside, the end value is held" in page
    pictures = "".join(drawn(t).decode() for t in answer.diagnosis.empirical)
    assert "position of joint1 [rad]" in pictures


def test_beyond_its_data_simulation_says_so_once_and_holds(found):
    folder, _ = found
    lines = (folder / "hold.csv").read_text().splitlines()
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    rows[:, 1] *= 1.6
    np.savetxt(folder / "wide.csv", rows, delimiter=",", header=lines[0], comments="")
    model = load_model(folder / "new.toml")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        simulate(model, folder / "wide.csv")
    said = [str(w.message) for w in caught if "its end value is held" in str(w.message)]
    tables = [t for p in model.effects for t in tables_of(p.effect)]
    assert len(said) == len(tables)
    assert "has data for position" in said[0]
