"""The first hour, timed: the wheel in a bare container, one's own URDF and CSV, a verdict; and what an install takes.

``python bench/first_hour.py --image docker.io/library/python:3.11-slim --image docker.io/library/python:3.13-slim``
starts a container of each, ``--python EXE`` a clean environment of an interpreter of this machine, with no variable and
no home of the caller. In a container the README's ``apt-get`` line comes first. In each: ``pip install`` of the wheel,
without the repository and without its constraints; then the README's model file of two lines beside a URDF and two
recordings under names of their own; then ``snarelab diagnose``. ``--demo`` times ``make demo`` in a fresh copy of the
repository, twice: the second has a warm cache. ``--run`` is what starts a container, where ``podman run --rm`` will
not do (``--run "docker run --rm"``).
Beside the seconds stand those of the processor, which a busy machine does not stretch.
Exit status 1 where a limit is passed or the verdict is not ``missing_physics``.
"""

import argparse
import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "build" / "bench" / "first_hour.json"
LIMITS = {"seconds": 300.0, "install_mb": 1000.0, "demo_seconds": 60.0, "demo_mb": 1100.0}
"""What the first hour may take: seconds from the wheel to the verdict, megabytes (10⁶ bytes) on disk."""
FIRST_HOUR = """
set -e
cd "$OWN"
python3 -c 'import sys; print("python", sys.version.split()[0])'
python3 -c 'import time; print("begun", time.time())'
sh -c "$LIBRARIES" > /dev/null 2>&1
python3 -m venv "$PLACE/v"
du -s --apparent-size --block-size=1 "$PLACE/v" | sed 's/^/empty /'
"$PLACE/v/bin/pip" install --quiet --no-cache-dir --disable-pip-version-check wheel/*.whl
python3 -c 'import time; print("installed", time.time())'
"$PLACE/v/bin/snarelab" diagnose my-arm.toml first.csv --holdout second.csv --report report.html --json diagnosis.json
python3 -c 'import time; print("diagnosed", time.time())'
times > "$PLACE/times"
sed -n '2s/^/processor /p' "$PLACE/times"
du -s --apparent-size --block-size=1 "$PLACE/v" | sed 's/^/bytes /'
"""


def main() -> int:
    """Time each place that was asked for, and write the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--image", action="append", default=[], help="a container's image; may be repeated")
    parser.add_argument("--python", action="append", default=[], help="an interpreter; may be repeated")
    parser.add_argument("--run", default="podman run --rm", help="what starts a container")
    parser.add_argument("--demo", action="store_true", help="time make demo, cold and warm")
    parser.add_argument("--result", type=Path, default=RESULT)
    given = parser.parse_args()
    rows = []
    program = shlex.split(given.run)[0]
    if given.image and not shutil.which(program):
        print(
            f"--run {given.run}: no {program!r} on the path; install it, or give what starts a container",
            file=sys.stderr,
        )
        return 2
    with tempfile.TemporaryDirectory() as place:
        wheel = build(Path(place) / "wheel") if given.image or given.python else None
        for kind, name in [*(("image", x) for x in given.image), *(("python", x) for x in given.python)]:
            assert wheel is not None
            rows.append(first_hour(kind, name, shlex.split(given.run), wheel, Path(place) / f"{len(rows)}"))
            print(json.dumps(rows[-1]), flush=True)
        if given.demo:
            rows.append(demo(Path(place) / "demo"))
            print(json.dumps(rows[-1]), flush=True)
    given.result.parent.mkdir(parents=True, exist_ok=True)
    given.result.write_text(json.dumps({"date": f"{datetime.now(UTC):%Y-%m-%d %H:%M}", "rows": rows}, indent=1))
    passed = [f"{row['place']}: {key} {row[key]}" for row in rows for key in LIMITS if row.get(key, 0) > LIMITS[key]]
    wrong = [f"{row['place']}: {row['verdict']}" for row in rows if row.get("verdict") not in (None, "missing_physics")]
    for line in (*passed, *wrong):
        print(f"over the limit or wrong: {line}", file=sys.stderr)
    return 1 if passed or wrong else 0


def build(folder: Path) -> Path:
    """The wheel of the files that git knows, built away from the repository."""
    folder.mkdir()
    source = copied(folder / "source")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, source]
    subprocess.run(command, check=True)
    shutil.rmtree(source)
    return next(folder.glob("*.whl"))


def copied(folder: Path) -> Path:
    """The repository's files as they stand, without what was built."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    return folder


