"""Write cases of the first generator with what is true of each beside them, as `proof.drives.score` reads it."""

import copy
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from snarelab.models.effects import get_effect

from ..cases import Answer, Case, draw
from ..concealed import VALUES
from ..drives.cases import FAULTY, LAWLESS, TWIN
from ..drives.make import made
from ..drives.places import joint
from .deck import Plan, planned
from .world import World

ATTEMPTS = 100
MASSES = ("payload_mass", "com_offset", "inertia_error")
"""Names that are true of a case besides: links whose numbers are 1 to 5 % off."""


def make(
    folder: Path, seed: int, count: int, group: str = "", tell: Callable[[str], None] = print, first: int = 0
) -> list[Path]:
    """Folders of the first ``count`` cases of a seed from number ``first`` on, or of those among them of one group.

    Raises
    ------
    ValueError
        ``folder`` holds cases of another seed.
    """
    return made(folder, seed, planned(seed, count), group, tell, write, first)


def write(plan: Plan, seed: int, number: int, folder: Path) -> None:
    """Record a case, with another arm where it or its twin cannot be recorded, and write it; ``truth.json`` last.

    Raises
    ------
    RuntimeError
        No such case in `ATTEMPTS` attempts.
    """
    fault = plan.concealed[0][0] if plan.group == FAULTY else ""
    kinds = () if fault else tuple(what for what, _ in plan.concealed)
    size = plan.concealed[0][1] if plan.concealed else 0.0
    group = {LAWLESS: "outside", FAULTY: "clean"}.get(plan.group, plan.group)
    for attempt in range(ATTEMPTS):
        case = draw((group, kinds, size), seed, number, attempt)
        world = World.random(case, plan.disturbance, np.random.default_rng([seed, number, attempt, 1]))
        case = replace(case, plant=world.of(case.plant), twin=world.of(case.twin))
        told: dict[str, Any] = truth(case.answer, seed) | {"group": plan.group, "fault": fault}
        told["disturbance"] = {"kind": plan.disturbance}
        told |= {"bits": world.bits, "rough": world.rough, "jitter": world.jitter}
        if len({joint(e["at"]) for e in told["effects"]}) < len(told["effects"]):
            continue
        try:
            twin = twin_of(case)
            case.write(folder, lambda name, columns, of=world: of.logged(name, columns, fault))
            if told["effects"]:
                twin.write(folder / TWIN, world.logged)
        except ValueError:
            shutil.rmtree(folder)
            continue
        part = folder / "truth.json.part"
        part.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        part.replace(folder / "truth.json")
        return
    raise RuntimeError(f"case {number} ({plan}): no arm could be recorded in {ATTEMPTS} attempts")


def twin_of(case: Case) -> Case:
    """A case with nothing concealed: its arm, motions and noise; of one that was not written yet."""
    return replace(case, plant=case.twin, model=case.twin_model, noise=copy.deepcopy(case.noise))


def truth(answer: Answer, seed: int) -> dict[str, Any]:
    """What is true of a case. A law outside the vocabulary has no name; nor has a wrong number of the model. What hides
    with the whole friction of a joint counts neither way, nor do a link's masses, which are off in every case."""
    lawless, wrong = answer.group == "outside", answer.group == "wrong"
    effects = [
        {
            "name": "" if lawless else answer.truths[k].name,
            "law": kind,
            "at": channel if lawless else answer.truths[k].at,
            "size": answer.size,
            "channel": channel,
            "values": {} if lawless else _comparable(kind, value),
        }
        for k, (kind, channel, value) in enumerate(zip(answer.kinds, answer.channels, answer.value, strict=True))
        if not wrong
    ]
    return {
        "generator": "mujoco",
        "seed": seed,
        "case": answer.case,
        "group": LAWLESS if lawless else answer.group,
        "disturbance": {"kind": "white"},
        "effects": effects,
        "background": [*MASSES, *(other for t in answer.truths for other in t.also)],
        "known": {},
        "joints": answer.joints,
    }


def _comparable(kind: str, value: float) -> dict[str, float]:
    """The value by its parameter in the vocabulary, where that has no sign: a maker's sign may be the other one."""
    if kind not in VALUES:
        return {}
    (parameter,) = (p for p in get_effect(kind).parameters if p.name == VALUES[kind])
    return {parameter.name: abs(value)} if parameter.low >= 0 else {}
