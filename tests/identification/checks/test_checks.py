"""Checks: each mistake by name, place and mend; sound recordings raise none. The whole bank is in test_checks_bank."""

import json
import re

import faulty_recordings as bank
import numpy as np
import pytest
from checked import MODEL, checked, mended, written

from snarelab.cli import main
from snarelab.identification.checks.kinds import ORDER, kinds

ONCE = [
    bank.degrees,
    bank.newton_centimetres,
    bank.milliseconds,
    bank.encoder_reversed,
    bank.torque_reversed,
    bank.joined,
    bank.load_turned,
    bank.torques_swapped,
    bank.on_the_wall,
    bank.zero_off,
    bank.axis_reversed,
    bank.cut_off,
    bank.bursting_clock,
    bank.standing,
]
"""One of each name, and the six of the page "Is my data sound?"."""


def test_kinds_are_found_by_folder():
    assert [kind.name for kind in kinds()] == list(ORDER)
    assert all((kind.readings is None) != (kind.find is None) for kind in kinds())


@pytest.mark.parametrize("mistake", ONCE, ids=lambda mistake: mistake.__name__)
def test_a_mistake_is_named_placed_and_mended(tmp_path, mistake):
    made = bank.machine(7)
    runs, name, places = mistake(made, 7)
    paths = written(tmp_path, made, runs)
    found = checked(tmp_path, paths)
    named = [f for f in found if f.name == name]
    assert named, found
    assert {f.at for f in named} <= places
    assert all(f.probability > 0.9 and f.message for f in named)
    assert all(f.fault == (name not in ("excitation", "inertia")) for f in named)
    if name == "mixed":
        assert checked(tmp_path, paths[:1]) == ()
        return
    (tmp_path / "arm.toml").write_text(mended(MODEL, found))
    assert checked(tmp_path, paths) == ()


@pytest.mark.parametrize(
    ("mistake", "odd", "usual", "low", "high"),
    [(bank.zero_moved, 1, 0.0, 0.25, 0.35), (bank.gain_changed, 2, 1.0, 0.8, 1.2)],
)
def test_of_recordings_that_differ_it_is_said_in_what_which_and_by_how_much(tmp_path, mistake, odd, usual, low, high):
    made = bank.machine(7)
    runs, _, places = mistake(made, 7)
    paths = written(tmp_path, made, runs)
    (found,) = checked(tmp_path, paths)
    assert found.name == "mixed"
    assert {found.at} == places
    assert f"run{odd}.csv is the one that differs" in found.message
    values = [float(x) for x in re.findall(r"(-?[\d.]+(?:e-?\d+)?)(?: rad)? in run", found.message)]
    others = [x for k, x in enumerate(values) if k != odd]
    assert len(others) == 2
    assert low < values[odd] - usual < high
    assert all(abs(x - usual) < 0.1 for x in others)
    assert checked(tmp_path, [path for k, path in enumerate(paths) if k != odd]) == ()


def test_all_channels_of_one_mistake_are_told(tmp_path):
    made = bank.machine(7)
    runs, _, places = bank.newton_centimetres(made, 7)
    assert {f.at for f in checked(tmp_path, written(tmp_path, made, runs))} == places


@pytest.mark.parametrize("seed", range(6))
def test_sound_recordings_raise_nothing(tmp_path, seed):
    """Friction, payloads, biases, gains, late and noisy channels that the model knows nothing of are physics."""
    made = bank.machine(seed, n_joints=2 + seed % 3)
    assert checked(tmp_path, written(tmp_path, made, [bank.record(made, seed), bank.record(made, seed + 500)])) == ()


def test_an_inertia_in_another_unit_is_no_body_of_the_robot(tmp_path):
    made = bank.machine(7)
    paths = written(tmp_path, made, [bank.record(made, 7)])
    text = (tmp_path / "arm.urdf").read_text()
    i = text.index("ixx=", text.index('name="link2"'))
    j = text.index("/>", i)
    grown = " ".join(
        f'{part.partition("=")[0]}="{1e6 * float(part.partition("=")[2].strip(chr(34)))}"' for part in text[i:j].split()
    )
    (tmp_path / "arm.urdf").write_text(text[:i] + grown + text[j:])
    (found,) = [f for f in checked(tmp_path, paths) if f.name == "inertia"]
    assert found.at == "link2"
    assert "is read as kg·m²" in found.message


