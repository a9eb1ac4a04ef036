"""What a diagnosis says: verdict, effects, places, fit; one frozen value for JSON, report and tests."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..models.effects import term_of
from .checks.finding import CheckFinding
from .verdict import Verdict

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A parameter's value, its standard deviation (inf where the recordings say nothing of it) and its unit."""

    value: float
    std: float
    unit: str
    at_bound: bool = False


@dataclass(frozen=True)
class Rival:
    """Another explanation: its probability, whether it is separable, and the experiment that would separate the two."""

    name: str
    at: str
    probability: float
    separable: bool
    experiment: str


@dataclass(frozen=True)
class Finding:
    """An effect that the model left out, in the field's words.

    ``margin`` is what the held-out recordings gain by the effect, in standard errors over blocks of time. ``gain`` is
    its log Bayes factor on the training recordings. ``explained`` is, of torques, the share of the held-out residual's
    energy that it explains, on the channel where this is largest. ``probability`` is how often a name with these three
    was right on simulated arms, shared with the rivals that are not separable.
    """

    name: str
    at: str
    margin: float
    probability: float
    parameters: Mapping[str, Estimate]
    evidence: str
    rivals: tuple[Rival, ...]
    gain: float | None = None
    explained: float | None = None
    coordinates: tuple[str, ...] = ()


@dataclass(frozen=True)
class Location:
    """Where in a recording the misfit lies: its share of all, when, and in which condition of motion."""

    channel: str
    share: float
    time_windows: tuple[tuple[float, float], ...]
    where: str


@dataclass(frozen=True)
class Misfit:
    """RMS residual of a channel before and after [channel's unit], and relative to the measurement's RMS."""

    rms_before: float
    rms_after: float
    relative_before: float
    relative_after: float


@dataclass(frozen=True)
class ChannelFit:
    """A channel's misfit on the training recordings and on the held-out ones, and its noise floor."""

    channel: str
    unit: str
    train: Misfit
    holdout: Misfit
    noise_floor: float


@dataclass(frozen=True)
class Step:
    """One line of the table: the model so far, and its relative RMS misfit over all channels on both sets (0 to 1)."""

    label: str
    train: float
    holdout: float


@dataclass(frozen=True)
class Candidate:
    """One effect at one place on top of the baseline: the share of the residual energy that it explains, 0 to 1."""

    name: str
    at: str
    explained: float
    score: float
    named: bool


@dataclass(frozen=True)
class Limit:
    """Smallest value of an effect's parameter that these recordings would have shown."""

    name: str
    at: str
    parameter: str
    value: float
    unit: str


@dataclass(frozen=True)
class ParameterShift:
    """A baseline parameter before and after the missing physics was added."""

    name: str
    unit: str
    before: float
    after: float
    std: float


