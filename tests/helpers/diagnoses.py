"""Diagnoses that are invented, as input for what is made of them: one of each verdict, and one that is all one text."""

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np

from snarelab.identification.diagnosis import (
    Candidate,
    ChannelFit,
    Diagnosis,
    Estimate,
    Finding,
    Limit,
    Location,
    Misfit,
    ParameterShift,
    Rival,
    Step,
    Trace,
)

JOINTS = range(1, 7)
RECORDING = {"train": "excitation_a.csv", "holdout": "pick_and_place.csv"}


@cache
def traces(missing: bool) -> tuple[Trace, ...]:
    """Six joints, 60 s at 200 Hz; joints 2 and 5 rub, joint 3 is on a soft spring, the rest is coloured noise."""
    random = np.random.default_rng(7)
    t = np.arange(12_000) / 200
    result = []
    roles: tuple[Literal["train", "holdout"], ...] = ("train", "holdout")
    for role in roles:
        for joint in JOINTS:
            a, f = 0.3 + 0.1 * joint, 0.05 + 0.013 * joint
            q = a * np.sin(2 * np.pi * f * t) + 0.2 * np.sin(2 * np.pi * 0.31 * t + joint)
            qd = np.gradient(q, t)
            qdd = np.gradient(qd, t)
            model = 60 / joint * np.cos(q) + 9 / joint * qdd + 4 * qd
            noise = np.convolve(random.normal(size=t.size + 20), np.hanning(21) / 10.5, "valid") * 0.8 / joint
            extra = np.zeros_like(t)
            if missing and joint in (2, 5):
                extra = 14 / joint * np.tanh(qd / 0.01) + 5 / joint * np.tanh(qd / 0.01) * np.exp(-((qd / 0.1) ** 2))
            if missing and joint == 3:
                extra = 9 * np.exp(-t / 20) * np.sin(2 * np.pi * 7.5 * t) * (np.abs(qdd) > 0.5)
            measured = model + extra + noise
            if joint == 4:
                measured[5000:5600] = np.nan
            result.append(
                Trace(
                    RECORDING[role], role, f"tau.joint{joint}", "N*m", t, q, qd, measured, model, model + 0.95 * extra
                )
            )
    return tuple(result)


def misfit(trace: Trace) -> Misfit:
    scale = np.sqrt(np.nanmean(trace.measured**2))
    before, after = (float(np.sqrt(np.nanmean((trace.measured - m) ** 2))) for m in (trace.before, trace.after))
    return Misfit(before, after, before / scale, after / scale)


def fits(kept: tuple[Trace, ...]) -> tuple[ChannelFit, ...]:
    return tuple(
        ChannelFit(a.channel, a.unit, misfit(a), misfit(b), 0.9 * misfit(a).rms_after)
        for a, b in zip(kept[:6], kept[6:], strict=True)
    )


def candidates(named: tuple[tuple[str, str], ...]) -> tuple[Candidate, ...]:
    names = ["coulomb_friction", "stribeck_friction", "position_dependent_friction", "joint_elasticity", "sensor_bias"]
    pairs = [(name, f"joint{joint}") for name in names for joint in JOINTS]
    shares = np.geomspace(0.41, 0.0001, len(pairs))
    pairs.sort(key=lambda pair: (pair not in named, pair[1][::-1]))
    return tuple(
        Candidate(n, at, float(s), 900 * float(s), (n, at) in named) for (n, at), s in zip(pairs, shares, strict=True)
    )


