"""What a set of cases says of itself: the rules, and the vocabulary of names."""

from pathlib import Path
from typing import Any

from snarelab.models.effects import effects


def rules() -> str:
    """The page that goes with a set."""
    return Path(__file__).with_name("RULES.md").read_text(encoding="utf-8")


def vocabulary() -> list[dict[str, Any]]:
    """Names for what an arm may lack, with what each is in words, its law, kind of place, and parameters with units."""
    return [
        {
            "name": e.name,
            "at": e.at,
            "what": e.sentence,
            "law": e.equation,
            "parameters": {p.name: p.unit for p in e.parameters},
        }
        for e in sorted(effects().values(), key=lambda e: e.name)
        if e.at in ("joint", "link", "sensor")
    ]
