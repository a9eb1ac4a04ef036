"""What the Python calls give back: frozen results that show themselves as text and, in a notebook, as tables."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd

from .. import __version__
from ..errors import InputError
from ..models.model import Model
from ..models.model_write import save_model
from ..report.html import folded, paragraph, table
from ..report.words import number, percent, unit_words, with_std, words
from .checks.finding import CheckFinding
from .data_fault import contradict
from .diagnosis import ChannelFit, Diagnosis, Finding, Step
from .report.figures import before_and_after
from .report.findings import STATUS, missing
from .report.fit import changes, most_changed
from .report.page import write_report
from .summary import check_lines, parameter_table, printed

# Colours come from the notebook, so that a result reads on its light page and on its dark one.
_STYLE = """<style>
.snarelab-result{max-width:60rem;line-height:1.45}
.snarelab-result .status{border:1px solid currentColor;border-radius:1rem;padding:.1rem .6rem;font-weight:600}
.snarelab-result table{border-collapse:collapse;font-variant-numeric:tabular-nums}
.snarelab-result caption{text-align:left;opacity:.75}
.snarelab-result th,.snarelab-result td{text-align:left;vertical-align:top;padding:.2rem .9rem .2rem 0}
.snarelab-result .n{text-align:right;white-space:nowrap}
.snarelab-result .scroll{overflow-x:auto;margin:.6rem 0}
.snarelab-result h3{font-size:1.05em;margin:.9rem 0 .2rem}
.snarelab-result summary{cursor:pointer}
</style>"""


@dataclass(frozen=True)
class Drawing:
    """A picture that a notebook shows: ``svg`` holds its bytes."""

    svg: bytes = field(repr=False)

    def _repr_svg_(self) -> str:
        return self.svg.decode("utf-8")

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.svg).decode("ascii")
        source = f'src="data:image/svg+xml;base64,{data}"'
        return f'<img alt="measured, model before and after" style="max-width:100%" {source}>'


@dataclass(frozen=True, repr=False)
class DiagnosisResult:
    """The verdict of `diagnose`, and the model with what was found.

    ``print`` gives the sentence and the table of steps; a notebook shows them with a card for each effect.

    Parameters
    ----------
    diagnosis : Diagnosis
        Everything that was found, as one frozen value.
    model : Model
        The model given, with the effects named and all values identified.
    """

    diagnosis: Diagnosis
    model: Model

    @property
    def verdict(self) -> str:
        """``data_fault``, ``missing_physics``, ``adequate`` or ``unknown_effect``."""
        return self.diagnosis.verdict

    @property
    def sentence(self) -> str:
        """The verdict in one or two sentences."""
        return self.diagnosis.sentence

    @property
    def effects(self) -> tuple[Finding, ...]:
        """What the model left out, each with place, probability, parameters, evidence and rivals."""
        return self.diagnosis.effects

    @property
    def checks(self) -> tuple[CheckFinding, ...]:
        """Findings of the check of recordings and model, each with the line that mends it."""
        return self.diagnosis.checks

    @property
    def steps(self) -> tuple[Step, ...]:
        """The model as given and after each effect added: relative misfit on both sets (0 to 1)."""
        return self.diagnosis.steps

    @property
    def fit(self) -> tuple[ChannelFit, ...]:
        """Misfit of every channel before and after, in the channel's unit, and its noise floor."""
        return self.diagnosis.fit

    def to_frame(self) -> pd.DataFrame:
        """The findings as a table, a row for each parameter: value, deviation, unit and its effect's probability."""
        rows = [
            (f.name, f.at, f.probability, name, e.value, e.std, e.unit, e.at_bound)
            for f in self.effects
            for name, e in f.parameters.items()
        ]
        heads = ["effect", "at", "probability", "parameter", "value", "std", "unit", "at_bound"]
        return pd.DataFrame(rows, columns=heads)

    def plot(self, channel: str | None = None) -> Drawing:
        """Measurement and model before and after, on a held-out channel; by default on the one that changed most.

        Shows itself in a notebook; its ``svg`` are the bytes of the picture. Raises InputError for another channel.
        """
        traces = {trace.channel: trace for trace in most_changed(self.diagnosis)}
        name = next(iter(traces), "") if channel is None else channel
        if name not in traces:
            raise InputError(f"channel {name!r} was not recorded; there are {', '.join(traces) or 'none'}")
        trace = traces[name]
        return Drawing(before_and_after(trace, changes([trace])))

    def to_json(self) -> dict[str, Any]:
        """What ``snarelab diagnose --json`` writes: plain dicts, lists, numbers and text."""
        return self.diagnosis.to_json()

    def write_report(self, path: str | Path) -> None:
        """Write the report, one HTML file that needs no network; raises InputError where it cannot be written."""
        write_report(self.diagnosis, path)

    def save_model(self, path: str | Path) -> None:
        """Write the improved model as a model file; raises InputError where it cannot be written."""
        save_model(self.model, path, f"{self.sentence}\nsnarelab diagnose {__version__}")

    def __str__(self) -> str:
        """What the command prints."""
        return printed(self.diagnosis)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        rows = [[escape(step.label), percent(step.train, 3), percent(step.holdout, 3)] for step in self.steps]
        _, heading, cards = missing(self.diagnosis)
        return _shown(
            f'<span class="status">{STATUS[self.diagnosis.verdict]}</span>\n'
            + paragraph(self.sentence)
            + (self.plot()._repr_html_() if self.diagnosis.traces else "")
            + table("Relative misfit over all channels", ["Model", "Training", "Held-out"], rows, (1, 2), wide=False)
            + folded(heading, cards)
            + folded("Notes", "".join(map(paragraph, self.diagnosis.notes)))
        )


