"""Where a command's outputs go: refused before the work starts where they cannot be written, then written whole."""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import written_whole


def demand_writable(numbers: str | None, outputs: Sequence[str | None], recordings: Sequence[str | None]) -> None:
    """Refuse a place that cannot be written, or holds what is read, before any long work starts.

    ``numbers`` is where the JSON goes; only that may be ``-``, standard output.
    """
    from ..recordings.part import part_of

    taken = {part_of(r).file.resolve(): "a recording that is read" for r in recordings if r}
    for path in (numbers if numbers != "-" else None, *outputs):
        if not path:
            continue
        if path == "-":
            raise InputError("-: only --json goes to standard output; name a file")
        place = Path(path).resolve()
        if not (place.parent.is_dir() and os.access(place.parent, os.W_OK)):
            raise InputError(f"{path}: its folder does not exist or cannot be written; make it first")
        if place.exists() and not place.is_file():
            raise InputError(f"{path}: exists and is not a regular file; name a file")
        if place in taken:
            raise InputError(f"{path}: is also {taken[place]}; write somewhere else")
        taken[place] = "another output"


def write_json(result: dict[str, Any], path: str) -> None:
    """Write a command's result whole, or to standard output where ``path`` is ``-``."""
    text = json.dumps(result, indent=1, allow_nan=False) + "\n"
    if path == "-":
        sys.stdout.write(text)
        return
    with written_whole(Path(path)) as part:
        part.write_text(text, encoding="utf-8")
