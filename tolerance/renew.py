"""``python -m snarelab.tolerance.renew [FILE]``: write the guarded numbers of captures anew.

FILE is ``tests/tolerances.toml`` where none is given. Only values change; what is allowed, units and comments stay. It
takes a few minutes of one core.
"""

import re
import sys
from collections.abc import Mapping
from pathlib import Path

from ..errors import InputError
from .guard import FARTHEST, arrival_numbers, envelope_end, ground_numbers, latched_numbers, load

FILE = Path("tests/tolerances.toml")


def measure(path: Path) -> dict[str, dict[str, float]]:
    """Every number of the file as it is today, by section and name; the envelope to a quarter of what is allowed."""
    before = load(path)
    ends = {axis: envelope_end(axis, 0.25 * before["envelope"][axis].allowed) for axis in FARTHEST}
    numbers = {"ground": ground_numbers(), "arrival": arrival_numbers(), "latched": latched_numbers()}
    return {"envelope": ends} | numbers


def rewritten(text: str, values: Mapping[str, Mapping[str, float]]) -> str:
    """The file's text with new values; everything else as it was."""
    section, lines = "", []
    for line in text.splitlines():
        head = re.match(r"\[(\w+)\]", line)
        section = head[1] if head else section
        name = line.partition("=")[0].strip()
        if not head and name in values.get(section, {}):
            line = re.sub(r"value = [^,]+,", f"value = {float(f'{values[section][name]:.6g}')!r},", line)
        lines.append(line)
    return "\n".join(lines) + "\n"


def main(arguments: list[str]) -> int:
    """Measure, say what moved, write."""
    path = Path(arguments[0]) if arguments else FILE
    try:
        before, after = load(path), measure(path)
    except InputError as error:
        print(f"snarelab: {error}", file=sys.stderr)
        return 2
    for section, rows in before.items():
        for name, guarded in rows.items():
            print(f"  {section}.{name:<22}{guarded.value:>12.6g}  ->{after[section][name]:>12.6g} {guarded.unit}")
    part = path.with_name(path.name + ".part")
    part.write_text(rewritten(path.read_text(encoding="utf-8"), after), encoding="utf-8")
    part.replace(path)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
