"""Model files: every mistake is named in one line, and what is saved reads back as it was."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from refusal import refusal

from bench.arm import random_arm
from snarelab.errors import InputError
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect, places
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.recordings import Signal

GOOD = 'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(random_arm(np.random.default_rng(0), 2).urdf())
    return tmp_path


def written(folder, text, name="model.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def refused(path, *words):
    refusal(lambda: load_model(path), path, *words)


def test_defaults(folder):
    model = load_model(written(folder, 'urdf = "arm.urdf"\n', "two_joints.toml"))
    assert (model.name, model.system, model.inertia, model.bandwidth) == ("two_joints", "arm", "fixed", None)
    assert model.effects == ()
    assert model.joints == ("joint1", "joint2")
    np.testing.assert_array_equal(model.tree.gravity, [0.0, 0.0, -9.81])
    assert not model.signals
    assert not model.values


def test_an_effect_named_alone_acts_everywhere(folder):
    effects = (
        'effects = ["viscous_friction", "payload_mass", "sensor_bias", { name = "sensor_delay", at = "q.joint2" }]'
    )
    model = load_model(written(folder, GOOD + effects))
    assert [p.key for p in model.effects] == [
        "viscous_friction.joint1",
        "viscous_friction.joint2",
        "payload_mass.link1",
        "payload_mass.link2",
        "sensor_bias.tau.joint1",
        "sensor_bias.tau.joint2",
        "sensor_delay.q.joint2",
    ]


def test_missing_file(tmp_path):
    refused(tmp_path / "none.toml", "no such model file")


def test_a_folder_is_no_model_file(tmp_path):
    refused(tmp_path, "no such model file")


@pytest.mark.parametrize(
    ("text", "word"), [("name = arm\n", "line 1"), (GOOD + "[signals\n", "line 4"), ('a = "', "TOML")]
)
def test_broken_toml(folder, text, word):
    refused(written(folder, text), "not a TOML file", word)


def test_bytes_that_are_no_text(folder):
    path = folder / "model.toml"
    path.write_bytes(b"name = \xff\xfe\n")
    refused(path, "is not UTF-8 text")


def test_missing_urdf_file(folder):
    with pytest.raises(InputError, match=r"urdf = 'amr\.urdf': no such file; nearest is 'arm\.urdf'"):
        load_model(written(folder, 'urdf = "amr.urdf"\n'))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('efects = ["viscous_friction"]', ("unknown key 'efects'", "did you mean 'effects'", "bandwidth")),
        ("xyzzy = 1", ("unknown key 'xyzzy'", "allowed are name, system")),
        ("gravity = [0.0, 9.81]", ("gravity = [0.0, 9.81]", "list of 3 numbers")),
        ("gravity = 9.81", ("gravity = 9.81", "list of 3 numbers")),
        ('gravity = [0, 0, "down"]', ("gravity", "list of 3 numbers")),
        ("gravity = [0, 0, nan]", ("gravity", "list of 3 numbers")),
        ("gravity = [0, 0, true]", ("gravity", "list of 3 numbers")),
        ('inertia = "loose"', ("inertia = 'loose'", "'fixed' and 'free'")),
        ("inertia = true", ("inertia = True", "text in quotes")),
        ("bandwidth = 0", ("bandwidth = 0", "positive number of hertz")),
        ("bandwidth = -2.5", ("bandwidth = -2.5", "positive number of hertz")),
        ("bandwidth = nan", ("bandwidth = nan", "positive number of hertz")),
        ("bandwidth = inf", ("bandwidth = inf", "positive number of hertz")),
        ("bandwidth = true", ("bandwidth = True", "positive number of hertz")),
        ('bandwidth = "20 Hz"', ("bandwidth = '20 Hz'", "positive number of hertz")),
        ('effects = "viscous_friction"', ("effects = 'viscous_friction'", "list of effect names")),
        ("effects = [3]", ("effects has 3", "name = ..., at = ...")),
        ("effects = [{ at = 'joint1' }]", ("effects has {'at': 'joint1'}", "name = ..., at = ...")),
        (
            'effects = ["viscous_fricton"]',
            ("unknown effect 'viscous_fricton'", "nearest: viscous_friction", "sensor_gain"),
        ),
        ('effects = ["joy"]', ("unknown effect 'joy'", "known effects: ", "payload_mass")),
        ('effects = [{ name = "viscous_friction", at = "joint3" }]', ("'joint3'", "joint1, joint2")),
        ('effects = [{ name = "viscous_friction", at = "link1" }]', ("'link1'", "joint1, joint2")),
        ('effects = [{ name = "viscous_friction", at = "" }]', ("''", "joint1, joint2")),
        ('effects = [{ name = "viscous_friction", at = ["joint1"] }]', ("['joint1']", "joint1, joint2")),
        ('effects = [{ name = "payload_mass", at = "joint1" }]', ("'joint1'", "link1, link2")),
        ('effects = [{ name = "sensor_bias", at = "joint1" }]', ("'joint1'", "tau.joint1, tau.joint2")),
        (
            'effects = [{ name = "sensor_bias", at = "q.joint1" }]',
            ("'q.joint1'", "this model has tau.joint1, tau.joint2"),
        ),
        *(
            (f'effects = [{{ name = "command_delay", at = "{at}" }}]', (repr(at), "has tau.joint1, tau.joint2"))
            for at in ("q.joint1", "q_link.joint1", "joint1")
        ),
        ('effects = [{ name = "sensor_delay", at = "qd.joint1" }]', ("tau.joint1, tau.joint2, q.joint1, q.joint2",)),
        (
            'effects = [{ name = "viscous_friction", place = "joint1" }]',
            ("viscous_friction has 'place'", "name, at, hold"),
        ),
        ('effects = [{ name = "stribeck_friction", hold = ["sped"] }]', ("hold = ['sped']", "level, speed")),
        ('effects = [{ name = "stribeck_friction", hold = "speed" }]', ("hold = 'speed'", "level, speed")),
        ('effects = ["viscous_friction", "viscous_friction"]', ("viscous_friction.joint1", "listed twice")),
        (
            'effects = ["viscous_friction", { name = "viscous_friction", at = "joint2" }]',
            ("viscous_friction.joint2", "listed twice"),
        ),
        ("signals = 3", ("[signals] must be a table",)),
        ('[signals]\n"tau.joint1" = 3', ("tau.joint1 = 3", "column = ...")),
        ('[signals]\n"tau.joint1" = { unit = "A" }', ("tau.joint1", "column = ...")),
        ('[signals]\n"tau.joint1" = { column = "i", factor = 2 }', ("tau.joint1 has 'factor'", "column, unit, gain")),
        ('[signals]\n"tau.joint1" = { column = "i", gain = true }', ("gain = True", "a number or a scalar's name")),
        ('[signals]\n"tau.joint1" = { column = "i", gain = [2] }', ("gain = [2]", "a number or a scalar's name")),
        ('[signals]\n"tau.joint1" = { column = "i", unit = 2 }', ("unit = 2", "text in quotes")),
        ('[signals]\n"tau.joint9" = { column = "i" }', ("'tau.joint9'", "no such joint", "joint1, joint2")),
        ('[signals]\n"torque.joint1" = { column = "i" }', ("'torque.joint1'", "not a signal's name", "tau")),
        ("parameters = 3", ("[parameters] must be a table",)),
        ('[parameters]\n"a.b.c" = "high"', ("a.b.c = 'high'", "finite number")),
        ('[parameters]\n"a.b.c" = nan', ("a.b.c = nan", "finite number")),
        ('[parameters]\n"a.b.c" = false', ("a.b.c = False", "finite number")),
        ("[parameters]\na.b.c = 3.0", ("[parameters] a", "finite number")),
    ],
)
def test_a_mistake_is_named(folder, line, words):
    refused(written(folder, GOOD + line + "\n"), *words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('system = "snare_capture"\nurdf = "arm.urdf"\n', ("'snare_capture'", "has no urdf")),
        ('system = "arm"\n', ("key 'urdf' is missing",)),
        ("urdf = 3\n", ("urdf = 3", "text in quotes")),
        ('name = 3\nurdf = "arm.urdf"\n', ("name = 3", "text in quotes")),
    ],
)
def test_a_mistake_at_the_head_is_named(folder, text, words):
    refused(written(folder, text), *words)


def full_model(folder):
    text = GOOD.replace('"arm"\nsystem', '"the \\"grey\\" arm\\\\2\\twith\\nnew wrist, naïve \\u007f"\nsystem')
    text += """gravity = [0.1, -0.2, -1.62]
