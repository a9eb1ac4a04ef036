"""A run on disk while it runs: reported rows are there, whatever happens to the process.

Rows go into ``unfinished-NAME.csv`` beside the recording that the run is to become, which itself appears whole or not
at all. After a kill that file holds every row up to the last report, and can be read as any recording. Rows are added
by one call of the system each time; what a machine that falls leaves of that call is a last line without an end.
"""

import csv
import io
import os
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from ..errors import InputError
from ..recordings.write import demand_suffix, write_recording
from .record import Record

OFTEN = 1.0
"""Time between two reports of a run, each with its rows on the disk before [s]: a few hundredths of a run's time."""

try:
    import fcntl
except ImportError:  # Windows: two runs of one name are then not kept apart
    fcntl = None


def unfinished(path: str | Path) -> Path:
    """The file with the rows of a run whose recording will be ``path``."""
    path = Path(path)
    return path.with_name(f"unfinished-{path.name}{'' if path.suffix.lower() == '.csv' else '.csv'}")


class Journal:
    """Writes a record's rows as they come; a context, within which nothing else may write the same recording.

    Parameters
    ----------
    record : Record
        Of the master that runs.
    path : path
        What the run is to become, ``.csv`` or ``.parquet``.
    often : float
        Least time between two reports [s].

    Raises
    ------
    InputError
        Where the folder cannot be written, the disk is full, or another run writes the same recording.
    """

    def __init__(self, record: Record, path: str | Path, often: float = OFTEN) -> None:
        """Start an empty file."""
        demand_suffix(path)
        self.path, self.rows = Path(path), unfinished(path)
        self._record, self._often, self._count, self._last = record, often, 0, time.monotonic()
        self._file = self._opened()
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(record.headers)
        self._add(line.getvalue())

    def report(self, say: Callable[[float], None]) -> Callable[[float], None]:
        """A progress for `Master.run`: once a second it writes the rows, then reports the time that they reach [s]."""

        def told(now: float) -> None:
            if time.monotonic() - self._last >= self._often:
                self.write()
                say(now)
                self._last = time.monotonic()

        return told

    def write(self) -> None:
        """Write all rows so far to disk."""
        rows = self._record.rows(self._count)
        self._add("".join(map(_line, rows.tolist())))
        self._count += len(rows)

    def finish(self) -> None:
        """Write the recording of all rows, whole, and remove the unfinished file."""
        if self.path.suffix.lower() == ".csv":
            self.write()
            try:
                self.rows.replace(self.path)
            except OSError as error:
                raise InputError(f"{self.path}: cannot be written: {error.strerror}; it is {self.rows}") from None
            self._file.close()
        else:
            write_recording(self._record.dataset(), self.path)
            self.discard()

    def discard(self) -> None:
        """Remove the unfinished file."""
        self._file.close()
        self.rows.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        """The journal."""
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Close; what was not finished stays."""
        self._file.close()

    def _opened(self) -> BinaryIO:
        try:
            file = open(self.rows, "ab", buffering=0)  # noqa: SIM115  closed by the context
        except OSError as error:
            raise InputError(f"{self.rows}: cannot be written: {error.strerror}; choose another folder") from None
        if not self._is_ours(file):
            file.close()
            raise InputError(f"{self.path}: another run is writing it; wait for it, or choose another name")
        file.truncate(0)
        return file

    def _is_ours(self, file: BinaryIO) -> bool:
        """Whether no other run holds the file, or has just made its recording of it."""
        if fcntl is None:
            return True
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return os.path.samestat(os.stat(self.rows), os.fstat(file.fileno()))
        except OSError:
            return False

    def _add(self, text: str) -> None:
        left = memoryview(text.encode())
        try:
            while left:
                left = left[self._file.write(left) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            raise InputError(
                f"{self.rows}: cannot be written further: {error.strerror}; free some space, it holds the run so far"
            ) from None


def _line(row: list[float]) -> str:
    """Every digit; a value that is not there is left empty, as in any recording."""
    return ",".join("" if value != value else repr(value) for value in row) + "\n"
