"""From a file to an ``xarray.Dataset`` in SI units."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..errors import InputError, nearest
from ..files import bounded_memory
from . import csv_table, hdf5, matlab
from .columns import Columns, check_count, split_header
from .joined import with_files
from .mixes import with_mixes
from .part import part_of
from .signals import FORMS, FREE, JointKind, Signal, default_unit, is_signal, joint_of
from .timebase import UNIFORM, sampling
from .units import convert, fits, parse_unit

if TYPE_CHECKING:
    import pint


def _parquet(path: Path) -> Columns:
    from . import parquet  # an extra brings what it is read with

    return parquet.read(path)


_READERS: Mapping[str, Callable[[Path], Columns]] = {
    ".csv": csv_table.read,
    ".tsv": csv_table.read,
    ".parquet": _parquet,
    ".mat": matlab.read,
    ".h5": hdf5.read,
    ".hdf5": hdf5.read,
}
_BAGS = (".db3", ".mcap")
SUFFIXES = (*_READERS, *_BAGS)
"""Of files that are recordings."""

_LISTED_GAPS = 20
_TIME_UNITS = ("ns", "us", "ms", "min")


def read_recording(
    path: str | Path, signals: Mapping[str, Signal] | None = None, joint_kinds: Mapping[str, JointKind] | None = None
) -> xr.Dataset:
    """Read a recording: CSV, Parquet, MATLAB, HDF5, or a ROS 2 bag (folder, .db3 or .mcap).

    Parameters
    ----------
    path : str or Path
        The file, or a bag's folder; a part of it as ``run.csv@2.5:10`` [s].
    signals : mapping of str to Signal
        A model's [signals]: where each signal is found. A mapped signal takes precedence over a column of the
        signal's own name.
    joint_kinds : mapping of str to "revolute" or "prismatic"
        Kind of each joint of a model. An unknown kind follows from the dimension of a unit that the file gives for
        that joint; without such a unit, the joint is revolute. A signal that no fit needs (velocity, acceleration,
        temperature, joints that are not in this mapping) is left out with a note if it cannot be read.

    Returns
    -------
    xarray.Dataset
        One float64 variable of shape (n_samples,) per recognised signal over ``time`` [s], in its SI default unit.
        ``attrs["unit"]`` and ``attrs["column"]`` of a variable: its unit as pint reads it, and the column it came from.
        ``attrs["path"]`` and ``attrs["notes"]`` of the dataset: the file, and the reader's remarks, one sentence each
        (gaps, missing samples, uneven sampling, columns left out). Missing samples are NaN; nothing is interpolated.

    Raises
    ------
    InputError
        The file is missing, damaged, empty or of an unknown kind; a mapped column is missing; there is no time, or it
        does not increase; a unit does not fit; a channel holds text, infinities or no number, or is not as long as
        time.
    """
    part, signals = part_of(path), signals or {}
    path, given = part.file, Path(path)
    kinds: dict[str, JointKind] = dict(joint_kinds or {})
    for name in signals:
        if not is_signal(name):
            raise InputError(f"{path}: {name!r} in [signals] is not a signal's name; allowed are {FORMS}")
    columns = _load(path, signals)
    check_count(path, len(columns.names))
    undriven = [name for name, signal in signals.items() if signal.nothing]
    columns, signals = with_files(columns, signals, lambda other: _load(other, {}))
    columns, signals = with_mixes(columns, signals)
    headers = {name: header for name, header in _signal_headers(columns, signals).items() if name not in undriven}
    time_header, time = _time(columns, signals, headers)
    del headers["time"]
    if not headers:
        raise InputError(
            f"{path}: none of its {len(columns.names)} columns is a signal ({_some(columns.names)}); "
            "map them in [signals]"
        )
    spared = {name for name in headers if name not in signals and joint_kinds is not None and _idle(name, joint_kinds)}
    faults: dict[str, str] = {}

    def tried(name: str, take: Callable[..., Any], *given: Any) -> Any:
        try:
            return take(*given)
        except InputError as error:
            if name not in spared:
                raise
            faults[name] = str(error).removeprefix(f"{path}: ")
            return None

    raw = {name: tried(name, columns.column, header, name, len(time)) for name, header in headers.items()}
    units = {name: tried(name, _unit, columns, found[0], signals.get(name)) for name, found in raw.items() if found}
    for name, unit in units.items():
        joint = None if name in signals and signals[name].gain is not None else joint_of(name)
        if joint and joint not in kinds and unit is not None and fits(unit, default_unit(name, "prismatic")):
            kinds[joint] = "prismatic"
    variables = {}
    for name in [name for name in raw if name not in faults]:
        header, values = raw[name]
        wanted = default_unit(name, kinds.get(joint_of(name) or name, "revolute"))
        values = tried(name, _in_unit, columns, header, name, values, units[name], wanted, signals.get(name))
        if values is not None:
            tried(name, _check_numbers, columns, header, values)
        if name not in faults:
            variables[name] = ("time", values, {"unit": wanted, "column": header})
    for name in undriven:
        unit = default_unit(name, kinds.get(joint_of(name) or name, "revolute"))
        variables[name] = ("time", np.zeros(len(time)), {"unit": unit, "column": "none"})
    idle = [f"{name} is left out, no fit needs it: {fault}" for name, fault in faults.items()]
    dataset = xr.Dataset(variables, {"time": ("time", time, {"unit": "s", "column": time_header})})
    used = {"time": time_header} | {name: raw[name][0] if raw[name] else header for name, header in headers.items()}
    gains = {signal.gain for signal in signals.values() if isinstance(signal.gain, str) and signal.gain != FREE}
    left_out = _left_out(columns, used, gains | {gain.rpartition("[")[0] for gain in gains})
    dataset = part(dataset)
    return dataset.assign_attrs(path=str(given), notes=[*columns.notes, *idle, *left_out, *_quality(dataset)])


def _load(path: Path, signals: Mapping[str, Signal]) -> Columns:
    if not path.exists():
        raise InputError(f"{path}: there is no such file; check the path")
    suffix = path.suffix.lower()
    if not (path.is_dir() or path.is_file()):
        raise InputError(f"{path}: is not a regular file; give a file, or the folder of a ROS 2 bag")
    if path.is_dir() or suffix in _BAGS:
        from . import ros_bag  # an extra brings what it is read with

        with bounded_memory(path):
            wanted = {f"{name} {k}": str(c) for name, s in signals.items() for k, c in enumerate(s.parts)}
            return ros_bag.read(path, wanted)
    if suffix not in _READERS:
        raise InputError(
            f"{path}: suffix {suffix!r} is not one of a recording; known are {' '.join(SUFFIXES)} "
            "and the folder of a ROS 2 bag"
        )
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; record it again")
    try:
        with bounded_memory(path):
            return _READERS[suffix](path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the file's permissions") from error


def _idle(name: str, joints: Mapping[str, JointKind]) -> bool:
    """Whether no fit of a model with these joints needs a signal."""
    family, _, joint = name.partition(".")
    return family in ("qd", "qdd", "temp", "command") or (joint_of(name) is not None and joint not in joints)


def _signal_headers(columns: Columns, signals: Mapping[str, Signal]) -> dict[str, str]:
    """Header of each signal: the one that [signals] names, else the first that carries the signal's name.

    A struct or group is read as a dot: ``q/joint1`` is ``q.joint1``.
    """
    headers = {name: str(signal.column) for name, signal in signals.items()}
    for header in [*columns.arrays, *columns.problems]:
        name = split_header(header)[0].replace("/", ".")
        if is_signal(name):
            headers.setdefault(name, header)
    return headers


def _left_out(columns: Columns, used: Mapping[str, str], gains: set[str]) -> list[str]:
    """Notes on the columns that no signal came from; ``used`` maps signal to header."""
    notes, unknown, taken = [], [], set(used.values())
    for header in [*columns.arrays, *columns.problems]:
        bare = split_header(header)[0]
        name = bare.replace("/", ".")
        if header in taken or {header, bare} & (gains | columns.mixed):
            continue
        if name in used:
            notes.append(f"column {header!r} is ignored; {name} is taken from {used[name]!r}")
        else:
            unknown.append(header)
    if unknown:
        notes.append(f"ignored, because no signal has such a name: {_some(unknown)}")
    return notes


def _time(columns: Columns, signals: Mapping[str, Signal], headers: Mapping[str, str]) -> tuple[str, np.ndarray]:
    """Header of the time column, and the time itself [s], checked to increase."""
    if "time" not in headers:
        column = nearest("time", columns.names)
        raise InputError(
            f"{columns.path}: there is no column 'time' among {_some(columns.names)}; rename one, or map it: "
            f'[signals] "time" = {{ column = "{column}", unit = "{_time_unit(column)}" }}'
        )
    header, values = columns.column(headers["time"], "time")
    if len(values) < 2:
        raise InputError(f"{columns.path}: has {len(values)} rows; at least 2 are wanted")
    values = _in_unit(
        columns, header, "time", values, _unit(columns, header, signals.get("time")), "s", signals.get("time")
    )
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise InputError(
            f"{columns.path}: column {header!r}: time is missing in row {columns.row(int(bad[0]))}; delete that row"
        )
    bad = np.flatnonzero(np.diff(values) <= 0.0)
    if bad.size:
        before, after = float(values[bad[0]]), float(values[bad[0] + 1])
        raise InputError(
            f"{columns.path}: column {header!r}: time {'repeats' if before == after else 'goes backwards'} in row "
            f"{columns.row(int(bad[0]) + 1)}: {after!r} s after {before!r} s; sort or cut the recording"
        )
    return header, values


def _time_unit(header: str) -> str:
    """The unit that a time's header says, in brackets or as ``t_ms`` does; seconds where it says none."""
    name, unit = split_header(header)
    ending = unit or name.rpartition("_")[2]
    return ending if ending in _TIME_UNITS else "s"


