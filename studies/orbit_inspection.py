"""Inspection: the arm catches a pin on its own base of 40 t; see `orbit`."""

import sys

from ..exit_status import status_of
from .orbit.capture import study


def main() -> int:
    """Run the study; leaves page and numbers in ``build/studies/orbit-inspection``."""
    return study("inspection")


if __name__ == "__main__":
    sys.exit(status_of(main))
