"""Writes ``docs/first-result.svg``, the README's figure: ``python docs/make_figure.py``.

It diagnoses the bundled arm and draws the joint that gained most on the held-out recording.
"""

from pathlib import Path

import snarelab

HERE = Path(__file__).resolve().parent
ARM = HERE.parent / "studies" / "bundled"


def main() -> None:
    """Diagnose, draw, write."""
    found = snarelab.diagnose(ARM / "arm3.toml", ARM / "train.csv", holdout=ARM / "holdout.csv")
    (HERE / "first-result.svg").write_bytes(found.plot().svg)
    print(found)


if __name__ == "__main__":
    main()
