"""The page around a report's sections: escaped markup and its style, nothing fetched from elsewhere."""

import base64
from collections.abc import Sequence
from html import escape

from . import time_cursor, zoom
from .time_axes import time_axes

STYLE = """
:root{color-scheme:light dark;--paper:#fff;--ink:#1c2329;--quiet:#56616b;--line:#d5dbe0;--card:#f5f7f9;--accent:#00588f;
--missing:#a34700;--adequate:#00664b;--unknown:#7a3f66;--plate:#fff}
@media (prefers-color-scheme:dark){:root{--paper:#14181c;--ink:#e4e8ec;--quiet:#a2adb7;--line:#37414a;--card:#1e242a;
--accent:#6cbcf0;--plate:#14181c}}
*{box-sizing:border-box}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,
"Helvetica Neue",Arial,sans-serif;overflow-wrap:anywhere}
main,header,nav,footer{max-width:68rem;margin:0 auto;padding:0 1.25rem}
header{padding-top:2rem}
h1{font-size:clamp(1.3rem,1rem + 1.3vw,1.8rem);line-height:1.25;font-weight:600;margin:.75rem 0 1rem;text-wrap:pretty}
h2{font-size:1.3rem;font-weight:600;margin:2.75rem 0 .75rem;padding-top:.75rem;border-top:1px solid var(--line)}
h3{font-size:1.08rem;font-weight:600;margin:0}
p{margin:.5rem 0;max-width:50rem}
a{color:var(--accent)}
nav{font-size:.9rem;margin-top:1.25rem}
nav a{margin-right:1.1rem;display:inline-block}
.status{display:inline-block;padding:.15rem .7rem;border-radius:1rem;color:#fff;font-weight:600;font-size:.9rem}
.status.missing_physics{background:var(--missing)}
.status.adequate{background:var(--adequate)}
.status.unknown_effect{background:var(--unknown)}
.facts{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1rem;margin:0;font-size:.95rem}
.facts dt{color:var(--quiet)}
.facts dd{margin:0}
.quiet,figcaption{color:var(--quiet);font-size:.9rem}
.card{background:var(--card);border:1px solid var(--line);border-radius:.5rem;padding:1rem 1.25rem;margin:1rem 0}
.card>header{padding:0;max-width:none;display:flex;flex-wrap:wrap;gap:.25rem 1rem;justify-content:space-between;
align-items:baseline}
.card h4{font-size:.95rem;font-weight:600;margin:1rem 0 .25rem}
.flag{display:inline-block;border:1px solid currentColor;border-radius:.25rem;padding:0 .4rem;font-size:.82rem;
font-weight:600;white-space:nowrap}
.scroll{overflow-x:auto;margin:.75rem 0}
table{border-collapse:collapse;overflow-wrap:break-word;font-size:.92rem;font-variant-numeric:tabular-nums}
.wide table{width:100%}
caption{text-align:left;color:var(--quiet);padding-bottom:.3rem}
th,td{padding:.3rem 1rem .3rem 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
tr>:last-child{padding-right:0}
thead th{font-weight:600;color:var(--quiet);vertical-align:bottom}
tbody th{font-weight:500}
th,.n{overflow-wrap:normal}
.n{text-align:right}
td.n,.share{white-space:nowrap}
.said{display:inline-block;max-width:18rem;white-space:normal}
.wide td:not(.n),tbody th{min-width:6.5rem}
.bar{display:inline-block;width:7rem;height:.65rem;background:var(--line);border-radius:.2rem;overflow:hidden;
margin-right:.6rem}
.bar i{display:block;height:100%;background:#0072b2}
figure{margin:1rem 0}
.plate{background:var(--plate);border:1px solid var(--line);border-radius:.5rem;padding:.5rem;overflow-x:auto}
.plot{position:relative}
.plot img{display:block;width:100%;height:auto}
.plate.small{max-width:48rem}
figcaption{margin-top:.35rem;max-width:50rem}
details{margin:1rem 0}
summary{cursor:pointer;color:var(--accent)}
.on-paper{display:none}
.kept{display:inline-block}
.provenance{font-size:.85rem}
code{font-size:.92em}
.card>h3{margin-bottom:.25rem}
footer{margin:3rem auto 2rem;color:var(--quiet);font-size:.85rem}
@media screen and (max-width:40rem){.stacks :is(table,caption,tbody,tr,th){display:block}.stacks thead{display:none}
.stacks tr{border-bottom:1px solid var(--line);padding:.4rem 0}.stacks :is(th,td){border:0;padding:0}
.stacks td{display:inline-block;margin-right:1.2rem;text-align:left}.stacks :is(th,td):empty{display:none}
.stacks td::before{content:attr(data-head) " ";color:var(--quiet)}}
@media (max-width:40rem){.bar{display:none}th,td{padding-right:.7rem}.wide td:not(.n),tbody th{min-width:0}
.facts{grid-template-columns:1fr}.facts dd{margin-bottom:.4rem}}
@media print{:root{--paper:#fff;--ink:#000;--quiet:#444;--line:#bbb;--card:#fff;--accent:#000;--plate:#fff}
@page{margin:15mm}body{font-size:10.5pt}nav,.on-screen{display:none}.on-paper{display:block}
.plate{border:0;padding:0}.plot{min-width:0}
figure,.card,tr{break-inside:avoid}h2,h3,summary{break-after:avoid}.scroll,.plate{overflow:visible}
.card{padding:.3rem .6rem}.scroll table{font-size:8pt}.scroll th,.scroll td{padding-right:.5rem}
.wide td:not(.n),tbody th{min-width:0}
header{padding-top:0}h1{font-size:13pt;margin:.3rem 0 .4rem}header .facts{font-size:8pt;
grid-template-columns:max-content 1fr max-content 1fr}
#answer{break-after:page;font-size:8.5pt;line-height:1.3}
#answer h2{margin:.4rem 0 .2rem;padding-top:.2rem;font-size:11pt}
#answer h3{font-size:9pt}#answer figure,#answer p,#answer h3,#answer .scroll{margin:.25rem 0}
#answer table,#answer figcaption{font-size:8.5pt}#answer th,#answer td{padding-top:.1rem;padding-bottom:.1rem}
#answer .plot img{max-height:55mm;width:auto;max-width:100%}#answer .provenance{font-size:7pt;line-height:1.2;row-gap:0}
#answer .plate{padding:0}.provenance code{font-size:1em}
.status{-webkit-print-color-adjust:exact;print-color-adjust:exact}.bar,.bar i{print-color-adjust:exact}
details:not([open]){display:none}
section:not(#answer){font-size:9pt;line-height:1.35}section:not(#answer)>h2{font-size:12pt;margin:.9rem 0 .3rem;
padding-top:.3rem}h3{font-size:10pt}.card{margin:.5rem 0}.card h4{font-size:9pt;margin:.4rem 0 .1rem}
section:not(#answer) :is(th,td){padding-top:.1rem;padding-bottom:.1rem}figure,.scroll,p{margin:.35rem 0}
figcaption,.quiet{font-size:8pt}.plot img{max-height:52mm;width:auto;max-width:100%}footer{margin:.6rem auto}}
"""

