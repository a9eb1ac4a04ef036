"""Worked examples: how a method answers a set. Each reads a case's folder as anybody would, and nothing else."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import snarelab
from snarelab.errors import InputError
from snarelab.files import written_whole

from ..rival_columns import baseline, fixed, library, read
from ..rivals import Task, selected
from .case_set import CaseSet, Tell, write

Answer = dict[str, Any]


def by_snarelab(case: Path, torque: Path) -> Answer:
    """The tool: names on ``fit.csv`` and ``confirm.csv``; torque along ``predict.csv`` by the model that it gives."""
    try:
        found = snarelab.diagnose(case / "arm.toml", case / "fit.csv", holdout=case / "confirm.csv")
        run = snarelab.simulate(found.model, case / "predict.csv")
        write(torque, {name: run[name].to_numpy() for name in run if str(name).startswith("tau.")})  # type: ignore
    except InputError as error:
        return {"verdict": "unknown_effect", "effects": [], "note": str(error)}
    said = found.to_json()
    effects = [
        {
            "name": e["name"],
            "at": e["at"],
            "probability": e["probability"],
            "alike": [{k: r[k] for k in ("name", "at", "probability")} for r in e["rivals"] if not r["separable"]],
            "values": {k: {"value": p["value"], "std": p["std"]} for k, p in e["parameters"].items() if p["std"]},
        }
        for e in said["effects"]
        if e["name"] != "empirical"
    ]
    return {"verdict": said["verdict"], "effects": effects}


def by_joint_bic(case: Path, torque: Path) -> Answer:
    """Forward selection by the Bayesian information criterion over textbook columns: a rival, in thirty lines."""
    task = Task(case, ("fit.csv", "confirm.csv"))
    chosen, effects = selected(task)
    theta = task.fit(np.concatenate([task.base, *(task.library[key] for key in chosen)], axis=2))
    last = read(case, "predict.csv", predict=True)
    every = library(last, task.train)
    whole = np.concatenate([baseline(last, task.travels), *(every[key] for key in chosen)], axis=2)
    predicted = fixed(last) + whole @ theta
    write(torque, {f"tau.{j}": predicted[:, k] for k, j in enumerate(last.model.joints)})
    return {"verdict": "missing_physics" if effects else "adequate", "effects": _alike(effects)}


def by_mujoco_sysid(case: Path, torque: Path) -> Answer:
    """MuJoCo's toolbox with every joint's friction and rotor and every link's mass free (`proof.rival_sysid`)."""
    from ..rival_sysid import fitted

    task = Task(case, ("fit.csv", "confirm.csv"))
    found = fitted(case / "arm.urdf", task.train, task.scale)
    last = read(case, "predict.csv", predict=True)
    predicted = found.torque(found.model, last)
    write(torque, {f"tau.{j}": predicted[:, k] for k, j in enumerate(last.model.joints)})
    effects = found.effects({(p.effect.name, p.at) for p in last.model.effects})
    return {"verdict": "missing_physics" if effects else "adequate", "effects": _alike(effects)}


def _alike(effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Effects in the form of the rules: with those that the method cannot tell from them."""
    return [
        {"alike": [{k: r[k] for k in ("name", "at", "probability")} for r in e["rivals"] if not r["separable"]]}
        | {k: e[k] for k in ("name", "at", "probability")}
        for e in effects
    ]


METHODS: dict[str, Callable[[Path, Path], Answer]] = {
    "snarelab": by_snarelab,
    "joint_bic": by_joint_bic,
    "mujoco_sysid": by_mujoco_sysid,
}


def answer(
    cases: CaseSet, method: str, out: Path, tell: Tell = print, run: Callable[..., Answer] | None = None
) -> None:
    """Answer every case of a set into ``out``; those that stand there already are kept.

    Raises
    ------
    ValueError
        ``out`` holds another method's answers.
    """
    run = run or METHODS[method]
    given: Answer = {"tool": method, "cases": {}}
    if out.exists():
        given = json.loads(out.read_text(encoding="utf-8"))
        if given["tool"] != method:
            raise ValueError(f"{out} holds the answers of {given['tool']}; give another file")
    torque = out.parent / "torque"
    torque.mkdir(parents=True, exist_ok=True)
    names = cases.names()
    for k, name in enumerate(names, 1):
        if name in given["cases"]:
            continue
        start = time.perf_counter()
        own = run(cases.case(name), torque / f"{name}.csv")
        given["cases"][name] = own | {"seconds": round(time.perf_counter() - start, 1)}
        with written_whole(out) as part:
            part.write_text(json.dumps(given, indent=1) + "\n", encoding="utf-8")
        said = ", ".join(f"{e['name']} at {e['at']} {e['probability']:.2f}" for e in own["effects"])
        tell(f"{k}/{len(names)} {name}: {own['verdict']} {said}")
