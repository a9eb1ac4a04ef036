"""What a command prints of its result: the verdict, the checks, the steps, what was found and how sure that is."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from ..report.words import chance, measured, percent, unit_words, words
from .diagnosis import Diagnosis, Finding, Step

_LABEL = 60


def printed(diagnosis: Diagnosis) -> str:
    """The sentence, the checks, the steps, and where something was found its table and what could not be told apart."""
    return "\n".join(
        [
            diagnosis.sentence,
            *check_lines([c.to_json() for c in diagnosis.checks]),
            *_steps(diagnosis.steps),
            *_findings(diagnosis.effects),
            *_alike(diagnosis.effects),
        ]
    )


def parameter_table(result: Mapping[str, Any]) -> str:
    """An identification's parameters, misfits and checks, from the form in which it is published."""
    lines = [f"{'effect':<26}{'at':<16}{'parameter':<24}{'value':>12}{'std':>11}  unit"]
    for p in result["parameters"]:
        flag = "  (at its bound)" if p["at_bound"] else ""
        std = "unknown" if p["std"] is None else f"{p['std']:.2g}"
        line = f"{p['effect']:<26}{p['at']:<16}{p['name']:<24}{p['value']:>12.5g}{std:>11}"
        lines.append(f"{line}  {unit_words(p['unit'])}{flag}".rstrip())
    for channel, fit in result["fit"].items():
        for role, said in (("train", "training"), ("holdout", "held-out")):
            if role in fit:
                f = fit[role]
                lines.append(
                    f"{channel} {said}: RMS residual {f['rms']:.4g} {unit_words(fit['unit'])}, "
                    f"{percent(f['relative'], 3)} of the measured"
                )
    lines.append(f"condition number {result['condition']:.3g}")
    return "\n".join([*lines, *check_lines(result.get("checks", ()))])


def check_lines(checks: Sequence[Mapping[str, Any]]) -> list[str]:
    """Published findings of the checks: what and where, and below it the lines for the model file."""
    lines = []
    for c in checks:
        lines.append(f"{c['name']} at {c['at']} ({chance(c['probability'])}): {c['message']}")
        lines += [f"    {line}" for line in c["mend"].splitlines()]
    return lines


def value_words(name: str, value: float, std: float | None, unit: str) -> str:
    """``level 20.39 ± 0.05 N``."""
    return f"{words(name)} {measured(value, inf if std is None else std, unit)}"


def indistinguishable(findings: Sequence[Finding]) -> list[tuple[Finding, str, str]]:
    """Findings with a rival that the recordings cannot part from them: its name and place, and what would part them."""
    return [
        (finding, f"{words(rival.name)} at {rival.at}", rival.experiment)
        for finding in findings
        for rival in finding.rivals
        if not rival.separable
    ]


def _steps(steps: Sequence[Step]) -> list[str]:
    return [
        f"  {step.label:<{_LABEL}} training {percent(step.train, 3):>8}   held-out {percent(step.holdout, 3):>8}"
        for step in steps
    ]


def _findings(findings: Sequence[Finding]) -> list[str]:
    if not findings:
        return []
    lines = ["", f"  {'what was found':<44} {'probability':<13} value"]
    for f in findings:
        values = "; ".join(value_words(name, e.value, e.std, e.unit) for name, e in f.parameters.items())
        name = f"{words(f.name)} at {f.at}"
        lines.append(f"  {name[:1].upper() + name[1:]:<44} {chance(f.probability):<13} {values}".rstrip())
    return lines


def _alike(findings: Sequence[Finding]) -> list[str]:
    pairs = indistinguishable(findings)
    if not pairs:
        return []
    lines = ["", "  what these recordings cannot tell apart"]
    for finding, rival, experiment in pairs:
        mend = f"; to separate them: {experiment}" if experiment else ""
        lines.append(f"  {words(finding.name)} at {finding.at}, or {rival}{mend}")
    return lines
