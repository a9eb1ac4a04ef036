"""Every bench starts as its page says, ``python bench/NAME.py``: with its own folder on the path, not the project's."""

import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).resolve().parents[2] / "bench"

START = """
import runpy, sys
path = sys.path[1:]
for script in sys.argv[1:]:
    sys.path[:] = [script.rpartition("/")[0], *path]
    for name in [n for n in sys.modules if n.partition(".")[0] == "bench"]:
        del sys.modules[name]
    print(script, flush=True)
    runpy.run_path(script, run_name="imported")
"""


@pytest.mark.slow
def test_every_bench_finds_what_it_imports(tmp_path: Path) -> None:
    scripts = [str(f) for f in sorted(BENCH.glob("*.py")) if "__main__" in f.read_text(encoding="utf-8")]
    assert len(scripts) > 10
    words = [sys.executable, "-c", START, *scripts]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()) == (0, scripts), done.stderr
