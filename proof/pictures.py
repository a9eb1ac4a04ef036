"""The proof's pictures: confusion matrix and reliability curve."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from snarelab.report.drawing import AFTER, GREY, drawing, svg

from .concealed import MAKERS
from .judge import Scored
from .outside import OUTSIDE
from .score import Score
from .statistics import BINS, clopper_pearson


def confusion(score: Score) -> tuple[bytes, str]:
    """The matrix as SVG, and its counts in words."""
    cases = [c for c in score.cases if c.answer.group != "pair"]
    counts = Counter((_concealed(c), _said(c)) for c in cases)
    rows = [r for r in ("nothing", *MAKERS, "wrong parameter", *OUTSIDE) if any(k[0] == r for k in counts)]
    columns = [c for c in ("adequate", *MAKERS, "unknown_effect", "failed", "none") if any(k[1] == c for k in counts)]
    shares = np.array([[counts[r, c] for c in columns] for r in rows], float)
    shares /= shares.sum(axis=1, keepdims=True)
    with drawing():
        picture = Figure(figsize=(3.2 + 0.34 * len(columns), 2.4 + 0.22 * len(rows)), layout="constrained")
        axes = picture.add_subplot()
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.3, aspect="auto")
        for i, r in enumerate(rows):
            for j, c in enumerate(columns):
                if counts[r, c]:
                    axes.text(j, i, str(counts[r, c]), ha="center", va="center", fontsize=8)
        axes.set_xticks(range(len(columns)), [c.replace("_", " ") for c in columns], rotation=60, ha="right")
        axes.set_yticks(range(len(rows)), [r.replace("_", " ") for r in rows])
        axes.grid(False)
        axes.set_xlabel("said")
        axes.set_ylabel("concealed")
        words = "; ".join(f"{r}: " + ", ".join(f"{c} {counts[r, c]}" for c in columns if counts[r, c]) for r in rows)
        return svg(picture), words


def _concealed(c: Scored) -> str:
    if c.answer.group == "clean":
        return "nothing"
    if c.answer.group == "wrong":
        return "wrong parameter"
    return c.answer.truths[0].name if c.answer.truths else c.answer.kinds[0]


def _said(c: Scored) -> str:
    """The first name; where the truth is in the class of one named, that counts as said."""
    if not c.named:
        return c.verdict
    if c.name:
        return c.answer.truths[0].name
    wrong = [n for (n, _), (_, right) in zip(c.named, c.claims, strict=True) if not right]
    return (wrong or [c.named[0][0]])[0]


def reliability(claims: Sequence[tuple[float, bool]]) -> bytes:
    """Frequency over stated probability, in ten bins, with exact intervals."""
    p, right = np.array([x for x, _ in claims]), np.array([y for _, y in claims])
    where = np.minimum((p * BINS).astype(int), BINS - 1)
    with drawing():
        picture = Figure(figsize=(5.0, 4.0), layout="constrained")
        axes = picture.add_subplot()
        axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.8)
        for b in np.unique(where):
            own = right[where == b]
            low, high = clopper_pearson(int(own.sum()), len(own))
            x, y = p[where == b].mean(), own.mean()
            axes.errorbar(x, y, [[y - low], [high - y]], color=AFTER, marker="o", markersize=4, linewidth=1.0)
            axes.annotate(str(len(own)), (x, y), (5, 4), textcoords="offset points", fontsize=8)
        axes.set_xlim(0, 1.02)
        axes.set_ylim(0, 1.02)
        axes.set_xlabel("probability stated")
        axes.set_ylabel("frequency of being right")
        return svg(picture)


def power(found: Mapping[str, Any]) -> bytes:
    """How often each effect is seen, and by its right name, over multiples of its limit, as SVG: a panel an effect."""
    effects = found["effects"]
    columns = 4
    rows = -(-len(effects) // columns)
    with drawing():
        picture = Figure(figsize=(2.2 * columns, 0.6 + 1.6 * rows), layout="constrained")
        panels = picture.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, (name, every) in zip(panels, effects.items(), strict=False):
            some = [r for r in every if r["cases"]]
            x = [r["ratio"] for r in some]
            low, high = np.array([r["seen_interval"] for r in some]).T
            axes.fill_between(x, low, high, color=GREY, alpha=0.25, linewidth=0)
            axes.plot(x, [r["seen"] for r in some], color=GREY, marker="o", label="seen")
            axes.plot(x, [r["named"] for r in some], color=AFTER, marker="o", label="by its name")
            axes.axvline(1.0, color=GREY, linewidth=0.5)
            axes.set_title(f"{name.replace('_', ' ')} ({max(r['cases'] for r in some)})", fontsize=8)
            axes.set_ylim(-0.05, 1.05)
        for axes in panels[len(effects) :]:
            axes.set_visible(False)
        panels[0].legend(fontsize=7)
        picture.supxlabel("size over the limit stated")
        picture.supylabel("share of arms")
        return svg(picture)
