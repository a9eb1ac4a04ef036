"""Names that a shared library on Linux exports, read from the file without loading it."""

import platform
import struct
from pathlib import Path

_MACHINES = {"x86_64": 62, "aarch64": 183, "i686": 3, "i386": 3, "armv7l": 40, "riscv64": 243, "ppc64le": 21}
_DYNAMIC_SYMBOLS, _SYMBOL = 11, 24  # a section's kind, and the size of its entries
_LONGEST = 4096  # bytes of a name; the rest is left out


class ElfFault(Exception):
    """Why a file is no shared library for this machine."""


def exported_symbols(path: Path) -> set[str]:
    """Symbols that are defined in the library's dynamic table.

    Raises
    ------
    ElfFault
        No ELF file of 64 bits, little-endian, or one for another machine, or a broken one.
    """
    data = path.read_bytes()
    if data[:4] != b"\x7fELF":
        raise ElfFault("is no shared library")
    if data[4:6] != b"\x02\x01":
        raise ElfFault("is no library of 64 bits, little-endian")
    try:
        machine = struct.unpack_from("<H", data, 18)[0]
        if machine != _MACHINES.get(platform.machine(), machine):
            raise ElfFault(f"is built for another machine (ELF number {machine}) than this {platform.machine()}")
        (sections,) = struct.unpack_from("<Q", data, 40)
        size, count = struct.unpack_from("<HH", data, 58)
        headers = [struct.unpack_from("<IIQQQQIIQQ", data, sections + size * k) for k in range(count)]
        found: set[str] = set()
        for _, kind, _, _, offset, length, link, _, _, each in headers:
            if kind != _DYNAMIC_SYMBOLS:
                continue
            if found or each != _SYMBOL:
                raise ElfFault("is a broken ELF file")
            names = headers[link][4]
            for at in range(offset, offset + length, each):
                name, _, _, section = struct.unpack_from("<IBBH", data, at)
                if section:
                    start = names + name
                    found.add(data[start : start + _LONGEST].split(b"\0", 1)[0].decode("ascii", "replace"))
        return found
    except (struct.error, IndexError, ValueError):
        raise ElfFault("is a broken ELF file") from None
