"""The proof: conceal effects, seal the answers, let the tool name them, score what it says.

``python -m proof --cases 142 --workers 2 --seed 700004``, from the repository's root, with the package installed.
What is done is kept under ``build/proof`` and not done again: recordings as long as the generator is the same,
diagnoses as long as the tool is, rivals as long as they are.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from snarelab.files import written_whole

from . import oracle, rivals
from .cases import ROUND, Answer, draw, planned_cases
from .ending import status_of, tell
from .page import write_page
from .result import result, terminal
from .rival_columns import CUTOFF
from .score import score
from .seal import INPUTS, SEALED, BrokenSeal, Seal, digest, sha256, text, tool, write_json
from .seal import oracle as oracle_digest
from .seal import rivals as rivals_digest
from .third import left

SEED = 700004
"""The proof's own: 700001 to 700003 were, until their misses had been read. 90000 to 99999 is for work on the tool."""

FOLDER = Path("build/proof")
LONGEST = 1800.0  # s, then a diagnosis counts as none
Diagnosed = dict[str, Any]
Tell = Callable[[str], None]
T = TypeVar("T")


def record(seed: int, count: int, number: int, folder: Path) -> int:
    """Record a case, redrawing arms that cannot be; the attempt that could."""
    plan = planned_cases(count, seed)[number]
    for attempt in range(100):
        try:
            draw(plan, seed, number, attempt).write(folder)
            return attempt
        except ValueError:
            shutil.rmtree(folder)
    raise RuntimeError(f"case {number}: no arm could be recorded in 100 attempts")


def diagnose(folder: Path) -> Diagnosed:
    """The tool as a user starts it, in a process whose folder holds model and recordings, and which is alone there."""
    words = ["diagnose", "arm.toml", "train.csv", "--holdout", "hold.csv", "--json", "-", "--save-model", "found.toml"]
    keep = {name: os.environ[name] for name in ("PATH", "HOME", "PYTHONPATH", "TMPDIR") if name in os.environ}
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    start = time.perf_counter()
    try:
        with tempfile.TemporaryDirectory() as alone:
            for name in INPUTS:
                shutil.copy(folder / name, alone)
            # The third recording is not in this folder.
            done = subprocess.run(
                [sys.executable, "-m", "snarelab.cli", *words],
                cwd=alone,
                env=keep | threads,
                capture_output=True,
                text=True,
                timeout=LONGEST,
            )
            seconds = round(time.perf_counter() - start, 1)
            found = json.loads(done.stdout) if done.returncode == 0 else failed(done.stderr.strip()[-300:])
            if done.returncode == 0:
                found["third"] = gained(folder, Path(alone) / "found.toml", found["band"]["value"])
    except subprocess.TimeoutExpired:
        found, seconds = failed(f"no answer within {LONGEST:g} s"), LONGEST
    return found | {"seconds": seconds}


def gained(folder: Path, model: Path, band: float) -> dict[str, list[float]]:
    """RMS on the third recording by channel: of a fit without a name, and of the model that was found, where there is
    one."""
    before = left(folder, folder / "arm.toml", band, refit=True)
    after = left(folder, model, band, refit=False) if model.exists() else before
    return {channel: [before[channel], after[channel]] for channel in before}


def failed(why: str) -> Diagnosed:
    """What stands for a diagnosis that the tool could not make; it is scored as any other, and never right."""
    none = {"verdict": "failed", "effects": [], "fit": {}, "third": {}, "candidates": [], "band": {"value": 10.0}}
    return none | {"notes": [why]}


def prepare(count: int, seed: int, pool: Executor, tell: Tell, folder: Path) -> tuple[list[Answer], list[Path], Seal]:
    """Recordings on the disk, answers in memory, and the seal on both; what was sealed before is checked."""
    folders = [folder / "recordings" / f"{k:04}" for k in range(count)]
    seal = Seal.read(folder / "sealed.json")
    new = Seal.make([], [], [], seed)
    plan = planned_cases(count, seed)
    if seal is None or (seal.generator, seal.seed, seal.cases) != (new.generator, seed, count):
        (folder / "sealed.json").unlink(missing_ok=True)
        shutil.rmtree(folder / "recordings", ignore_errors=True)
        jobs = {pool.submit(record, seed, count, k, path): k for k, path in enumerate(folders)}
        attempts = [0] * count
        for done, job in enumerate(as_completed(jobs), 1):
            attempts[jobs[job]] = job.result()
            tell(f"recorded {done}/{count}")
        answers = [draw(plan[k], seed, k, attempts[k]).answer for k in range(count)]
        seal = Seal.make(answers, attempts, folders, seed)
        seal.write(folder / "sealed.json")
    else:
        answers = [draw(plan[k], seed, k, seal.attempts[k]).answer for k in range(count)]
    (folder / "answers.json").unlink(missing_ok=True)
    if sha256(text(answers)) != seal.answers or digest(f / n for f in folders for n in SEALED) != seal.recordings:
        raise BrokenSeal(f"{folder}: answers or recordings are not those sealed at {seal.time}; delete the folder")
    tell(f"answers sealed at {seal.time}, SHA-256 {seal.answers}")
    return answers, folders, seal


