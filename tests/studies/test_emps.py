"""The main job on real data: EMPS against its published identification (Janot, Gautier, Brunot 2019)."""

import json
from pathlib import Path

import pytest
from made_studies import made_study

import snarelab.studies
from snarelab.cli import main
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import channel_rms
from snarelab.identification.search.refit import assemble
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody
from snarelab.studies import emps as study

pytestmark = pytest.mark.slow

MODELS = Path(snarelab.studies.__file__).parent / "emps"


@pytest.fixture(scope="module")
def identified(emps, tmp_path_factory):
    out = tmp_path_factory.mktemp("identify") / "out.json"
    files = [str(MODELS / "published.toml"), str(emps / "DATA_EMPS.mat")]
    assert main(["identify", *files, "--holdout", str(emps / "DATA_EMPS_PULSES.mat"), "--json", str(out)]) == 0
    return json.loads(out.read_text())


@pytest.fixture(scope="module")
def folder(emps, tmp_path_factory):
    """What the study leaves: a diagnosis from viscous friction alone, and a second one from the model that it saved."""
    with pytest.MonkeyPatch.context() as patch:
        return made_study("emps", study, emps.parent, tmp_path_factory.mktemp("study"), patch)


@pytest.mark.parametrize(
    ("effect", "at", "name", "published", "unit"),
    [
        ("inertia", "carriage", "mass", 95.1089, "kg"),
        ("viscous_friction", "slide", "coefficient", 203.5034, "N*s/m"),
        ("coulomb_friction", "slide", "level", 20.3935, "N"),
        ("sensor_bias", "tau.slide", "offset", -3.1648, "N"),
    ],
)
def test_parameters_are_the_published_ones(identified, effect, at, name, published, unit):
    (found,) = [p for p in identified["parameters"] if (p["effect"], p["at"], p["name"]) == (effect, at, name)]
    assert found["value"] == pytest.approx(published, rel=0.005)
    assert found["unit"] == unit
    assert 0 < found["std"] < abs(published)
    assert not found["at_bound"]


def test_force_error_is_the_published_one(identified):
    fit = identified["fit"]["tau.slide"]
    assert 0.037 < fit["train"]["relative"] <= 0.041  # published: 0.0408
    assert 0.050 < fit["holdout"]["relative"] <= 0.060  # published: 0.0598


def test_names_what_is_missing_in_order(folder):
    found = json.loads((folder / "diagnosis.json").read_text())
    assert found["verdict"] == "missing_physics"
    names = [(e["name"], e["at"]) for e in found["effects"]]
    # No law beside another that holds it. The force is what the controller asks for; a late encoder looks alike.
    # Friction changes along the screw by some 1 N: a curve without a name, and a table for it.
    friction = [(f"{x}_friction", "slide") for x in ("coulomb", "asymmetric")]
    assert names == [*friction, ("command_delay", "tau.slide")]
    assert ("sensor_delay", "q.slide") in {
        (r["name"], r["at"]) for r in found["effects"][2]["rivals"] if not r["separable"]
    }
    assert found["effects"][0]["parameters"]["level"]["value"] == pytest.approx(20.4, abs=1.0)
    # The table beside them does not change what was confirmed, in the saved model neither.
    saved = load_model(folder / "model.toml").values
    for e in found["effects"]:
        for name, p in e["parameters"].items():
            assert saved[f"{e['name']}.{e['at']}.{name}"] == pytest.approx(p["value"], rel=1e-5)
    for e in found["effects"]:
        # Names that cannot be told apart share a probability; the one that is told has the most of it.
        alike = [r["probability"] for r in e["rivals"] if not r["separable"]]
        assert e["probability"] + sum(alike) > 0.8
        assert e["probability"] > max(alike, default=0.0)


def test_ends_well_below_the_published_cross_test_error(folder):
    found = json.loads((folder / "diagnosis.json").read_text())
    errors = [s["holdout"] for s in found["steps"]]
    assert errors[0] > 0.17
    assert errors[-1] <= 0.031
    holdout = found["fit"]["tau.slide"]["holdout"]
    assert holdout["relative_after"] == pytest.approx(errors[-1])
    assert sum(p["share"] for p in found["location"]) <= 1 + 1e-9


def test_what_the_saved_model_still_lacks_is_little(folder):
    """A law's form, for a hundredth of the error; the position says something without a name."""
    found = json.loads((folder / "again.json").read_text())
    first = json.loads((folder / "diagnosis.json").read_text())
    assert found["steps"][-1]["holdout"] > 0.95 * first["steps"][-1]["holdout"]
    assert {e["at"] for e in found["effects"]} <= {"slide"}
    assert found["limits"]


def test_nothing_is_lost_on_the_way_through_the_file(folder, emps):
    """The saved model, as it stands, leaves what the diagnosis says that its own leaves."""
    model = load_model(folder / "model.toml")
    body = RigidBody(model.tree)
    train = load_experiments(model, [emps / "DATA_EMPS.mat"], body)
    assembly = assemble(model, base_parameters(body), scales(train))
    rms, _ = channel_rms(assembly, train, assembly.start)
    fit = json.loads((folder / "diagnosis.json").read_text())["fit"]["tau.slide"]["train"]
    assert rms[0] == pytest.approx(fit["rms_after"], rel=1e-6)


def test_leaves_a_report(folder):
    page = (folder / "report.html").read_text()
    assert "Coulomb friction" in page
    assert "https://" not in page
