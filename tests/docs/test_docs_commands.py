"""Every command and every Python example in the README and the pages is run, or stands in a list with the reason."""

import ast
import dataclasses
import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from documentation import DOCS, PAGES, ROOT, blocks, read

import snarelab
import snarelab.identification.diagnose as diagnosing
from snarelab.cli import _parser, main
from snarelab.recordings.part import several

SNARELAB = (".venv/bin/snarelab", "snarelab")

NOT_RUN = {
    r"make .*": "targets are checked by test_docs.py; they set up environments, or run for minutes",
    r"\. \.venv/bin/activate": "a shell's own",
    r"(\.venv/bin/python -m )?pip install .*": "needs the network",
    r"ros2 bag record .*": "needs a robot",
    r"python -m snarelab\.tolerance\.renew": "rewrites tests/tolerances.toml: test_capture_tolerances.py",
    r"snarelab cosim brake\.toml .*|snarelab export lagging_motor .*": "test_adding.py runs them with the page's file",
}
PARSED = {
    r"snarelab tolerance STUDY\.toml .*": "minutes of captures; test_tolerance_study.py runs a small study",
    r"snarelab (diagnose|identify) capture\.toml .*": "minutes of captures; test_snare_recordings.py runs short ones",
    r"snarelab (diagnose|identify|simulate) .*(docking|predicted).*": "a minute; test_docking_recordings.py runs them",
    r"snarelab simulate new\.toml --out capture\.csv": "of the model that the diagnosis left; test_snare_recordings.py",
}
NOT_RUN_PYTHON = {
    "fmu.md": "importers that may not be there: tests/helpers/fmu_tools.py runs the same calls",
    "cluster.md": "needs a cluster",
    "tolerance.md": "simulate stands for the reader's own",
    "adding-an-effect.md": "test_adding.py puts it into a package",
    "adding-a-nuisance.md": "test_adding.py puts it into a package",
    "adding-a-kind-of-recording.md": "test_adding.py puts it into a package",
    "adding-a-participant.md": "test_adding.py",
    "study-free-floating.md": "the robot is the reader's own",
    "study-orbit.md": "a minute of co-simulation",
}

ARM = """<robot name="arm"><link name="base"/>
<link name="table"><inertial><origin xyz="0.1 0 0"/><mass value="5"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.2"/></inertial></link>
<joint name="joint1" type="revolute"><parent link="base"/><child link="table"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="100" velocity="5"/></joint></robot>"""


def commands(page):
    """Command lines of a page's shell blocks, comments and prompts taken off, in order."""
    lines = []
    for language, block in blocks(page, "sh", "console"):
        whole = block.replace("\\\n", " ")
        typed = [line.removeprefix("$ ") for line in whole.splitlines() if language == "sh" or line.startswith("$ ")]
        lines += [re.sub(r"\s+#.*", "", line).strip() for line in typed]
    return [line for line in lines if line]


def excused(line, reasons):
    return any(re.fullmatch(pattern, line) for pattern in reasons)


def motion(seconds, seed):
    """One joint with viscous and Coulomb friction, by formula: what the examples are tried on."""
    rng, t = np.random.default_rng(seed), np.arange(round(seconds * 100)) / 100
    amplitude, w = rng.uniform(0.2, 0.5, (3, 1)), np.array([[1.1], [2.3], [5.2]]) + 0.3 * rng.uniform(size=(3, 1))
    q, qd, qdd = (amplitude * np.sin(w * t)).sum(0), (amplitude * w * np.cos(w * t)).sum(0), None
    qdd = -(amplitude * w**2 * np.sin(w * t)).sum(0)
    tau = 0.25 * qdd + 0.6 * qd + 0.5 * np.tanh(qd / 1e-3) + 0.02 * rng.normal(size=t.size)
    return pd.DataFrame({"time": t, "q.joint1": q, "tau.joint1": tau})


