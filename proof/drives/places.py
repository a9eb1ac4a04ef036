"""Where things are: joint2, link2 and tau.joint2 are one place."""

import re


def joint(place: str) -> int:
    """Number of the joint that a place belongs to."""
    return int(re.findall(r"\d+", place)[-1])