def _unit(columns: Columns, header: str, signal: Signal | None) -> "pint.Unit | None":
    """The unit that the values are in, as the header or else [signals] says; None where neither does.

    A gain counts per unit that [signals] names, or else as it is.
    """
    own, mapped = split_header(header)[1], None if signal is None else signal.unit
    if signal is not None and signal.gain is not None:
        if mapped is None:
            return None
        raw = parse_unit(mapped, header, columns.path)
        return raw if own is None or own.isdigit() else parse_unit(own, header, columns.path)  # or "name[1]"
    text = own if mapped is None else mapped
    return None if text is None else parse_unit(text, header, columns.path)


def _in_unit(
    columns: Columns,
    header: str,
    name: str,
    values: np.ndarray,
    unit: "pint.Unit | None",
    wanted: str,
    signal: Signal | None,
) -> np.ndarray:
    if signal is not None and signal.gain is not None:
        given = 1.0 if signal.gain == FREE else signal.gain
        gain = columns.scalar(given, name) if isinstance(given, str) else float(given)
        if not math.isfinite(gain) or gain == 0.0:
            raise InputError(
                f"{columns.path}: gain {signal.gain!r} of [signals] {name!r} is {gain}; a number but 0 is wanted"
            )
        if signal.unit is not None and unit is not None:
            per = str(parse_unit(signal.unit, header, columns.path))
            if not fits(unit, per):
                raise InputError(
                    f"{columns.path}: column {header!r}: its unit does not fit unit = {signal.unit!r} of [signals] "
                    f"{name!r}, which the gain counts per; correct one of them"
                )
            values = convert(values, unit, per)
        return values * gain
    if unit is None:
        return values
    if not fits(unit, wanted):
        raise InputError(
            f"{columns.path}: column {header!r}: unit '{unit:~P}' ({unit.dimensionality}) does not fit {name}, "
            f"which is in {wanted} or a unit of that dimension; correct the unit or the joint's kind, or give it a "
            "gain under [signals] in the model file"
        )
    return convert(values, unit, wanted)


