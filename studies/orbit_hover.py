"""Hover: the arm catches a target of 10 t that floats by itself; see `orbit`."""

import sys

from ..exit_status import status_of
from .orbit.capture import study


def main() -> int:
    """Run the study; leaves page and numbers in ``build/studies/orbit-hover``."""
    return study("hover")


if __name__ == "__main__":
    sys.exit(status_of(main))
