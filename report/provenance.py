"""What a result stands on: the command, every file with its SHA-256, and the versions of what computed it."""

import hashlib
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .. import __version__
from ..recordings.part import part_of

PACKAGES = ("casadi", "drake", "numpy", "scipy")
"""What computes an arm's result."""


@dataclass(frozen=True)
class Provenance:
    """``files`` are (role, name, SHA-256); ``versions`` (name, version)."""

    command: str
    files: tuple[tuple[str, str, str], ...]
    versions: tuple[tuple[str, str], ...]

    def markup(self) -> str:
        """A list of terms for a page."""
        rows = [("Command", f"<code>{escape(self.command)}</code>")] if self.command else []
        rows += [(role, f"{escape(name)} <code>sha256:{digest[:16]}</code>") for role, name, digest in self.files]
        rows.append(("Computed with", escape(", ".join(f"{name} {number}" for name, number in self.versions))))
        items = "".join(f"<dt>{escape(term)}</dt><dd>{value}</dd>" for term, value in rows)
        return f'<dl class="facts provenance">{items}</dl>\n'


def provenance(
    command: str = "", files: Sequence[tuple[str, str | Path | None]] = (), packages: Sequence[str] = PACKAGES
) -> Provenance:
    """Of a command and its files, each with its role; None is passed over. A folder counts with all files in it."""
    known = tuple((role, Path(path).name, _digest(part_of(path).file)) for role, path in files if path is not None)
    own = (("snarelab", __version__), ("Python", platform.python_version()))
    return Provenance(command, known, (*own, *_versions(packages)))


def _versions(packages: Sequence[str]) -> list[tuple[str, str]]:
    found = []
    for name in packages:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:  # installed by other means than a package's
            continue
    return found


def _digest(path: Path) -> str:
    whole = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as opened:
                whole.update(hashlib.file_digest(opened, "sha256").digest() if path.is_dir() else opened.read())
    return whole.hexdigest()
