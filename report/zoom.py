"""Plots over time that zoom: Bokeh draws them where a reader asks, beside the picture that stands for print.

A page carries Bokeh's script packed (a third of its megabyte) and unpacks it at the first plot that is asked for. All
plots of one recording share their time axis; colours follow the page, light or dark. Nothing is fetched.
"""

import base64
import gzip
import json
from collections.abc import Sequence
from functools import cache
from html import escape

import numpy as np

from .drawing import thinned
from .strips import Strip

_COLUMNS = 900
"""Stretches of a curve of which smallest and largest sample are kept: enough to zoom in by a factor of ten."""


def zoomable(strips: Sequence[Strip], alternative: str) -> str:
    """What lets a page draw these strips, one below the other; goes into a figure beside its picture."""
    from bokeh.embed import json_item
    from bokeh.layouts import column
    from bokeh.models import BoxAnnotation, CrosshairTool, DataRange1d, HoverTool, Range1d, Span
    from bokeh.plotting import figure

    shared = {}
    for recording in dict.fromkeys(strip.recording for strip in strips):
        times = [curve.time for strip in strips if strip.recording == recording for curve in strip.curves]
        start, end = float(min(np.nanmin(t) for t in times)), float(max(np.nanmax(t) for t in times))
        shared[recording] = Range1d(start=start, end=end, bounds=(start, end), tags=["time", recording])
    ruler, plots = Span(dimension="height", line_alpha=0.6), []
    for k, strip in enumerate(strips):
        plot = figure(
            height=260 if k == 0 else 180,
            sizing_mode="stretch_width",
            x_range=shared[strip.recording],
            y_range=DataRange1d(only_visible=True),
            title=strip.title,
            y_axis_label=f"[{strip.unit}]" if strip.unit else None,
            tools="xpan,xbox_zoom,xzoom_in,xzoom_out,reset",
            active_drag="xbox_zoom",
            toolbar_location="above" if k == 0 else None,
            tags=["zoom"],
        )
        plot.toolbar.logo = None
        plot.add_tools(CrosshairTool(overlay=ruler))
        for begin, stop in strip.windows:
            plot.add_layout(BoxAnnotation(left=begin, right=stop, fill_color="#56B4E9", fill_alpha=0.25))
        for curve in strip.curves:
            t, y = (part.astype(np.float32) for part in thinned(curve.time, curve.values, _COLUMNS))
            said = curve.label or strip.title
            label = {"legend_label": curve.label} if curve.label else {}
            drawn = plot.line(t, y, line_width=1.5, tags=[curve.colour], **label)  # pyright: ignore[reportCallIssue]
            drawn.glyph.line_color = "#888888" if curve.colour == "ink" else curve.colour
            plot.add_tools(
                HoverTool(renderers=[drawn], tooltips=[("time", "@x{0.000} s"), (said, "@y{0.0000}")], visible=False)
            )
        if any(curve.label for curve in strip.curves):
            plot.legend.click_policy = "hide"
            plot.legend.orientation = "horizontal"
            plot.legend.location = "top_left"
        plots.append(plot)
    plots[-1].xaxis.axis_label = "time [s]"
    item = json_item(column(*plots, sizing_mode="stretch_width"))  # pyright: ignore[reportArgumentType]
    text = json.dumps(item, separators=(",", ":"))
    kind = f'type="application/octet-stream" class="zoom" data-text="{escape(alternative)}"'
    return f"<script {kind}>{_packed(text)}</script>"


@cache
def library() -> str:
    """Bokeh's script, packed, as markup."""
    from bokeh.resources import Resources

    script = Resources(mode="inline", components=["bokeh"]).js_raw[0]  # what follows it sets a level of messages
    return f'<script type="application/octet-stream" id="plotting">{_packed(script)}</script>\n'


def _packed(text: str) -> str:
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode("ascii")