_STACKS = 4
"""Columns from which on a table does not fit on a phone."""

_FOLDED = '<p class="on-paper">Parts that are folded on the screen are not printed: open them, and print again.</p>'

# What scrolls sideways on a narrow window can be reached by key; not every browser sees to that by itself.
_SCROLLING = """
(() => {
  const boxes = document.querySelectorAll(".scroll,.plate");
  const see = () => {
    for (const box of boxes) {
      if (box.scrollWidth <= box.clientWidth) { box.removeAttribute("tabindex"); box.role = box.ariaLabel = null; }
      else Object.assign(box, {tabIndex: 0, role: "group", ariaLabel: "scrolls sideways"});
    }
  };
  const observer = new ResizeObserver(see);
  boxes.forEach(box => observer.observe(box));
})();
"""


def page(title: str, header: str, sections: Sequence[tuple[str, str, str]], footer: str) -> str:
    """The whole document; ``sections`` are (identifier, heading as text, body as markup)."""
    links = "".join(f'<a href="#{key}">{escape(heading)}</a>' for key, heading, _ in sections)
    body = "\n".join(
        f'<section id="{key}" aria-labelledby="{key}-heading"><h2 id="{key}-heading">{escape(heading)}</h2>\n'
        f"{content}</section>"
        for key, heading, content in sections
    )
    style, script = STYLE, _SCROLLING
    folded_away = _FOLDED if "<details>" in body else ""
    if ' data-time-axes="' in body:
        style, script = style + time_cursor.STYLE, script + time_cursor.SCRIPT
    packed = ""
    if ' class="zoom"' in body:
        style, script, packed = style + zoom.STYLE, script + zoom.SCRIPT, zoom.library()
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<link rel="icon" href="data:,">\n'
        f"<title>{escape(title)}</title>\n<style>{style}</style></head>\n<body>\n<header>{header}</header>\n"
        f'<nav aria-label="Sections">{links}</nav>\n<main>\n{body}\n</main>\n'
        f"<footer>{escape(footer)}{folded_away}</footer>\n{packed}<script>{script}</script>\n</body>\n</html>\n"
    )


