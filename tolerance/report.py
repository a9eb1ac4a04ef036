"""A tolerance study's results as numbers for scripts and one page for people."""

import re
from html import escape
from typing import Any

import numpy as np

from .. import __version__
from ..report.html import figure, headline, page, paragraph, table
from ..report.words import percent
from .box import where_the_box_stands_out, why_the_box_fails
from .gallery import Miss, play_misses
from .pictures import envelope_bars, probability_maps, sensitivity_bars, width_curve
from .rays import ANGLES, RADIAL, STAGE, Ray, ends, envelope, shortest
from .results import Results
from .run import space_boundary
from .study import LARGEST, Study
from .summary import Interval, proxy_beside, sensitivities, success_probability

_OTHERS = ("box", STAGE)
"""Cases that the maps are fitted to beside those over the whole range; those along single axes choose no others."""


def summarise(study: Study, results: Results) -> dict[str, Any]:
    """Write ``result.json``, ``cases.parquet`` and ``report.html`` into the results folder; returns the numbers.

    Keys: ``cases``, ``failed`` (cases without a result), ``width``, ``probability`` over the ranges and
    ``probability_box``, ``box`` (what speaks against it, in words), ``envelope`` an axis, ``envelope_radial`` [m] and
    ``envelope_angle`` [rad] in the worst of the directions that were tried (see `rays`), ``sensitivity``, ``misses``
    (file, kind, text), ``sentence``.
    """
    space = results.table("space")
    boundary = space_boundary(study, results, others=_OTHERS)
    indices = sensitivities(study, boundary)
    found = ends(study, results.table(STAGE)) if study.envelope else []
    limits = envelope(study, found) if found else {}
    content: dict[str, Any] = {
        "study": study.name,
        "capture": study.capture.name,
        "cases": len(results),
        "failed": sum(map(len, _failures(results))),
        "width": boundary.width(),
        "probability": vars(success_probability(space)) if study.sampling != "adaptive" else None,
        "envelope": {n: {"down": _plain(d), "up": _plain(u)} for n, (d, u) in limits.items()},
        "sensitivity": indices.reset_index().to_dict("records"),
    }
    for key, axes in (("envelope_radial", RADIAL), ("envelope_angle", ANGLES)):
        worst = shortest(found, axes)
        if worst:
            content[key] = _plain(worst)
    if study.box:
        box = results.table("box")
        content["probability_box"] = vars(success_probability(box))
        content["box"] = f"{where_the_box_stands_out(study, found)} {why_the_box_fails(study, box)}".strip()
    if study.success.latched:
        content["proxy"] = proxy_beside(study, results.table())
    content["sentence"] = _sentence(study, content)
    misses = play_misses(study, results)
    content["misses"] = [vars(m) for m in misses]
    results.write_table()
    results.write("result.json", content)
    results.write("report.html", _page(study, results, content, found, indices, misses))
    return content


def _sentence(study: Study, content: dict[str, Any]) -> str:
    words = [f"{study.name}: {content['cases']} captures"]
    if "probability_box" in content:
        p = content["probability_box"]
        low, high = percent(p["low"], 3), percent(p["high"], 3)
        where = "at the ends of" if study.box_ends else "inside"
        words.append(f"{where} the box {percent(p['value'])} succeed (95 % interval {low} to {high})")
    for key, factor, unit, what in (
        ("envelope_radial", 1e3, "mm", "offset alone"),
        ("envelope_angle", 180 / np.pi, "deg", "tilt alone"),
    ):
        e = content.get(key)
        if e and e["value"] is not None:
            low, high = factor * e["low"], factor * e["high"]
            if low == high:
                words.append(f"{what} may be {low:.1f} {unit} at least")
            else:
                words.append(f"{what} may be {low:.1f} to {high:.1f} {unit} in the worst direction tried")
    if "proxy" in content:
        p = content["proxy"]
        limit = f"{1e3 * study.success.radial_error:g} mm"
        words.append(f"the proxy of {limit} says otherwise in {p['disagree']} of {p['cases']}")
        if p["ends"]:
            words.append("failures end in " + ", ".join(f"{state} ({n})" for state, n in p["ends"].items()))
    first, *others = sorted(content["sensitivity"], key=lambda s: -s["total"])
    most = [first["axis"], *(s["axis"] for s in others if s["total_high"] > first["total_low"])]
    sure = content["width"] <= study.width
    doubt = "" if sure else f", by a boundary that leaves {percent(content['width'])} of the ranges undecided"
    words.append(f"{', '.join(most)} matter{'s' if len(most) == 1 else ''} most{doubt}")
    return "; ".join(words) + "."


