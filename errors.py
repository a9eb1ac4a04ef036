"""The one exception that means "the user can mend this", and what its messages are made with."""

import difflib
from collections.abc import Iterable

_LONGEST = 4000


def one_line(text: object) -> str:
    """A text from anywhere as one line: control characters written out, cut after 4000 characters."""
    text = str(text)
    line = "".join(c if c.isprintable() else " " if c in "\r\n\t" else ascii(c)[1:-1] for c in text[:_LONGEST])
    return line if max(len(text), len(line)) <= _LONGEST else f"{line[:_LONGEST]} ..."


class InputError(ValueError):
    """Input that cannot be used: what it is, the value, what is allowed, the mend, in one line.

    The command line prints it as it stands and exits with status 2; nothing is written before it is raised. What the
    message quotes may come from anywhere, see `one_line`.
    """

    def __init__(self, message: object = "") -> None:
        """Make one line of the message."""
        super().__init__(one_line(message))


def nearest(name: str, known: Iterable[str], likeness: float = 0.0) -> str:
    """The known name that is spelled most like ``name``, of this ``likeness`` (0 to 1) at least; ``""`` for none."""
    by_spelling = {candidate.casefold(): candidate for candidate in known}
    close = difflib.get_close_matches(name.casefold(), by_spelling, n=1, cutoff=likeness)
    return by_spelling[close[0]] if close else ""


def unknown_key(path: object, key: str, allowed: Iterable[str], table: str = "") -> InputError:
    """The fault that a file has a key which nothing reads: all that are allowed, and one that is spelled like it."""
    allowed = list(allowed)
    near = nearest(key, allowed, 0.6)
    place = f" in [{table}]" if table else ""
    hint = f"; did you mean {near!r}?" if near else ""
    return InputError(f"{path}: unknown key {key!r}{place}; allowed are {', '.join(allowed)}{hint}")