def fill(
    path: Path, version: str, items: Sequence[T], run: Callable[[T], Diagnosed], pool: Executor, tell: Tell
) -> list[Diagnosed]:
    """``run`` on every item, but for those that ``path`` has a line of with this version; all, in order."""
    lines = path.read_text().splitlines(keepends=True) if path.exists() else []
    kept = [line for line in lines if line.endswith("\n") and json.loads(line)["version"] == version]
    with written_whole(path) as part:
        part.write_text("".join(kept))  # without what other sources made, and without half a line of a run stopped
    done = {record["case"]: record["found"] for record in map(json.loads, kept)}
    with path.open("a") as file:
        jobs = {pool.submit(run, item): k for k, item in enumerate(items) if k not in done}
        for job in as_completed(jobs):
            k = jobs[job]
            done[k] = job.result()
            file.write(json.dumps({"case": k, "version": version, "found": done[k]}) + "\n")
            file.flush()
            tell(f"{path.stem} {len(done)}/{len(items)}: case {k}, {done[k].get('seconds', 0.0):.0f} s")
    return [done[k] for k in range(len(items))]


def prove(
    count: int,
    seed: int,
    pool: Executor,
    *,
    folder: Path = FOLDER,
    tell: Tell = print,
    run: Callable[[Path], Diagnosed] = diagnose,
) -> dict[str, Any]:
    """The whole proof; what `result.json` holds."""
    start = time.perf_counter()
    answers, folders, seal = prepare(count, seed, pool, tell, folder)
    sources = tool()
    by_tool = fill(folder / "diagnoses.jsonl", sources + seal.answers, folders, run, pool, tell)
    if tool() != sources:
        raise BrokenSeal(
            "the package's sources changed while it diagnosed; run again, and every diagnosis is made anew"
        )
    version = rivals_digest() + seal.answers
    by_rivals = fill(folder / "rivals.jsonl", version, folders, rivals.run, pool, tell)
    plan = planned_cases(count, seed)
    wanted = [
        oracle.Wanted(plan[k], seed, k, seal.attempts[k], (d["band"]["value"], CUTOFF) if a.truths else ())
        for k, (a, d) in enumerate(zip(answers, by_tool, strict=True))
    ]
    oracles = fill(folder / "oracles.jsonl", sources + oracle_digest() + seal.answers, wanted, oracle.run, pool, tell)
    own, theirs = ([o["over_floor"][i] if o["over_floor"] else {} for o in oracles] for i in (0, 1))
    (folder / "answers.json").write_text(text(answers))
    methods = {"snarelab": by_tool} | {name: [r[name] for r in by_rivals] for name in rivals.NAMES}
    scores = {name: score(answers, d, own if name == "snarelab" else theirs) for name, d in methods.items()}
    content = result(scores, seal, time.perf_counter() - start, [d["seconds"] for d in by_tool])
    write_json(folder / "result.json", content)
    write_page(folder / "report.html", answers, scores, seal, content, by_tool)
    tell(terminal(scores))
    return content


def main() -> int:
    """Read the arguments, prove, say where the page is."""
    parser = argparse.ArgumentParser(prog="python -m proof", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=len(ROUND))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    given = parser.parse_args()

    def run() -> None:
        with ProcessPoolExecutor(given.workers, get_context("spawn")) as pool:
            prove(given.cases, given.seed, pool, folder=given.folder, tell=tell)
        tell(f"page: {given.folder / 'report.html'}\nnumbers: {given.folder / 'result.json'}")

    return status_of(run, (BrokenSeal,), refused=1)