def _page(
    study: Study,
    results: Results,
    content: dict[str, Any],
    found: list[tuple[Ray, Interval]],
    indices: Any,
    misses: list[Miss],
) -> str:
    space = results.table("space")
    limits = envelope(study, found) if found else {}
    rows = [
        [
            name,
            f"{d.value:.4g}",
            _between(d.high, d.low),
            f"{u.value:.4g}",
            _between(u.low, u.high),
            study.capture.axis(name).unit,
        ]
        for name, (d, u) in limits.items()
    ]
    numbers = table(
        "How far each axis may go, the others at nominal. Interval: the last capture outwards that succeeded and the "
        "first that did not, or has no result.",
        ["axis", "down to", "interval", "up to", "interval", "unit"],
        rows,
        numeric=(1, 2, 3, 4),
    )
    counts, widths = _widths(study, results)
    reasons = "; ".join(f"{len(like)} x {like[0]}" for like in _failures(results)) or "none"
    boundary = space_boundary(study, results, others=_OTHERS)
    sections = [
        (
            "maps",
            "Where captures succeed",
            figure(
                probability_maps(study, boundary, space),
                "Maps of the probability of success",
                "Blue: success is at least 95 % sure; red: failure is; grey: undecided. Dots succeeded, crosses failed "
                "(cases of every other misalignment, so a few stand on the other side).",
            ),
        ),
        (
            "matters",
            "What matters",
            figure(
                sensitivity_bars(indices),
                "Sobol indices",
                "How much of the variance of success each axis explains over the ranges.",
            ),
        ),
        (
            "cost",
            "Cases",
            figure(
                width_curve(counts, widths, study.width),
                "Undecided share against cases",
                "The line is the width at which the study may stop.",
            )
            + paragraph(f"Cases without a result, of those alike the first: {reasons}."),
        ),
    ]
    if limits:
        drawn = figure(
            envelope_bars(study, limits), "Envelope of each axis", "Bars: success; black: the interval of each end."
        )
        sections.insert(0, ("envelope", "Envelope", drawn + numbers))
    if misses:
        sections.insert(-1, ("misses", "Typical misses", _gallery(misses)))
    if study.success.latched:
        sections.insert(1 if limits else 0, ("proxy", "What the proxy is worth", _proxy(study, content["proxy"])))
    if study.box:
        sections.insert(1 if limits else 0, ("box", "The box", paragraph(content["box"])))
    return page(
        f"{study.name}: capture tolerance",
        headline(content["sentence"]),
        sections,
        f"Written by snarelab {__version__}.",
    )


def _proxy(study: Study, found: dict[str, Any]) -> str:
    """The soft capture's radial error against the latch, and the states in which the program gave up."""
    total, latched, failed = found["cases"], found["latched"], found["cases"] - found["latched"]
    both, neither = latched - found["latched_against"], failed - found["failed_against"]
    limit = f"{1e3 * study.success.radial_error:g} mm"
    counts = table(
        f"Of {total} captures with a result: what the radial error after the soft capture says, and what came of it.",
        ["", "latched", "did not"],
        [
            [f"within {limit}", str(both), str(found["failed_against"])],
            [f"beyond {limit}", str(found["latched_against"]), str(neither)],
        ],
        numeric=(1, 2),
    )
    if not found["ends"]:
        return counts
    ends = table(
        "State in which the program gave up, or LATCHED where a limit of the latch was missed.",
        ["state", "captures"],
        [[state, str(count)] for state, count in found["ends"].items()],
        numeric=(1,),
    )
    return counts + ends


def _between(low: float, high: float) -> str:
    return "all succeeded" if low == high else f"{low:.4g} to {high:.4g}"


def _gallery(misses: list[Miss]) -> str:
    items = "".join(
        f'<li><a href="{escape(m.file)}">{escape(m.kind.capitalize())}</a>: {escape(m.text)}.</li>' for m in misses
    )
    return paragraph("Each opens in 3-D with a slider of time; the pages stand beside this one.") + f"<ul>{items}</ul>"


def _failures(results: Results) -> list[list[str]]:
    """Reasons of cases without a result, those together that differ in numbers only."""
    alike: dict[str, list[str]] = {}
    for why in filter(None, map(str, results.table()["reason"])):
        alike.setdefault(re.sub(r"\[.*?\]|[-+]?\d[\d.e+-]*", "", why), []).append(why)
    return list(alike.values())


def _widths(study: Study, results: Results) -> tuple[np.ndarray, np.ndarray]:
    total = min(len(results.table("space")), LARGEST)
    counts = np.unique(np.append(np.arange(study.batch, total, max(study.batch, total // 8)), total))
    return counts, np.array([space_boundary(study, results, int(n), _OTHERS).width() for n in counts])


def _plain(interval: Interval) -> dict[str, float | None]:
    return {k: None if np.isnan(v) else v for k, v in vars(interval).items()}
