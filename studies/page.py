"""A study's ``report.html``: what was found, a table of the paper's numbers and ours, a 3-D playback, and figures."""

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path

from ..files import written_whole
from ..report.html import figure, headline, page, paragraph, table
from ..report.provenance import PACKAGES, provenance
from ..report.strips import StripDrawing
from ..report.words import unit_words, words
from ..report.zoom import zoomable
from .outcome import FOLDER, Quantity

_KINDS = {
    "predicted": "A result of the model; nothing was set to meet the paper's number.",
    "calibrated": "A free parameter of the model was set to meet the paper's number: agreement here proves nothing.",
    "reference": "Our number; no agreement is claimed, and the paper has no number for it.",
}
_BESIDE = (
    "Our number; no agreement is claimed. Where the paper has a number, it is shown for its size: it measures "
    "something else."
)
"""Of ``reference``, where the paper's number stands beside one."""

# Where there is room, the playback stays in sight beside the plots that it moves.
_PLAYBACK = """<style>@media screen and (min-width:90rem){body>*{max-width:120rem}
main{display:grid;grid-template-columns:minmax(40rem,1fr) minmax(36rem,1fr);column-gap:2rem}
main>section{grid-column:1}#playback{grid-column:2;grid-row:1/span 99;position:sticky;top:0;align-self:start}}</style>
<div class="on-paper" id="playback-paper">
<p class="quiet" id="playback-said">The playback moves in the HTML file only: open it on a screen.</p></div>
<figure class="on-screen"><div class="plate"><iframe id="playback-frame" title="3-D playback"
style="display:block;width:100%;height:min(38rem,85vh);border:0"></iframe></div>
<figcaption>CAPTION</figcaption></figure>
<noscript><p>The playback needs JavaScript.</p></noscript>
<script type="application/octet-stream" id="playback-data">DATA</script>
<script>
new IntersectionObserver(async (entries, observer) => {
  if (!entries.some(entry => entry.isIntersecting)) return;
  observer.disconnect();
  const packed = Uint8Array.from(atob(document.getElementById("playback-data").textContent), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  document.getElementById("playback-frame").srcdoc = await new Response(stream).text();
}, {rootMargin: "1500px"}).observe(document.getElementById("playback-frame"));
(() => {
  const frame = document.getElementById("playback-frame"), clock = CLOCK;
  let ready = false, wanted = null;  // The playback speaks first; a time chosen before that waits.
  const seek = () => frame.contentWindow.postMessage({playbackTime: (wanted - clock.start) / clock.rate}, "*");
  document.addEventListener("timechosen", ({detail: {recording, time}}) => {
    if (recording !== "") return;
    wanted = time;
    if (ready) seek();
  });
  const still = document.createElement("img"), said = document.getElementById("playback-said");
  Object.assign(still, {id: "playback-still", style: "max-width:100%;max-height:90mm"});
  addEventListener("message", ({source, data}) => {
    if (source !== frame.contentWindow) return;
    if (data.playbackStill) {
      still.src = data.playbackStill;
      document.getElementById("playback-paper").prepend(still);
      const time = (clock.start + clock.rate * data.time).toFixed(2);
      still.alt = said.textContent = `The playback at ${time} s; it moves in the HTML file.`;
      return;
    }
    const time = clock.start + clock.rate * data.playbackTime;
    if (ready || wanted === null)
      document.dispatchEvent(new CustomEvent("timeplayed", {detail: {recording: "", time}}));
    else seek();
    ready = true;
  });
})();
</script>
"""


@dataclass(frozen=True)
class Picture:
    """One figure: its SVG, the same in words for those who cannot see it, and a caption."""

    svg: bytes
    alternative: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A part of the page below table and playback: a heading, paragraphs of plain text, pictures."""

    heading: str
    paragraphs: Sequence[str] = ()
    pictures: Sequence[Picture] = ()


@dataclass(frozen=True)
class Clock:
    """Time in the plots, of the axes that name no recording: ``start`` [s] plus ``rate`` times the playback's."""

    start: float = 0.0
    rate: float = 1.0


