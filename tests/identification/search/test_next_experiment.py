"""A pendulum with a spring at its joint, moved little: what is named is uncertain; the motion designed settles it."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from diagnoses import missing_physics

from snarelab.cli import main
from snarelab.identification.search.next_experiment import rivals
from snarelab.models.model_file import load_model
from snarelab.recordings import read_recording

MASS, ARM, INERTIA = 4.0, 0.5, 0.2  # of the link: kg, m, kg m2 about its centre
VISCOUS, COULOMB, SPRING = 0.8, 1.2, 6.0
URDF = f"""<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="{ARM} 0 0"/>
<mass value="{MASS}"/><inertia ixx="0.01" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="joint1" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<origin rpy="0 1.5707963267948966 0"/><limit lower="-2" upper="2" velocity="4" effort="100"/></joint></robot>"""
"""At zero it hangs straight down."""


def write(path, time, q, rng):
    """A recording of the pendulum along a motion: gravity, inertia, friction, a spring towards 0.3 rad, and noise."""
    qd, qdd = np.gradient(q, time), np.gradient(np.gradient(q, time), time)
    tau = (INERTIA + MASS * ARM**2) * qdd + MASS * 9.81 * ARM * np.sin(q)
    tau += VISCOUS * qd + COULOMB * np.tanh(qd / 1e-3) + SPRING * (q - 0.3)
    tau += 0.05 * rng.normal(size=len(q))
    with open(path, "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", "q.joint1", "tau.joint1"])
        rows.writerows(np.stack([time, q + 1e-6 * rng.normal(size=len(q)), tau], axis=1).tolist())


def moved(amplitude, time, phase=0.0):
    return amplitude * (np.sin(1.3 * time + phase) + 0.5 * np.sin(3.1 * time) + 0.2 * np.sin(7.3 * time + phase))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place, rng = tmp_path_factory.mktemp("pendulum"), np.random.default_rng(5)
    (place / "p.urdf").write_text(URDF)
    (place / "p.toml").write_text('urdf = "p.urdf"\neffects = ["viscous_friction", "coulomb_friction"]\n')
    time = np.arange(0, 20, 0.01)
    write(place / "small.csv", time, moved(0.08, time), rng)
    write(place / "hold.csv", time, moved(0.07, time, 1.0), rng)
    write(place / "wide.csv", time, moved(0.9, time, 2.0), rng)
    return place


def diagnosis(folder, recordings, holdout, *more):
    out = folder / "out.json"
    assert main(["diagnose", str(folder / "p.toml"), *recordings, "--holdout", holdout, "--json", str(out), *more]) == 0
    return json.loads(out.read_text())


@pytest.mark.slow
def test_the_motion_designed_parts_what_small_motions_could_not(folder, capsys):
    motion = str(folder / "next.csv")
    first = diagnosis(folder, [str(folder / "small.csv")], str(folder / "hold.csv"), "--next-experiment", motion)
    rivals = [r for e in first["effects"] for r in e["rivals"] if not r["separable"]]
    assert rivals  # a spring, a payload and a shifted centre of mass all pull with q while q is small
    said = capsys.readouterr().out
    assert "Next experiment: the motion written parts" in said
    now = float(said.split("recordings so far by ")[1].split(".\n")[0].rstrip("."))
    then = float(said.split("they would differ by ")[1].split(" ")[0])
    assert then > 5 * max(now, 0.05)

    planned = read_recording(motion)
    q, qd, time = (planned[n].values for n in ("q.joint1", "qd.joint1", "time"))
    assert np.abs(q).max() <= 2
    assert np.abs(qd).max() <= 4
    assert abs(q[[1, -2]] - q[[0, -1]]).max() < 1e-4 * np.ptp(q)  # from rest to rest
    assert not qd[[0, -1]].any()
    write(folder / "played.csv", time, q, np.random.default_rng(6))
    second = diagnosis(folder, [str(folder / "small.csv"), str(folder / "played.csv")], str(folder / "wide.csv"))
    assert [(e["name"], e["at"]) for e in second["effects"]] == [("harness_stiffness", "joint1")]
    assert second["effects"][0]["parameters"]["stiffness"]["value"] == pytest.approx(SPRING, rel=0.02)
    left = sum(r["probability"] for r in second["effects"][0]["rivals"])
    assert left < 0.25 * sum(r["probability"] for r in rivals)


def test_without_a_rival_none_is_written(folder, capsys):
    (folder / "full.toml").write_text(
        'urdf = "p.urdf"\neffects = ["viscous_friction", "coulomb_friction", "harness_stiffness"]\n'
    )
    motion = folder / "none.csv"
    command = ["diagnose", str(folder / "full.toml"), str(folder / "small.csv"), "--holdout", str(folder / "hold.csv")]
    assert main([*command, "--next-experiment", str(motion)]) == 0
    assert "no rival is left" in capsys.readouterr().out
    assert not motion.exists()


def test_of_two_encoders_no_torque_says_which_is_off(folder):
    told = missing_physics()
    (finding, *_) = [e for e in told.effects if e.rivals]
    here = replace(finding, name="viscous_friction", at="joint1")
    on_link = replace(finding, name="sensor_delay", at="q_link.joint1")
    (folder / "link.toml").write_text(
        'urdf = "p.urdf"\neffects = ["viscous_friction", { name = "sensor_delay", at = "q_link.joint1" }]\n'
    )
    model = load_model(folder / "link.toml")
    found = rivals(model, replace(told, effects=(on_link, here)))
    assert found
    assert {a.at for a, _ in found} == {"joint1"}
    assert rivals(model, replace(told, effects=(on_link,))) == []