def _check_numbers(columns: Columns, header: str, values: np.ndarray) -> None:
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        raise InputError(
            f"{columns.path}: column {header!r}: row {columns.row(int(infinite[0]))} is infinite; "
            "write NaN where a sample is missing"
        )
    if np.isnan(values).all():
        raise InputError(
            f"{columns.path}: column {header!r}: holds no number in any of its {len(values)} rows; "
            "remove the column or record the channel"
        )


def _quality(dataset: xr.Dataset) -> list[str]:
    """Notes on missing samples, gaps and uneven sampling."""
    size = dataset.sizes["time"]
    # by `variables`: to make an array of its own of one, xarray looks at all the others
    counts = {name: int(np.isnan(dataset.variables[name].to_numpy()).sum()) for name in dataset.data_vars}
    notes = [f"{name}: {count} of {size} samples are missing" for name, count in counts.items() if count]
    rate = sampling(dataset)
    notes += [
        f"gap of {stop - start:.6g} s from {start:.9g} s to {stop:.9g} s" for start, stop in rate.gaps[:_LISTED_GAPS]
    ]
    if len(rate.gaps) > _LISTED_GAPS:
        total = sum(stop - start for start, stop in rate.gaps)
        notes.append(
            f"{len(rate.gaps)} gaps in all, {total:.6g} s of {float(np.ptp(dataset['time'].to_numpy())):.6g} s"
        )
    if rate.jitter > UNIFORM:
        notes.append(
            f"uneven sampling: median period {rate.period:.6g} s, steps off by up to {100 * rate.jitter:.3g} %"
        )
    return notes


def _some(names: list[str], most: int = 8, longest: int = 60) -> str:
    shown = [name if len(name) <= longest else f"{name[: longest - 3]}..." for name in names[:most]]
    return ", ".join(shown) + (f" and {len(names) - most} more" if len(names) > most else "")