def headline(text: str) -> str:
    """What was found, as plain text: its first sentence is the heading, the others stand below."""
    first, stop, rest = text.partition(". ")
    return f"<h1>{_kept(first + stop.rstrip())}</h1>\n{paragraph(rest) if rest else ''}"


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text."""
    return f"<p{_class(kind)}>{_kept(text)}</p>\n"


def _kept(text: str) -> str:
    """Plain text as markup; a number and its % stay on one line."""
    return escape(text.replace(" %", "\u202f%"))


def table(
    caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int] = (), wide: bool = True
) -> str:
    """A table of markup cells; the first of each row is its header, columns in ``numeric`` stand to the right.

    One of `_STACKS` columns and more becomes a list on a phone, in which each cell says the head of its column.
    """
    stacks = len(heads) >= _STACKS

    def cells(row: Sequence[str], tag: str, scope: str) -> str:
        row = [cell.replace(" %", "\u202f%") for cell in row]
        return "".join(
            f'<th scope="{scope}"{_class("n" if i in numeric else "")}>{cell}</th>'
            if (tag == "th" and cell) or i == 0
            else f"<td{_class('n' if i in numeric else '')}{said[i]}>{cell}</td>"
            for i, cell in enumerate(row)
        )

    said = [f' data-head="{_kept(head)}"' if stacks and head else "" for head in heads]
    top = cells([escape(head) for head in heads], "th", "col")
    body = "\n".join(f"<tr>{cells(row, 'td', 'row')}</tr>" for row in rows)
    kind = "scroll" + (" wide" if wide else "") + (" stacks" if stacks else "")
    return (
        f'<div class="{kind}"><table><caption>{escape(caption)}</caption>'
        f"<thead><tr>{top}</tr></thead>\n<tbody>{body}</tbody></table></div>\n"
    )


def figure(svg: bytes, alternative: str, caption: str, small: bool = False, zoom: str = "") -> str:
    """A picture on a plate; plots over time share a cursor. ``zoom`` is what `zoomable` gave of the same plot."""
    data = base64.b64encode(svg).decode("ascii")
    return (
        f'<figure><div class="plate{" small" if small else ""}">'
        f'<div class="plot"{time_axes(svg)}><img src="data:image/svg+xml;base64,{data}" alt="{escape(alternative)}">'
        f"</div></div>{zoom}"
        f"<figcaption>{_kept(caption)}</figcaption></figure>\n"
    )


def folded(summary: str, content: str) -> str:
    """Content behind a line that opens it; nothing where there is no content."""
    return f"<details><summary>{escape(summary)}</summary>\n{content}</details>\n" if content else ""


def bar(share: float, text: str) -> str:
    """A number with a small bar before it, 0 to 1."""
    width = 100 * min(max(share, 0.0), 1.0) if share == share else 0.0
    return (
        f'<span class="share"><span class="bar" aria-hidden="true"><i style="width:{width:.1f}%"></i></span>'
        f"{_kept(text)}</span>"
    )


def flag(text: str) -> str:
    """A short mark that something wants attention."""
    return f'<span class="flag">{escape(text)}</span>'


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
