"""Let the tool diagnose cases, one line a case: what it said, how long it took, and what is true."""

import hashlib
import json
import math
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import snarelab
from snarelab.errors import InputError
from snarelab.files import written_whole

from ..third import closing
from .cases import TWIN

Said = dict[str, Any]
Diagnose = Callable[[Path], Said]


BAND = 10.0
"""Edge [Hz] below which errors are compared where there is no answer, which has one of its own."""

IDLE = 4.0
"""Times its processor time that an answer may take by the clock."""


class OutOfTime(BaseException):
    """No answer within the limit; not an Exception, so that nothing on the way takes it for a failure of its own."""


FOUND = "found.toml"
"""The model that was found, in a case's folder."""


def diagnose(folder: Path) -> Said:
    """The tool on a case's model, fitted and held-out recording; the third is left alone. The model is `FOUND`."""
    found = snarelab.diagnose(folder / "arm.toml", folder / "train.csv", holdout=folder / "hold.csv")
    found.save_model(folder / FOUND)
    return found.to_json()


def score(
    folders: Sequence[Path],
    out: Path,
    limit: float = 0.0,
    tell: Callable[[str], None] = print,
    run: Diagnose = diagnose,
) -> list[dict[str, Any]]:
    """A line for each case in ``out``; what these sources of the tool have answered is not asked again.

    ``limit`` [s of processor time] a case, none where 0. Lines of other sources, or of other truths, are made anew;
    truths that another processor drew differ in their last digits.
    """
    version = sources()
    out.parent.mkdir(parents=True, exist_ok=True)
    lines = [json.loads(x) for x in out.read_text().splitlines()] if out.exists() else []
    truths = {path.name: json.loads((path / "truth.json").read_text()) for path in folders}
    kept = [x for x in lines if x["version"] == version and alike(truths.get(x["case"], x["truth"]), x["truth"])]
    if len(kept) < len(lines):
        tell(f"{out}: {len(lines) - len(kept)} lines of other sources or other cases are made anew")
    with written_whole(out) as part:
        part.write_text("".join(json.dumps(x) + "\n" for x in kept), encoding="utf-8")
    done = {x["case"] for x in kept}
    with out.open("a", encoding="utf-8") as file:
        for k, path in enumerate(folders, 1):
            if path.name in done:
                continue
            line = {"case": path.name, "version": version, **asked(path, limit, run), "truth": truths[path.name]}
            kept.append(line)
            file.write(json.dumps(line) + "\n")
            file.flush()
            names = ", ".join(f"{e['name']} at {e['at']} {e['probability']:.2f}" for e in line["effects"])
            tell(f"{k}/{len(folders)} {path.name}: {line['verdict']} {names}; {line['seconds']:.0f} s")
    return kept


def alike(one: Any, other: Any) -> bool:
    """Whether two values of JSON are the same, numbers but for their rounding."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(alike(one[k], other[k]) for k in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-12)
    return one == other


def asked(folder: Path, limit: float, run: Diagnose) -> dict[str, Any]:
    """Verdict, names with their rivals and values, and seconds; ``failed`` or ``out of time`` where there is none.

    ``third``: what is left of the third recording before, after and at best, by channel (`proof.third.closing`); where
    something is concealed, and the case has a twin.
    """
    (folder / FOUND).unlink(missing_ok=True)
    start = time.perf_counter()
    try:
        with within(limit):
            found = run(folder)
    except OutOfTime:
        found = {"verdict": "out of time", "effects": []}
    except InputError as error:
        found = {"verdict": "failed", "effects": [], "notes": [str(error)]}
    seconds = time.perf_counter() - start
    kept = ("name", "at", "probability", "margin", "gain", "explained", "parameters", "rivals")
    effects = [{key: e[key] for key in kept if key in e} for e in found["effects"] if e["name"] != "empirical"]
    for effect in effects:
        effect["rivals"] = [
            {key: r[key] for key in ("name", "at", "probability", "separable")} for r in effect["rivals"]
        ]
    channels = {place["channel"]: place["share"] for place in found.get("location", [])}
    fit = {
        channel: [f[part][name] for part in ("train", "holdout") for name in ("rms_before", "rms_after")]
        for channel, f in found.get("fit", {}).items()
    }
    said = {key: found[key] for key in ("description", "notes", "moved") if key in found}
    if (folder / TWIN).exists():
        said["third"] = closing(folder, folder / FOUND, found.get("band", {}).get("value", BAND))
    return {"verdict": found["verdict"], "effects": effects, "location": channels, "fit": fit, **said} | {
        "seconds": round(seconds, 2)
    }


@contextmanager
def within(limit: float) -> Iterator[None]:
    """Raise `OutOfTime` in the main thread after so many seconds of processor time, or `IDLE` times that by the clock:
    what else the machine does is no part of an answer. 0: never."""

    def end(*_: object) -> None:
        raise OutOfTime

    timers = ((signal.SIGPROF, signal.ITIMER_PROF, limit), (signal.SIGALRM, signal.ITIMER_REAL, IDLE * limit))
    before = [(sign, signal.signal(sign, end)) for sign, _, _ in timers]
    for _, timer, seconds in timers:
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for _, timer, _ in timers:
            signal.setitimer(timer, 0.0)
        for sign, handler in before:
            signal.signal(sign, handler)


def sources() -> str:
    """SHA-256 over the sources that a diagnosis follows from."""
    package = Path(next(iter(snarelab.__path__)))
    total = hashlib.sha256()
    for name in ("identification", "models", "recordings"):
        for path in sorted((package / name).rglob("*")):
            if path.suffix in (".py", ".json"):
                total.update(path.read_bytes())
    return total.hexdigest()
