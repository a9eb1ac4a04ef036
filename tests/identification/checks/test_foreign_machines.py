"""Machines that no rule of ours was made on, from their publishers' bytes through a model file alone."""

import json
from dataclasses import replace

import pytest
from made_studies import made_study
from real_recordings import real_recordings

import snarelab
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.model_file import load_model
from snarelab.studies import cart, tx40


@pytest.fixture(scope="module")
def halves():
    positions = real_recordings("tx40", "pos_read_data.csv") / "pos_read_data.csv"
    return [f"{positions}@{part}" for part in (tx40.TRAIN, tx40.HOLDOUT)]


def errors(result, role):
    return {c: entry[role]["relative"] for c, entry in result.fit.items()}


def test_the_coupled_wrist_of_a_tx40_is_what_its_makers_say(halves):
    """Friction and rotor of motor 6 load joints 5 and 6; without them both joints' errors are twice and more."""
    model = load_model(tx40.HERE / "tx40" / "tx40.toml")
    laws = ("viscous_friction", "coulomb_friction", "rotor_inertia")
    tied = replace(model, effects=(*model.effects, *(PlacedEffect(get_effect(name), "motor6") for name in laws)))
    alone = snarelab.identify(model, halves[0], holdout=halves[1])
    found = snarelab.identify(tied, halves[0], holdout=halves[1])
    assert found.published["checks"] == []
    for role in ("train", "holdout"):
        before, after = errors(alone, role), errors(found, role)
        for channel in ("tau.joint_5", "tau.joint_6"):
            assert after[channel] < 0.6 * before[channel], (role, channel)
        assert after["tau.joint_1"] == pytest.approx(before["tau.joint_1"], rel=0.02)
    values = {p.effect: p.value for p in found.parameters if p.at == "motor6"}
    for key, makers in tx40.MAKERS.items():
        assert values[key.partition(".")[0]] == pytest.approx(makers, rel=0.3)


def test_a_zero_that_is_a_quarter_turn_off_is_found(halves):
    """The makers' offset of joint 2, left out of the model file."""
    model = load_model(tx40.HERE / "tx40" / "tx40.toml")
    signals = {**model.signals, "q.joint_2": replace(model.signals["q.joint_2"], offset=0.0)}
    (finding,) = [c for c in snarelab.check(replace(model, signals=signals), halves[0]).checks if c.fault]
    assert (finding.name, finding.at) == ("encoder_offset", "q.joint_2")


def test_the_carts_bytes_come_to_a_mass_near_its_makers():
    place = real_recordings("cart", "cartTest2/0m05.csv")
    train = [str(place / "cartTest2" / name) for name in cart.RUNS]
    (mass,) = cart.mass(train)
    assert mass.ours == pytest.approx(cart.MASS, rel=0.1)
    result = snarelab.identify(cart.MODEL, train, holdout=place / "cartTest3" / cart.RUNS[0])
    assert result.published["checks"] == []


@pytest.mark.slow
@pytest.mark.parametrize(("study", "name"), [(cart, "cart"), (tx40, "tx40")])
def test_a_study_leaves_its_page_and_numbers(study, name, tmp_path, monkeypatch):
    place = real_recordings(name, {"cart": "cartTest2/0m05.csv", "tx40": "pos_read_data.csv"}[name])
    left = made_study(name, study, place.parent, tmp_path, monkeypatch)
    assert "What cannot be told apart" in (left / "report.html").read_text()
    result = json.loads((left / "result.json").read_text())
    values = {q["name"]: q["ours"] for q in result["quantities"]}
    channels = {key.partition(".")[2] for key in values if key.startswith("holdout_before.")}
    assert channels == ({"tau.cart"} if name == "cart" else {f"tau.joint_{k}" for k in range(1, 7)})
    for channel in channels:
        assert values[f"holdout_after.{channel}"] <= 1.05 * values[f"holdout_before.{channel}"]
    if name == "cart":
        assert values["mass"] == pytest.approx(cart.MASS, rel=0.1)
    if name == "tx40":
        assert "coulomb_friction at motor6" in values["named"]
        assert "makkar_friction" not in values["named"]
        assert values["holdout_after.tau.joint_5"] < 0.5 * values["holdout_before.tau.joint_5"]
