"""The rig study's own parts, on a recording whose friction is known because the tool's model made it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from snarelab.identification.diagnosis import Candidate
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.model_file import load_model
from snarelab.models.rig.rig import built_in_rig
from snarelab.models.rigid_body import RigidBody
from snarelab.recordings.write import write_recording
from snarelab.studies.zero_g_rig.explain import (
    DRIFT,
    PAYLOAD,
    SETS,
    TENSION,
    TOGETHER,
    TWIST,
    after,
    alike_in_words,
    explanations,
    remedy,
    suspected_boom,
    tell_apart,
)
from snarelab.studies.zero_g_rig.friction import SlideFrictionCurve
from snarelab.studies.zero_g_rig.motion import JointMoves, Move
from snarelab.studies.zero_g_rig.scene import rig_scene
from snarelab.studies.zero_g_rig.score import coverage, score
from snarelab.studies.zero_g_rig.stand_ins import compare
from snarelab.studies.zero_g_rig.study import MODEL, Friction, friction_study

LAW = {
    "stribeck_level": 12.0,
    "stribeck_speed": 0.004,
    "stribeck_ratio": 4.0,
    "coulomb_level": 40.0,
    "coulomb_speed": 0.002,
    "viscous_coefficient": 90.0,
}
MOVES = [
    Move(1.0 + 0.5 * k + 24.0 * back, joint, (-1) ** back * 0.4, 0.03 + 0.02 * back)
    for k, joint in enumerate((7, 5, 4, 3, 1, 2, 6))
    for back in (0, 1)
]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Friction:
    """Every slide has the same friction; 0.05 N·m of noise on every torque."""
    folder = tmp_path_factory.mktemp("rig")
    model = load_model(MODEL)
    time = np.arange(0.0, 46.0, 0.02)
    q, _ = JointMoves(MOVES)(time)
    rng = np.random.default_rng(0)
    paths = []
    for name, moved in (("train", q), ("holdout", q[::-1].copy())):
        columns = {f"q.{j}": ("time", moved[:, k]) for k, j in enumerate(model.joints)}
        bare = columns | {f"tau.{j}": ("time", np.ones(len(time))) for j in model.joints}
        paths.append(folder / f"{name}.parquet")
        write_recording(xr.Dataset(bare, coords={"time": time}), paths[-1])
        experiment = load_experiments(model, [paths[-1]], RigidBody(model.tree), 4.0)[0]
        values = {f"slide_friction.{j}.{name}": value for j in model.joints for name, value in LAW.items()}
        assembly = TorqueModel(model.tree, model.effects, None, scales([experiment]), values)
        tau = assembly.torque(experiment, assembly.start)
        tau = tau + 0.05 * rng.standard_normal(tau.shape)
        kept = np.isin(np.round(time, 6), np.round(experiment.motion.time, 6))
        full = {k: ("time", v[kept]) for k, (_, v) in columns.items()}
        full |= {f"tau.{j}": ("time", tau[:, k]) for k, j in enumerate(model.joints)}
        write_recording(xr.Dataset(full, coords={"time": time[kept]}), paths[-1])
    return friction_study(model, paths[0], paths[1], lambda _: None)


def test_friction_curves_come_back(study: Friction):
    for curve in study.curves:
        v = curve.speed
        stribeck = np.tanh(v / LAW["stribeck_speed"]) - np.tanh(v / (LAW["stribeck_ratio"] * LAW["stribeck_speed"]))
        true = LAW["stribeck_level"] * stribeck + LAW["coulomb_level"] * np.tanh(v / LAW["coulomb_speed"])
        true += LAW["viscous_coefficient"] * v
        np.testing.assert_allclose(curve.force, true, rtol=0.03)


def test_friction_takes_nearly_all_of_the_error_away_on_both_recordings(study: Friction):
    assert np.all(study.train.reduction > 0.9)
    assert np.all(study.holdout.reduction > 0.9)
    assert np.all(study.train.error(study.train.tip_to_base) < 0.2 * study.train.error(study.train.rigid))


def test_an_explanation_is_like_itself_and_like_what_contains_it(study: Friction):
    one = PlacedEffect(get_effect("sling_tension_error"), "sling9", ("lag_loss",))
    other = PlacedEffect(get_effect("sling_tension_error"), "sling5", ("lag_loss",))
    pairs = compare(study.fit, {"a": [one], "b": [one], "both": [one, other]}, study.experiments, np.ones(7))
    found = {(p.name, p.other): p for p in pairs}
    assert found["a", "b"].angle == pytest.approx(0.0, abs=1e-3)
    assert found["a", "b"].mimicked == pytest.approx(1.0)
    assert found["a", "both"].mimicked == pytest.approx(1.0)
    assert found["both", "a"].mimicked < 1.0


def test_what_is_told_apart_is_said_with_its_share(study: Friction):
    pairs = tell_apart(built_in_rig(), study, "link3")
    by = {(p.name, p.other): p.mimicked for p in pairs}
    for alone in (TENSION, PAYLOAD, DRIFT):
        assert by[TWIST, alone] <= by[TWIST, TOGETHER] + 1e-9
    for some in SETS:
        assert by[TWIST, after(some)] <= by[TWIST, TOGETHER] + 1e-9
    both = "load cells on the slings and the payload weighed"
    assert by[TWIST, f"{TOGETHER}, with {both}"] == pytest.approx(by[TWIST, DRIFT])  # nothing else is left
    assert by[TWIST, DRIFT] < 0.5 < by[TWIST, TENSION]
    words = remedy(pairs, "link3")
    assert f"{100 * by[TWIST, TENSION]:.0f} % by {TENSION}" in words
    assert f"{100 * by[TWIST, DRIFT]:.0f} % with {both}" in words
    assert "track the twist of link3" in words
    assert all(" can pose as " in text for text in alike_in_words(pairs))


def test_explanations_free_what_they_say():
    placed = explanations(built_in_rig(), "link4")
    assert placed[TWIST][0].at == "link4"
    assert [p.at for p in placed[TENSION]] == [f"sling{k}" for k in range(1, 11)]
    assert placed[TWIST][0].hold == ("radius",)


@dataclass
class _Effect:
    name: str
    at: str
    rivals: tuple = ()


@dataclass
class _Rival:
    name: str
    at: str
    separable: bool


@dataclass
class _Diagnosis:
    verdict: str = "missing_physics"
    effects: list = field(default_factory=list)
    candidates: list = field(default_factory=list)


CURVE = SlideFrictionCurve("joint1", np.array([0.01, 0.02]), np.array([10.0, 10.0]), np.array([0.1, 1.0]), (), ())
FRICTION = {
    "joint1": {"coulomb": 11.0, "static": 11.0, "stribeck_speed": 1.0, "viscous": 0.0, "radius": 0.25, "creep": np.inf}
}


def test_the_boom_is_the_one_that_the_diagnosis_suspects():
    weak, strong = (Candidate("link_torsion", f"link{k}", share, 1.0, False) for k, share in ((3, 0.1), (4, 0.4)))
    other = _Effect("sensor_drift", "tau.joint2")
    for effects, candidates, boom in (
        ([other, _Effect("link_torsion", "link3")], [weak, strong], "link3"),
        ([other], [weak, strong], "link4"),
        ([], [], "link1"),
    ):
        assert suspected_boom(built_in_rig(), _Diagnosis("", effects, candidates)) == boom  # pyright: ignore[reportArgumentType]


def test_a_score_asks_for_name_and_place():
    answer = {"effect": {"name": "link_torsion", "at": "link3"}, "friction": FRICTION}
    right = _Diagnosis(effects=[_Effect("link_torsion", "link3")])
    elsewhere = _Diagnosis(effects=[_Effect("link_torsion", "link4")])
    alike = _Diagnosis(effects=[_Effect("com_offset", "link3", (_Rival("link_torsion", "link3", False),))])
    apart = _Diagnosis(effects=[_Effect("com_offset", "link3", (_Rival("link_torsion", "link3", True),))])
    extra = _Diagnosis(effects=[_Effect("link_torsion", "link3"), _Effect("makkar_friction", "joint1")])
    told = [score(answer, d, [CURVE]) for d in (right, elsewhere, alike, apart, extra)]  # pyright: ignore[reportArgumentType]
    assert [(s.named, s.placed, s.in_class) for s in told] == [
        (True, True, True),
        (True, False, True),
        (False, False, True),
        (False, False, False),
        (True, True, True),
    ]
    assert [s.wrong for s in told] == [0, 1, 1, 1, 1]
    beside = answer | {"beside": {"name": "makkar_friction", "at": "joint1"}}
    assert score(beside, extra, [CURVE]).wrong == 0  # pyright: ignore[reportArgumentType]
    assert told[0].coverage == pytest.approx(0.5)


def test_nothing_concealed_wants_adequate():
    answer = {"effect": None, "friction": FRICTION}
    told = [score(answer, _Diagnosis(v), [CURVE]).named for v in ("adequate", "unknown_effect")]  # pyright: ignore[reportArgumentType]
    assert told == [True, False]
    assert coverage([CURVE], {"joint1": np.array([10.1, 12.1])}) == pytest.approx(0.5)


def test_playback_shows_every_joint_and_sling():
    rig, time = built_in_rig(), np.linspace(5.0, 25.0, 101)
    scene = rig_scene(rig, time, np.outer(np.sin(0.2 * time), np.ones(7)))
    kinds = [name.split("/")[0] for name in scene._names]
    assert [kinds.count(kind) for kind in ("joints", "slings", "carriages")] == [7, 10, 10]
    assert scene.html().count("</html>") == 1


def test_the_model_of_the_study_is_shipped():
    assert Path(MODEL).is_file()
    assert load_model(MODEL).system == "zero_g_rig"
