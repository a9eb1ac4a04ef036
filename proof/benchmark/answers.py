"""Answers of any tool: read from JSON, and every mistake told in one line."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .case_set import CaseSet

VERDICTS = ("adequate", "missing_physics", "unknown_effect", "data_fault")
NO_ANSWER = {"verdict": "failed", "effects": [], "seconds": 0.0}


def read_answers(path: Path, cases: CaseSet) -> tuple[str, dict[str, dict[str, Any]]]:
    """The tool's name, and its answer to each case in the form that `proof.drives.judge` judges.

    Raises
    ------
    ValueError
        What is wrong, where, and what is allowed.
    """
    try:
        given = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} cannot be read as JSON: {error}") from None
    if not isinstance(given, dict) or not isinstance(given.get("cases"), dict):
        raise ValueError(f'{path} has no "cases"; RULES.md of the set shows the form')
    known = cases.names()
    strange = sorted(set(given["cases"]) - set(known))
    if strange:
        raise ValueError(f'{path}: case "{strange[0]}" is not in the set; its cases are {known[0]} to {known[-1]}')
    names = {e["name"] for e in json.loads((cases.folder / "vocabulary.json").read_text(encoding="utf-8"))}
    answers = {}
    for case in known:
        where = f"{path}, case {case}"
        answers[case] = _answer(given["cases"][case], where, names) if case in given["cases"] else dict(NO_ANSWER)
    return str(given.get("tool", path.stem)), answers


def _answer(given: Any, where: str, names: set[str]) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise ValueError(f"{where}: {given!r} is no answer; give an object with a verdict and effects")
    verdict = given.get("verdict")
    if verdict not in VERDICTS:
        raise ValueError(f"{where}: verdict {verdict!r} is none of {', '.join(VERDICTS)}")
    effects = [_effect(e, f"{where}, effect {k + 1}", names) for k, e in enumerate(_list(given, "effects", where))]
    seconds = given.get("seconds", 0.0)
    if not _number(seconds) or seconds < 0:
        raise ValueError(f"{where}: seconds {seconds!r} is no time; give a number of 0 or more")
    return {"verdict": verdict, "effects": effects, "seconds": float(seconds)}


def _effect(given: Any, where: str, names: set[str]) -> dict[str, Any]:
    name, at = _place(given, where, names)
    alike = []
    for k, other in enumerate(_list(given, "alike", where)):
        own = f"{where}, alike {k + 1}"
        pair = _place(other, own, names)
        alike.append({"name": pair[0], "at": pair[1], "probability": _probability(other, own), "separable": False})
    values = given.get("values", {})
    for parameter, value in values.items() if isinstance(values, dict) else [("values", values)]:
        if not isinstance(value, dict) or not (_number(value.get("value")) and _number(value.get("std"))):
            raise ValueError(f'{where}: {parameter} is {value!r}; give {{"value": number, "std": number}}')
    return {
        "name": name,
        "at": at,
        "probability": _probability(given, where),
        "rivals": alike,
        "parameters": values,
    }


def _list(given: Mapping[str, Any], key: str, where: str) -> Sequence[Any]:
    found = given.get(key, [])
    if not isinstance(found, list):
        raise ValueError(f"{where}: {key} is {found!r}; give a list")
    return found


def _place(given: Any, where: str, names: set[str]) -> tuple[str, str]:
    if not isinstance(given, dict) or not isinstance(given.get("at"), str):
        raise ValueError(f"{where}: {given!r} has no name and place; give name and at")
    if given.get("name") not in names:
        raise ValueError(f"{where}: {given.get('name')!r} is not in vocabulary.json")
    if not any(x.isdigit() for x in given["at"]):
        raise ValueError(f'{where}: {given["at"]!r} is no place; give "joint2", "link2" or "tau.joint2"')
    return given["name"], given["at"]


def _probability(given: Mapping[str, Any], where: str) -> float:
    found: Any = given.get("probability")
    if not _number(found) or not 0.0 <= found <= 1.0:
        raise ValueError(f"{where}: probability {found!r} is not between 0 and 1")
    return float(found)


def _number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and x == x and abs(x) != float("inf")
