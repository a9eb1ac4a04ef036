"""The documentation page inside an FMU, and its icon."""

import struct
import zlib
from html import escape
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

import numpy as np

from .. import __version__
from .equations import ModelVariable

if TYPE_CHECKING:
    from .description import ModelInfo

STYLE = """:root{color-scheme:light dark}
body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}
table{border-collapse:collapse;width:100%;margin-bottom:1.5rem}th,td{text-align:left;padding:.25rem .6rem;border-bottom:
1px solid #8888;vertical-align:top}td.b{white-space:nowrap}td.n{text-align:right;font-variant-numeric:tabular-nums}
code{font-size:.95em}h1{font-size:1.5rem}h2{font-size:1.1rem;margin-top:2rem}
@media screen and (max-width:40rem){body{overflow-wrap:anywhere}tr{display:flex;flex-wrap:wrap;padding:.3rem 0;
border-bottom:1px solid #8888}th,td{border:0;padding:0 1rem 0 0}
:is(th,td):is(:first-child,:last-child){flex-basis:100%}}"""

_HEADINGS = {"input": "Inputs", "parameter": "Parameters", "output": "Outputs"}


def page(about: "ModelInfo", variables: tuple[ModelVariable, ...], version: int) -> str:
    """HTML: the model, its capabilities, and every variable."""
    abilities = {
        "saves, restores and serialises its state, exactly": about.saves,
        "gives directional derivatives of outputs by inputs and parameters, states held": about.derivatives,
        "takes first derivatives of inputs (FMI 2.0)": about.interpolates and version == 2,
        "runs a Python process beside the importer; see resources/host.json": about.needs_tool,
        "needs nothing but the C library": not about.needs_tool,
    }
    parts = [
        '<!doctype html><html lang="en"><meta charset="utf-8">',
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{escape(about.name)}</title>',
        f"<style>{STYLE}</style>",
        f"<h1>{escape(about.name)}</h1><p>{escape(about.description)}</p>",
        f"<p>FMI {version}.0 co-simulation, any number of instances, any communication step. Made with snarelab "
        f"{__version__}. It:</p><ul>",
        *(f"<li>{escape(text)}</li>" for text, true in abilities.items() if true),
        "</ul>",
    ]
    order = list(_HEADINGS)
    for causality, members in groupby(sorted(variables, key=lambda v: order.index(v.causality)), lambda v: v.causality):
        parts.append(f"<h2>{_HEADINGS[causality]}</h2><table><tr><th>name</th><th>unit</th>")
        parts.append("<th>meaning</th>" if causality == "output" else "<th>start</th><th>bounds</th><th>meaning</th>")
        for v in members:
            numbers = (
                "" if causality == "output" else f'<td class="n">{v.start:.6g}</td><td class="b">{_bounds(v)}</td>'
            )
            fixed = " (fixed after initialization)" if v.fixed else ""
            parts.append(
                f"<tr><td><code>{escape(v.name)}</code></td><td>{escape(_unit(v.unit))}</td>{numbers}"
                f"<td>{escape(v.description)}{fixed}</td></tr>"
            )
        parts.append("</table>")
    return "\n".join([*parts, "</html>"]) + "\n"


def _unit(text: str) -> str:
    return text.replace("**", "^").replace("*", "·")


def _bounds(v: ModelVariable) -> str:
    if not np.isfinite([v.minimum, v.maximum]).any():
        return ""
    low = "−∞" if v.minimum == -np.inf else f"{v.minimum:.4g}"
    return f"{low} … {'∞' if v.maximum == np.inf else f'{v.maximum:.4g}'}"


def icon() -> bytes:
    """PNG of a two-link arm reaching for a ring."""
    size = 128
    y, x = np.mgrid[0:size, 0:size] / (size - 1.0)
    image = np.full((size, size, 3), 255, np.uint8)
    joints = [(0.18, 0.86), (0.34, 0.42), (0.62, 0.56)]
    for (ax, ay), (bx, by) in pairwise(joints):
        along = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2), 0, 1)
        image[np.hypot(x - ax - along * (bx - ax), y - ay - along * (by - ay)) < 0.04] = (47, 72, 88)
    for jx, jy in joints:
        image[np.hypot(x - jx, y - jy) < 0.07] = (51, 101, 138)
    ring = np.hypot(x - 0.78, y - 0.36)
    image[(ring > 0.10) & (ring < 0.15)] = (246, 134, 53)
    rows = b"".join(b"\0" + row.tobytes() for row in image)
    header = struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 9)), (b"IEND", b""))
    body = b"".join(struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + body
