"""Answers sealed before the tool runs: their SHA-256 is on the disk and on the terminal, they themselves are not.

Until the score is made, answers live in the memory of the process that draws them, and nowhere else. ``sealed.json``
holds the digest, and that of every recording; ``answers.json`` appears after the last diagnosis, and anyone can check
with ``sha256sum`` that it is what was sealed.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .cases import Answer

ROOT = Path(__file__).resolve().parents[1]
INPUTS = ("arm.toml", "arm.urdf", "train.csv", "hold.csv")
"""What of a case's folder the tool is given."""
SEALED = (*INPUTS, "third.csv")
"""What it holds."""


@dataclass(frozen=True)
class Seal:
    """What was fixed before the first diagnosis. ``attempts``: how often each case was redrawn until it ran."""

    answers: str
    recordings: str
    generator: str
    seed: int
    cases: int
    attempts: tuple[int, ...]
    time: str

    @staticmethod
    def make(answers: Sequence[Answer], attempts: Sequence[int], folders: Sequence[Path], seed: int) -> "Seal":
        """Digest answers and recordings."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        recordings = digest(folder / name for folder in folders for name in SEALED)
        return Seal(sha256(text(answers)), recordings, generator(), seed, len(answers), tuple(attempts), now)

    def write(self, path: Path) -> None:
        """Whole or not at all."""
        write_json(path, asdict(self))

    @staticmethod
    def read(path: Path) -> "Seal | None":
        """None where there is none."""
        if not path.exists():
            return None
        fields = json.loads(path.read_text())
        return Seal(**fields | {"attempts": tuple(fields["attempts"])})


class BrokenSeal(RuntimeError):
    """What lies on the disk is not what was sealed."""


def text(answers: Sequence[Answer]) -> str:
    """The answers as they are sealed, and as ``answers.json`` holds them."""
    return json.dumps([a.to_json() for a in answers], indent=1, sort_keys=True) + "\n"


def sha256(content: str) -> str:
    """Of UTF-8 text, in hexadecimal."""
    return hashlib.sha256(content.encode()).hexdigest()


def digest(paths: Iterable[Path]) -> str:
    """SHA-256 over files, in order."""
    total = hashlib.sha256()
    for path in paths:
        total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


CASES = [
    *(ROOT / "proof" / f"{n}.py" for n in ("robots", "plant", "concealed", "outside", "cases", "model_text")),
    *(ROOT / "bench" / f"{n}.py" for n in ("arm", "concealed", "lugre", "motion", "mujoco_plant", "parts")),
]
"""Sources that cases and recordings of the first generator follow from."""


def generator() -> str:
    """SHA-256 over them."""
    return digest(CASES)


def tool(names: Sequence[str] = ("identification", "models", "recordings")) -> str:
    """SHA-256 over the installed package's sources: diagnoses made by other sources are made again."""
    import snarelab

    package = Path(next(iter(snarelab.__path__)))
    paths = [p for name in names for p in sorted((package / name).rglob("*")) if p.suffix in (".py", ".json", ".c")]
    return digest([package / "cli.py", *paths])


def rivals() -> str:
    """SHA-256 over the rivals' sources."""
    return digest(sorted((ROOT / "proof").glob("rival*.py")))


def oracle() -> str:
    """SHA-256 over the sources of the oracle, and of what is counted on the third recording."""
    return digest([ROOT / "proof" / "oracle.py", ROOT / "proof" / "third.py"])


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Whole or not at all."""
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    part.replace(path)
