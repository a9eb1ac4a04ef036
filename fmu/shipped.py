"""The FMUs that are shipped, for both versions of FMI, and a page that lists them: ``make fmus``.

``python -m snarelab.fmu.shipped [FOLDER]`` writes ``NAME-fmiV.fmu``, a page for each (the one inside it), and
``index.html``; FMPy validates each, and one that has a problem is an error.
"""

import sys
import zipfile
from html import escape
from pathlib import Path

from fmpy import read_model_description
from fmpy.validation import validate_fmu

from .elements import ELEMENTS
from .export import export
from .hosted import participant_names
from .page import STYLE


def build(folder: Path) -> list[Path]:
    """Write every shipped FMU and the pages; returns the FMUs.

    Raises
    ------
    RuntimeError
        Where FMPy finds a problem.
    InputError
        No C compiler, or a folder that cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written, rows = [], []
    for name in (*sorted(ELEMENTS), *participant_names()):
        for version in (2, 3):
            path = folder / f"{name}-fmi{version}.fmu"
            export(name, version, path)
            problems = validate_fmu(str(path))
            if problems:
                raise RuntimeError(f"{path}: {'; '.join(problems)}")
            with zipfile.ZipFile(path) as archive:
                path.with_suffix(".html").write_bytes(archive.read("documentation/index.html"))
            rows.append(_row(path))
            written.append(path)
    text = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>FMUs of snarelab</title><style>{STYLE}</style>'
    text += "<h1>FMUs of snarelab</h1><table><tr><th>file</th><th>FMI</th><th>runs</th><th>what it is</th></tr>"
    (folder / "index.html").write_text(text + "".join(rows) + "</table></html>\n", encoding="utf-8")
    return written


def _row(path: Path) -> str:
    described = read_model_description(str(path))
    capable = described.coSimulation
    assert capable is not None
    runs = "Python beside the importer" if capable.needsExecutionTool else "C, alone"
    return (
        f'<tr><td><a href="{escape(path.stem)}.html">{escape(path.name)}</a></td>'
        f"<td>{escape(str(described.fmiVersion))}</td><td>{runs}</td>"
        f"<td>{escape(described.description or '')}</td></tr>"
    )


def main() -> None:
    """Build into the folder named, or ``build/fmus``."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/fmus")
    for path in build(folder):
        print(f"{path}  {path.stat().st_size / 1024:.0f} KiB")
    print(f"Pages: {folder / 'index.html'}")


if __name__ == "__main__":
    main()
