"""``python -m proof.calibrate``: how often a name is right, counted on cases of another seed than the proof's.

The cases are drawn as the proof's are, from seeds that are for work on the tool. The result is
``identification/reliability.json``: the frequency of a right name and place against the margin, which is how often the
effect beat its rivals in a bootstrap. It never falls with the margin (isotonic regression: Barlow, Bartholomew, Bremner
and Brunk 1972), and every group of names counts one right and one wrong name more than it saw, so that no name is ever
certain. What is done is kept under ``build/calibration`` as the proof keeps its own.
"""

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from multiprocessing import get_context
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from .cases import ROUND
from .judge import rightly_placed
from .run import diagnose, fill, prepare
from .score import score
from .seal import ROOT, tool, write_json

SEED = 90200
FOLDER = Path("build/calibration")
JSON = ROOT / "identification" / "reliability.json"
GROUP = 15
"""Fewest names behind a knot of the curve."""


def curve(margins: ArrayLike, right: ArrayLike, group: int = GROUP) -> tuple[NDArray, NDArray]:
    """Knots (n_knots,) of margin, rising, and of probability, never falling.

    Names are grouped by margin, equal margins together and at least ``group`` at a time (all of them, if fewer).
    """
    order = np.argsort(margins)
    x, y = np.asarray(margins, float)[order], np.asarray(right, float)[order]
    starts = [0]
    for k in range(1, len(x)):
        if x[k] > x[k - 1] and k - starts[-1] >= group and len(x) - k >= group:
            starts.append(k)
    count = np.diff([*starts, len(x)])
    knots = np.add.reduceat(x, starts) / count
    smoothed = (np.add.reduceat(y, starts) + 1.0) / (count + 2.0)
    return knots, isotonic_regression(smoothed, weights=count + 2.0).x


def main() -> int:
    """Record, diagnose, count; print the figures, too, which are those of work on the tool and prove nothing."""
    parser = argparse.ArgumentParser(prog="python -m proof.calibrate", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=len(ROUND))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=SEED)
    given = parser.parse_args()
    folder = FOLDER / str(given.seed)

    def tell(words: str) -> None:
        print(words, flush=True)

    try:
        with ProcessPoolExecutor(given.workers, get_context("spawn")) as pool:
            answers, folders, seal = prepare(given.cases, given.seed, pool, tell, folder)
            version = tool() + seal.answers
            found = fill(folder / "diagnoses.jsonl", version, folders, diagnose, pool, tell)
    except KeyboardInterrupt:
        print("stopped; the same command goes on where it was", file=sys.stderr)
        return 130
    names = [
        (effect["margin"], right)
        for answer, one in zip(answers, found, strict=True)
        for effect, right in zip(one["effects"], rightly_placed(answer, one), strict=True)
    ]
    for figure in score(answers, found).figures.values():
        tell(f"{figure.name:24} {figure.value}")
    knots, probability = curve([margin for margin, _ in names], [right for _, right in names])
    write_json(
        JSON,
        {
            "margin": knots.tolist(),
            "probability": probability.tolist(),
            "names": len(names),
            "cases": given.cases,
            "seed": given.seed,
            "date": date.today().isoformat(),
            "command": f"python -m proof.calibrate --cases {given.cases} --seed {given.seed}",
        },
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
