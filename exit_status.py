"""The exit statuses that every command and study shares, and one line where it is refused or stopped."""

import sys
from collections.abc import Callable

from .errors import InputError
from .extras import refusal
from .progress import terminated_is_interrupted


def status_of(job: Callable[[], int]) -> int:
    """Run a job; its status, 2 for unusable input, 130 where Ctrl-C or SIGTERM stopped it."""
    try:
        with terminated_is_interrupted():
            return job()
    except InputError as error:
        print(f"snarelab: {error}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        said = refusal(error)
        if said is None:
            raise
        print(f"snarelab: {said}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("snarelab: interrupted; files that are there are whole; run the same command again", file=sys.stderr)
        return 130
