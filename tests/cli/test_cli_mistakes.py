"""The command line: a mistake of the user's gives one line that names it, status 2, and leaves nothing behind."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from arm_commands import MODEL, arguments, table

from snarelab.cli import main


def refused(capfd, given, *words):
    """One line on standard error with all the words, status 2, and no file more or less, or changed."""
    here = Path.cwd()

    def state():
        return {p: p.read_bytes() if p.is_file() else None for p in here.rglob("*")}

    before = state()
    capfd.readouterr()
    assert main(given) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1, err
    assert err.startswith("snarelab: ")
    assert "Traceback" not in err
    for word in words:
        assert word in err, err
    assert state() == before
    return err


def edited(change):
    """A mistake made in the good recording's table."""

    def make():
        frame = table(0)
        change(frame).to_csv("bad.csv", index=False)
        return {"recording": "bad.csv"}

    return make


def raw(name, content):
    """A recording of these bytes."""

    def make():
        Path(name).write_bytes(content)
        return {"recording": name}

    return make


def model(text):
    def make():
        Path("bad.toml").write_text(text)
        return {"model": "bad.toml"}

    return make


def backwards(frame):
    frame.loc[300, "time"] = 1.25
    return frame


def stray(frame):
    frame["tau.joint2"] = frame["tau.joint2"].astype(object)
    frame.loc[41, "tau.joint2"] = "overload"
    return frame


