"""The ledger: what the tool says of every recording that a change of its method must not make worse.

    python bench/ledger.py [--cases 12] [--slow] [--only PREFIX ...] [--most SECONDS] [--compare OLD.json]

Verdict, names, places, values and held-out error of: the bundled arm, EMPS, KUKA, BAM, suspended arms of the rig study,
free-floating bases, pendulums clean and under a torque that wanders, and ``--cases`` cases each of both proofs'
development seeds; with ``--slow`` captures as well. Each answer is a line of ``build/bench/ledger.jsonl`` and is not
asked for again while the tool's sources are the same, so the bench may be stopped and gone on with. When all are there
they are written to ``bench/ledger.json``, which the repository keeps. ``--compare``: what moved since another one.
"""

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))

from bench.ledger_cases import Entry, entries
from bench.results import write_result
from proof.drives.score import sources
from snarelab.errors import InputError

Line = Mapping[str, Any]
STATE, KEPT = ROOT / "build/bench/ledger.jsonl", ROOT / "bench/ledger.json"
MOVED = {"probability": 0.05, "value": 0.02, "held out": 0.02}
"""What counts as moved: a probability by so much; a value by so much of itself; a held-out error likewise."""


def asked(
    wanted: Sequence[Entry],
    state: Path,
    version: str,
    *,
    most: float = float("inf"),
    tell: Callable[[str], None] = print,
) -> dict[str, Line]:
    """The answers by key, those of ``state`` that the same sources gave and those asked for now.

    Stops after ``most`` seconds, between two. What cannot be asked for, as its recording is not at hand, is told of,
    and kept out.
    """
    state.parent.mkdir(parents=True, exist_ok=True)
    lines = [json.loads(x) for x in state.read_text(encoding="utf-8").splitlines()] if state.exists() else []
    have = {x["key"]: x["said"] for x in lines if x["version"] == version}
    begun = time.perf_counter()
    for k, entry in enumerate(wanted, 1):
        if entry.key in have:
            continue
        if time.perf_counter() - begun > most:
            tell(f"{len(wanted) - k + 1} entries left; the same command goes on")
            break
        start = time.perf_counter()
        try:
            with tempfile.TemporaryDirectory() as folder:
                said = entry.ask(Path(folder))
        except InputError as error:
            tell(f"{k}/{len(wanted)} {entry.key}: cannot be asked: {error}")
            continue
        said = {"concealed": entry.concealed, **said, "seconds": round(time.perf_counter() - start, 1)}
        have[entry.key] = said
        with state.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": entry.key, "version": version, "said": said}) + "\n")
        tell(f"{k}/{len(wanted)} {row(entry.key, said)}")
    keys = {entry.key for entry in wanted}
    return {key: said for key, said in have.items() if key in keys}


def row(key: str, said: Line) -> str:
    """One answer as a line of the table."""
    names = ", ".join(f"{e['name']} at {e['at']} {e['probability']:.2f}" for e in said["effects"])
    before, after = (f"{100.0 * x:.2f}" if x is not None else "-" for x in said["held_out"])
    return f"{key:<34}{said['concealed'] or 'nothing':<34} {said['verdict']}: {names or '-'} ({before} -> {after} %)"


def summary(answers: Mapping[str, Line]) -> str:
    """Counts by group: the part of a key before its last stroke."""
    groups: dict[str, list[Line]] = {}
    for key, said in answers.items():
        groups.setdefault(key.rpartition("/")[0] or key, []).append(said)
    rows = [f"{'group':<34}{'n':>4}{'adequate':>10}{'unknown':>9}{'names':>7}{'seconds':>9}"]
    for group, some in groups.items():
        verdicts = [said["verdict"] for said in some]
        names = sum(len(said["effects"]) for said in some)
        counts = f"{verdicts.count('adequate'):>10}{verdicts.count('unknown_effect'):>9}{names:>7}"
        rows.append(f"{group:<34}{len(some):>4}{counts}{sum(said['seconds'] for said in some):>9.0f}")
    return "\n".join(rows)


