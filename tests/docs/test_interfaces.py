"""What scripts of others are written against (`INTERFACES.md`, beside the repository) is there, and on the pages."""

import argparse
import json
import re

import pytest
from arm_commands import arguments
from diagnoses import spelt
from documentation import DOCS, read
from real_recordings import shared

from snarelab.cli import _parser, main
from snarelab.identification.checks.kinds import kinds
from snarelab.models.effects import effects
from snarelab.models.empirical import NAME

TO_COME = {"compare": set(), "verify": set(), "diagnose": {"--patch-model"}}
"""Commands and options that the page promises and no version has had; what comes leaves this list."""
PARAMETERS = {"stiffness"}
"""Of an effect, keys of its `parameters`."""


@pytest.fixture(scope="module")
def interfaces():
    return read(shared("INTERFACES.md"))


def section(page, head):
    return page[page.index(f"\n## {head}\n") :].split("\n## ", 2)[1]


def keys_shown(text):
    return set(re.findall(r'"(\w+)":', text)) - PARAMETERS


def keys(value):
    if isinstance(value, list):
        return set().union(*map(keys, value))
    return set(value).union(*map(keys, value.values())) if isinstance(value, dict) else set()


def described(page):
    return set(re.findall(r"\w+", " ".join(re.findall(r"^\| (`[^|]*`) \|", page, re.MULTILINE))))


def test_keys_of_an_identification_remain(interfaces, arm_folder):
    assert main(arguments("identify")) == 0
    named = keys_shown(section(interfaces, "Identification (JSON)"))
    assert {"parameters", "value", "relative"} <= named
    assert named <= keys(json.loads((arm_folder / "out.json").read_text()))
    assert named <= described(section(read(DOCS / "results.md"), "Identification (JSON)"))


def test_keys_of_a_diagnosis_remain(interfaces):
    own = section(interfaces, "Diagnosis (JSON)")
    block, said = own.split("```json\n")[1].split("```\n")
    assert {"verdict", "rivals", "noise_floor"} <= keys_shown(block)
    assert keys_shown(block) <= keys(spelt("x_name").to_json())
    page = read(DOCS / "results.md")
    assert keys_shown(block) <= described(section(page, "Diagnosis (JSON)"))
    # Of `checks`, which stand in both results, and what an answer has besides.
    assert {"message", "mend"} <= keys_shown(said)
    assert keys_shown(said) | {"checks", "description"} <= described(page)
    assert "`coordinates`" in page
    verdicts = set(re.findall(r"`(data_fault|missing_physics|adequate|unknown_effect)`", said))
    assert len(verdicts | {json.loads(block)["verdict"]}) == 4


def test_names_of_checks_remain(interfaces):
    (names,) = re.findall(r"names\n((?:`\w+` ?)+)\.", section(interfaces, "Diagnosis (JSON)"))
    named = set(re.findall(r"\w+", names))
    assert len(named) > 10
    assert named <= {kind.name for kind in kinds()}


def test_keys_of_a_study_remain(interfaces):
    named = keys_shown(section(interfaces, "Studies"))
    assert {"study", "quantities", "kind"} <= named
    assert named <= described(section(read(DOCS / "results.md"), "Studies"))


def test_names_of_effects_remain(interfaces):
    table = [line.split("|")[2] for line in section(interfaces, "Effects: the vocabulary").splitlines() if "|" in line]
    named = set(re.findall(r"`(\w+)`", " ".join(table)))
    assert len(named) > 40
    assert named <= {*effects(), NAME}


def test_commands_and_their_options_remain(interfaces):
    (commands,) = (a.choices for a in _parser()._actions if isinstance(a, argparse._SubParsersAction))
    known = {name: {o for a in p._actions for o in a.option_strings} for name, p in commands.items()}
    lines = re.findall(r"^snarelab (\w+) (.*)$", section(interfaces, "Commands"), re.MULTILINE)
    promised = {name: set(re.findall(r"--[a-z-]+", rest.partition("#")[0])) for name, rest in lines}
    assert {"identify", "diagnose", "export"} <= set(promised)
    for name, options in promised.items():
        if name in known:
            assert options - known[name] == TO_COME.get(name, set()), name
    assert set(promised) - set(known) == set(TO_COME) - set(known) == {n for n, own in TO_COME.items() if not own}


def test_exit_statuses_remain(interfaces):
    promised = re.findall(r"(?:status |\. )(\d): ", section(interfaces, "Commands"))
    assert {"0", "1", "2"} <= set(promised)
    table = section(read(DOCS / "commands.md"), "Exit status")
    assert all(f"| {status} |" in table for status in promised)
