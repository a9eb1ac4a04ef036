"""What FMI calls this machine's binaries, and the folder they lie in."""

import platform
import sys


def library_suffix() -> str:
    """Ending of a shared library's name on this machine."""
    return {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def binary_folder(version: int) -> str:
    """Name of this platform's folder under ``binaries``."""
    machine = {"AMD64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    if version == 3:
        return f"{machine}-{system}"
    bits = "64" if machine in ("x86_64", "aarch64") else "32"
    return {"windows": "win", "darwin": "darwin", "linux": "linux"}[system] + bits