STYLE = """
.zoom-button{position:absolute;right:.4rem;top:.3rem;z-index:1;font:inherit;font-size:.8rem;padding:.1rem .6rem;
border:1px solid var(--quiet);border-radius:.3rem;background:var(--paper);color:var(--ink);cursor:pointer}
.zoom-button:focus-visible{outline:2px solid var(--accent);outline-offset:1px}
.plate{position:relative}
.zoomed>.plot{display:none}
.drawn{padding-top:1.6rem}
@media print{.zoom-button,.drawn{display:none!important}.zoomed>.plot{display:block}}
"""

SCRIPT = """
(() => {
  const unpacked = async text => {
    const packed = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  let loading;
  const loaded = () => loading ??= unpacked(document.getElementById("plotting").textContent).then(text => {
    document.head.appendChild(document.createElement("script")).textContent = text;
    Bokeh.logger.set_level("off");
  });
  const ranges = [], roots = [], dark = matchMedia("(prefers-color-scheme: dark)");
  const narrow = matchMedia("screen and (max-width: 40rem)");  // there the legend would be cut
  const colour = root => {
    const style = getComputedStyle(document.documentElement);
    const [paper, ink, quiet, line] = ["paper", "ink", "quiet", "line"]
      .map(name => style.getPropertyValue("--" + name).trim());
    for (const model of root.references()) {
      if (model.tags?.[0] === "zoom") model.setv({
        background_fill_color: paper, border_fill_color: paper, outline_line_color: line});
      if (model.type === "Title") model.text_color = ink;
      if (model.type === "Grid") model.grid_line_color = line;
      if (model.type?.endsWith("Axis")) model.setv({axis_label_text_color: ink, major_label_text_color: quiet,
        axis_line_color: quiet, major_tick_line_color: quiet, minor_tick_line_color: null});
      if (model.type === "Legend") model.setv({
        background_fill_color: paper, background_fill_alpha: 0.7, border_line_color: null, label_text_color: ink,
        ...narrow.matches && {label_text_font_size: "10px", glyph_width: 10, label_standoff: 3, spacing: 5, margin: 2,
          padding: 3}});
      if (model.type === "Span") model.line_color = quiet;
      if (model.tags?.[0] === "ink") (model.glyph ?? model).line_color = ink;
    }
  };
  dark.addEventListener("change", () => roots.forEach(colour));
  const link = root => {
    for (const range of root.references()) {
      if (range.tags?.[0] !== "time") continue;
      const others = ranges.filter(other => other.tags[1] === range.tags[1]);
      if (others.length) range.setv({start: others[0].start, end: others[0].end});
      ranges.push(range);
      range.change.connect(() => {
        const {start, end} = range;
        for (const other of ranges.filter(other => other.tags[1] === range.tags[1]))
          if (other.start !== start || other.end !== end) other.setv({start, end});
      });
    }
  };
  for (const holder of document.querySelectorAll("script.zoom")) {
    const plate = holder.closest("figure").querySelector(".plate"), button = document.createElement("button");
    const text = holder.dataset.text;
    let place;
    const label = () => {
      const on = plate.classList.contains("zoomed");
      button.textContent = on ? "Picture" : "Zoom";
      button.ariaLabel = (on ? "Show as a picture: " : "Zoom in time: ") + text;
    };
    button.type = "button";
    button.className = "zoom-button";
    const show = async () => {
      if (!place) {
        place = document.createElement("div");
        place.className = "drawn";
        place.role = "group";
        place.ariaLabel = text;
        plate.append(place);
        plate.classList.add("zoomed");
        await loaded();
        const views = await Bokeh.embed.embed_item(JSON.parse(await unpacked(holder.textContent)), place);
        const root = views.roots ? [...views.roots][0].model : Bokeh.documents.at(-1).roots()[0];
        roots.push(root);
        colour(root);
        link(root);
        place.dataset.ready = "";
      } else {
        plate.classList.toggle("zoomed");
        place.hidden = !plate.classList.contains("zoomed");
      }
      label();
    };
    button.addEventListener("click", show);
    plate.prepend(button);
    label();
    if (narrow.matches)  // small print on a phone: there the plot is drawn at once
      new IntersectionObserver((entries, observer) => {
        if (!place && entries.some(entry => entry.isIntersecting)) { observer.disconnect(); show(); }
      }).observe(plate);
  }
})();
"""
