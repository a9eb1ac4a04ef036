"""Write what is generated: ``python docs/make_pages.py``.

``effects.md`` from the effects, ``commands.md`` from the program's parser, the README's table of what can be named,
the numbers that decide in ``method.md``, and picture and table of ``architecture.md`` from the imports. A test compares
each with the code, so that none goes stale; ``make docs`` writes them before it builds the pages.
"""

from pathlib import Path

import make_architecture
import make_commands
import make_deciding
import make_effects

DOCS = Path(__file__).resolve().parent
README, METHOD = DOCS.parent / "README.md", DOCS / "method.md"
ARCHITECTURE = DOCS / "architecture.md"


def pages() -> dict[Path, str]:
    """Each file and what should stand in it."""
    return {
        DOCS / "effects.md": make_effects.page(),
        DOCS / "commands.md": make_commands.page(),
        DOCS / "architecture.svg": make_architecture.picture(),
        ARCHITECTURE: _between(ARCHITECTURE, "parts", make_architecture.table()),
        README: _between(README, "effects", make_effects.families()),
        METHOD: _between(METHOD, "numbers", make_deciding.table()),
    }


def _between(page: Path, what: str, text: str) -> str:
    """A page with a text between its marks of what it is."""
    begin, end = f"<!-- {what}: written by docs/make_pages.py -->\n", f"<!-- end of {what} -->"
    before, rest = page.read_text(encoding="utf-8").split(begin)
    return before + begin + text + end + rest.split(end)[1]


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
