"""Recordings held out of a fit: none of them may be one that is fitted, nor stand twice."""

import filecmp
from collections.abc import Sequence
from pathlib import Path

from ...errors import InputError
from ...recordings.part import part_of, several


def demand_apart(
    recordings: Sequence[str | Path], holdout: str | Path | Sequence[str | Path]
) -> tuple[str | Path, ...]:
    """The held-out recordings; refuses none, one that is fitted too, and one given twice (InputError)."""
    held = several(holdout)
    if not held:
        raise InputError("holdout: none is given; give one or more recordings that the fit does not see")
    for k, one in enumerate(held):
        _demand_unseen(recordings, one)
        if any(part_of(one).overlaps(part_of(other)) for other in held[:k]):
            raise InputError(f"{one}: is held out twice, or parts of it are; give each once")
    return held


def _demand_unseen(recordings: Sequence[str | Path], holdout: str | Path) -> None:
    part = part_of(holdout)
    for one in map(part_of, recordings):
        held, fitted = part.file, one.file
        same = part.overlaps(one)
        if not same and held.resolve() == fitted.resolve():
            continue  # another part of one file
        if same or _is_copy(held, fitted):
            copy = "" if same else f", byte for byte {fitted}"
            raise InputError(
                f"{holdout}: the holdout is also a recording to fit{copy}; hold out one that the fit does not see"
            )


def _is_copy(held: Path, fitted: Path) -> bool:
    """Whether two files hold the same bytes; what cannot be read is left to its reader."""
    try:
        return held.is_file() and fitted.is_file() and filecmp.cmp(held, fitted, shallow=False)
    except OSError:
        return False
