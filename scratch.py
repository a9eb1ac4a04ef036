"""Temporary folders that are gone once the process that made them is, even where it was killed."""

import atexit
import os
import select
import shutil
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from .warden import SCRATCH

_ROOTS: dict[int, str] = {}
_START = 20_000  # ms for a small Python to come up


def scratch_folder(prefix: str) -> str:
    """A new empty folder; to be removed by whoever asked for it, and at the latest when this process has ended."""
    return tempfile.mkdtemp(prefix=prefix, dir=scratch_root())


def scratch_root() -> str:
    """The process's own folder, with a process beside it that removes it in the end."""
    guarded = os.environ.get(SCRATCH, "")
    if os.path.isdir(guarded):
        return guarded
    here = os.getpid()
    if here not in _ROOTS:
        _ROOTS[here] = _swept(here) if hasattr(os, "posix_spawn") else tempfile.mkdtemp(prefix="snarelab-")
    return _ROOTS[here]


def _swept(here: int) -> str:
    """Start the sweeper; it makes the folder, so that no moment is left at which a kill would leave one."""
    (theirs, lifeline), (answer, told) = os.pipe(), os.pipe()
    opened = os.open(os.devnull, os.O_WRONLY)
    # Descriptors 0 to 2 may be free in a daemon, so that the pipes may have just these numbers: moved out of the way.
    lifeline, moved = _above(lifeline), [_above(descriptor) for descriptor in (theirs, told, opened)]
    actions = [(os.POSIX_SPAWN_DUP2, descriptor, number) for number, descriptor in enumerate(moved)]
    script = str(Path(__file__).with_name("warden.py"))
    process = os.posix_spawn(
        sys.executable, [sys.executable, "-I", "-S", script, str(here)], os.environ, file_actions=actions, setsid=True
    )
    for descriptor in moved:
        os.close(descriptor)
    poll = select.poll()
    poll.register(answer, select.POLLIN)
    folder = os.read(answer, 4096).decode() if poll.poll(_START) else ""
    os.close(answer)
    if not folder:
        raise OSError(
            f"{sys.executable} did not start to keep temporary folders; set TMPDIR to one that can be written"
        )
    atexit.register(_finished, here, process, lifeline, folder)
    return folder


def _above(descriptor: int) -> int:
    """The pipe or file of a descriptor under a number above the standard streams'."""
    if descriptor > 2:
        return descriptor
    import fcntl

    moved = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 3)
    os.close(descriptor)
    return moved


def _finished(owner: int, process: int, lifeline: int, folder: str) -> None:
    """Remove the folder and let the sweeper end; not in a process that was forked."""
    if os.getpid() != owner:
        return
    shutil.rmtree(folder, ignore_errors=True)
    with suppress(OSError):
        os.close(lifeline)
        os.waitpid(process, 0)
