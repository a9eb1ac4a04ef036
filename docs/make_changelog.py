"""Make a release's section of ``CHANGELOG.md`` from ``changelog.d/``: ``make_changelog.py VERSION DATE``.

A fragment is one file for one change, ``NAME.KIND.md``, with what a user sees of it.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KINDS = ("added", "changed", "removed", "fixed")
FIRST = "\n## ["


def fragments(folder: Path) -> dict[str, list[str]]:
    """Texts by kind, in the order of the files' names; ValueError for a file that is no fragment."""
    found: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for path in sorted(folder.glob("*")):
        if path.name == "README.md":
            continue
        _, _, kind = path.name.removesuffix(".md").rpartition(".")
        text = path.read_text(encoding="utf-8").strip()
        if path.suffix != ".md" or kind not in KINDS or not text:
            raise ValueError(
                f"{path.name} is no fragment: NAME.KIND.md with a sentence, KIND one of {', '.join(KINDS)}"
            )
        found[kind].append(text)
    return found


def section(version: str, date: str, texts: dict[str, list[str]]) -> str:
    """A release as Keep a Changelog has it; a fragment's further lines are indented below its first."""
    parts = [f"## [{version}] - {date}"]
    for kind, items in texts.items():
        if items:
            lines = "\n".join("- " + "\n  ".join(item.splitlines()) for item in items)
            parts.append(f"### {kind.capitalize()}\n\n{lines}")
    return "\n\n".join(parts) + "\n"


def release(root: Path, version: str, date: str) -> None:
    """Put the section above the last release's, and take the fragments away."""
    texts = fragments(root / "changelog.d")
    if not any(texts.values()):
        raise ValueError("changelog.d holds no fragment")
    page = root / "CHANGELOG.md"
    head, mark, rest = page.read_text(encoding="utf-8").partition(FIRST)
    page.write_text(f"{head}\n{section(version, date, texts)}{mark}{rest}", encoding="utf-8")
    for path in (root / "changelog.d").glob("*.*.md"):
        path.unlink()


if __name__ == "__main__":
    release(ROOT, *sys.argv[1:])
