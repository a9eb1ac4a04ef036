"""Checks run on the bank's recordings as a user would run them: files in a folder, mends pasted into the model file."""

import pandas as pd

from snarelab.identification.checks.run import check_file

MODEL = 'urdf = "arm.urdf"\neffects = ["viscous_friction", "coulomb_friction"]\n'


def written(folder, made, runs, text=MODEL):
    """A model file and recordings; the paths of the recordings."""
    (folder / "arm.urdf").write_text(made.arm.urdf())
    (folder / "arm.toml").write_text(text)
    paths = []
    for k, run in enumerate(runs):
        paths.append(folder / f"run{k}.csv")
        pd.DataFrame(run.table()).to_csv(paths[-1], index=False)
    return paths


def checked(folder, paths):
    return check_file(folder / "arm.toml", paths)[1]


def mended(text, findings):
    """A model file's text with the mends of findings pasted in, once each."""
    lines = list(dict.fromkeys(line for finding in findings for line in finding.mend.splitlines()))
    signals = [line for line in lines if line.startswith('"')]
    top = [line for line in lines if not line.startswith('"')]
    keys = {line.partition("=")[0].strip() for line in top}
    merged = [line for line in top if list(keys) and line.partition("=")[0].strip() != "breaks"]
    breaks = [line.partition("=")[2].strip(" []") for line in top if line.startswith("breaks")]
    if breaks:
        merged.append(f"breaks = [{', '.join(breaks)}]")
    return "\n".join([*merged, text, "[signals]", *signals, ""])
