"""Halve and double every constant that decides, one at a time, and count how often a test of the decision fails.

``python bench/moved_constants.py [FILE ...] [--names NAME ...]``; by default ``identification/deciding.py``.

A constant is a name in capitals that a module sets to a number, or to a tuple of them; a tuple's numbers are moved
together. A constant of ``deciding.py`` is tried by the files of ``tests/identification/test_deciding_*.py`` that name
it, one of another module by the test files that import that module, so that a mutant costs seconds. Tests of the
documentation, which compare its tables with the source and so would notice any number, are not asked.
Lines are written to ``build/mutants/constants.jsonl`` as they come, and what was tried in one commit's files is not
tried again.
"""

import argparse
import ast
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.mutants import FOLDER, committed, git, lay_out, pytest
from bench.results import leave

DECIDING = "identification/deciding.py"
FACTORS = (0.5, 2.0)
LONGEST = 600.0
"""Then a mutant that never ends is killed [s]."""


@dataclass(frozen=True)
class Moved:
    """A constant of a file, and what it is multiplied by."""

    path: str
    name: str
    factor: float

    def text(self) -> str:
        """The file with the constant moved."""
        return moved(committed(self.path), self.name, self.factor)


def constants(text: str) -> list[str]:
    """Names in capitals that a module sets to numbers other than 0, once each, in order."""
    return [name for name, numbers in _found(text) if numbers]


def moved(text: str, name: str, factor: float) -> str:
    """A module's text with every number of a constant times a factor; whole numbers stay whole, and change.

    Raises
    ------
    KeyError
        The module sets no such constant.
    """
    numbers = dict(_found(text))[name]
    lines = text.splitlines(keepends=True)
    for node in sorted(numbers, key=lambda n: (n.lineno, n.col_offset), reverse=True):
        value = node.value
        assert isinstance(value, int | float)
        new = factor * value
        if isinstance(value, int):
            new = int(new) if int(new) != value else value + (1 if factor > 1 else -1)
        line = lines[node.lineno - 1].encode()  # columns are counted in bytes
        line = line[: node.col_offset] + repr(new).encode() + line[node.end_col_offset :]
        lines[node.lineno - 1] = line.decode()
    return "".join(lines)


def _found(text: str) -> list[tuple[str, list[ast.Constant]]]:
    found: dict[str, list[ast.Constant]] = {}
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            if name.isupper() and name not in found and _is_numeric(node.value):
                numbers = [n for n in ast.walk(node.value) if isinstance(n, ast.Constant) and n.value]
                found[name] = numbers
    return list(found.items())


def _is_numeric(node: ast.expr) -> bool:
    if isinstance(node, ast.Tuple):
        return bool(node.elts) and all(map(_is_numeric, node.elts))
    if isinstance(node, ast.UnaryOp):
        return _is_numeric(node.operand)
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def asked(path: str, name: str, root: Path) -> list[str]:
    """Files of tests that decide over a constant."""
    if path == DECIDING:
        files = sorted(root.glob("tests/identification/test_deciding_*.py"))
        return [str(f.relative_to(root)) for f in files if f'"{name}"' in f.read_text(encoding="utf-8")]
    module = "snarelab." + path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    files = [f for f in sorted(root.glob("tests/**/test_*.py")) if "docs" not in f.parts]
    return [str(f.relative_to(root)) for f in files if module in imported(f.read_text(encoding="utf-8"))]


def imported(text: str) -> set[str]:
    """Modules, and names that may be modules, which a file imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
    return found


def tried(mutant: Moved, tree: Path, tests: Sequence[str]) -> str:
    """``killed``, ``survived`` or ``no test``."""
    if not tests:
        return "no test"
    whole = (tree / mutant.path).read_text(encoding="utf-8")
    (tree / mutant.path).write_text(mutant.text(), encoding="utf-8")
    try:
        done = pytest(tree, ["-x", *tests], timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return "killed"
    finally:
        (tree / mutant.path).write_text(whole, encoding="utf-8")
    if done.returncode > 1:
        raise SystemExit(f"pytest did not run: {done.stdout[-2000:]}{done.stderr[-500:]}")
    return "survived" if done.returncode == 0 else "killed"


def main() -> int:
    """Try every constant that was not tried, and count."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", default=[DECIDING], metavar="FILE", help=f"of the sources ({DECIDING})")
    parser.add_argument("--names", nargs="+", default=[], metavar="NAME", help="of constants (all)")
    given = parser.parse_args()
    version, log = git("rev-parse", "HEAD^{tree}"), FOLDER / "constants.jsonl"
    FOLDER.mkdir(parents=True, exist_ok=True)
    lines = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {Moved(**x["mutant"]): x["end"] for x in lines if x["version"] == version}
    some = [(p, n) for p in given.files for n in constants(committed(p)) if n in (given.names or [n])]
    every = [Moved(p, n, f) for p, n in some for f in FACTORS]
    tree, plain = None, {}
    with log.open("a") as file:
        for k, mutant in enumerate(every, 1):
            if mutant not in done:
                tree = tree or lay_out("constants")
                tests = asked(mutant.path, mutant.name, tree)
                # A file that fails as it is would kill every mutant.
                for test in [t for t in tests if t not in plain]:
                    plain[test] = pytest(tree, ["-x", test]).returncode == 0
                passing = [t for t in tests if plain[t]]
                for test in set(tests) - set(passing):
                    print(f"{test} fails with nothing changed, and kills no mutant", flush=True)
                done[mutant] = tried(mutant, tree, passing)
                file.write(json.dumps({"version": version, "mutant": asdict(mutant), "end": done[mutant]}) + "\n")
                file.flush()
            print(f"{k}/{len(every)} {done[mutant]}: {mutant.path} {mutant.name} times {mutant.factor:g}", flush=True)
    ends = Counter(done[m] for m in every)
    if given.files == [DECIDING] and not given.names:
        leave(FOLDER / "result.json", {"constants_pinned": ends["killed"] / len(every)})
    print(f"{ends['killed']} of {len(every)} killed, {100.0 * ends['killed'] / max(len(every), 1):.0f} %; {dict(ends)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
