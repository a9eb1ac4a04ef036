"""Where a bench leaves its figures."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def leave(path: Path, figures: Mapping[str, float]) -> None:
    """Add figures to those that are there, or replace them: two programs fill one file."""
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    write_result(path, known | dict(figures))


def write_result(path: Path, result: dict[str, Any]) -> None:
    """Write the figures as JSON, making the folder where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result, indent=2) + "\n")
