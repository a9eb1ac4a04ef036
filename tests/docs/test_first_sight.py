"""What someone who is new meets first: README, words, what `make demo` installs and where it leaves its report."""

import ast
import re
import subprocess
import tomllib
from dataclasses import replace

import pytest
from diagnoses import VERDICTS
from documentation import DOCS, PAGES, README, ROOT, read

from snarelab import __version__
from snarelab.errors import InputError
from snarelab.identification.diagnose import Answer
from snarelab.models.model_file import load_model
from snarelab.studies import emps

OTHER_WORDS = re.compile(
    r"fitted recording|recordings? held out|\bhold-out\b|never seen|no fit has seen|\bheld out (?:recording|data)|"
    r"locked[- ]away recording|\btest set\b|validation (?:set|recording)",
    re.IGNORECASE,
)
"""A recording is one of training, or held-out: no third word for either."""
EXPLAINED = "recording that no fit has seen"
"""What the README says once, to explain the word."""


def test_the_first_picture_is_a_result_with_the_numbers_of_the_first_command():
    text = read(README)
    (alternative, target), *_ = re.findall(r"!\[([^\]]*)\]\(([^)]*)\)", text)
    assert target == "docs/first-result.svg"
    assert target.removeprefix("docs/") in read(DOCS / "make_figure.py")
    fallen = re.search(r"falls from ([\d.]+ %) to ([\d.]+ %)", alternative)
    assert fallen
    assert f"the held-out recording falls from {fallen[1]} to {fallen[2]}." in text


def test_the_readme_says_why_the_name_how_to_cite_to_ask_and_to_contribute():
    text = " ".join(read(README).split())
    assert "(A snare is" in text
    for head in ("Two commands", "What it can find", "What it cannot", "Beside other tools", "Cite, ask, contribute"):
        assert f"## {head}" in text
    for file in ("CITATION.cff", "CONTRIBUTING.md", "Containerfile"):
        assert (ROOT / file).is_file()
        assert f"`{file}`" in text
    cited = read(ROOT / "CITATION.cff")
    assert f"\nversion: {__version__}\n" in cited
    assert "\nlicense: Apache-2.0\n" in cited


def words_of(tree):
    """Every text of a module that is no docstring."""
    spoken = {id(x.value) for x in ast.walk(tree) if isinstance(x, ast.Expr) and isinstance(x.value, ast.Constant)}
    return [x.value for x in ast.walk(tree) if isinstance(x, ast.Constant) and id(x) not in spoken]


def test_training_and_held_out_are_the_only_words_for_the_two_kinds_of_recording():
    folders = ("identification", "report", "studies", "recordings", "checks")
    files = [ROOT / "cli.py", *(path for folder in folders for path in (ROOT / folder).rglob("*.py"))]
    said = [(f.name, text) for f in files for text in words_of(ast.parse(read(f))) if isinstance(text, str)]
    said += [(page.name, " ".join(read(page).split()).replace(EXPLAINED, "")) for page in PAGES]
    found = [(name, match[0]) for name, text in said for match in OTHER_WORDS.finditer(text)]
    assert found == []
    assert len(said) > 1000


def test_the_demo_installs_no_tool_for_developers():
    """Its recipe makes what the core asks for and the package, and nothing of any extra."""
    made = subprocess.run(["make", "-n", "-B", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "needed.txt" in made
    assert "wanted.txt" not in made
    assert made.count("-m pip install") == 2
    core = tomllib.loads(read(ROOT / "pyproject.toml"))["project"]["dependencies"]
    heavy = ("exudyn", "numba", "fmpy", "pyarrow", "scikit-learn", "playwright", "mujoco", "pyright", "pytest")
    assert not {re.split(r"[<>=]", line)[0] for line in core} & {*heavy}


def test_without_the_servos_recordings_the_demo_leaves_its_report_under_another_name(tmp_path, monkeypatch, capsys):
    def nowhere(name):
        raise InputError(f"{name}: nowhere")

    found = replace(VERDICTS["missing_physics"]())
    monkeypatch.setattr(emps, "find_recording", nowhere)
    monkeypatch.setattr(emps, "diagnose", lambda model, *_, **__: Answer(found, load_model(model.path)))
    monkeypatch.chdir(tmp_path)
    assert emps.main() == 0
    assert "A bundled recording of a three-joint arm is diagnosed instead" in capsys.readouterr().out
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    names = {"model.toml", "diagnosis.json", "report.html", "result.json"}
    assert {f"build/studies/bundled/{name}" for name in names} <= left
    assert not [name for name in left if "/emps/" in name]


@pytest.mark.parametrize("page", [README, DOCS / "own-robot.md"], ids=lambda page: page.name)
def test_what_is_installed_is_said_with_its_extras(page):
    text = read(page)
    assert "pip install ." in text
    assert "'.[formats]'" in text
