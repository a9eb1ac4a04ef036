"""The pages of the documentation, and what stands in their fenced blocks."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS, README, CHANGELOG = ROOT / "docs", ROOT / "README.md", ROOT / "CHANGELOG.md"
EXTRAS = "snare", "fmu", "cluster", "formats"
IMPORTED_AS = {"drake": "pydrake", "scikit-learn": "sklearn", "pin": "pinocchio"}
PAGES = [README, *sorted(DOCS.glob("*.md"))]


def read(page):
    return page.read_text(encoding="utf-8")


def blocks(page, *languages):
    """Language and content of a page's blocks in these languages, in order."""
    return re.findall(rf"^```({'|'.join(languages)})\n(.*?)^```", read(page), re.MULTILINE | re.DOTALL)
