"""Where finished cases are kept: a folder of small Parquet files, each written whole, that a killed run goes on from.

A finished case is one file of one row, ``cases/<stage>-<number>.parquet``; when a batch is complete its rows are merged
into ``cases/<stage>-<first>-<last>.parquet`` and the single files go. A file appears by renaming, so a kill at any
moment leaves whole files only, and a row that stands twice is the same row.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

import pandas as pd

from ..errors import InputError
from ..files import bounded_memory, json_value, written_whole
from .capture import Outcome
from .study import Study

_SAFE = "finished cases are kept; make room and run again"
_OUTCOME = tuple(f.name for f in fields(Outcome))
_ABSENT = {f.name: f.default for f in fields(Outcome) if f.default is not MISSING}
"""What a row that was written before a column was there has in it."""


class Results:
    """The results folder of one study.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    study : Study

    Raises
    ------
    InputError
        The folder holds another study's results, or something else, or cannot be written.
    """

    def __init__(self, folder: str | Path, study: Study) -> None:
        """Open or make the folder."""
        self.folder, self.study = Path(folder), study
        self._cases = self.folder / "cases"
        identity = self.folder / "study.json"
        if identity.exists():
            _same(identity, study)
        elif self.folder.exists() and not (self.folder.is_dir() and all(_scrap(p) for p in self.folder.iterdir())):
            raise InputError(f"{self.folder}: is there and holds no tolerance results; name a new folder")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if not identity.exists():
                self.write(identity.name, json.dumps(study.identity(), indent=1) + "\n")
            self._cases.mkdir(exist_ok=True)
            for scrap in filter(_scrap, self._cases.iterdir()):
                scrap.unlink()
        except OSError as error:
            raise InputError(f"{self.folder}: cannot be written: {error.strerror}; {_SAFE}") from None
        self._rows = self._read()

    def __len__(self) -> int:
        """How many cases are recorded."""
        return len(self._rows)

    def done(self, stage: str, number: int) -> bool:
        """Whether that case has a recorded outcome."""
        return (stage, number) in self._rows

    def add(self, stage: str, number: int, values: Mapping[str, float], outcome: Outcome) -> None:
        """Record one case; it is on disk when this returns."""
        row = self._row(stage, number, values, outcome)
        self._write([row], self._cases / f"{stage}-{number:07d}.parquet")
        self._rows[stage, number] = row

    def merge(self, stage: str, numbers: Sequence[int]) -> None:
        """Put a complete batch into one file."""
        if len(numbers) < 2:
            return
        target = self._cases / f"{stage}-{numbers[0]:07d}-{numbers[-1]:07d}.parquet"
        if not target.exists():
            self._write([self._rows[stage, n] for n in numbers], target)
        for n in numbers:
            (self._cases / f"{stage}-{n:07d}.parquet").unlink(missing_ok=True)

    def table(self, stage: str | None = None) -> pd.DataFrame:
        """Every recorded case in order, of one stage or of all."""
        rows = [self._rows[key] for key in sorted(self._rows) if stage in (None, key[0])]
        return pd.DataFrame(rows, columns=pd.Index(self._columns))

    def write(self, name: str, content: Any) -> Path:
        """Write a summary beside the cases: text, or a JSON object; returns its path."""
        text = content if isinstance(content, str) else json.dumps(content, indent=1, allow_nan=False) + "\n"
        with written_whole(self.folder / name, _SAFE) as part:
            part.write_text(text, encoding="utf-8")
        return self.folder / name

    def write_table(self) -> Path:
        """Write every case into ``cases.parquet``."""
        self._write(self.table().to_dict("records"), self.folder / "cases.parquet")
        return self.folder / "cases.parquet"

    def _row(self, stage: str, number: int, values: Mapping[str, float], outcome: Outcome) -> dict[str, Any]:
        margin = self.study.success.margin(outcome)
        return {"stage": stage, "case": number, **values, **asdict(outcome), "margin": margin}

    def _write(self, rows: Sequence[Mapping[str, Any]], path: Path) -> None:
        with written_whole(path, _SAFE) as part:
            pd.DataFrame(rows).to_parquet(part, index=False)

    def _read(self) -> dict[tuple[str, int], dict[str, Any]]:
        rows = {}
        for path in sorted(self._cases.glob("*.parquet")):
            try:
                with bounded_memory(path):
                    for row in pd.read_parquet(path).to_dict("records"):
                        rows[str(row["stage"]), int(row["case"])] = {
                            name: (_ABSENT | row)[name] for name in self._columns
                        }
            except (InputError, MemoryError):
                raise
            except Exception as error:  # a damaged file makes pyarrow raise anything
                reason = " ".join(f"{type(error).__name__}: {error}".split())[:100]
                raise InputError(f"{path}: damaged ({reason}); delete it, and its cases are run again") from None
        return rows

    @property
    def _columns(self) -> list[str]:
        return ["stage", "case", *(a.name for a in self.study.capture.axes), *_OUTCOME, "margin"]


def _scrap(path: Path) -> bool:
    """What a process left that was killed while it wrote."""
    return path.name.endswith(".part")


def _same(identity: Path, study: Study) -> None:
    found = json_value(identity)
    for key, value in study.identity().items():
        if not isinstance(found, dict) or found.get(key) != value:
            was = found.get(key) if isinstance(found, dict) else found
            raise InputError(
                f"{identity.parent}: holds results of another study ({key} was {str(was)[:80]}, is {value}); "
                "name a new folder"
            )
