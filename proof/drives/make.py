"""Write cases; one that is there is not made again."""

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from .cases import draw, planned


def make(
    folder: Path, seed: int, count: int, group: str = "", tell: Callable[[str], None] = print, first: int = 0
) -> list[Path]:
    """Folders of the first ``count`` cases of a seed from number ``first`` on, or of those among them of one group;
    raises ValueError where ``folder`` holds cases of another seed.
    """
    plans = planned(seed, count)
    return made(folder, seed, plans, group, tell, lambda plan, seed, k, path: draw(plan, seed, k).write(path), first)


def made(
    folder: Path,
    seed: int,
    plans: Sequence[Any],
    group: str,
    tell: Callable[[str], None],
    write: Callable[[Any, int, int, Path], object],
    first: int = 0,
) -> list[Path]:
    """Folders of the plans of one group, or of all; ``write`` makes those that are not there, from plan, seed, number
    and folder. Those before ``first`` are left out. Raises ValueError where ``folder`` holds cases of another seed."""
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder / "seed.json"
    if mark.exists() and json.loads(mark.read_text())["seed"] != seed:
        raise ValueError(f"{folder} holds cases of seed {json.loads(mark.read_text())['seed']}; give another folder")
    mark.write_text(json.dumps({"seed": seed}) + "\n")
    wanted = [k for k, plan in enumerate(plans) if k >= first and group in ("", plan.group)]
    folders = []
    for done, k in enumerate(wanted, 1):
        path = folder / f"{k:04}"
        folders.append(path)
        if (path / "truth.json").exists():
            continue
        start = time.perf_counter()
        write(plans[k], seed, k, path)
        what = ", ".join(f"{name} {size:g}x" for name, size in plans[k].concealed) or "nothing"
        tell(f"{done}/{len(wanted)} {path}: {plans[k].group}, {what}; {time.perf_counter() - start:.1f} s")
    return folders


def written(folder: Path, group: str = "") -> list[Path]:
    """Folders of the cases that are there, or of those of one group; raises ValueError where there is none."""
    marks = sorted(folder.glob("*/truth.json"))
    found = [path.parent for path in marks if group in ("", json.loads(path.read_text())["group"])]
    if not found:
        raise ValueError(
            f"{folder} holds no {group + ' ' if group else ''}cases; make some: python -m proof.drives make"
        )
    return found
