"""Figures of a registered run as scripts read them: ``build/proof/result.json``, in the form of a study's numbers.

Each stands as ``generator.figure``, and once more by its plain name, where it is the worst of the generators'. With a
rival's name before it, it is the rival's. The generator `played` is called ``replay`` there.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from snarelab.studies.outcome import Quantity

from .bars_table import LEFT_OUT
from .drives.table import Figure
from .registered_rivals import OWN

NAMES = {"played": "replay"}
AT_MOST = {
    "false_alarms": "clean: a false name",
    "unknown_on_clean": "clean: told that something has no name",
    "wrong_names": "wrong names a case",
    "calibration_error": LEFT_OUT,
    "calibration_error_of_the_map": "calibration error of names told",
}
AT_LEAST = {
    "name_at_0.5x": "single 0.5x: its name at its place",
    "name_at_1x": "single 1x: its name at its place",
    "name_at_2x": "single 2x and above: its name at its place",
    "place": "place right, of names that are told",
    "pairs": "pairs: both told, and nothing wrong besides",
    "triples": "three and four at once: all told, and nothing wrong besides",
    "unknown_recall": "laws without a name 2x and above: told as unknown",
    "faulty": "faulty recordings: told as a fault of the data",
    "not_blamed": "a parameter or a sensor is wrong: physics not blamed",
    "closure_median": "single, told rightly: closure on the third recording, median",
    "closure_worst": "single, told rightly: closure on the third recording, worst",
    "coverage": "true values of right names within two deviations",
    "brier_skill": "Brier skill of names told",
}

Figures = Mapping[str, Mapping[str, Any]]


def quantities(generators: Mapping[str, Figures], prefix: str = "") -> list[Quantity]:
    """Of one method: each figure of each generator, and the worst of them; "n/a" where nothing could be counted.

    Parameters
    ----------
    generators : mapping of str to mapping
        Figures by their words, each with ``value`` and, where it counts cases, ``interval``.
    prefix : str
        Before each name: ``rival.``.
    """
    found = []
    for name, words in {**AT_MOST, **AT_LEAST}.items():
        own = {g: figures[words] for g, figures in generators.items() if words in figures}
        found += [_quantity(f"{prefix}{NAMES.get(g, g)}.{name}", figure) for g, figure in own.items()]
        counted = [f for f in own.values() if f["value"] is not None]
        if own:
            worst = max if name in AT_MOST else min
            none: Mapping[str, Any] = {"value": None}
            found.append(_quantity(f"{prefix}{name}", worst(counted, key=lambda f: f["value"], default=none)))
    return found


def of_rivals(compared: Mapping[str, Mapping[str, Sequence[Figure]]]) -> dict[str, dict[str, Figures]]:
    """Figures by rival and generator, of `registered_rivals.compared`, which has them by generator and method."""
    found: dict[str, dict[str, Figures]] = {}
    for generator, methods in compared.items():
        for method, figures in methods.items():
            if method != OWN:
                own = {f.name: {"value": f.value, "cases": f.count, "interval": f.interval} for f in figures}
                found.setdefault(method, {})[generator] = own
    return found


def seen_at_limit(folder: Path) -> Quantity:
    """Share of effects of the size of the stated limit that were seen, of ``python -m proof.power``'s result there."""
    path = folder / "result.json"
    rows = json.loads(path.read_text(encoding="utf-8"))["effects"].get("all", []) if path.exists() else []
    row = next((r for r in rows if r["ratio"] == 1.0 and r["cases"]), None)
    figure = {"value": None} if row is None else {"value": row["seen"], "interval": row["seen_interval"]}
    return _quantity("seen_at_limit", figure)


def result(
    found: Mapping[str, Any], rivals: Mapping[str, Mapping[str, Figures]], power: Path, seconds: float
) -> dict[str, Any]:
    """What the file holds.

    Parameters
    ----------
    found : mapping
        As `register.result` gives it, with the figures of `left_out.of_files`.
    rivals : mapping of str to mapping
        Figures by rival and generator.
    power : Path
        Folder of ``python -m proof.power``; `seen_at_limit` is "n/a" where it holds no result.
    seconds : float
        That the command took, for what was still to be answered.
    """
    every = [*quantities(found["generators"]), seen_at_limit(power)]
    for rival, generators in rivals.items():
        every += quantities(generators, f"{rival}.")
    registered = found["registered"]
    return {
        "study": "proof",
        "command": "make proof HOURS=1",
        "seconds": round(seconds, 1),
        "quantities": [asdict(q) for q in every],
        "registered": {key: registered[key] for key in ("date", "commit", "cases", "seeds", "tool")},
    }


def _quantity(name: str, figure: Mapping[str, Any]) -> Quantity:
    low, high = figure.get("interval") or (None, None)
    value = figure["value"]
    return Quantity(name, "1", "n/a" if value is None else value, "reference", None, low, high)
