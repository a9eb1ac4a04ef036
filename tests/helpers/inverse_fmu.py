"""An inverse FMU along a motion, and how far it is from what `simulate` gives there."""

import numpy as np
import pandas as pd

from bench.fmu_models import Slave
from snarelab.fmu.export import export
from snarelab.identification.simulate import simulate
from snarelab.models.model_file import load_model


def follow(path, folder, dataset, joints):
    """Torque (n_samples, J) that an FMU gives along a motion: set, read, step."""
    time = dataset["time"].values
    columns = {f"{x}.{j}": dataset[f"{x}.{j}"].values for x in ("q", "qd", "qdd") for j in joints}
    s = Slave(path, folder, {name: values[0] for name, values in columns.items()}, start_time=time[0])
    found = []
    for k, later in enumerate([*time[1:], None]):
        s.set({name: values[k] for name, values in columns.items()})
        found.append(s.get([f"tau.{j}" for j in joints]))
        if later is not None:
            s.step(later - time[k])
    s.close()
    return np.array(found)


def parted(path, version, t, q):
    """The furthest that an arm's FMU is from `simulate` along positions q (n_samples, J) [share of a joint's peak].

    It is written, and run, beside the model file.
    """
    names = [f"joint{k + 1}" for k in range(q.shape[1])]
    columns = {f"q.{j}": q[:, k] for k, j in enumerate(names)} | {f"tau.{j}": 1 + 0 * t for j in names}
    pd.DataFrame({"time": t, **columns}).to_csv(path.parent / "motion.csv", index=False)
    wanted = simulate(load_model(path), path.parent / "motion.csv")
    export(str(path), version, path.parent / "x.fmu", inverse=True)
    found = follow(path.parent / "x.fmu", path.parent / "x", wanted, names)
    tau = np.stack([wanted[f"tau.{j}"].values for j in names], 1)
    return (np.abs(found - tau).max(axis=0) / np.abs(tau).max(axis=0)).max()