inertia = "free"
bandwidth = 12.5
effects = ["viscous_friction", { name = "stribeck_friction", at = "joint2", hold = ["speed"] }, "sensor_bias",
           { name = "sensor_delay", at = "q.joint1" }, { name = "coulomb_friction", at = "joint1" }]
[signals]
time = { column = "t", unit = "ms" }
"tau.joint1" = { column = "motor \\"1\\"", unit = "A", gain = 35.15 }
"tau.joint2" = { column = "vir[0]", gain = "gtau" }
"q.joint1" = "encoder 1 [deg]"
[parameters]
"viscous_friction.joint1.coefficient" = 0.1
"stribeck_friction.joint2.speed" = 1e-17
"sensor_bias.tau.joint1.bias" = -3
"inertia.link2.Ixy" = -0.30000000000000004
"""
    return load_model(written(folder, text))


def same(a, b):
    for name in ("name", "system", "inertia", "bandwidth", "joints"):
        assert getattr(a, name) == getattr(b, name)
    assert dict(a.signals) == dict(b.signals)
    assert dict(a.values) == dict(b.values)
    assert {p.key: (p.effect, p.hold) for p in a.effects} == {p.key: (p.effect, p.hold) for p in b.effects}
    np.testing.assert_array_equal(a.tree.gravity, b.tree.gravity)
    np.testing.assert_array_equal(a.tree.phi, b.tree.phi)


def test_what_is_saved_reads_back(folder):
    model = full_model(folder)
    assert model.name == 'the "grey" arm\\2\twith\nnew wrist, naïve \x7f'
    save_model(model, folder / "again.toml", "first line\nsecond line")
    same(load_model(folder / "again.toml"), model)
    text = (folder / "again.toml").read_text(encoding="utf-8")
    assert text.startswith("# first line\n# second line\n")


def test_the_saved_file_is_toml_of_the_published_form(folder):
    save_model(full_model(folder), folder / "again.toml", "note")
    raw = tomllib.loads((folder / "again.toml").read_text(encoding="utf-8"))
    assert raw["urdf"] == "arm.urdf"
    assert raw["gravity"] == [0.1, -0.2, -1.62]
    assert raw["effects"] == [
        "viscous_friction",
        {"name": "stribeck_friction", "at": "joint2", "hold": ["speed"]},
        "sensor_bias",
        {"name": "sensor_delay", "at": "q.joint1"},
        {"name": "coulomb_friction", "at": "joint1"},
    ]
    assert raw["signals"]["tau.joint1"] == {"column": 'motor "1"', "unit": "A", "gain": 35.15}
    assert raw["signals"]["tau.joint2"] == {"column": "vir[0]", "gain": "gtau"}
    assert raw["signals"]["q.joint1"] == {"column": "encoder 1 [deg]"}
    assert raw["parameters"]["inertia.link2.Ixy"] == -0.30000000000000004


def test_saved_elsewhere_it_still_finds_its_urdf(folder):
    (folder / "found" / "deep").mkdir(parents=True)
    model = full_model(folder)
    save_model(model, folder / "found" / "deep" / "again.toml", "note")
    same(load_model(folder / "found" / "deep" / "again.toml"), model)


def test_added_effects_are_saved_with_their_values(folder):
    model = load_model(written(folder, GOOD + 'effects = ["viscous_friction"]\n'))
    friction = get_effect("coulomb_friction")
    added = [PlacedEffect(friction, place) for place in places(friction, model.tree)[:1]]
    model = model.with_effects(added, {"coulomb_friction.joint1.level": np.float64(1 / 3)})
    save_model(model, folder / "again.toml", "note")
    again = load_model(folder / "again.toml")
    same(again, model)
    assert again.values["coulomb_friction.joint1.level"] == 1 / 3


def test_numbers_of_numpy_are_saved_as_numbers(folder):
    model = load_model(written(folder, GOOD))
    gain: float = np.float64(35.15)
    model = replace(model, bandwidth=np.float64(12.5), signals={"tau.joint1": Signal("i", None, gain)})
    save_model(model, folder / "again.toml", "note")
    again = load_model(folder / "again.toml")
    assert again.bandwidth == 12.5
    assert again.signals["tau.joint1"].gain == 35.15


@pytest.mark.parametrize("place", ["none/again.toml", "arm.urdf/again.toml", "taken"])
def test_all_or_nothing(folder, place):
    (folder / "taken").mkdir()
    model = full_model(folder)
    before = sorted(folder.rglob("*"))
    with pytest.raises(InputError, match="cannot be written"):
        save_model(model, folder / place, "note")
    assert sorted(folder.rglob("*")) == before


def test_a_file_that_was_there_is_replaced_whole(folder):
    model = full_model(folder)
    assert model.path.is_file()
    save_model(model, model.path, "note")
    same(load_model(model.path), model)
    assert sorted(p.name for p in folder.iterdir()) == ["arm.urdf", "model.toml"]
