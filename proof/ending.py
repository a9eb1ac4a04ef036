"""How every command of the proof speaks, and how it ends where it is refused or stopped."""

import sys
from collections.abc import Callable


def tell(words: str) -> None:
    """A line on standard output, at once."""
    print(words, flush=True)


def status_of(
    job: Callable[[], int | None],
    refusals: tuple[type[Exception], ...] = (ValueError, FileNotFoundError),
    refused: int = 2,
) -> int:
    """Run a job; its status, ``refused`` and one line for these errors, 130 where Ctrl-C stopped it."""
    try:
        return job() or 0
    except refusals as error:
        print(error, file=sys.stderr)
        return refused
    except KeyboardInterrupt:
        print("stopped; the same command goes on where it was", file=sys.stderr)
        return 130