def write_bag(folder, table):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = [store.types[f"{x}"] for x in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header")]
    joint_state, header = kinds
    stamp = store.types["builtin_interfaces/msg/Time"]
    with Writer(folder, version=9) as writer:
        topic = writer.add_connection("/joint_states", joint_state.__msgtype__, typestore=store)
        for time, q, tau in table.to_numpy():
            ns = round(time * 1e9)
            at = header(stamp=stamp(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")
            message = joint_state(at, ["joint1"], np.array([q]), np.zeros(0), np.array([tau]))
            writer.write(topic, ns, store.serialize_cdr(message, joint_state.__msgtype__))


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """A folder with files of the names that the pages use, and the repository's studies beside them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    for name in ("arm", "arm3", "bag"):
        (tmp_path / f"{name}.urdf").write_text(ARM)
        (tmp_path / f"{name}.toml").write_text(
            f'urdf = "{name}.urdf"\neffects = ["viscous_friction"]\n[parameters]\n'
            '"speed_scale.joint1" = 3.0\n"viscous_friction.joint1.coefficient" = 0.5\n'
        )
    first, second = motion(12, 1), motion(8, 2)
    for name in ("train.csv", "sines.csv"):
        first.to_csv(name, index=False)
    for name in ("hold.csv", "steps.csv"):
        second.to_csv(name, index=False)
    write_bag(tmp_path / "sines", first)
    write_bag(tmp_path / "steps", second)
    return tmp_path


@pytest.fixture(scope="module", autouse=True)
def each_of_a_page_once(each_diagnosis_once):
    """A diagnosis that two pages ask for, of the same effects and recordings, is made once."""
    made, diagnose = {}, diagnosing.diagnose

    def remembered(model, recordings, holdout, **options):
        bytes_of = [Path(p).read_bytes() if Path(p).is_file() else str(p) for p in (*recordings, *several(holdout))]
        key = repr((model.urdf and model.urdf.read_bytes(), model.effects, model.values, bytes_of))
        if key not in made:
            made[key] = diagnose(model, recordings, holdout, **options)
        model_here = dataclasses.replace(made[key].model, path=model.path, urdf=model.urdf)
        return dataclasses.replace(made[key], model=model_here)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(diagnosing, "diagnose", remembered)
        yield


def run(line, capsys):
    """What a command prints; it must end with status 0."""
    words = shlex.split(line)
    if words[0] in SNARELAB:
        capsys.readouterr()
        assert main(words[1:]) == 0, line
        return capsys.readouterr().out
    if words[0] == "cd":
        os.chdir(words[1])
        return ""
    assert words[0] in ("mkdir", "cp", "fmpy"), f"{line}: is neither run nor excused in NOT_RUN"
    command = [sys.executable, "-m", *words] if words[0] == "fmpy" else words
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, f"{line}: {ran.stderr}"
    return ran.stdout


def numbered(text):
    """Words of a text, and its numbers apart: percentages may move in the last digit from machine to machine."""
    return re.sub(r"[\d.]+", "#", re.sub(r" +", " ", text)), [float(x) for x in re.findall(r"\d+(?:\.\d+)?", text)]


WITH_COMMANDS = [page for page in PAGES if any(not excused(line, NOT_RUN) for line in commands(page))]
TOGETHER = ("README.md", "own-robot.md")  # they diagnose the same recordings: one worker does that once
GROUPS = [[p for p in WITH_COMMANDS if p.name in TOGETHER], *([p] for p in WITH_COMMANDS if p.name not in TOGETHER)]


@pytest.mark.slow
@pytest.mark.parametrize("pages", GROUPS, ids=lambda pages: "+".join(page.name for page in pages))
def test_every_command_runs(pages, bench, capsys):
    for page in pages:
        os.chdir(bench)
        printed = try_out(page, bench, capsys)
        if page.name in TOGETHER:
            check_shown(read(page), "".join(printed))


def try_out(page, bench, capsys):
    """What the commands of a page print, in order; files that the page says to write are written first."""
    printed = []
    if page.name == "own-robot.md":
        own = bench / "build" / "own"
        own.mkdir(parents=True)
        for _, block in blocks(page, "toml"):
            if named := re.match(r"# (\S+\.toml)\n", block):
                (own / named[1]).write_text(block, encoding="utf-8")
    for line in commands(page):
        if excused(line, NOT_RUN):
            continue
        if excused(line, PARSED):
            _parser().parse_args(shlex.split(line)[1:])
            continue
        if " export " in line and shutil.which("cc") is None:
            pytest.skip("no C compiler: FMUs were not tried")
        if " sines --holdout " in line:
            os.chdir(bench)  # where the bags are, not the arm that is followed
        printed.append(run(line, capsys))
    return printed


def check_shown(text, said):
    """Every line of output that a page shows is what came out today; ``...`` stands for what is left out."""
    blocks = re.findall(r"^```(?:text\n|console\n\$ [^\n]*\n)(.*?)^```", text, re.MULTILINE | re.DOTALL)
    shown = [line for block in blocks for line in block.splitlines() if line.strip() != "..."]
    assert len(shown) > 5
    came = [numbered(line) for line in said.splitlines()]
    for line in shown:
        words, numbers = numbered(line.removesuffix("..."))
        near = [n[: len(numbers)] for w, n in came if (w.startswith(words) if line.endswith("...") else w == words)]
        assert any(numbers == pytest.approx(n, rel=0.02, abs=0.3) for n in near), f"is not what comes out: {line}"


def examples():
    for page in PAGES:
        if page.name not in NOT_RUN_PYTHON:
            for k, (_, code) in enumerate(blocks(page, "python")):
                yield pytest.param(code, id=f"{page.name}-{k}")


@pytest.mark.parametrize("code", list(examples()))
def test_every_python_example_runs(code, bench, capsys):
    exec(compile(code, "example", "exec"), {})


@pytest.mark.parametrize("page", sorted(NOT_RUN_PYTHON))
def test_examples_that_are_not_run_are_python_and_import_what_there_is(page):
    found = blocks(DOCS / page, "python")
    assert found, f"{page}: has no example any more; take it off NOT_RUN_PYTHON"
    named = re.findall(r"`([\w/]+)\.py`", read(DOCS / page))
    own = {f"snarelab/{x}".replace("/", ".") for x in named if not (ROOT / f"{x}.py").exists()}
    for _, code in found:
        for node in ast.walk(ast.parse(code, page)):
            if isinstance(node, ast.ImportFrom) and node.module in own:
                continue  # of the file that the page gives
            if isinstance(node, ast.ImportFrom) and f"{node.module}".startswith("snarelab"):
                module = importlib.import_module(f"{node.module}")
                assert all(hasattr(module, name.name) for name in node.names), f"{page}: {ast.unparse(node)}"


def test_every_excuse_is_needed():
    every = [line for page in PAGES for line in commands(page)]
    for pattern in (*NOT_RUN, *PARSED):
        assert any(re.fullmatch(pattern, line) for line in every), f"{pattern}: no page has such a command"


def test_every_python_file_mentioned_exists():
    """``python bench/fmu.py`` in a sentence, ``python -m snarelab.fmu.shipped``: the file or module is there."""
    for page in PAGES:
        for inside in re.findall(r"`python ([^`]+)`", read(page)):
            words = inside.split()
            where = Path(words[1].removeprefix("snarelab.").replace(".", "/")) if words[0] == "-m" else Path(words[0])
            places = [ROOT / where, ROOT / where.with_suffix(".py"), ROOT / where / "__main__.py"]
            assert any(p.is_file() for p in places), f"{page.name}: python {inside}"
    assert snarelab.__version__
