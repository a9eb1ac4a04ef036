"""A participant's state as bytes that contain data only: reading them runs no code.

A value is a letter and its content; numbers are little-endian, lengths have 64 bits:

====== ===========================================================================================
letter content
====== ===========================================================================================
N T F  none, true, false
i s b  whole number (as text), text, bytes: length, then so many bytes
f      number of 64 bits
a x    array, numpy's scalar: length and text of its type, number of dimensions, their lengths, values in C order
( [ {  tuple, list, mapping (keys and values in turn): number of entries, then these
D      dataclass: length and text "module:name", then its fields as a mapping
====== ===========================================================================================

A dataclass is one that the program has loaded already, with just its fields, and is filled without being called.
"""

import math
import struct
import sys
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

_MARK = b"snarelab state 1\n"
_DEEPEST = 50
_KINDS = "biufc"  # numpy's letters for truth and numbers


class StateError(ValueError):
    """A value that cannot be a state, or bytes that are none."""


def dumps(state: Any) -> bytes:
    """Bytes of a state.

    Raises
    ------
    StateError
        For anything but None, truth, numbers, text, bytes, arrays of numbers, and tuples, lists, mappings and
        dataclasses of these.
    """
    parts = [_MARK]
    _write(state, parts, 0)
    return b"".join(parts)


def loads(data: bytes) -> Any:
    """The state of bytes that `dumps` gave; raises StateError for others."""
    if not data.startswith(_MARK):
        raise StateError("these bytes are no state of a participant")
    reader = _Reader(data, len(_MARK))
    try:
        state = _read(reader, 0)
    except StateError:
        raise
    except (struct.error, ValueError, TypeError, OverflowError, MemoryError) as error:
        raise StateError(f"a damaged state ({error})") from None
    if reader.at != len(data):
        raise StateError("a damaged state: there is more than one value")
    return state


def _write(value: Any, parts: list[bytes], depth: int) -> None:
    if depth > _DEEPEST:
        raise StateError(f"a state lies more than {_DEEPEST} deep; make it flatter")
    kind = type(value)
    if value is None or value is True or value is False:
        parts.append({None: b"N", True: b"T", False: b"F"}[value])
    elif isinstance(value, np.ndarray | np.generic):
        _write_array(value, parts)
    elif kind is float:
        parts.append(b"f" + struct.pack("<d", value))
    elif kind in (int, str, bytes):
        content = value if isinstance(value, bytes) else str(value).encode()
        parts.append({int: b"i", str: b"s", bytes: b"b"}[kind] + _length(content))
    elif kind in (tuple, list):
        parts.append((b"(" if kind is tuple else b"[") + struct.pack("<Q", len(value)))
        for entry in value:
            _write(entry, parts, depth + 1)
    elif kind is dict:
        _write_mapping(value, parts, depth)
    elif is_dataclass(kind):
        parts.append(b"D" + _length(f"{kind.__module__}:{kind.__qualname__}".encode()))
        _write_mapping({field.name: getattr(value, field.name) for field in fields(value)}, parts, depth)
    else:
        raise StateError(
            f"a state holds a {kind.__name__}; give numbers, text, arrays, or tuples and mappings of these"
        )


def _write_array(value: np.ndarray | np.generic, parts: list[bytes]) -> None:
    if value.dtype.kind not in _KINDS:
        raise StateError(f"a state holds an array of {value.dtype}; give numbers")
    scalar = isinstance(value, np.generic)
    array = np.asarray(value, value.dtype.newbyteorder("<"))
    parts += [b"x" if scalar else b"a", _length(array.dtype.str.encode()), struct.pack("<Q", array.ndim)]
    parts += [struct.pack(f"<{array.ndim}Q", *array.shape), array.tobytes()]


def _write_mapping(value: dict[Any, Any], parts: list[bytes], depth: int) -> None:
    parts.append(b"{" + struct.pack("<Q", len(value)))
    for key, entry in value.items():
        _write(key, parts, depth + 1)
        _write(entry, parts, depth + 1)


def _length(content: bytes) -> bytes:
    return struct.pack("<Q", len(content)) + content


class _Reader:
    """Bytes, and how far they were read; never further than there are any."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at = data, at

    def take(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            raise StateError("a damaged state: it ends too early")
        self.at += size
        return self.data[self.at - size : self.at]

    def number(self) -> int:
        return struct.unpack("<Q", self.take(8))[0]

    def content(self) -> bytes:
        return self.take(self.number())


def _read(reader: _Reader, depth: int) -> Any:
    if depth > _DEEPEST:
        raise StateError(f"a damaged state: it lies more than {_DEEPEST} deep")
    letter = reader.take(1)
    if letter in b"NTF":
        return {b"N": None, b"T": True, b"F": False}[letter]
    if letter == b"f":
        return struct.unpack("<d", reader.take(8))[0]
    if letter in b"sb":
        return reader.content().decode() if letter == b"s" else reader.content()
    if letter == b"i":
        return _read_whole(reader)
    if letter in b"ax":
        return _read_array(reader, letter == b"x")
    if letter in b"([":
        entries = [_read(reader, depth + 1) for _ in range(reader.number())]
        return tuple(entries) if letter == b"(" else entries
    if letter == b"{":
        return {_read(reader, depth + 1): _read(reader, depth + 1) for _ in range(reader.number())}
    if letter == b"D":
        return _read_dataclass(reader, depth)
    raise StateError(f"a damaged state: {letter!r} stands for nothing")


def _read_whole(reader: _Reader) -> int:
    text = reader.content().decode()
    if not text.removeprefix("-").isdecimal():
        raise StateError("a damaged state: a whole number is none")
    try:
        return int(text)
    except ValueError as error:  # thousands of digits
        raise StateError(f"a damaged state: {error}") from None


def _read_array(reader: _Reader, scalar: bool) -> Any:
    name = reader.content().decode()
    if len(name) > 4 or name[:1] not in "<|" or name[1:2] not in _KINDS:
        raise StateError(f"a damaged state: {name[:40]!r} is no type of numbers")
    dtype = np.dtype(name)
    n_dimensions = reader.number()
    if n_dimensions > 32:
        raise StateError("a damaged state: an array has more than 32 dimensions")
    shape = struct.unpack(f"<{n_dimensions}Q", reader.take(8 * n_dimensions))
    values = np.frombuffer(reader.take(math.prod(shape) * dtype.itemsize), dtype).reshape(shape)
    values = values.astype(dtype.newbyteorder("="))
    return values[()] if scalar else values


def _read_dataclass(reader: _Reader, depth: int) -> Any:
    name = reader.content().decode()
    module, _, path = name.partition(":")
    kind: Any = sys.modules.get(module)
    for part in path.split("."):
        kind = vars(kind).get(part) if kind is not None and hasattr(kind, "__dict__") else None
    if not (isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == module):
        raise StateError(f"a damaged state: {name[:80]!r} is no dataclass of this model")
    if reader.take(1) != b"{":
        raise StateError("a damaged state: a dataclass has no fields")
    given = {_read(reader, depth + 1): _read(reader, depth + 1) for _ in range(reader.number())}
    if list(given) != [field.name for field in fields(kind)]:
        raise StateError(f"a state of another version: {name[:80]!r} has other fields here")
    made = object.__new__(kind)
    for key, value in given.items():
        object.__setattr__(made, key, value)
    return made
