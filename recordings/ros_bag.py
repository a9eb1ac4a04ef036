"""ROS 2 bags: a folder with its ``metadata.yaml``, or a single ``.db3`` or ``.mcap`` file.

``sensor_msgs/JointState`` needs no mapping: position is ``q.<joint>``, velocity ``qd``, effort ``tau``, and the
header's stamp is the time. Any other number is ``"/topic/field.path"``, for example ``"/wrench/wrench.force.x"`` or
``"/data/data[2]"``.

Topics keep clocks of their own. One of them is the recording's time: the topic that [signals] maps to ``time``, else
the first joint state, else the first topic mapped to a torque, else the first mapped one. Every other topic gives, at
each of its stamps, the sample that is nearest within half a period, and NaN where there is none. Nothing is
interpolated.
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, nearest
from ..extras import needed_for
from ..files import content
from .columns import Columns

with needed_for("a ROS 2 bag"):
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection, Nodetype
    from rosbags.typesys import Stores, get_typestore

_JOINT_STATE = "sensor_msgs/msg/JointState"
_FAMILIES = {"q": "position", "qd": "velocity", "tau": "effort"}
_INDEX = re.compile(r"(\w+)\[(\d+)\]")


@dataclass
class _Stream:
    """Samples that share their stamps [ns]: one topic, or one set of joints on a joint-state topic."""

    label: str
    bag_stamps: list[int] = field(default_factory=list)
    header_stamps: list[int] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, message: object, bag_stamp: int, values: Mapping[str, float]) -> None:
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        self.bag_stamps.append(bag_stamp)
        self.header_stamps.append(0 if stamp is None else stamp.sec * 1_000_000_000 + stamp.nanosec)
        for name, value in values.items():
            self.values.setdefault(name, []).append(value)

    @property
    def stamps(self) -> np.ndarray:
        """Header stamps, or the bag's own where the messages carry none."""
        return np.array(self.header_stamps if any(self.header_stamps) else self.bag_stamps, dtype=np.int64)


_LARGEST_ARRAY = 1_000_000


def _check_folder(path: Path) -> None:
    """Refuse a bag's description that a parser would never get done with."""
    description = path / "metadata.yaml"
    # rosbag2 writes no aliases, of which a few lines can stand for gigabytes
    if path.is_dir() and description.exists() and re.search(rb"(?:^|[\s\[{,])[&*]\w", content(description)):
        raise InputError(f"{description}: has YAML aliases, which no bag needs; write them out")


def _check_definitions(path: Path, reader: AnyReader) -> None:
    """Refuse arrays so long that the code that rosbags writes to read them, line by line, would not fit in memory."""
    for name, (_, fields) in reader.typestore.fielddefs.items():
        for field_name, description in fields:
            kind, inside = description
            if kind == Nodetype.ARRAY and int(inside[1]) > _LARGEST_ARRAY:
                raise InputError(f"{path}: {name} has {inside[1]} of {field_name}; {_LARGEST_ARRAY} is the most")


def read(path: Path, wanted: Mapping[str, str]) -> Columns:
    """Read the joint states of a bag, and the columns that [signals] ``wanted`` (signal name to column) asks for.

    Raises InputError for a bag that cannot be read, a topic or field that is not there, and a bag with nothing to read.
    """
    _check_folder(path)
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            _check_definitions(path, reader)
            topics = {str(connection.topic) for connection in reader.connections}
            fields = {column: _topic_and_field(path, column, topics) for column in wanted.values() if column[:1] == "/"}
            streams = _streams(path, reader, fields)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # rosbags raises sqlite3, struct, type system and file errors as they come
        reason = " ".join(str(error).split())[:100]
        raise InputError(
            f"{path}: cannot be read as a ROS 2 bag ({type(error).__name__}: {reason}); "
            "give a folder with metadata.yaml, or an intact .db3 or .mcap"
        ) from error
    if not streams:
        raise InputError(
            f"{path}: holds no sensor_msgs/JointState; map its topics in [signals] ({', '.join(sorted(topics))})"
        )
    return _aligned(path, streams, wanted)


def _topic_and_field(path: Path, column: str, topics: Iterable[str]) -> tuple[str, str]:
    """Topic and field path of ``"/topic/field.path"``; topics may have slashes of their own."""
    matching = [topic for topic in topics if column.startswith(f"{topic}/")]
    if not matching:
        raise InputError(
            f"{path}: column {column!r} of [signals] is on none of its {len(list(topics))} topics; "
            f"nearest is {nearest(column, topics)!r}, write '/topic/field.path'"
        )
    topic = max(matching, key=len)
    return topic, column[len(topic) + 1 :]