def own_files(folder: Path, wheel: Path) -> None:
    """A URDF, two recordings and the README's model file, under names of their own."""
    (folder / "wheel").mkdir(parents=True)
    shutil.copy(wheel, folder / "wheel")
    bundled = ROOT / "studies" / "bundled"
    for name, own in (("arm3.urdf", "my-arm.urdf"), ("train.csv", "first.csv"), ("holdout.csv", "second.csv")):
        shutil.copy(bundled / name, folder / own)
    shown = re.findall(r"```toml\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    (folder / "my-arm.toml").write_text(shown[0].replace("arm3.urdf", "my-arm.urdf"), encoding="utf-8")


def first_hour(kind: str, name: str, run: list[str], wheel: Path, folder: Path) -> dict[str, object]:
    """From the wheel to the verdict in one place."""
    own_files(folder, wheel)
    if kind == "image":
        (line,) = re.findall(r"`(apt-get install [^`]*)`", (ROOT / "README.md").read_text(encoding="utf-8"))
        line = f"apt-get update && {line.replace('install', 'install -y --no-install-recommends')}"
        mounted = ["-v", f"{folder}:/own", "-e", "OWN=/own", "-e", "PLACE=/tmp", "-e", f"LIBRARIES={line}"]
        command, environment = [*run, *mounted, name, "sh", "-c", FIRST_HOUR], dict(os.environ)
    else:
        (folder / "home").mkdir()
        (folder / "bin").mkdir()
        (folder / "bin" / "python3").symlink_to(shutil.which(name) or name)
        kept = {key: os.environ[key] for key in ("PIP_CERT", "SSL_CERT_FILE") if key in os.environ}
        home = {"HOME": f"{folder / 'home'}", "PATH": f"{folder / 'bin'}:/usr/bin:/bin", "LC_ALL": "C.UTF-8"}
        environment = {**kept, **home, "OWN": f"{folder}", "PLACE": f"{folder / 'home'}", "LIBRARIES": "true"}
        command = ["sh", "-c", FIRST_HOUR]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True)
    if ran.returncode:
        raise SystemExit(f"{name}: ended with {ran.returncode}:\n{ran.stdout[-2000:]}{ran.stderr[-4000:]}")
    told = dict(re.findall(r"^(python|begun|empty|installed|diagnosed|bytes) (\S+)", ran.stdout, re.MULTILINE))
    begun, installed, diagnosed = (float(told[key]) for key in ("begun", "installed", "diagnosed"))
    (used,) = re.findall(r"^processor (\S+)m(\S+)s (\S+)m(\S+)s", ran.stdout, re.MULTILINE)
    found = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert (folder / "report.html").stat().st_size > 100_000
    return {
        "place": name,
        "python": told["python"],
        "install_seconds": round(installed - begun, 1),
        "diagnose_seconds": round(diagnosed - installed, 1),
        "seconds": round(diagnosed - begun, 1),
        "processor_seconds": round(60 * (float(used[0]) + float(used[2])) + float(used[1]) + float(used[3]), 1),
        "install_mb": round((int(told["bytes"]) - int(told["empty"])) / 1e6),
        "verdict": found["verdict"],
        "named": sorted({effect["name"] for effect in found["effects"]}),
        "said_on_stderr": ran.stderr.splitlines()[:5],
    }


def demo(folder: Path) -> dict[str, object]:
    """``make demo`` in a copy of the repository: once for the cache, then from ``make clean`` again."""
    copied(folder)
    took, used = [], []
    own = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    for _ in range(2):
        subprocess.run(["make", "--silent", "clean"], cwd=folder, check=True)
        begun, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
        ran = subprocess.run(["make", "demo"], cwd=folder, env=own, capture_output=True, text=True)
        took.append(round(time.monotonic() - begun, 1))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used.append(round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1))
        if ran.returncode:
            raise SystemExit(f"make demo: ended with {ran.returncode}:\n{ran.stderr[-4000:]}")
    files = [path for path in (folder / ".venv").rglob("*") if path.is_file() and not path.is_symlink()]
    size = round(sum(path.stat().st_size for path in files) / 1e6)
    return {
        "place": "make demo",
        "cold_seconds": took[0],
        "demo_seconds": took[1],
        "processor_seconds": used[1],
        "demo_mb": size,
    }


if __name__ == "__main__":
    sys.exit(main())
