"""Nothing outlives the process that wanted it: workers end and temporary folders go with it, however it ends.

A process that is killed cleans up nothing, and one that hangs or has forked does not notice that nobody waits for it.
`guard` therefore splits a process in two. The first half, the warden, runs no foreign code: it waits for the worker,
the second half, to end, or for whoever started them to be gone. Then it ends the worker with everything that this has
started, removes its scratch folder, and ends as the worker did. `sweep` is the same for folders alone.

On Linux descendants that left their parents come to the warden (``PR_SET_CHILD_SUBREAPER``, see prctl(2)), so that a
daemon does not escape; elsewhere the worker's process group is ended. A copy of this file lies in each hosted FMU:
it needs Python's own library only.
"""

import ctypes
import os
import select
import shutil
import signal
import sys
import tempfile
import time
from contextlib import suppress

SCRATCH = "SNARELAB_SCRATCH"
"""The variable that names a guarded process's scratch folder."""

_DEATH_SIGNAL, _DUMPABLE, _SUBREAPER = 1, 4, 36  # linux/prctl.h
_GRACE = 1.0  # s that a worker gets to end by itself once nobody waits for it
_LONGEST = 5.0  # s of killing what forks ever on
_GLANCE = 0.5  # s between two looks at the parent, where the system gives no descriptor of a process
_DEAF = (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)


def guard(link: int, parent: int) -> str:
    """Split: returns in the worker, a new process and session of its own; never in the warden.

    Parameters
    ----------
    link : int
        Descriptor of a socket whose other end is the parent's alone; that it hangs up means that nobody waits.
    parent : int
        Process that is to be outlived by nothing.

    Returns
    -------
    str
        The worker's scratch folder, also in ``TMPDIR``.
    """
    with suppress(OSError):  # the starter may have done so
        os.setsid()
    for kind in _DEAF:  # Ctrl-C is for whoever started this
        signal.signal(kind, signal.SIG_IGN)
    alarm = _alarmed(signal.SIGCHLD, signal.SIGTERM)
    _prctl(_SUBREAPER, 1)
    scratch = tempfile.mkdtemp(prefix="snarelab-process-")
    warden = os.getpid()
    worker = os.fork()
    if worker:
        _watch(worker, link, parent, alarm, scratch)
    signal.set_wakeup_fd(-1)
    for kind in (signal.SIGCHLD, signal.SIGTERM):
        signal.signal(kind, signal.SIG_DFL)
    for descriptor in alarm:
        os.close(descriptor)
    os.setsid()
    _prctl(_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != warden:
        os._exit(1)
    os.environ["TMPDIR"] = os.environ[SCRATCH] = scratch
    tempfile.tempdir = None
    return scratch


def sweep(parent: int) -> None:
    """Make a folder, print its path, and remove it when the parent or standard input has ended."""
    for kind in (*_DEAF, signal.SIGTERM):
        signal.signal(kind, signal.SIG_IGN)
    folder = tempfile.mkdtemp(prefix="snarelab-")
    try:
        with suppress(OSError):
            os.write(1, folder.encode())
            os.close(1)
        poll = select.poll()
        poll.register(0, 0)
        _registered(poll, parent)
        while os.getppid() == parent and not poll.poll(_GLANCE * 1000):
            pass
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _watch(worker: int, link: int, parent: int, alarm: tuple[int, int], scratch: str) -> None:
    """Wait for the worker or for nobody to be left, end everything, and end as the worker did."""
    poll = select.poll()
    poll.register(link, 0)  # hanging up is always told
    poll.register(alarm[0], select.POLLIN)
    _registered(poll, parent)
    status, alone = None, None
    while status is None:
        if alone is not None and time.monotonic() > alone + _GRACE:
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
        told = {descriptor for descriptor, _ in poll.poll(_GLANCE * 1000 if alone is None else 20)}
        woken = os.read(alarm[0], 4096) if alarm[0] in told else b""
        status = _reaped(worker)
        for descriptor in (ended := told - {alarm[0]}):
            poll.unregister(descriptor)
        if alone is None and (ended or os.getppid() != parent):
            alone = time.monotonic()
        if signal.SIGTERM in woken:  # who sends it has waited
            alone = -_GRACE
    _end_descendants(worker)
    shutil.rmtree(scratch, ignore_errors=True)
    if os.WIFSIGNALED(status):
        kind = os.WTERMSIG(status)
        _prctl(_DUMPABLE, 0)  # one core file is enough
        if kind not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(kind, signal.SIG_DFL)
        os.kill(os.getpid(), kind)
        time.sleep(1.0)
    os._exit(os.waitstatus_to_exitcode(status) if os.WIFEXITED(status) else 1)


def _alarmed(*kinds: int) -> tuple[int, int]:
    """A pipe that tells of these signals."""
    reader, writer = os.pipe()
    for descriptor in (reader, writer):
        os.set_blocking(descriptor, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for kind in kinds:
        signal.signal(kind, lambda *_: None)
    return reader, writer


def _registered(poll: "select.poll", process: int) -> None:
    """Have a process's end told, where the system can (Linux 5.3)."""
    opened = getattr(os, "pidfd_open", None)
    if opened is not None:
        with suppress(OSError):
            poll.register(opened(process), select.POLLIN)


def _reaped(worker: int) -> "int | None":
    """Take what has ended from the system; the worker's status where it was among them."""
    found = None
    with suppress(ChildProcessError):
        while True:
            process, status = os.waitpid(-1, os.WNOHANG)
            if process == 0:
                break
            if process == worker:
                found = status
    return found


def _end_descendants(worker: int) -> None:
    """Kill whatever the worker has left, also what appears while it is done."""
    begun = time.monotonic()
    while time.monotonic() < begun + _LONGEST:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(worker, signal.SIGKILL)
        for process in _descendants(os.getpid()):
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process, signal.SIGKILL)
        try:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.002)
        except ChildProcessError:
            return


def _descendants(process: int) -> list[int]:
    """Children and theirs, by ``/proc``; none where the system has no such lists."""
    found, level = [], [process]
    while level:
        below = []
        for parent in level:
            with suppress(OSError):
                for task in os.listdir(f"/proc/{parent}/task"):
                    with open(f"/proc/{parent}/task/{task}/children") as listed:
                        below += [int(number) for number in listed.read().split()]
        found += below
        level = below
    return found


def _prctl(option: int, value: int) -> None:
    """prctl(2), on Linux."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value), 0, 0, 0)


if __name__ == "__main__":
    sweep(int(sys.argv[1]))