def missing_physics() -> Diagnosis:
    kept = traces(True)
    findings = (
        Finding(
            "coulomb_friction",
            "joint2",
            1.0,
            0.994,
            {"level": Estimate(7.0123, 0.0432, "N*m")},
            "Torque steps by 14 N·m wherever joint2 turns round, whatever its speed and position.",
            (),
        ),
        Finding(
            "stribeck_friction",
            "joint5",
            0.9,
            0.87,
            {
                "level": Estimate(2.81, 0.061, "N*m"),
                "excess": Estimate(1.04, 0.17, "N*m"),
                "stribeck_speed": Estimate(0.1, 0.0123, "rad/s", at_bound=True),
            },
            "Friction falls from 3.8 to 2.8 N·m as joint5 gains speed, on both recordings alike.",
            (
                Rival("load_dependent_friction", "joint5", 0.08, False, "repeat the slow part of the motion with 5 kg"),
                Rival("coulomb_friction", "joint5", 0.03, True, ""),
            ),
        ),
        Finding(
            "joint_elasticity",
            "joint3",
            0.75,
            0.71,
            {"stiffness": Estimate(5423.0, 61.0, "N*m/rad"), "damping": Estimate(3.2e-5, 4e-6, "N*m*s/rad")},
            "joint3 rings at 7.5 Hz after each acceleration, and the ringing dies out as a spring's would.",
            (Rival("backlash", "joint3", 0.22, True, "reverse joint3 slowly under constant load"),),
        ),
    )
    return Diagnosis(
        verdict="missing_physics",
        sentence="The model leaves out Coulomb friction at joint2 (7.01 ± 0.04 N·m), Stribeck friction at joint5 and "
        "elasticity at joint3; with them the error on the held-out recording falls from 8.9 % to 1.6 %.",
        description="",
        model="arm6",
        effects=findings,
        location=(
            Location(
                "tau.joint2", 0.62, ((0.0, 4.2), (11.8, 13.0), (30.1, 42.4)), "|qd.joint2| < 0.05 rad/s, reversing"
            ),
            Location("tau.joint2", 0.05, ((50.0, 52.0),), "temp.joint2 > 40 °C"),
            Location("tau.joint3", 0.21, ((3.0, 9.5),), "|qdd.joint3| > 0.5 rad/s²"),
            Location("tau.joint5", 0.09, tuple((5.0 * i, 5.0 * i + 1) for i in range(12)), "qd.joint5 changing sign"),
        ),
        fit=fits(kept),
        steps=(
            Step("baseline: viscous_friction on every joint", 0.0873, 0.0891),
            Step("+ coulomb_friction at joint2", 0.0412, 0.0433),
            Step("+ stribeck_friction at joint5", 0.0291, 0.0302),
            Step("+ joint_elasticity at joint3", 0.0154, 0.0161),
        ),
        candidates=candidates(tuple((f.name, f.at) for f in findings)),
        moved=(
            ParameterShift("viscous_friction.joint2.coefficient", "N*m*s/rad", 19.34, 4.021, 0.034),
            ParameterShift("viscous_friction.joint5.coefficient", "N*m*s/rad", 4.05, 4.01, 0.06),
            ParameterShift("inertia.link3.mass", "kg", 3.1234, 3.1239, 0.0021),
        ),
        traces=kept,
        limits=tuple(Limit("coulomb_friction", f"joint{j}", "level", 0.04 * j, "N*m") for j in JOINTS),
        notes=(
            "Condition number 310: every parameter is excited.",
            "joint6 turns by less than 40°: a spring and an imbalance there would look alike.",
        ),
        band=20.0,
    )


def adequate() -> Diagnosis:
    kept = traces(False)
    return replace(
        missing_physics(),
        verdict="adequate",
        sentence="Nothing is left out that these recordings can show: the error on the held-out recording is 1.6 %.",
        effects=(),
        location=(),
        fit=fits(kept),
        steps=(Step("baseline", 0.0154, 0.0161),),
        candidates=candidates(()),
        moved=(),
        traces=kept,
    )


def unknown_effect() -> Diagnosis:
    known = missing_physics()
    kept = tuple(replace(trace, after=trace.before) for trace in known.traces)
    return replace(
        known,
        verdict="unknown_effect",
        sentence="Something is left out at joint3 that no name in the vocabulary explains.",
        description="Bursts at 7.5 Hz, 9 N·m at first, after accelerations above 0.5 rad/s².",
        effects=(),
        location=known.location[2:3],
        fit=fits(kept),
        steps=known.steps[:1],
        candidates=candidates(()),
        moved=(),
        traces=kept,
    )


def unbroken(text: str) -> str:
    """As a page has it: a number and its % stay on one line."""
    return text.replace(" %", "\u202f%")


VERDICTS = {"missing_physics": missing_physics, "adequate": adequate, "unknown_effect": unknown_effect}


def spelt(text: str) -> Diagnosis:
    """A small diagnosis in which every text is the same."""
    t = np.arange(400) / 100
    speed = np.cos(t)
    misfit = Misfit(1.0, 0.1, 0.5, 0.05)
    traces = [
        Trace(text, role, text, text, t, np.sin(t), speed, np.sign(speed), 0 * t, np.tanh(9 * speed))
        for role in ("train", "holdout")
    ]
    rival = Rival(text, text, 0.1, False, text)
    return Diagnosis(
        verdict="missing_physics",
        sentence=text,
        description=text,
        model=text,
        effects=(Finding(text, text, 0.95, 0.9, {text: Estimate(1.0, 0.1, text)}, text, (rival,)),),
        location=(Location(text, 0.5, ((1.0, 2.0),), text),),
        fit=(ChannelFit(text, text, misfit, misfit, 0.1),),
        steps=(Step(text, 0.5, 0.5), Step(text, 0.05, 0.05)),
        candidates=(Candidate(text, text, 0.4, 1.0, True),),
        moved=(ParameterShift(text, text, 1.0, 2.0, 0.1),),
        traces=tuple(traces),
        limits=(Limit(text, text, text, 0.1, text),),
        notes=(text,),
        band=20.0,
    )
