"""Compile with a cache that knows all three files: numba's own looks only at the file that a function stands in.

Without that, a law that was changed would go on as it was inside the loop that calls it.
"""

# pyright: reportAttributeAccessIssue=false
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config

HERE = Path(__file__).parent
DIGEST = hashlib.sha256(b"".join((HERE / f"{name}.py").read_bytes() for name in ("bodies", "laws", "loop"))).hexdigest()
FOLDER = HERE / "__pycache__" / DIGEST[:16]


def compiled(function: Callable[..., Any]) -> Any:
    """The function as machine code, made once for these sources."""
    before, config.CACHE_DIR = config.CACHE_DIR, str(FOLDER)
    try:
        return numba.njit(cache=True)(function)
    finally:
        config.CACHE_DIR = before
