"""Exudyn, in its faster build where the processor allows it: no range checks, AVX2; about a third less time.

It has to be asked for before the first import, and would announce itself on standard output, which belongs to results.
Whoever imports Exudyn in this package does so from here: the builds differ in the last bits, and whichever a process
imports first is the one it keeps. Where a user's program has imported Exudyn before, its build is used.
"""

import contextlib
import io
import sys

from ..extras import needed_for

if "exudyn" not in sys.modules:
    sys.exudynFast = True  # pyright: ignore[reportAttributeAccessIssue]
    with contextlib.redirect_stdout(io.StringIO()), needed_for("a model in Exudyn"):
        import exudyn
else:
    import exudyn
import exudyn.itemInterface as items

__all__ = ["exudyn", "items"]