def moved(old: Mapping[str, Line], new: Mapping[str, Line]) -> list[str]:
    """What changed between two ledgers, one line each."""
    found = [f"{key}: only in the old ledger" for key in old if key not in new]
    found += [f"{key}: new" for key in new if key not in old]
    for key in new:
        if key in old:
            found += [f"{key}: {words}" for words in _differences(old[key], new[key])]
    return found


def _differences(old: Line, new: Line) -> list[str]:
    found = []
    if old["concealed"] != new["concealed"]:
        return ["another case; the two cannot be compared"]
    if old["verdict"] != new["verdict"]:
        found.append(f"{old['verdict']} -> {new['verdict']}")
    before, after = ({(e["name"], e["at"]): e for e in said["effects"]} for said in (old, new))
    found += [f"no longer {name} at {at}" for name, at in before if (name, at) not in after]
    found += [
        f"now {name} at {at}, {e['probability']:.2f}" for (name, at), e in after.items() if (name, at) not in before
    ]
    for place, e in after.items():
        if place not in before:
            continue
        was, name = before[place], " at ".join(place)
        if abs(e["probability"] - was["probability"]) > MOVED["probability"]:
            found.append(f"{name}: probability {was['probability']:.2f} -> {e['probability']:.2f}")
        for key, (value, _) in e["values"].items():
            last = was["values"].get(key, [0.0])[0]
            if _apart(last, value, MOVED["value"]):
                found.append(f"{name}: {key} {last:.4g} -> {value:.4g}")
        if was["not_told_apart"] != e["not_told_apart"]:
            words = [", ".join(x["not_told_apart"]) or "nothing" for x in (was, e)]
            found.append(f"{name}: not told apart from {words[0]} -> {words[1]}")
    ends = [said["held_out"][1] for said in (old, new)]
    if None not in ends and _apart(ends[0], ends[1], MOVED["held out"]):
        found.append(f"held-out error {100 * ends[0]:.2f} -> {100 * ends[1]:.2f} %")
    for channel, error in new.get("held_out_mdeg", {}).items():
        last = old.get("held_out_mdeg", {}).get(channel, error)
        if _apart(last, error, MOVED["held out"]):
            found.append(f"held-out {channel} {last:.4g} -> {error:.4g} mdeg")
    return found


def _apart(a: float, b: float, share: float) -> bool:
    return abs(a - b) > share * max(abs(a), abs(b))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=12, help="of each proof's development seed")
    parser.add_argument("--slow", action="store_true", help="captures too: an hour")
    parser.add_argument("--only", nargs="+", default=[""], metavar="PREFIX", help="entries whose keys begin so")
    parser.add_argument("--most", type=float, default=float("inf"), metavar="SECONDS", help="stop after so long")
    parser.add_argument("--compare", type=Path, metavar="OLD.json", help="print what moved since")
    parser.add_argument("--out", type=Path, default=KEPT)
    given = parser.parse_args()
    old = json.loads(given.compare.read_text(encoding="utf-8"))["entries"] if given.compare else {}
    every = entries(given.cases, given.slow)
    wanted = [e for e in every if e.key.startswith(tuple(given.only))]
    version = sources()
    try:
        answers = asked(wanted, STATE, version, most=given.most, tell=lambda words: print(words, flush=True))
    except KeyboardInterrupt:
        print("stopped; the same command goes on where it was", file=sys.stderr)
        return 130
    ordered = {e.key: answers[e.key] for e in wanted if e.key in answers}
    print("\n".join(row(key, said) for key, said in ordered.items()), summary(ordered), sep="\n\n")
    if given.compare:
        of_these = {key: said for key, said in old.items() if key.startswith(tuple(given.only))}
        print("\nMoved:", *(moved(of_these, ordered) or ["nothing"]), sep="\n")
    if len(ordered) == len(every):
        # Without seconds: they hang on what else the machine does.
        kept = {key: {name: x for name, x in said.items() if name != "seconds"} for key, said in ordered.items()}
        write_result(given.out, {"tool": version, "entries": kept})
        print(f"\n{given.out}")
    else:
        print(f"\n{len(ordered)} of {len(every)} entries; {given.out} is written when all are there")
    return 0


if __name__ == "__main__":
    sys.exit(main())
