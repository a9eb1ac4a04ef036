"""The proof's page: figures beside bars and rivals, the confusion matrix, reliability, limits, every miss."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from snarelab.report.html import figure, flag, folded, page, paragraph, table

from .cases import ROUND, SIZES, Answer
from .concealed import MAKERS
from .misses import explained, words
from .pictures import confusion, reliability
from .result import behind, interval, shown
from .score import Score
from .seal import Seal

TOOL = "snarelab"

ABOUT = (
    "Robots, friction, disturbances, noise, motions and concealed effects are drawn at random; MuJoCo moves the arms "
    "in a closed loop with quantised encoders, and shares no dynamics code with the tool. Everything was recorded and "
    "the answers were sealed before the first diagnosis; each diagnosis then ran as `snarelab diagnose` in a process "
    "of its own, in a folder that holds the model and two recordings, while the answers were in no file. No case is "
    "dropped.",
    "The tool's settings and its probability curve come from robots of other seeds (90000 to 99999, drawn in the same "
    "way: proof/robots.py, three to six joints, tubes with motors and a tool, a tilted foot) and from the studies' "
    "real recordings. Of robots that are made in another way this page says nothing.",
    "The size of an effect is the RMS torque that it makes along the planned motion and that a refit of the known "
    "friction cannot pose as, over the RMS of the disturbance at every joint. Effects outside the vocabulary are sized "
    "by what the nearest named laws leave of them, at 2 and 4 times; pairs, decoys and wrong parameters at 2 times.",
    "A name is right if the effect is named or is in its class: the names that the answer itself says the recordings "
    "cannot tell from it. A case is right if every concealed effect is named and nothing else is.",
)


def write_page(
    path: Path,
    answers: Sequence[Answer],
    scores: Mapping[str, Score],
    seal: Seal,
    content: Mapping[str, Any],
    found: Sequence[Mapping[str, Any]],
) -> None:
    """Write it, whole or not at all."""
    own = scores[TOOL]
    held = [f for f in own.figures.values() if f.met is not None]
    title = (
        f"{sum(bool(f.met) for f in held)} of {len(held)} figures meet their bars, on {len(answers)} concealed cases"
    )
    facts = (
        ("answers' SHA-256", seal.answers),
        ("sealed at", f"{seal.time}, before the first diagnosis; check with: sha256sum answers.json"),
        ("recordings' SHA-256", seal.recordings),
        ("seed", str(seal.seed)),
        ("a diagnosis takes", f"{content['seconds_a_diagnosis']:.0f} s in the mean"),
    )
    listed = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts)
    header = f'<p class="quiet">Missing physics named on concealed data</p>\n<h1>{escape(title)}</h1>\n'
    header += f'<dl class="facts">{listed}</dl>\n'
    sections = [
        ("figures", "Figures, bars and rivals", _figures(scores)),
        ("how", "How it was done", "".join(paragraph(text) for text in ABOUT)),
        ("confusion", "What was concealed, what was said", _confusion(own)),
        ("reliability", "Reliability of the probabilities", _reliability(own)),
        ("limits", "Detection limits", _limits(own)),
        ("misses", "Every miss", _misses(own, found)),
        ("cases", "All cases", _cases(own)),
    ]
    part = path.with_name(path.name + ".part")
    part.write_text(page("snarelab: proof", header, sections, "Written by snarelab: make proof."), encoding="utf-8")
    part.replace(path)


def _figures(scores: Mapping[str, Score]) -> str:
    rivals = [name for name in scores if name != TOOL]
    rows = []
    for f in scores[TOOL].figures.values():
        bar = "" if f.bar is None else f"{'≤' if f.at_most else '≥'} {f.bar:g}"
        mark = {True: "met", False: flag("not met"), None: ""}[f.met]
        others = [escape(shown(scores[r].figures[f.name])) for r in rivals]
        name = f'{escape(f.name.replace("_", " "))}<br><span class="quiet">{escape(f.meaning)}</span>'
        rows.append([name, escape(bar), escape(shown(f)), escape(interval(f)), str(f.count), mark, *others])
    heads = ["figure", "bar", TOOL, "95 % interval", "cases", "", *(r.replace("_", " ") for r in rivals)]
    lost = behind(scores)
    text = (
        "No rival does better on any figure with a bar, nor on the error on the third recording."
        if not lost
        else "A rival does better on: "
        + "; ".join(f"{f.replace('_', ' ')} ({r.replace('_', ' ')})" for f, r in lost)
        + "."
    )
    notes = (
        "Shares have exact intervals (Clopper and Pearson 1934), medians and the calibration error bootstrapped ones. "
        "n/a: the method says nothing that the figure could count.",
        "Rivals: joint BIC without whitening, over textbook columns; PySINDy on the residual of the frozen baseline; a "
        "Gaussian process on each joint's residual, which names nothing; mujoco.sysid with every joint's friction "
        "and rotor, and every link's mass, free. They are given the same rigid body, baseline "
        "physics and recordings, and their errors are counted below their own filter's edge.",
    )
    return table("", heads, rows, numeric=(1, 2, 3, 4, *range(6, len(heads)))) + "".join(
        paragraph(t) for t in (text, *notes)
    )


def _confusion(own: Score) -> str:
    svg, counts = confusion(own)
    return figure(
        svg,
        f"Confusion matrix: {counts}",
        "Rows: what was concealed. Columns: the first name given, or the "
        "verdict. Cases with one concealed effect, none, one outside the vocabulary, a wrong parameter or a "
        "faulty sensor.",
    )


def _reliability(own: Score) -> str:
    claims = [claim for c in own.cases for claim in c.claims]
    if not claims:
        return paragraph("Nothing was named.")
    return figure(
        reliability(claims),
        "Frequency of being right over the probability stated",
        "How often a class named with this probability was right, name and place; bars are exact 95 % "
        "intervals. On the diagonal, probabilities are frequencies.",
        small=True,
    )


def _limits(own: Score) -> str:
    rows = []
    for kind in MAKERS:
        cells, whole = [], []
        for size in SIZES:
            cases = [
                c
                for c in own.cases
                if c.answer.group == "single" and c.answer.kinds == (kind,) and c.answer.size == size
            ]
            named = sum(c.name for c in cases)
            cells.append(f"{named} of {len(cases)}" if cases else "–")
            whole.append(bool(cases) and named == len(cases))
        sure = [size for k, size in enumerate(SIZES) if all(whole[k:])]
        limit = f"{min(sure):g}" if sure else f"> {SIZES[-1]:g}" if any(c != "–" for c in cells) else "–"
        rows.append([escape(kind.replace("_", " ")), *cells, limit])
    heads = ["effect", *(f"{size:g}×" for size in SIZES), "named from"]
    intro = paragraph(
        "Cases named, by size in multiples of the disturbance's RMS, and the smallest size from which on every case is "
        f"named. A round of {len(ROUND)} cases has one of each: a limit is one sequence of cases, not a mean."
    )
    return intro + table("", heads, rows, numeric=range(1, len(heads)))


def _misses(own: Score, found: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [str(c.answer.case), escape(words(c.answer)), escape(_said(c)), escape(text)]
        for c, d in zip(own.cases, found, strict=True)
        if (text := explained(c, d))
    ]
    if not rows:
        return paragraph("None.")
    intro = paragraph(f"{len(rows)} of {len(own.cases)} cases, each with what its own answer shows of the reason.")
    return intro + table("", ["case", "concealed", "said", "why"], rows)


def _cases(own: Score) -> str:
    rows = [
        [
            str(c.answer.case),
            escape(words(c.answer)),
            escape(_said(c)),
            *(("–",) * 4 if c.error is None else (f"{x:.2f}" for x in (*c.error, c.oracle, c.closure or 0.0))),
            str(c.answer.joints),
            f"{c.answer.disturbance:.2f}",
            f"{c.answer.noise:.2f}",
        ]
        for c in own.cases
    ]
    heads = ["case", "concealed", "said", "before", "after", "oracle", "closure", "joints"]
    heads += ["disturbance [N·m]", "noise [N·m]"]
    about = paragraph(
        "Before, after, oracle: error on the third recording over its floor where the concealed effects show most. "
        "Closure: (before − after) / (before − oracle). The oracle is the tool's fit of the same arm, motion, "
        "disturbance and noise with nothing concealed; where that arm cannot be recorded, it is the floor."
    )
    return folded(f"{len(rows)} cases", about + table("", heads, rows, numeric=range(3, 10)))


def _said(c: Any) -> str:
    names = ", ".join(f"{n.replace('_', ' ')} at {at}" for n, at in c.named)
    return names or c.verdict.replace("_", " ")
