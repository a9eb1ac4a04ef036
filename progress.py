"""Long work on the terminal: one line, rewritten, with the time left where that is known; nothing in a pipe.

With ``--verbose`` each message is a line of Python's logging on standard error instead, in a pipe too.
"""

import logging
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .errors import one_line

LOG = logging.getLogger("snarelab")
_COUNT = re.compile(r"(\d+) of (?:at most )?(\d+)")
_NUMBER = re.compile(r"(?<!round )(?<![\d.])[\d.]+")
_INTERRUPTED = threading.Event()
_QUIET = threading.Event()
_RARELY = 0.2
"""Least time between two rewritten lines of the same kind [s]."""


class Progress:
    """A context that gives ``show(text)``: what is under way, the time since its start, rate and time left.

    Rate and time left follow from the share that is done: the caller's ``share``, or "3 of 8" in the text, which then
    counts from the first text of that wording on. Nothing is said of them before there is something to judge by.
    """

    def __init__(self) -> None:
        """Start the clock."""
        self._shown = sys.stderr.isatty() and not LOG.isEnabledFor(logging.INFO) and not _QUIET.is_set()
        self._start = self._since = time.monotonic()
        self._wording, self._first, self._count, self._last = "", 0.0, 0, 0.0

    def __enter__(self) -> "Progress":
        """Ready."""
        return self

    def __call__(self, text: str, share: float | None = None) -> None:
        """Say what is under way, and which share of it is done, 0 to 1."""
        if _INTERRUPTED.is_set():
            raise KeyboardInterrupt
        text, now = one_line(text), time.monotonic()
        wording, count = _NUMBER.sub("", text), _COUNT.search(text)
        if share is None and count:
            share = int(count[1]) / max(int(count[2]), 1)
        if wording != self._wording:
            LOG.info(text)
            self._wording, self._since, self._first, self._last = wording, now, share or 0.0, 0.0
            self._count = int(count[1]) if count else 0
        else:
            LOG.debug(text)
        if not self._shown or now - self._last < _RARELY:
            return
        self._last = now
        parts = [duration(now - self._start)]
        if share is not None and share > self._first and now > self._since:
            seconds = now - self._since
            if count and int(count[1]) > self._count:
                parts.append(_rate((int(count[1]) - self._count) / seconds))
            left = (1.0 - share) * seconds / (share - self._first)
            if left >= 0.5:
                parts.append(f"{duration(left)} left")
        bar = "" if share is None else f" {_bar(share)}"
        line = f"[{', '.join(parts)}]{bar} {text}"
        columns = shutil.get_terminal_size().columns  # a longer line wraps, and its first half stays
        print(f"\r\x1b[2K{line[: columns - 1]}", end="", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        """Leave the line empty."""
        if self._shown:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)


def _rate(each_second: float) -> str:
    return f"{each_second:.2g}/s" if each_second >= 0.1 else f"{60 * each_second:.2g}/min"


def _bar(share: float) -> str:
    """Ten places of a bar."""
    full = round(10 * min(max(share, 0.0), 1.0))
    return "━" * full + "─" * (10 - full)


def stages(say: Callable[[str], None]) -> Callable[[str], None]:
    """Progress in lines: a text is said where its wording is new, indented and cut before its count."""
    last = ""

    def told(text: str) -> None:
        nonlocal last
        before, last = last, _NUMBER.sub("", text)
        if last != before:
            count = _COUNT.search(text)
            say(f"  {text[: count.start()].rstrip(', ') if count else text}")

    return told


def duration(seconds: float) -> str:
    """``8 s``, ``2 min 05 s``, ``3 h 20 min``."""
    whole = round(max(seconds, 0.0))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02} min"


@contextmanager
def terminated_is_interrupted() -> Iterator[None]:
    """SIGTERM ends a command as Ctrl-C does: with whole files.

    Where Python is in an object's finaliser as the signal comes, it drops the KeyboardInterrupt (Dask's futures have
    such); the next call of a `Progress` then raises it again.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(*_: object) -> None:
        _INTERRUPTED.set()
        raise KeyboardInterrupt

    before = {kind: signal.getsignal(kind) for kind in (signal.SIGINT, signal.SIGTERM)}
    hook = sys.unraisablehook
    sys.unraisablehook = lambda dropped: None if dropped.exc_type is KeyboardInterrupt else hook(dropped)
    _INTERRUPTED.clear()
    try:
        for kind, handler in before.items():
            if handler != signal.SIG_IGN:
                signal.signal(kind, interrupt)
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)
        sys.unraisablehook = hook
        _INTERRUPTED.clear()


def start_logging(verbose: int, quiet: bool = False) -> None:
    """Log to standard error from warnings on, with ``-v`` what is under way, with ``-vv`` every step of it.

    ``quiet``: no progress on a terminal either.
    """
    (_QUIET.set if quiet else _QUIET.clear)()
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    LOG.setLevel(level)
    LOG.handlers.clear()
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s", "%H:%M:%S"))
    LOG.addHandler(handler)
    LOG.propagate = False
