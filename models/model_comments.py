"""A model file that is written again keeps the comments, the order and the spelling of the file it was read from."""

import re
from collections.abc import MutableMapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Array

_NOTE = re.compile(r"\A(?:#[^\n]*\n)*?#(?: snarelab diagnose| .*: values from snarelab identify) [^\n]*\n")
"""What an earlier writing put at the top: it is replaced, not piled up."""


def with_comments(source: Path, written: str) -> str:
    """What is written of a model, laid into the text of its source; as it stands where that cannot be read.

    Parameters
    ----------
    source : Path
        The file that the model was read from.
    written : str
        The whole new file, its note as comments at the top.
    """
    try:
        text = source.read_text(encoding="utf-8-sig")
        old = tomlkit.parse(_NOTE.sub("", text))
    except (OSError, UnicodeDecodeError, TOMLKitError):
        return written
    note = "".join(re.findall(r"\A((?:#[^\n]*\n)*)", written))
    new = tomlkit.parse(written)
    _merge(old, new)
    return note + old.as_string().lstrip("\n")


def _merge(old: MutableMapping[str, Any], new: MutableMapping[str, Any]) -> None:
    for key in [key for key in old if key not in new]:
        del old[key]
    for key, value in new.items():
        before = old.get(key)
        if before is None:
            old[key] = value
        elif isinstance(before, MutableMapping) and isinstance(value, MutableMapping):
            _merge(before, value)
        elif _plain(before) != _plain(value) and not (isinstance(before, Array) and _extended(before, value)):
            old[key] = value


def _extended(before: Array, value: Any) -> bool:
    """Append to a list what it lacks, where the rest is as it was."""
    had, wanted = _plain(before), _plain(value)
    if not (isinstance(wanted, list) and wanted[: len(had)] == had):
        return False
    for entry in wanted[len(had) :]:
        before.add_line(tomlkit.item(_inline(entry)), indent="    ")
    if wanted[len(had) :]:
        before.add_line(indent="")
    return True


def _inline(entry: Any) -> Any:
    if not isinstance(entry, dict):
        return entry
    table = tomlkit.inline_table()
    table.update(entry)
    return table


def _plain(value: Any) -> Any:
    return value.unwrap() if hasattr(value, "unwrap") else value