def cut_mat():
    scipy.io.savemat("bad.mat", {name: table(0)[name].to_numpy() for name in ("time", "q.joint1")})
    content = Path("bad.mat").read_bytes()
    Path("bad.mat").write_bytes(content[: len(content) // 2])
    return {"recording": "bad.mat"}


def unphysical():
    urdf = Path("arm.urdf").read_text()
    start = urdf.index('ixx="', urdf.index('<link name="link2">')) + 5
    Path("bad.urdf").write_text(urdf[:start] + "9.0" + urdf[urdf.index('"', start) :])
    return model(MODEL.replace("arm.urdf", "bad.urdf"))()


MAPPED = MODEL + '[signals]\n"tau.joint1" = { column = "tau.jiont1", unit = "N*m" }\n'
MISTAKES = {
    "missing file": (lambda: {"recording": "none.csv"}, ("none.csv", "no such file")),
    "missing mapped column": (
        model(MAPPED),
        ("train.csv", "'tau.jiont1'", "nearest is 'tau.joint1'; correct [signals]"),
    ),
    "missing column": (
        edited(lambda f: f.rename(columns={"q.joint2": "q.jont2"})),
        ("bad.csv", "'q.joint2'", "nearest is 'q.jont2'"),
    ),
    "time backwards": (edited(backwards), ("bad.csv", "'time'", "backwards in row 302", "1.25 s after 2.99 s")),
    "unit": (
        edited(lambda f: f.rename(columns={"q.joint1": "q.joint1 [kg]"})),
        ("bad.csv", "'q.joint1 [kg]'", "does not fit", "rad", "gain under [signals]"),
    ),
    "decimal commas": (
        raw("bad.csv", b"time,q.joint1,q.joint2,tau.joint1,tau.joint2\n0,00,1,0,2,0,3,0,4,0\n"),
        ("bad.csv", "row 2", "10 cells", "';' where numbers have decimal commas"),
    ),
    "unknown unit": (edited(lambda f: f.rename(columns={"tau.joint1": "tau.joint1 [Nmm!]"})), ("bad.csv", "Nmm!")),
    "all NaN": (edited(lambda f: f.assign(**{"tau.joint1": np.nan})), ("bad.csv", "'tau.joint1'", "no number")),
    "joint without signal": (
        edited(lambda f: f.drop(columns=["q.joint2", "tau.joint2"])),
        ("bad.csv", "'q.joint2'", "only q.joint1", "; add the column", "[signals]"),
    ),
    "no time": (edited(lambda f: f.rename(columns={"time": "tmie"})), ("bad.csv", "no column 'time'", "tmie")),
    "too few samples": (edited(lambda f: f[:60]), ("bad.csv", "too few samples", "60 rows", "at least 50")),
    "three rows": (edited(lambda f: f[:3]), ("bad.csv", "too few samples", "3 rows")),
    "one row": (edited(lambda f: f[:1]), ("bad.csv", "1 rows")),
    "no two channels at once": (
        edited(
            lambda f: f.assign(
                **{
                    "q.joint1": f["q.joint1"].where(f.index % 2 == 0),
                    "tau.joint1": f["tau.joint1"].where(f.index % 2 == 1),
                }
            )
        ),
        ("bad.csv", "too few samples"),
    ),
    "stray text": (edited(stray), ("bad.csv", "'tau.joint2'", "row 43", "overload")),
    "corrupt MAT": (raw("bad.mat", b"MATLAB 5.0 MAT-file" + bytes(range(256)) * 3), ("bad.mat",)),
    "MAT cut off": (cut_mat, ("bad.mat",)),
    "corrupt Parquet": (raw("bad.parquet", b"PAR1 and nothing more"), ("bad.parquet",)),
    "corrupt HDF5": (raw("bad.h5", b"\x89HDF\r\n\x1a\n" + bytes(64)), ("bad.h5",)),
    "corrupt MCAP": (raw("bad.mcap", b"\x89MCAP0\r\n" + bytes(64)), ("bad.mcap",)),
    "empty file": (raw("bad.csv", b""), ("bad.csv", "empty")),
    "bytes": (raw("bad.csv", bytes(range(256)) * 10), ("bad.csv",)),
    "unknown suffix": (raw("bad.xlsx", b"PK"), ("bad.xlsx", ".csv")),
    "missing model": (lambda: {"model": "amr.toml"}, ("amr.toml", "no such", "nearest is 'arm.toml'")),
    "recording for a model": (lambda: {"model": "train.csv"}, ("train.csv", "the model file (TOML) comes first")),
    "unknown effect": (
        model(MODEL.replace("viscous", "viscuos")),
        ("bad.toml", "'viscuos_friction'", "nearest: viscous_friction", "coulomb_friction", "sensor_delay"),
    ),
    "broken TOML": (model(MODEL + "[signals\n"), ("bad.toml", "not a TOML file", "line 5")),
    "joint in signals": (
        model(MAPPED.replace('"tau.joint1"', '"tau.joint7"')),
        ("bad.toml", "'tau.joint7'", "joint1, joint2", "did you mean"),
    ),
    "missing URDF": (
        model(MODEL.replace("arm.urdf", "amr.urdf")),
        ("bad.toml: urdf = 'amr.urdf'", "nearest is 'arm.urdf'"),
    ),
    "unphysical URDF": (unphysical, ("bad.urdf", "'link2'", "nearest", "ixx=")),
    "bandwidth": (model(MODEL + "bandwidth = 45\n"), ("train.csv", "45 Hz", "100 samples a second", "<= 40 Hz")),
}


READ_ALIKE = ("missing file", "missing column", "stray text", "missing model", "unphysical URDF", "bandwidth")
"""Of each reader one: `identify` and `simulate` read with the code with which `diagnose` meets all mistakes."""
ALONE = {"identify": ("too few samples", "no two channels at once"), "simulate": ("joint without signal", "three rows")}
"""What a command says itself: a fit needs more samples than a motion that is only followed."""


@pytest.mark.parametrize(
    ("command", "mistake"),
    [("diagnose", m) for m in MISTAKES] + [(c, m) for c, own in ALONE.items() for m in (*READ_ALIKE, *own)],
)
def test_a_mistake_gives_one_line_and_nothing_else(arm_folder, capfd, command, mistake):
    make, words = MISTAKES[mistake]
    refused(capfd, arguments(command, **make()), *words)


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_torque_channel_of_zeros(arm_folder, capfd, command):
    make = edited(lambda f: f.assign(**{"tau.joint1": 0.0}))
    refused(capfd, arguments(command, **make()), "bad.csv", "'tau.joint1'", "zero in every row")


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_mistake_in_the_second_or_held_out_recording(arm_folder, capfd, command):
    stray(table(2)).to_csv("bad.csv", index=False)
    refused(capfd, arguments(command, holdout="bad.csv"), "bad.csv", "row 43")
    refused(capfd, arguments(command, holdout="none.csv"), "none.csv", "no such file")
    given = arguments(command)
    refused(capfd, [*given[:3], "bad.csv", *given[3:]], "bad.csv", "row 43")


@pytest.mark.parametrize("same", ["train.csv", "./train.csv", "link.csv", "copy.csv"])
@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_holdout_that_is_fitted_is_refused(arm_folder, capfd, command, same):
    (arm_folder / "link.csv").symlink_to("train.csv")
    (arm_folder / "copy.csv").write_bytes((arm_folder / "train.csv").read_bytes())
    refused(capfd, arguments(command, holdout=same), same, "also a recording to fit")


@pytest.mark.parametrize("option", ["--json", "--save-model", "--report", "--out"])
@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("none/x", "folder does not exist"),
        ("arm.urdf/x", "folder does not exist"),
        (".", "not a regular file"),
        ("train.csv", "recording that is read"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_work(arm_folder, capfd, monkeypatch, option, place, words):
    monkeypatch.setattr("snarelab.models.model_file.load_model", None)  # any work would fail
    given = arguments("simulate" if option == "--out" else "diagnose")
    given[given.index(option) + 1] = place
    refused(capfd, given, f"snarelab: {place}: ", words)


def test_two_outputs_in_one_place_are_refused(arm_folder, capfd):
    refused(capfd, [*arguments("identify")[:-1], "out.json"], "out.json", "another output")


@pytest.mark.parametrize(
    "given", [[], ["identify"], ["diagnose", "arm.toml", "train.csv"], ["diagnoze"], ["simulate", "a"]]
)
def test_a_command_that_is_not_complete(arm_folder, capfd, given):
    with pytest.raises(SystemExit) as stopped:
        main(given)
    assert stopped.value.code == 2
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert said.endswith("--help\n")


def test_a_required_option_that_is_misspelt(arm_folder, capfd):
    with pytest.raises(SystemExit):
        main(["diagnose", "arm.toml", "train.csv", "--hodlout=hold.csv"])
    assert "--hodlout is not one, did you mean --holdout?" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--next-experiment", "motion.txt"], ("motion.txt", ".csv or .parquet")),
        (["--report", "-"], ("-: only --json goes to standard output",)),
        (["--save-model", "-"], ("-: only --json goes to standard output",)),
    ],
)
def test_an_output_that_cannot_be_is_refused_before_the_work(capfd, arm_folder, more, words):
    given = ["diagnose", "arm.toml", "train.csv", "--holdout", "hold.csv", "--json", "out.json", *more]
    refused(capfd, given, *words)


def test_no_motion_is_planned_for_a_rig_and_that_is_said_first(capfd, arm_folder):
    Path("rig.toml").write_text('system = "zero_g_rig"\n')
    given = ["diagnose", "rig.toml", "train.csv", "--holdout", "hold.csv", "--next-experiment", "n.csv"]
    refused(capfd, given, "rig.toml", "'zero_g_rig'", "leave --next-experiment out")