def test_an_inertia_that_no_body_can_have_is_a_finding_and_its_mend_loads(tmp_path, capsys):
    made = bank.machine(7)
    paths = written(tmp_path, made, [bank.record(made, 7)])
    text = (tmp_path / "arm.urdf").read_text()
    i = text.index("ixx=", text.index('name="link3"'))
    j = text.index("/>", i)
    (tmp_path / "arm.urdf").write_text(text[:i] + 'ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.05"' + text[j:])
    (found,) = [f for f in checked(tmp_path, paths) if f.name == "inertia"]
    assert (found.at, found.mend) == ("link3", 'inertia_fix = "nearest"')
    assert main(["identify", str(tmp_path / "arm.toml"), str(paths[0])]) == 2  # as it stands, it is refused
    assert 'inertia_fix = "nearest"' in capsys.readouterr().err
    (tmp_path / "arm.toml").write_text(f"{found.mend}\n{MODEL}")
    assert main(["identify", str(tmp_path / "arm.toml"), str(paths[0])]) == 0


def test_the_command_writes_what_it_prints(tmp_path, capsys):
    made = bank.machine(7)
    runs, *_ = bank.torque_reversed(made, 7)
    (path,) = written(tmp_path, made, runs)
    out = tmp_path / "out.json"
    assert main(["check", str(tmp_path / "arm.toml"), str(path), "--json", str(out)]) == 0
    result = json.loads(out.read_text())
    assert result["sound"] is False
    (found,) = result["checks"]
    assert set(found) == {"name", "at", "probability", "message", "mend"}
    assert (found["name"], found["at"]) == ("sign", "tau.joint2")
    assert found["mend"] == '"tau.joint2" = { column = "tau.joint2", gain = -1.0 }'
    printed = capsys.readouterr().out
    assert found["message"] in printed
    assert f"    {found['mend']}" in printed


def test_a_diagnosis_names_no_physics_while_data_and_model_contradict(tmp_path, capsys):
    made = bank.machine(7)
    runs, *_ = bank.torque_reversed(made, 7)
    path, hold = written(tmp_path, made, [*runs, *bank.torque_reversed(made, 1006)[0]])
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    command = ["diagnose", str(tmp_path / "arm.toml"), str(path), "--holdout", str(hold), "--json", str(out)]
    assert main([*command, "--report", str(page), "--save-model", str(tmp_path / "new.toml")]) == 0
    found = json.loads(out.read_text())
    assert found["verdict"] == "data_fault"
    assert found["effects"] == []
    assert [(c["name"], c["at"]) for c in found["checks"]] == [("sign", "tau.joint2")]
    assert found["sentence"].startswith("The recordings and the model contradict each other")
    assert found["checks"][0]["message"] in found["sentence"]
    assert found["sentence"] in capsys.readouterr().out
    assert "fault in the data" in page.read_text()
    assert "&quot;tau.joint2&quot; = { column" in page.read_text()


def test_identify_says_it_and_goes_on(tmp_path, capsys):
    made = bank.machine(7)
    runs, *_ = bank.torque_reversed(made, 7)
    (path,) = written(tmp_path, made, runs)
    assert main(["identify", str(tmp_path / "arm.toml"), str(path), "--json", str(tmp_path / "out.json")]) == 0
    assert [c["name"] for c in json.loads((tmp_path / "out.json").read_text())["checks"]] == ["sign"]
    assert "sign at tau.joint2" in capsys.readouterr().out


def test_what_is_beyond_the_urdfs_limits_is_said(tmp_path):
    made = bank.machine(7)
    runs, *_ = bank.degrees(made, 7)
    found = checked(tmp_path, written(tmp_path, made, runs))
    assert "and the URDF allows" in found[0].message


def test_a_mend_keeps_unit_gain_and_offset_that_are_there(tmp_path):
    """Of a position in degrees with an offset, and a current with a gain."""
    made = bank.machine(7)
    (run,), *_ = bank.encoder_reversed(made, 7)
    text = MODEL + '[signals]\n"q.joint2" = { column = "q.joint2", unit = "deg", offset = 30.0 }\n'
    q = run.q.copy()
    q[:, 1] = np.degrees(q[:, 1]) - 30.0
    run.q = q
    (path,) = written(tmp_path, made, [run], text)
    (found,) = checked(tmp_path, [path])
    assert found.mend == '"q.joint2" = { columns = { "q.joint2" = -1.0 }, unit = "deg", offset = -30.0 }'
    (tmp_path / "arm.toml").write_text(f"{MODEL}[signals]\n{found.mend}\n")
    assert checked(tmp_path, [path]) == ()
