"""Shared libraries from C source, built once with the machine's own compiler and kept in the user's cache."""

import ctypes
import functools
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

_DIGEST_BYTES = 32
# No -march=native: a home folder may be shared between machines. No contraction: the same bits on all of them.
_FLAGS = ("-ffp-contract=off", "-shared", "-fPIC", "-fvisibility=hidden", "-w")


def load_library(source: str, optimisation: int = 1) -> ctypes.CDLL:
    """The library of a C source, from the cache or newly built there.

    Parameters
    ----------
    source : str
    optimisation : int
        The compiler's -O. Straight-line code gains next to nothing from more than 1, and compiles in half the time;
        3 turns loops into vector instructions.

    Notes
    -----
    The environment variable ``SNARELAB_CC`` names the compiler (``none``: use no compiler); else ``cc``, ``gcc`` or
    ``clang`` is taken. Libraries are kept in ``$XDG_CACHE_HOME/snarelab`` or ``~/.cache/snarelab``. Threads and
    processes may ask for the same library at once.

    Raises
    ------
    OSError, subprocess.SubprocessError
        Where there is no compiler, it fails, or the cache cannot be written.
    """
    compiler, version = find_compiler(os.environ.get("SNARELAB_CC", ""), os.environ.get("PATH", ""))
    flags = (f"-O{optimisation}", *_FLAGS)
    identity = "\0".join([source, *compiler, version, platform.machine(), *flags])
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "snarelab"
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = cache / f"{hashlib.sha256(identity.encode()).hexdigest()}.so"
    if not _intact(path):
        with tempfile.TemporaryDirectory(dir=cache) as folder:
            built = Path(folder) / path.name
            command = [*compiler, *flags, "-x", "c", "-", "-o", str(built), "-lm"]
            run = subprocess.run(command, input=source, capture_output=True, text=True, check=False)
            if run.returncode:
                complaint = (run.stderr.strip().splitlines() or ["no message"])[0]
                raise OSError(f"{compiler[0]} failed with '{complaint}'")
            built.write_bytes(built.read_bytes() + hashlib.sha256(built.read_bytes()).digest())
            built.replace(path)
    return ctypes.CDLL(str(path))


def _intact(path: Path) -> bool:
    """Whether the library is there and ends in its own digest: a torn file may load and then crash."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return False
    return hashlib.sha256(content[:-_DIGEST_BYTES]).digest() == content[-_DIGEST_BYTES:]


@functools.cache
def find_compiler(named: str, search_path: str) -> tuple[tuple[str, ...], str]:
    """Command and version of the C compiler; OSError where there is none."""
    if named == "none":
        raise OSError("SNARELAB_CC is 'none'")
    for candidate in [named] if named else ["cc", "gcc", "clang"]:
        try:
            program, *options = shlex.split(candidate)
            found = shutil.which(program, path=search_path)
            if found:
                run = subprocess.run([found, "--version"], capture_output=True, text=True, check=True)
                return (found, *options), run.stdout
        except (ValueError, subprocess.SubprocessError) as error:
            raise OSError(f"the C compiler '{candidate}' cannot be run: {error}") from None
    raise OSError(f"SNARELAB_CC is '{named}', which is not found" if named else "no cc, gcc or clang on PATH")
