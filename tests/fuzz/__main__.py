"""Coverage-guided fuzzing of every reader, with Atheris: ``python tests/fuzz [--seconds 60] [READER ...]``.

Each reader runs in a process of its own, from its folder of ``tests/fuzz/corpus`` and from what earlier runs found (in
``build/fuzz``). What raises anything but InputError, crashes, takes longer than 20 s or more than 2 GiB is left in
``build/fuzz/findings``: mend the reader, then put the file into the corpus, which the tests replay.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
BUILD = Path("build", "fuzz")
_INSTRUMENTED = ["snarelab", "rosbags", "tomllib", "zipfile", "csv", "fmpy", "pint", "xml", "json", "scipy.io"]


def main() -> int:
    """Fuzz the readers one after the other; 1 where anything was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("readers", nargs="*", metavar="READER", help="all of them where none is named")
    parser.add_argument("--seconds", type=int, default=60, help="for each reader")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        _fuzz(given.readers[0], given.seconds)
    from readers import READERS  # not before: the process that fuzzes imports them instrumented

    names = given.readers or sorted(READERS)
    (BUILD / "findings").mkdir(parents=True, exist_ok=True)
    found = False
    for name in names:
        (BUILD / name).mkdir(exist_ok=True)
        log = BUILD / f"{name}.log"
        command = [sys.executable, str(HERE), "--one", "--seconds", str(given.seconds), name]
        with log.open("w", encoding="utf-8") as file:
            status = subprocess.run(command, stderr=file, stdout=file, check=False).returncode
        executed = re.findall(r"number_of_executed_units:\s*(\d+)|Done (\d+) runs", log.read_text(errors="replace"))
        runs = max((int(a or b) for a, b in executed), default=0)
        print(f"{name:<20} {runs:>9} runs   {'nothing found' if status == 0 else f'FOUND, see {log}'}", flush=True)
        found |= status != 0
    return int(found)


def _fuzz(name: str, seconds: int) -> None:
    """Fuzz one reader in this process; does not return."""
    import atheris

    warnings.simplefilter("ignore")
    sys.path[:0] = [str(HERE), str(HERE.parents[1])]
    instrument: Any = atheris.instrument_imports  # pyright: ignore[reportAttributeAccessIssue]
    with instrument(include=_INSTRUMENTED, enable_loader_override=False):
        import readers

        from snarelab import files
        from snarelab.recordings import columns

    columns.LARGEST, files.LARGEST_MEMORY = 64 << 20, 1 << 30  # the caps, within what the fuzzer watches

    def one(data: bytes) -> None:
        with tempfile.TemporaryDirectory(prefix="snarelab-fuzz-") as folder:
            readers.attempt(name, data, Path(folder))

    options = (
        f"-max_total_time={seconds} -timeout=20 -rss_limit_mb=2048 -max_len=65536 -print_final_stats=1 -verbosity=1"
    )
    artifacts = f"-artifact_prefix={BUILD / 'findings' / name}-"
    atheris.Setup([sys.argv[0], *options.split(), artifacts, str(BUILD / name), str(HERE / "corpus" / name)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
