"""Files: read within bounds, written whole or not at all.

What is read may come from anywhere. Sizes are therefore checked before anything is unpacked or parsed, nothing but a
regular file is opened (a pipe would never end), and a reader of a binary format runs under `bounded_memory`.
"""

import glob
import json
import lzma
import os
import re
import struct
import sys
import tomllib
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .errors import InputError

LARGEST_TEXT = 4 << 20
"""Most bytes of a TOML, JSON or XML file that a person writes."""

LARGEST_MEMORY = 12 << 30
"""Most bytes that a reader of a binary format may ask for, and the most that it may unpack into one file on disk."""

ZIP_FAULTS = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, OSError, EOFError, RuntimeError, ValueError)
"""What a damaged ZIP archive makes Python's reader raise; InputError is one of them, as a ValueError."""

_DEEPEST, _MOST = 32, 10_000  # how deep tables and lists lie, and how many entries one has
_DEEP_KEY = re.compile(rf"""(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{_DEEPEST}}}""")


def content(path: Path, largest: int = LARGEST_TEXT) -> bytes:
    """Bytes of a regular file; raises InputError where it is none, cannot be read, or is larger than ``largest``."""
    try:
        if not path.exists():
            raise InputError(f"{path}: no such file; check the path")
        if not path.is_file():
            raise InputError(f"{path}: cannot be read: it is not a regular file; name one")
        if path.stat().st_size > largest:
            raise InputError(f"{path}: has {path.stat().st_size} bytes; give a file of {largest} at most")
        return path.read_bytes()
    except InputError:
        raise
    except (OSError, ValueError) as error:  # a path with a null byte is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); check the file's permissions") from None


def toml_table(path: Path) -> dict[str, Any]:
    """A TOML file's table; raises InputError with the line that is wrong.

    Whole numbers have 64 bits, as the TOML standard has it, and tables and lists lie at most 32 deep, with
    10 000 entries each.
    """
    text = _text(path)
    if _DEEP_KEY.search(text):  # the parser's time grows with the square of a key's parts
        raise InputError(f"{path}: not a TOML file: a key has more than {_DEEPEST} parts; correct that line")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: not a TOML file: lies more than {_DEEPEST} deep; make it flatter") from None
    except ValueError as error:  # TOMLDecodeError, and numbers with thousands of digits
        raise InputError(f"{path}: not a TOML file: {error}; correct that line") from None
    _check_tree(path, table)
    return table


def json_value(path: Path) -> Any:
    """What a JSON file holds; raises InputError where it is none, with the same bounds as `toml_table`."""
    try:
        value = json.loads(_text(path))
    except (RecursionError, ValueError) as error:
        raise InputError(f"{path}: not a JSON file: {' '.join(str(error).split())}; write it anew") from None
    _check_tree(path, value)
    return value


def _text(path: Path) -> str:
    data = content(path)
    try:
        return data.removeprefix(b"\xef\xbb\xbf").decode()
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not UTF-8 text ({error.reason} at byte {error.start}); save it as UTF-8"
        ) from None


def _check_tree(path: Path, value: Any) -> None:
    level = [value]
    for _ in range(_DEEPEST):
        for leaf in level:
            if isinstance(leaf, dict | list) and len(leaf) > _MOST:
                raise InputError(f"{path}: a table or list has {len(leaf)} entries; {_MOST} is the most")
            if isinstance(leaf, int) and not -(2**63) <= leaf < 2**63:
                raise InputError(
                    f"{path}: a whole number of {leaf.bit_length()} bits; 64 is the most: write it as 1e30"
                )
        level = [x for v in level if isinstance(v, dict | list) for x in (v.values() if isinstance(v, dict) else v)]
    if level:
        raise InputError(f"{path}: lies more than {_DEEPEST} deep; make it flatter")


@contextmanager
def written_whole(path: Path, mend: str = "choose another folder") -> Iterator[Path]:
    """A place beside ``path`` to write to, that takes its name at the end; where anything fails, nothing is left.

    Raises InputError with ``mend`` where the disk is full or the folder cannot be written.
    """
    _sweep(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}; {mend}") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _sweep(path: Path) -> None:
    """Remove what processes left that were killed while they wrote this file."""
    for old in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        owner = old.name.split(".")[-2]
        if owner.isdigit() and not Path("/proc", owner).exists() and Path("/proc/self").exists():
            with suppress(OSError):
                old.unlink()


@contextmanager
def bounded_memory(path: Path) -> Iterator[None]:
    """Turns a file that would unpack to more than `LARGEST_MEMORY` into an InputError (Linux; elsewhere no bound).

    Some formats say how large they unpack only while they do. The limit is the process's own soft one, for as long as
    the reader runs.
    """
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    wanted = {
        resource.RLIMIT_AS: pages * resource.getpagesize() + LARGEST_MEMORY,
        resource.RLIMIT_FSIZE: LARGEST_MEMORY,
    }
    before = {kind: resource.getrlimit(kind) for kind in wanted}
    try:
        for kind, size in wanted.items():
            soft, hard = before[kind]
            lowest = min((limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY), default=size)
            resource.setrlimit(kind, (min(size, lowest), hard))
        yield
    except MemoryError:
        raise InputError(
            f"{path}: needs more than {LARGEST_MEMORY >> 30} GiB to be read; it is damaged, or cut it into parts"
        ) from None
    finally:
        for kind, limits in before.items():
            resource.setrlimit(kind, limits)
