"""What a user is told of a mistake: one line that names the file, and words of it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from snarelab.errors import InputError


def refusal(read: Callable[[], object], path: Path, *words: str, leads: bool = True) -> str:
    """The one line that names the file, first of all unless ``leads`` is false, and holds the words."""
    with pytest.raises(InputError) as caught:
        read()
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(path)) if leads else str(path) in line, line
    for word in words:
        assert word in line, line
    return line