@dataclass(frozen=True)
class Trace:
    """A channel of one recording in the analysis band, for pictures; all arrays (n,)."""

    recording: str
    role: Literal["train", "holdout"]
    channel: str
    unit: str
    time: Array
    position: Array
    speed: Array
    measured: Array
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction at one place over the speeds that the joint travelled.

    Parameters
    ----------
    at : str
        The joint.
    kind : "joint" or "slide"
        Torque at the joint, or force at each contact of the hang units' slides that it moves.
    effects : tuple of str
        Effects that add up to it.
    speed : array (n,)
        [rad/s or m/s]
    value, std : array (n,)
        Friction and its standard deviation [unit]; the band is two deviations either side.
    unit : str
    parts : tuple of array (n,)
        What each of ``effects`` adds [unit].
    measured : tuple of array (m,), or None
        The measured torque less everything else in the model, in bins of speed: speed, mean, standard deviation. None
        where several joints feel the friction, and for slides.
    """

    at: str
    kind: str
    effects: tuple[str, ...]
    speed: Array
    value: Array
    std: Array
    unit: str
    parts: tuple[Array, ...]
    measured: tuple[Array, Array, Array] | None = None

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        numbers = {name: getattr(self, name).tolist() for name in ("speed", "value", "std")}
        told = {"at": self.at, "kind": self.kind, "effects": list(self.effects), **numbers, "unit": self.unit}
        told["parts"] = [part.tolist() for part in self.parts]
        if self.measured is not None:
            names = ("speed", "value", "std")
            told["measured"] = {name: x.tolist() for name, x in zip(names, self.measured, strict=True)}
        return told


@dataclass(frozen=True, eq=False)
class EmpiricalTable:
    """A table at a joint for nameless physics.

    Parameters
    ----------
    at : str
        The joint.
    over : tuple of str
        One or two coordinates.
    times : str
        Factor of the value; empty: none.
    knots : tuple of array
        Along each coordinate, in its unit.
    value, std : array
        Of the knots' shape [unit]; the band is two deviations either side.
    unit : str
    over_units : tuple of str
        Of each coordinate.
    """

    at: str
    over: tuple[str, ...]
    times: str
    knots: tuple[Array, ...]
    value: Array
    std: Array
    unit: str
    over_units: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        numbers = {"knots": [k.tolist() for k in self.knots], "value": self.value.tolist(), "std": self.std.tolist()}
        return {
            "at": self.at,
            "coordinates": list(self.over),
            "times": self.times,
            **numbers,
            "unit": self.unit,
            "coordinate_units": list(self.over_units),
        }


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    Parameters
    ----------
    verdict : "data_fault", "missing_physics", "adequate" or "unknown_effect"
    sentence : str
        The verdict in one or two sentences, with names, places and numbers.
    description : str
        Of nameless physics, all that the data support. Empty otherwise.
    model : str
        Model's name.
    effects : tuple of Finding
        Ordered by how much of the held-out recordings each explains.
    location : tuple of Location
    fit : tuple of ChannelFit
    steps : tuple of Step
        Baseline first, then one line for each effect added.
    candidates : tuple of Candidate
        Each effect at each place by itself on top of the model as given, best first.
    moved : tuple of ParameterShift
    traces : tuple of Trace
    limits : tuple of Limit
        Smallest effects that would have been seen.
    notes : tuple of str
        Conditioning and excitation, in words.
    band : float
        Analysis band's edge [Hz].
    checks : tuple of CheckFinding
        Findings of the check of recordings and model; a contradiction makes the verdict ``data_fault``.
    curves : tuple of FrictionCurve
        Friction of each joint over its speed, by the laws that depend on speed alone, with its deviation.
    foremost : str
        Channel whose error the sentence gives, and which pictures show first. Empty where nothing was fitted.
    empirical : tuple of EmpiricalTable
        Tables for nameless physics; part of the model beside the named laws.
    """

    verdict: Verdict
    sentence: str
    description: str
    model: str
    effects: tuple[Finding, ...]
    location: tuple[Location, ...]
    fit: tuple[ChannelFit, ...]
    steps: tuple[Step, ...]
    candidates: tuple[Candidate, ...]
    moved: tuple[ParameterShift, ...]
    traces: tuple[Trace, ...]
    limits: tuple[Limit, ...]
    notes: tuple[str, ...]
    band: float
    checks: tuple[CheckFinding, ...] = ()
    curves: tuple[FrictionCurve, ...] = ()
    foremost: str = ""
    empirical: tuple[EmpiricalTable, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The published form: plain dicts, lists, numbers and text. JSON has no infinity: what is unknown is null."""
        curves = {"curves": [c.to_json() for c in self.curves]} if self.curves else {}
        if self.empirical:
            curves["empirical"] = [t.to_json() for t in self.empirical]
        return _finite(
            {
                "verdict": self.verdict,
                "sentence": self.sentence,
                "description": self.description,
                "model": self.model,
                "checks": [c.to_json() for c in self.checks],
                "effects": [_finding(e) for e in self.effects],
                "location": [
                    {
                        "channel": p.channel,
                        "share": p.share,
                        "time_windows": [list(w) for w in p.time_windows],
                        "where": p.where,
                    }
                    for p in self.location
                ],
                "fit": {
                    f.channel: {
                        "train": vars(f.train),
                        "holdout": vars(f.holdout),
                        "noise_floor": f.noise_floor,
                        "unit": f.unit,
                    }
                    for f in self.fit
                },
                "steps": [vars(s) for s in self.steps],
                "candidates": [vars(c) for c in self.candidates],
                "moved": [vars(m) for m in self.moved],
                "limits": [vars(x) for x in self.limits],
                "notes": list(self.notes),
                "band": {"value": self.band, "unit": "Hz"},
                **curves,
            }
        )


def _finding(finding: Finding) -> dict[str, Any]:
    name, term = term_of(finding.name)
    return {
        "name": name,
        "at": finding.at,
        **({"term": term} if term > 1 else {}),
        "margin": finding.margin,
        "gain": finding.gain,
        "explained": finding.explained,
        "probability": finding.probability,
        "parameters": {name: vars(p) for name, p in finding.parameters.items()},
        "evidence": finding.evidence,
        "rivals": [vars(r) for r in finding.rivals],
        **({"coordinates": list(finding.coordinates)} if finding.coordinates else {}),
    }


def _finite(content: Any) -> Any:
    """Content for JSON, with null in place of numbers that are not finite."""
    if isinstance(content, dict):
        return {key: _finite(x) for key, x in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(x) for x in content]
    return None if isinstance(content, float) and not np.isfinite(content) else content
