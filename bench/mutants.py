"""Change the source at random places, one at a time, and count how often a test notices.

``python bench/mutants.py [--mutants 40] [--seed 1] [--workers 2] [FOLDER ...]`` over identification, cosim and models,
as they are in the last commit, so many changes of each. The whole tests run once under coverage, which also gives the
branch coverage and tells which tests reach which line. Then Cosmic Ray's operators change places drawn evenly from all
that can be changed in a folder, and of the tests that reach the line the shortest run, up to ``--minutes`` together:
those left out could only kill more. A mutant that no test reaches, or that all of them pass, survives; one that never
ends is killed. What is done is kept under ``build/mutants`` for the same commit's files, and not done again;
``result.json`` there has the shares.

Operators that a checker of types or an import would catch by itself (``<<`` for ``+``, ``is`` for ``==``) are left out.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue

sys.path.append(str(Path(__file__).resolve().parents[1]))

from bench.results import leave

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "mutants"
FOLDERS = ("identification", "cosim", "models")
_ARITHMETIC = ("Add", "Sub", "Mul", "Div", "Pow")
_ORDER = ("Eq", "NotEq", "Lt", "LtE", "Gt", "GtE")
OPERATORS = (
    *(f"ReplaceBinaryOperator_{a}_{b}" for a in _ARITHMETIC for b in _ARITHMETIC if a != b),
    *(f"ReplaceComparisonOperator_{a}_{b}" for a in _ORDER for b in _ORDER if a != b),
    *("ReplaceUnaryOperator_Delete_USub", "ReplaceUnaryOperator_Delete_Not", "AddNot", "NumberReplacer"),
    *("ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ExceptionReplacer", "ZeroIterationForLoop"),
)

_COVERAGE = """
[run]
branch = true
source = .
patch = subprocess, _exit
parallel = true
[report]
omit = */tests/*, */bench/*, */proof/*, */docs/*
exclude_also = ^@compiled
"""
"""Functions that numba compiles are run by no interpreter, and so seen by no tracer: they are left out."""


@dataclass(frozen=True)
class Mutant:
    """A change: Cosmic Ray's operator at its ``occurrence``-th place in a file, on this line."""

    path: str
    operator: str
    occurrence: int
    line: int

    def text(self) -> str:
        """The file with the change."""
        from cosmic_ray.mutating import mutate_code  # pyright: ignore[reportMissingImports]
        from cosmic_ray.plugins import get_operator  # pyright: ignore[reportMissingImports]

        changed = mutate_code(committed(self.path), get_operator(f"core/{self.operator}")(), self.occurrence)
        assert changed is not None
        return changed


def git(*words: str) -> str:
    """What git says of this repository."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def committed(path: str) -> str:
    """A file of the last commit."""
    return git("show", f"HEAD:{path}") + "\n"


def lay_out(name: str) -> Path:
    """A clone of the repository as package ``snarelab``, with what lies beside it; the clone's path."""
    home = FOLDER / name
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    git("clone", "--quiet", str(ROOT), str(home / "snarelab"))
    if (ROOT.parent / "shared").exists():
        (home / "shared").symlink_to(ROOT.parent / "shared")
    return home / "snarelab"


def pytest(tree: Path, words: Sequence[str], timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    """The tests of a copy, which import that copy."""
    environment = os.environ | {"PYTHONPATH": str(tree.parent), "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    return subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=timeout)


def measure(tree: Path, workers: int, tests: Sequence[str]) -> None:
    """Run these tests, or all, once under coverage; raises SystemExit where pytest does not come to an end."""
    (tree / ".coveragerc").write_text(_COVERAGE)
    words = ["-n", str(workers), "--junitxml", str(FOLDER / "times.xml"), "--cov", "--cov-config", ".coveragerc"]
    words += ["--cov-context", "test", "--cov-report", "json", *tests]
    print("the tests, under coverage ...", flush=True)
    done = pytest(tree, words)
    if done.returncode > 1:
        raise SystemExit(done.stdout[-3000:] + done.stderr[-1000:])
    for line in done.stdout.splitlines():
        if line.startswith("FAILED"):
            print(f"{line}; under coverage at least, and it kills no mutant", flush=True)
    shutil.copy(tree / ".coverage", FOLDER / "coverage")
    shutil.copy(tree / "coverage.json", FOLDER / "coverage.json")


def times() -> dict[str, float]:
    """Seconds of every test that passed, by its name in contexts."""
    found = {}
    for case in ET.parse(FOLDER / "times.xml").getroot().iter("testcase"):
        if case.find("failure") is not None or case.find("error") is not None:
            continue
        parts = case.attrib["classname"].split(".")
        found[f"{'/'.join(parts[:2])}.py::{'::'.join([*parts[2:], case.attrib['name']])}"] = float(case.attrib["time"])
    return found


def reaching(tree: Path) -> dict[str, dict[int, set[str]]]:
    """Tests that reach each line of each file; what is reached as a module is imported, by all tests of that module."""
    import coverage  # pyright: ignore[reportMissingImports]

    data = coverage.CoverageData(str(FOLDER / "coverage"))
    data.read()
    found: dict[str, dict[int, set[str]]] = {}
    for path in data.measured_files():
        lines = {k: {c.partition("|")[0] for c in some} for k, some in data.contexts_by_lineno(path).items()}
        every = set().union(*lines.values()) - {""}
        found[str(Path(path).relative_to(tree))] = {k: (some - {""}) or every for k, some in lines.items()}
    return found


def draw(count: int, seed: int, folders: Sequence[str]) -> list[Mutant]:
    """Places drawn evenly from all that can be changed, and there one of the changes."""
    from cosmic_ray.ast import ast_nodes, get_ast  # pyright: ignore[reportMissingImports]
    from cosmic_ray.plugins import get_operator  # pyright: ignore[reportMissingImports]

    places: dict[tuple[str, tuple[int, int]], list[Mutant]] = {}
    for name in git("ls-files", *(f"{folder}/*.py" for folder in folders)).splitlines():
        nodes = list(ast_nodes(get_ast(committed(name))))
        for operator in OPERATORS:
            made = get_operator(f"core/{operator}")()
            starts = [start for node in nodes for start, _ in made.mutation_positions(node)]
            for k, start in enumerate(starts):
                places.setdefault((name, start), []).append(Mutant(name, operator, k, start[0]))
    rng = random.Random(seed)
    return [rng.choice(places[at]) for at in rng.sample(sorted(places), min(count, len(places)))]


def tried(mutant: Mutant, tree: Path, tests: Sequence[str], limit: float) -> str:
    """``killed``, ``survived`` or ``not reached``."""
    if not tests:
        return "not reached"
    whole = (tree / mutant.path).read_text()
    (tree / mutant.path).write_text(mutant.text())
    try:
        status = pytest(tree, ["-x", *tests], timeout=3.0 * limit + 120.0).returncode
    except subprocess.TimeoutExpired:
        status = 1
    finally:
        (tree / mutant.path).write_text(whole)
    return "survived" if status == 0 else "killed"


def shortest(names: set[str], seconds: dict[str, float], limit: float) -> list[str]:
    """Of these tests the shortest, as many as run within a time; one at least."""
    order = sorted((n for n in names if n in seconds), key=lambda n: seconds[n])
    total, chosen = 0.0, []
    for name in order:
        total += seconds[name]
        if chosen and total > limit:
            break
        chosen.append(name)
    return chosen


def killed(ended: Mapping[Mutant, str], folders: Sequence[str]) -> dict[str, float]:
    """``killed.FOLDER``: the share of a folder's mutants that a test noticed; folders without a mutant are left out."""
    own = {f: [end == "killed" for m, end in ended.items() if m.path.startswith(f"{f}/")] for f in folders}
    return {f"killed.{f}": sum(hits) / len(hits) for f, hits in own.items() if hits}


def main() -> int:
    """Measure, draw, try, count."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="*", default=FOLDERS, metavar="FOLDER")
    parser.add_argument("--mutants", type=int, default=40, help="of each folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--tests", nargs="*", default=(), metavar="FILE", help="files of tests (default: all)")
    given = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    version, whole = " ".join([git("rev-parse", "HEAD^{tree}"), *given.tests]), lay_out("whole")
    if not (FOLDER / "version").exists() or (FOLDER / "version").read_text() != version:
        measure(whole, given.workers, given.tests)
        (FOLDER / "version").write_text(version)
    totals = json.loads((FOLDER / "coverage.json").read_text())["totals"]
    share = [totals[f"percent_{what}_covered"] for what in ("branches", "statements")]
    print(f"covered: {share[0]:.1f} % of branches, {share[1]:.1f} % of lines, but for what numba compiles", flush=True)
    reach, seconds = reaching(whole), times()
    trees: SimpleQueue[Path] = SimpleQueue()
    for k in range(given.workers):
        trees.put(lay_out(f"tree{k}"))
    log = FOLDER / "mutants.jsonl"
    lines = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {json.dumps(x["mutant"]): x["end"] for x in lines if x["version"] == version}
    mutants = [m for folder in given.folders for m in draw(given.mutants, given.seed, [folder])]

    def run(mutant: Mutant) -> str:
        tree = trees.get()
        try:
            tests = shortest(reach.get(mutant.path, {}).get(mutant.line, set()), seconds, 60.0 * given.minutes)
            return tried(mutant, tree, tests, 60.0 * given.minutes)
        finally:
            trees.put(tree)

    ended = {m: done[key] for m in mutants if (key := json.dumps(asdict(m))) in done}
    with ThreadPoolExecutor(given.workers) as pool, log.open("a") as file:
        jobs = {pool.submit(run, m): m for m in mutants if json.dumps(asdict(m)) not in done}
        for job in as_completed(jobs):
            mutant = jobs[job]
            ended[mutant] = end = job.result()
            file.write(json.dumps({"version": version, "mutant": asdict(mutant), "end": end}) + "\n")
            file.flush()
            print(f"{len(ended)}/{len(mutants)} {end}: {mutant.path}:{mutant.line} {mutant.operator}", flush=True)
    found = killed(ended, given.folders)
    for folder in given.folders:
        ends = Counter(end for m, end in ended.items() if m.path.startswith(f"{folder}/"))
        text = f"{100.0 * found[f'killed.{folder}']:.0f} %; {dict(ends)}"
        print(f"{folder}: {ends['killed']} of {ends.total()} killed, {text}")
    leave(FOLDER / "result.json", found | {"branch_coverage": share[0] / 100.0})
    return 0


if __name__ == "__main__":
    sys.exit(main())