def write_page(
    study: str,
    title: str,
    found: str,
    quantities: Sequence[Quantity],
    sections: Sequence[Section] = (),
    playback: str | None = None,
    caption: str = "Drag to turn, scroll to come closer, right button to shift.",
    clock: Clock = Clock(),
    files: Sequence[tuple[str, str | Path]] = (),
) -> Path:
    """Write ``build/studies/<study>/report.html``, whole or not at all; returns its path.

    The page needs no other file and no network. The playback is packed, and unpacked when it comes into view.

    Parameters
    ----------
    study : str
        Name of the folder and of the make target.
    title : str
        What was studied, a few words.
    found : str
        What was found; its first sentence is the page's heading.
    quantities : sequence of Quantity
        The table.
    sections : sequence of Section
    playback : str, optional
        A page of its own, from `Playback.html`.
    caption : str
        What the playback shows.
    clock : Clock
        How the playback's time goes with that of the plots, whose cursor and it move each other.
    files : sequence of (str, str or Path)
        What the study was computed from, each with its role; the page ends with their hashes and all versions.
    """
    parts = [("numbers", "The paper's numbers and ours", _numbers(quantities))]
    if playback is not None:
        parts.append(("playback", "Playback in 3-D", _frame(playback, caption, clock)))
    for number, section in enumerate(sections, start=1):
        content = "".join(paragraph(text) for text in section.paragraphs)
        content += "".join(figure(p.svg, p.alternative, p.caption, zoom=_zoom(p)) for p in section.pictures)
        parts.append((f"part{number}", section.heading, content))
    origin = provenance(f"make study-{study}", files, (*PACKAGES, "exudyn", "numba", "scikit-learn"))
    parts.append(("origin", "Files and versions", origin.markup()))
    header = f'<p class="quiet">{escape(title)}</p>\n{headline(found)}'
    document = page(title, header, parts, f"Written by snarelab: make study-{study}.")
    folder = FOLDER / study
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "report.html"
    with written_whole(path) as part:
        part.write_text(document, encoding="utf-8")
    return path


def _numbers(quantities: Sequence[Quantity]) -> str:
    rows = [
        [
            escape(words(q.name)),
            escape("" if q.unit == "1" else unit_words(q.unit)),
            "–" if q.paper is None else f"{q.paper:g}",
            _text(q.ours) if isinstance(q.ours, float) else _said(_text(q.ours)),
            "" if q.low is None or q.high is None else f"{q.low:.4g} to {q.high:.4g}",
            q.kind,
        ]
        for q in quantities
    ]
    used = {q.kind for q in quantities}
    beside = any(q.kind == "reference" and q.paper is not None for q in quantities)
    said = {**_KINDS, "reference": _BESIDE} if beside else _KINDS
    kinds = "".join(f"<dt>{kind}</dt><dd>{text}</dd>" for kind, text in said.items() if kind in used)
    heads = ["quantity", "unit", "paper", "ours", "interval", "kind"]
    return table("", heads, rows, numeric=(2, 3, 4)) + f'<dl class="facts">{kinds}</dl>\n'


def _zoom(picture: Picture) -> str:
    strips = picture.svg.strips if isinstance(picture.svg, StripDrawing) else ()
    return zoomable(strips, picture.alternative) if strips else ""


def _said(words: str) -> str:
    return f'<span class="said">{escape(words)}</span>'


def _text(ours: float | str) -> str:
    return ours if isinstance(ours, str) else f"{ours:.4g}"


def _frame(playback: str, caption: str, clock: Clock) -> str:
    data = base64.b64encode(gzip.compress(playback.encode(), mtime=0)).decode("ascii")
    page = _PLAYBACK.replace("CAPTION", escape(caption)).replace("CLOCK", json.dumps(asdict(clock)))
    return page.replace("DATA", data)
