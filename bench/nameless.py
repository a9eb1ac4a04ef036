"""How many laws without a name are seen, on what they hang, and how far a table for them closes the error.

``python bench/nameless.py [--seeds 1 2] [--sizes 1 2 4] [--only WORD] [--out FILE.jsonl]``. Twenty-four laws
(`bench/nameless_laws.py`), once, twice and four times the disturbance beside the nearest named laws: twelve in MuJoCo's
arms as the proof draws them (`proof/cases.py`), twelve on published arms along recorded residuals (`proof/played`). A
line a case is kept as it is made, and not made again with the same sources; the table at the end counts all lines.

Seen: a table for the law's joint, or a curve over something there, or the verdict ``unknown_effect`` with its channel
in the description. Coordinates right: those that are told first are the law's, the direction of motion aside. Closure:
(before - after) / (before - oracle) of the channel's error on a third recording, with the model as it was fitted
without a name, with the model that was found, and, the oracle, with the same fit on the same arm without the law. A
name that is true of neither the law nor the arm counts as a wrong one.
"""

import argparse
import json
import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np

from bench.concealed import Concealed, Planned, Rng
from bench.nameless_laws import PLAYED, STEPPED, Nameless, State
from proof.cases import draw
from proof.concealed import multiple
from proof.drives.score import sources
from proof.outside import SMOOTH, sized
from proof.played import cases as played
from proof.played.machine import Drive, Extra
from proof.played.motions import STEP
from proof.run import diagnose
from proof.statistics import clopper_pearson
from proof.third import left

OUT = Path("build/bench/nameless.jsonl")
SIZES, MOST, ATTEMPTS = (1.0, 2.0, 4.0), 1e4, 100
BARS = {1.0: 0.60, 2.0: 0.85, 4.0: 0.95}
KINDS = (*STEPPED, *PLAYED)
Case = dict[str, Any]