@dataclass(frozen=True, repr=False)
class CheckResult:
    """What `check` found: ``checks`` on the recordings of ``model``, those of contradiction first."""

    model: str
    checks: tuple[CheckFinding, ...]

    @property
    def sound(self) -> bool:
        """Whether nothing in the recordings contradicts the model."""
        return not contradict(self.checks)

    def to_json(self) -> dict[str, Any]:
        """What ``snarelab check --json`` writes: plain dicts, lists, numbers and text."""
        return {"model": self.model, "sound": self.sound, "checks": [c.to_json() for c in self.checks]}

    def __str__(self) -> str:
        """What the command prints."""
        head = "Nothing in the recordings contradicts the model." if self.sound else "Recordings and model contradict."
        return "\n".join([head, *check_lines([c.to_json() for c in self.checks])])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return _shown(f"<pre>{escape(str(self))}</pre>")


@dataclass(frozen=True)
class ParameterEstimate:
    """One identified number.

    ``std`` is None if the recordings say nothing of the parameter. ``identifiable`` is False if they do not determine
    it: do not quote its value then. ``at_bound`` is True if it ended at a physical bound. Units are SI.
    """

    effect: str
    at: str
    name: str
    value: float
    std: float | None
    unit: str
    at_bound: bool
    identifiable: bool


@dataclass(frozen=True, repr=False)
class IdentificationResult:
    """What `identify` found: parameters, misfits, and the model with its values.

    Parameters
    ----------
    parameters : tuple of ParameterEstimate
    fit : mapping
        Channel to ``{"train": {"rms", "relative"}, "holdout": ..., "unit"}``, as in the JSON.
    condition : float
        Condition number of the fit; above about 100 the parameters are hard to tell apart.
    model : Model
        The model given, with all values.
    published : mapping
        The whole result as JSON has it.
    """

    parameters: tuple[ParameterEstimate, ...]
    fit: Mapping[str, Any]
    condition: float
    model: Model
    published: Mapping[str, Any]

    def to_frame(self) -> pd.DataFrame:
        """The parameters as a table, a row each."""
        return pd.DataFrame([vars(p) for p in self.parameters])

    def to_json(self) -> dict[str, Any]:
        """What ``snarelab identify --json`` writes: plain dicts, lists, numbers and text."""
        return dict(self.published)

    def save_model(self, path: str | Path) -> None:
        """Write the model file with the values found; raises InputError where it cannot be written."""
        save_model(self.model, path, f"{self.model.name}: values from snarelab identify {__version__}")

    def __str__(self) -> str:
        """What the command prints."""
        checks = self.published.get("checks", ())
        shown = {"parameters": [vars(p) for p in self.parameters], "fit": self.fit, "condition": self.condition}
        return parameter_table({**shown, "checks": checks})

    __repr__ = __str__

    def _misfits(self) -> list[tuple[str, str, float, float, str]]:
        return [
            (channel, said, entry[role]["rms"], entry[role]["relative"], entry["unit"])
            for channel, entry in self.fit.items()
            for role, said in (("train", "training"), ("holdout", "held-out"))
            if role in entry
        ]

    def _repr_html_(self) -> str:
        parameters = []
        for p in self.parameters:
            value, std = with_std(p.value, float("inf") if p.std is None else p.std)
            remark = "at its bound" if p.at_bound else "" if p.identifiable else "not carried by the recordings"
            cells = (words(p.effect), p.at, words(p.name), value, f"± {std}", unit_words(p.unit), remark)
            parameters.append([escape(cell) for cell in cells])
        misfits = [
            [escape(channel), role, f"{number(rms)} {escape(unit_words(unit))}", percent(relative, 3)]
            for channel, role, rms, relative, unit in self._misfits()
        ]
        heads = ["Effect", "At", "Parameter", "Value", "Std", "Unit", ""]
        return _shown(
            table(f"Parameters of {self.model.name}", heads, parameters, (3, 4), wide=False)
            + table("Misfit", ["Channel", "Set", "RMS residual", "Of the measured"], misfits, (2, 3), wide=False)
            + paragraph(f"Condition number {number(self.condition)}.")
        )


def _shown(content: str) -> str:
    return f'<div class="snarelab-result">{_STYLE}\n{content}</div>'
