"""Run the notebooks of these pages and store what they show: ``python docs/run_notebooks.py [NAME ...]``.

The stored outputs are what the pages show; building the pages runs nothing. A test runs every notebook again and
compares names and verdicts with those stored (``tests/docs/test_notebooks.py``).
"""

import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

DOCS = Path(__file__).resolve().parent
LONGEST = 1800
"""Longest that one cell may take [s]."""


def notebooks() -> list[Path]:
    """Every notebook of the pages."""
    return sorted(DOCS.glob("*.ipynb"))


def run(path: Path) -> Any:
    """A notebook with fresh outputs; raises nbclient's CellExecutionError where a cell fails."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook, timeout=LONGEST, kernel_name="python3", resources={"metadata": {"path": str(DOCS)}}
    )
    client.execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "text/html" in data:  # the same picture again
                data.pop("image/svg+xml", None)
        for key in ("execution", "collapsed"):  # times of day: another one at each run
            cell.metadata.pop(key, None)
    return notebook


if __name__ == "__main__":
    for one in [DOCS / f"{name}.ipynb" for name in sys.argv[1:]] or notebooks():
        nbformat.write(run(one), one)
