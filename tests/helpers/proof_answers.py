"""The proof's answers and diagnoses, made by hand."""

from proof.cases import BANDS, Answer, Truth


def answer(group="single", name="harness_stiffness", at="joint2", size=2.0, also=()) -> Answer:
    truths = () if group in ("clean", "outside", "wrong") else (Truth(name, at, also),)
    kinds = () if group == "clean" else (name,)
    lowest = {f"tau.joint{k}": (0.5,) * len(BANDS) for k in (1, 2)}
    return Answer(0, group, kinds, size, truths, (1.0,), 0.3, 0.1, 2, ("tau.joint2",) if kinds else (), lowest)


def finding(name, at, probability=0.9, rivals=()):
    listed = [{"name": n, "at": a, "probability": p, "separable": s} for n, a, p, s in rivals]
    return {"name": name, "at": at, "probability": probability, "rivals": listed}


def diagnosis(*effects, verdict="", before=1.0, after=0.55):
    third = {"tau.joint1": [0.6, 0.6], "tau.joint2": [before, after]}
    verdict = verdict or ("missing_physics" if effects else "adequate")
    return {"verdict": verdict, "effects": list(effects), "third": third, "band": {"value": 30.0}, "candidates": []}


RIGHT = finding("harness_stiffness", "joint2")


def several():
    """Twelve answers, and what was found."""
    given = [
        *[answer("clean", size=0.0)] * 4,
        *[answer("outside", "damaged tooth")] * 2,
        *[answer("wrong", "link too light")] * 2,
        *[answer(size=s) for s in (0.5, 1.0, 2.0, 4.0)],
    ]
    found = [
        *[diagnosis()] * 3,
        diagnosis(finding("torque_ripple", "joint1", 0.25)),
        diagnosis(verdict="unknown_effect"),
        diagnosis(RIGHT),
        diagnosis(finding("inertia_error", "link1", 0.9)),
        diagnosis(finding("viscous_friction", "joint1", 0.9)),
        diagnosis(),
        *[diagnosis(RIGHT)] * 3,
    ]
    return given, found