def _streams(path: Path, reader: AnyReader, fields: Mapping[str, tuple[str, str]]) -> list[_Stream]:
    """All samples, stream by stream in the order of their first message."""
    topics = {topic for topic, _ in fields.values()}
    chosen: list[Connection] = [c for c in reader.connections if c.topic in topics or c.msgtype == _JOINT_STATE]
    streams: dict[tuple[str, ...], _Stream] = {}
    for connection, bag_stamp, data in reader.messages(chosen) if chosen else ():
        message = reader.deserialize(data, connection.msgtype)
        topic = connection.topic
        if topic in topics:
            values = {column: _number(path, message, column, at) for column, (on, at) in fields.items() if on == topic}
            streams.setdefault((topic,), _Stream(topic)).add(message, bag_stamp, values)
        if connection.msgtype == _JOINT_STATE:
            values = _joint_state(path, topic, message)
            if values:
                streams.setdefault((topic, *values), _Stream(topic)).add(message, bag_stamp, values)
    return list(streams.values())


def _joint_state(path: Path, topic: str, message: Any) -> dict[str, float]:
    """Position, velocity and effort by signal name; the arrays that a message leaves empty are left out."""
    values: dict[str, float] = {}
    for family, attribute in _FAMILIES.items():
        numbers = getattr(message, attribute)
        if len(numbers) and len(numbers) != len(message.name):
            raise InputError(
                f"{path}: a message of {topic} names {len(message.name)} joints and gives {len(numbers)} of {attribute}"
            )
        values |= {f"{family}.{joint}": float(number) for joint, number in zip(message.name, numbers, strict=False)}
    return values


def _number(path: Path, message: Any, column: str, at: str) -> float:
    """The number at a field path; a stamp is its seconds."""
    value: Any = message
    for part in at.split("."):
        match = _INDEX.fullmatch(part)
        name = match[1] if match else part
        if not hasattr(value, name):
            known = [known for known in getattr(value, "__dataclass_fields__", ()) if not known.startswith("__")]
            raise InputError(
                f"{path}: column {column!r} of [signals] has no field {name!r}; nearest is {nearest(name, known)!r}"
            )
        value = getattr(value, name)
        if match:
            value = value[int(match[2])] if int(match[2]) < len(value) else math.nan
    if hasattr(value, "nanosec"):
        return value.sec + value.nanosec * 1e-9
    if not isinstance(value, (int, float, np.number)):
        raise InputError(f"{path}: column {column!r} of [signals] is not one number; go on with '.field' or '[index]'")
    return float(value)


def _aligned(path: Path, streams: list[_Stream], wanted: Mapping[str, str]) -> Columns:
    clock = _clock(streams, wanted)
    stamps = clock.stamps
    notes = [f"time is the clock of {clock.label}"]
    notes += [
        f"{s.label}: messages carry no header stamp; the bag's are used" for s in streams if not any(s.header_stamps)
    ]
    arrays: dict[str, np.ndarray] = {"time": stamps / 1e9}
    problems: dict[str, str] = {}
    for stream in [clock, *(other for other in streams if other is not clock)]:
        index, shift = _nearest_samples(stream.stamps, stamps)
        matched = index >= 0
        if stream is not clock and not np.array_equal(stream.stamps, stamps):
            worst = f", shifted by at most {shift[matched].max() / 1e6:.3g} ms" if matched.any() else ""
            notes.append(
                f"{stream.label}: {len(index)} samples of the clock found {matched.sum()} of its {len(stream.stamps)} "
                f"messages within half a period{worst}; the others are NaN"
            )
        for name, numbers in stream.values.items():
            values = np.where(matched, np.array(numbers)[index], np.nan)
            if name in arrays:
                notes.append(f"{name} of {stream.label} is ignored; it was read before")
            elif name not in wanted.values() and np.isnan(values).all():
                notes.append(f"{name} of {stream.label} is ignored; it holds no number")
            elif not matched.any():
                problems[name] = f"no message of {stream.label} is within half a period of the clock of {clock.label}"
            else:
                arrays[name] = values
    return Columns(path, arrays, problems=problems, notes=tuple(notes))


def _clock(streams: list[_Stream], wanted: Mapping[str, str]) -> _Stream:
    """The stream that gives the recording's time."""
    by_column = {column: stream for stream in streams for column in stream.values}
    torques = [
        by_column[column] for signal, column in wanted.items() if signal.startswith("tau.") and column in by_column
    ]
    joint_states = [stream for stream in streams if any(not column.startswith("/") for column in stream.values)]
    mapped = [by_column[wanted["time"]]] if wanted.get("time") in by_column else []
    return [*mapped, *joint_states, *torques, *streams][0]


def _nearest_samples(stamps: np.ndarray, clock: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of the sample nearest to each stamp of the clock, -1 if half a period or more away, and its shift [ns]."""
    order = np.argsort(stamps, kind="stable")
    after = np.searchsorted(stamps[order], clock).clip(1, max(len(stamps) - 1, 1))
    candidates = np.stack([order[after - 1], order[np.minimum(after, len(stamps) - 1)]])
    shifts = np.abs(stamps[candidates] - clock)
    best = shifts.argmin(axis=0)
    index, shift = np.take_along_axis(candidates, best[None], 0)[0], shifts.min(axis=0)
    half_period = 0.5 * np.median(np.diff(clock)) if len(clock) > 1 else 0.0
    return np.where((shift == 0) | (shift < half_period), index, -1), shift
