"""Which packages there are: every folder with an ``__init__.py``, below ``snarelab``, which is this folder itself.

``pyproject.toml`` says all else. Its own search for packages knows no name for the folder that it starts in.
"""

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

OUTSIDE = ["tests*", "docs*", "bench*", "proof*", "build*"]


class WithoutThisFile(build_py):
    """The modules of each package but ``setup.py``, which stands beside them."""

    def find_package_modules(self, package: str, package_dir: str) -> list[tuple[str, str, str]]:
        """Package, module and file of each."""
        return [m for m in super().find_package_modules(package, package_dir) if m[:2] != ("snarelab", "setup")]


setup(
    packages=["snarelab", *(f"snarelab.{name}" for name in find_packages(exclude=OUTSIDE))],
    cmdclass={"build_py": WithoutThisFile},
)
