"""A check of the nesting of a MATLAB 5 file's elements.

SciPy trusts an element's type and size: a few wrong bytes in a file crash the interpreter (seen with SciPy 1.17).
Compressed variables are unpacked to be checked, one at a time and no further than a recording may go.

Layout: The MathWorks, "MAT-File Format", the part on level 5 files.
"""

import math
import struct
import zlib
from pathlib import Path

from .columns import LARGEST, check_size

_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 14: 1, 15: 1, 16: 1, 17: 2, 18: 4}
_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 9, 12, 13)
_TEXT = (1, 2, 4, 16, 17, 18)
_UINT32, _MATRIX, _COMPRESSED = 6, 14, 15
_INTEGER, _NAME = (5, 6), (1, 16)
_COMPLEX = 0x800
_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 5, 16, 17
_NUMERIC = range(6, 16)
_Element = tuple[int, bytes]


def check_structure(path: Path, data: bytes) -> None:
    """Raise ValueError for an impossible element of a version 5 file; other versions pass.

    Raises InputError where its variables unpack to more than is read of a recording.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is not None and data[:4].strip(b"\0"):
        size = 0
        for kind, content in _elements(data[128:], order):
            _require(kind in (_MATRIX, _COMPRESSED))
            if kind == _COMPRESSED:
                unpacked = zlib.decompressobj().decompress(content, LARGEST + 1 - size)
                size += len(unpacked)
                check_size(path, size)
                ((kind, content),) = _elements(unpacked, order)
                _require(kind == _MATRIX)
            _check_matrix(content, order)


def _elements(data: bytes, order: str) -> list[_Element]:
    """Type and content of each element; short ones share one 8-byte word with their tag."""
    found: list[_Element] = []
    at = 0
    while at < len(data):
        _require(at + 8 <= len(data))
        kind, size = struct.unpack_from(f"{order}II", data, at)
        begin = at + 8
        if kind >> 16:
            kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
            _require(size <= 4)
        _require(kind in _BYTES and size % _BYTES[kind] == 0 and begin + size <= len(data))
        found.append((kind, data[begin : begin + size]))
        at = begin + size if kind == _COMPRESSED else begin + size + -(begin + size) % 8
    return found


def _check_matrix(data: bytes, order: str) -> None:
    """One array: flags, dimensions, name, then what its class asks for."""
    if not data:
        return
    (kind, flags), *rest = _elements(data, order)
    _require(kind == _UINT32 and len(flags) == 8)
    (word,) = struct.unpack(f"{order}I", flags[:4])
    family, parts = word & 0xFF, 2 if word & _COMPLEX else 1
    _require(family in range(1, 18))
    if family == _OPAQUE:  # name, type and class, then what it holds
        _require(len(rest) == 4 and all(kind in _NAME for kind, _ in rest[:3]) and rest[3][0] == _MATRIX)
        return _check_matrix(rest[3][1], order)
    _require(len(rest) >= 2 and rest[0][0] in _INTEGER and len(rest[0][1]) >= 8 and rest[1][0] in _NAME)
    shape = struct.unpack(f"{order}{len(rest[0][1]) // 4}i", rest[0][1])
    _require(min(shape) >= 0)
    body = rest[2:]
    if family in (_CELL, _STRUCT, _OBJECT):
        children = body
        count = math.prod(shape)
        if family != _CELL:
            names = body[1:] if family == _OBJECT else body
            _require(len(names) >= 2 and names[0][0] in _INTEGER and len(names[0][1]) == 4 and names[1][0] in _NAME)
            width = struct.unpack(f"{order}i", names[0][1])[0]
            _require(width > 0 and len(names[1][1]) % width == 0)
            children, count = names[2:], count * (len(names[1][1]) // width)
        _require(len(children) == count)
        for kind, content in children:
            _require(kind == _MATRIX)
            _check_matrix(content, order)
    elif family == _FUNCTION:
        _require(len(body) == 1 and body[0][0] == _MATRIX)
        _check_matrix(body[0][1], order)
    elif family == _SPARSE:
        _require(len(body) == 2 + parts and all(kind in _INTEGER for kind, _ in body[:2]))
        _require(all(kind in _NUMBERS for kind, _ in body[2:]))
        _require(len(shape) == 2 and len(body[1][1]) == 4 * (shape[1] + 1))
    elif family in _NUMERIC:
        _require(len(body) == parts and all(kind in _NUMBERS for kind, _ in body))
        _require(all(len(content) == math.prod(shape) * _BYTES[kind] for kind, content in body))
    else:
        _require(bool(body) and body[0][0] in _TEXT)


def _require(holds: bool) -> None:
    if not holds:
        raise ValueError("an element of the file does not fit its size or type")