def stepped(kind: Nameless) -> Callable[[Planned, float, Rng], Concealed]:
    """A law as a maker of the proof's: at every step of MuJoCo's."""

    def make(m: Planned, rms: float, rng: Rng) -> Concealed:
        k, other = m.joint, neighbour(m.joint)
        time = m.period * np.arange(len(m.q))

        def state(t: Any, q: Any, qd: Any, direction: Any) -> State:
            return {
                "q": q[..., k],
                "qd": qd[..., k],
                "direction": direction,
                "q_of": q[..., other],
                "qd_of": qd[..., other],
                "time": t,
            }

        whole = state(time, m.q, m.qd, np.sign(m.own[1]))
        law = kind.draw(whole, rng)
        size = sized(m, law(whole), rms, MOST)
        multiple(size * law(whole), rms, 5.0)
        unit = np.eye(m.q.shape[1])[k]

        def torque(t: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
            return size * float(law(state(t, q, qd, np.tanh(qd[k] / SMOOTH)))) * unit

        return Concealed(m.name, size, plant={"laws": (torque,)})

    return make


def along(kind: Nameless) -> Callable[[Drive, int, Rng], Extra]:
    """A law as one of the played machines'."""

    def make(d: Drive, k: int, rng: Rng) -> Extra:
        other = neighbour(k)

        def state(e: Drive) -> State:
            return {
                "q": e.q[:, k],
                "qd": e.qd[:, k],
                "direction": e.direction[:, k],
                "load": e.load[:, k],
                "q_of": e.q[:, other],
                "qd_of": e.qd[:, other],
                "load_of": e.load[:, other],
                "time": STEP * np.arange(len(e.q)),
            }

        law = kind.draw(state(d), rng)
        return lambda e: law(state(e))

    return make


def neighbour(k: int) -> int:
    """The other joint that a law hangs on."""
    return k - 1 if k else 1


def in_mujoco(kind: Nameless, size: float, seed: int, number: int, folder: Path, twin: Path) -> tuple[int, str]:
    """Record an arm in MuJoCo, with a law and without; joint (from 0) and channel that have it."""
    plan, makers = ("outside", (kind.name,), size), {kind.name: stepped(kind)}
    for attempt in range(ATTEMPTS):
        case = draw(plan, seed, number, attempt, makers)
        try:
            case.write(folder)
            replace(case, plant=case.twin, model=case.twin_model).write(twin)
        except ValueError:
            continue
        return case.planned[0].joint, case.answer.channels[0]
    raise ValueError(f"{kind.name} {size:g}x, seed {seed}: no arm could be recorded in {ATTEMPTS} attempts")


def on_played(kind: Nameless, size: float, seed: int, number: int, folder: Path, twin: Path) -> tuple[int, str]:
    """Record a published arm beside recorded residuals, with a law and without; joint and channel that have it."""
    plan, makers = played.Plan(played.LAWLESS, ((kind.name, size),)), {kind.name: along(kind)}
    attempt = played.write(plan, seed, number, folder, makers)
    played.write(replace(plan, concealed=((kind.name, 0.0),)), seed, number, twin, makers, attempt)
    channel = json.loads((folder / "truth.json").read_text())["effects"][0]["channel"]
    return int(channel.removeprefix("tau.joint")) - 1, channel


def run(kind: Nameless, size: float, seed: int) -> Case:
    """Record, diagnose and score one case."""
    number = KINDS.index(kind)
    with tempfile.TemporaryDirectory() as name:
        folder, twin = Path(name) / "case", Path(name) / "twin"
        record = in_mujoco if kind in STEPPED else on_played
        joint, channel = record(kind, size, seed, number, folder, twin)
        found = diagnose(folder)
        truth = folder / "truth.json"
        # A published arm's URDF is off: a link's mass is told rightly there.
        background = json.loads(truth.read_text())["background"] if truth.exists() else []
        least = left(twin, twin / "arm.toml", found["band"]["value"], refit=True)
    other = f"joint{neighbour(joint) + 1}"
    right = sorted(x.replace(" of other", f" of {other}") for x in kind.over)
    third = found["third"].get(channel)
    return {
        "kind": kind.name,
        "size": size,
        "seed": seed,
        "channel": channel,
        "over": right,
        "verdict": found["verdict"],
        "told": [list(x) for x in told(found, channel)],
        "named": [[e["name"], e["at"]] for e in found["effects"] if e["name"] != "empirical"],
        "background": background,
        "seen": seen(found, channel),
        "closure": None if third is None else (third[0] - third[1]) / (third[0] - least[channel]),
        "gap": None if third is None else third[0] / least[channel],
        "seconds": found["seconds"],
    }


def seen(found: Mapping[str, Any], channel: str) -> bool:
    """Whether something without a name is told on a channel."""
    return bool(told(found, channel)) or (
        found["verdict"] == "unknown_effect" and channel in found.get("description", "")
    )


def told(found: Mapping[str, Any], channel: str) -> list[tuple[str, ...]]:
    """Coordinates of the tables and curves of a channel, as they are told."""
    tables = [t["coordinates"] for t in found.get("empirical", []) if f"tau.{t['at']}" == channel]
    text = re.findall(r"on (\S+), a smooth curve over (.*?) still explains", found.get("description", ""))
    curves = [coordinates(words) for on, words in text if on == channel]
    return [tuple(sorted(x)) for x in dict.fromkeys(tuple(sorted(t)) for t in [*tables, *curves])]


def coordinates(words: str) -> list[str]:
    """Coordinates in the words of a curve: "position and position of joint3 by direction, fine"."""
    plain = re.sub(r", (narrow|fine)| by direction| when (driving|braking)", "", words)
    return [x for part in plain.split(" and ") for x in part.split(" by ")]


def summary(lines: Sequence[Case]) -> str:
    """The figures of all cases, as a table."""
    rows = [f"{'figure':<46}{'bar':>6}{'value':>8}{'n':>5}  95 %"]

    def share(name: str, bar: float | None, hits: Sequence[bool]) -> None:
        if hits:
            low, high = clopper_pearson(sum(hits), len(hits))
            of = f"{100 * bar:.0f} %" if bar else ""
            value = f"{100 * sum(hits) / len(hits):.0f} %"
            rows.append(f"{name:<46}{of:>6}{value:>8}{len(hits):>5}  {100 * low:.0f} to {100 * high:.0f} %")

    for size in sorted({x["size"] for x in lines}):
        own = [x for x in lines if x["size"] == size]
        share(f"{size:g}x: seen", BARS.get(size), [x["seen"] for x in own])
        share(
            f"{size:g}x: a wrong name", None, [any(name not in x["background"] for name, _ in x["named"]) for x in own]
        )
    some = [x for x in lines if x["told"]]
    share("coordinates right, of those with a curve", 0.8, [sorted(x["told"][0]) == x["over"] for x in some])
    share("one coordinate of them right", None, [bool({*x["told"][0]} & {*x["over"]}) for x in some])
    # Where the law leaves nothing to close on the third recording, a share of it says nothing.
    closed = [x["closure"] for x in some if x["closure"] is not None and x["gap"] > 1.02]
    for name, bar, value in (("median", 0.8, np.median), ("worst", 0.5, np.min)):
        if closed:
            rows.append(f"{'closure on the third recording, ' + name:<46}{bar:>6}{value(closed):>8.2f}{len(closed):>5}")
    return "\n".join(rows)


def main() -> int:
    """Read the arguments, run what is not there yet, print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--sizes", type=float, nargs="+", default=list(SIZES))
    parser.add_argument("--only", default="", help="laws whose name holds this")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    version = sources()
    lines = [json.loads(x) for x in given.out.read_text().splitlines()] if given.out.exists() else []
    lines = [x for x in lines if x["version"] == version]
    done = {(x["kind"], x["size"], x["seed"]) for x in lines}
    wanted = [(s, k, x) for s in given.seeds for x in given.sizes for k in KINDS if given.only in k.name]
    try:
        for n, (seed, kind, size) in enumerate(wanted, 1):
            if (kind.name, size, seed) in done:
                continue
            line = {"version": version, **run(kind, size, seed)}
            lines.append(line)
            with given.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            over = "; ".join(" and ".join(x) for x in line["told"])
            print(f"{n}/{len(wanted)} {kind.name} {size:g}x: {line['verdict']} [{over}] {line['named']}", flush=True)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here")
    print(summary(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
