"""Typical misses: which are shown, that they are linked, and that a real capture plays."""

from dataclasses import replace
from functools import partial

import pytest
from tolerance_toy import FILMED, toy_results, toy_study

from snarelab.tolerance import ground, report
from snarelab.tolerance.gallery import play_misses, typical_misses
from snarelab.tolerance.summary import sensitivities


@pytest.fixture
def study(tmp_path):
    return toy_study(tmp_path)


@pytest.fixture
def results(study, tmp_path):
    return toy_results(tmp_path / "out", study)


def test_one_of_each_kind_from_its_middle(study, results):
    found = {kind: case["radial_y"] for kind, case in typical_misses(study, results.table("space"))}
    assert set(found) == {"off the axis", "escaped", "never touched"}
    assert 0.04 < found["off the axis"] < 0.06
    assert 0.07 < found["escaped"] < 0.09 < found["never touched"]


def test_more_of_one_kind_where_there_is_only_one(study, results):
    table = results.table("space")
    kinds = typical_misses(study, table[table["radial_y"].to_numpy() < 0.065])
    assert [kind for kind, _ in kinds] == ["off the axis"] * 3
    assert len({case["case"] for _, case in kinds}) == 3
    assert typical_misses(study, table[table["margin"].to_numpy() > 0]) == []


def test_misses_are_linked_and_played_once(study, results, monkeypatch):
    monkeypatch.setattr(report, "sensitivities", partial(sensitivities, samples=64))  # not what this is about
    FILMED.clear()
    content = report.summarise(study, results)
    assert len(FILMED) == 3
    page = (results.folder / "report.html").read_text(encoding="utf-8")
    for miss in content["misses"]:
        assert f'<a href="{miss["file"]}">' in page
        assert (results.folder / miss["file"]).read_text(encoding="utf-8").startswith("<p>")
    play_misses(study, results)
    assert len(FILMED) == 3


def test_a_study_without_its_envelope_has_a_page(study, results, monkeypatch):
    monkeypatch.setattr(report, "sensitivities", partial(sensitivities, samples=64))
    content = report.summarise(replace(study, envelope=None), results)
    assert content["envelope"] == {}
    assert "envelope_radial" not in content
    page = (results.folder / "report.html").read_text(encoding="utf-8")
    assert "Where captures succeed" in page
    assert "Envelope" not in page


def test_a_ground_capture_plays(monkeypatch):
    monkeypatch.setattr(ground, "DURATION", 0.1)
    page = ground.film({axis.name: axis.nominal for axis in ground.AXES})
    assert "<script" in page
    assert 'type="range"' in page
