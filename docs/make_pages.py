"""Write what is generated: ``python docs/make_pages.py``.

``effects.md`` from the effects, ``commands.md`` from the program's parser, and the README's table of what can be named.
A test compares each with the code, so that none goes stale; ``make docs`` writes them before it builds the pages.
"""

from pathlib import Path

import make_commands
import make_effects

DOCS = Path(__file__).resolve().parent
README = DOCS.parent / "README.md"
BEGIN, END = "<!-- effects: written by docs/make_pages.py -->\n", "<!-- end of effects -->"


def pages() -> dict[Path, str]:
    """Each file and what should stand in it."""
    before, rest = README.read_text(encoding="utf-8").split(BEGIN)
    after = rest.split(END)[1]
    return {
        DOCS / "effects.md": make_effects.page(),
        DOCS / "commands.md": make_commands.page(),
        README: before + BEGIN + make_effects.families() + END + after,
    }


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
