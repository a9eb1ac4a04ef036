"""Time of a step of the self-contained arm, and its error: the FMU against the same equations in CasADi from Python.

``python bench/fmu.py [RESULT.json]``. Six joints with viscous and Coulomb friction, steps of 1 ms, one Runge-Kutta step
each. The FMU is stepped by plain calls of fmi2DoStep through ctypes, so its time includes Python's side of the call;
CasADi gets the whole Runge-Kutta step as one function, the fewest calls that Python can make. Both take turns, and
figures are medians over the repetitions, of CPU time. The error is the largest of position and speed after 0.2 s,
against DOP853 on pinocchio's forward dynamics. Exit status 1 where a bar is not met.
"""

import ctypes
import os
import platform
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import casadi as ca
import numpy as np
import pinocchio
from scipy.integrate import solve_ivp

from bench.fmu_models import Slave, everywhere, write_model
from bench.results import write_result
from snarelab.fmu.build import write_fmu
from snarelab.fmu.equations import Equations
from snarelab.fmu.export import model_equations
from snarelab.models.model_file import load_model

N, SIZE, STEPS, REPETITIONS = 6, 1e-3, 2000, 9
VISCOUS, COULOMB = np.array([12.0, 10.0, 6.0, 2.0, 1.0, 0.5]), np.array([6.0, 5.0, 3.0, 1.0, 0.5, 0.2])
SPEED_SCALE = 1000.0  # Coulomb friction turns over within 0.3 rad/s, which an explicit step of 1 ms resolves
Q, QD = np.array([0.3, -0.4, 0.5, 0.2, -0.3, 0.1]), np.array([0.2, 0.1, -0.3, 0.4, 0.5, -0.6])
TAU = np.array([20.0, -30.0, 10.0, 5.0, -2.0, 1.0])
BARS = {"microseconds": 10.0, "times_faster": 10.0, "error": 1e-9}


def start() -> dict[str, float]:
    """Start values of the FMU."""
    names = [(f"start.q.joint{k + 1}", Q[k]) for k in range(N)] + [(f"start.qd.joint{k + 1}", QD[k]) for k in range(N)]
    return dict([*names, *((f"tau.joint{k + 1}", TAU[k]) for k in range(N))])


def error(slave: Slave, urdf: str) -> float:
    """Largest error of position [rad] and speed [rad/s] after 0.2 s."""
    engine: Any = pinocchio
    model = engine.buildModelFromXML(urdf)
    model.gravity = engine.Motion(np.array([0.0, 0.0, -9.81]), np.zeros(3))
    data = model.createData()

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        friction = VISCOUS * x[N:] + COULOMB * np.tanh(x[N:] / (3e-4 * SPEED_SCALE))
        return np.concatenate([x[N:], engine.aba(model, data, x[:N], x[N:], TAU - friction)])

    wanted = solve_ivp(rate, (0, 0.2), np.concatenate([Q, QD]), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    for _ in range(200):
        slave.step(SIZE)
    return float(np.abs(slave.get([f"{n}.joint{k}" for n in ("q", "qd") for k in range(1, N + 1)]) - wanted).max())


def casadi_step(equations: Equations) -> ca.Function:
    """One Runge-Kutta step of the same equations as one CasADi function (x, u, p) -> x."""
    f = equations.functions["rate"]
    x, u, p = (ca.SX.sym(name, f.size1_in(k)) for name, k in (("x", 1), ("u", 2), ("p", 3)))
    k1 = f(0, x, u, p)
    k2 = f(0, x + SIZE / 2 * k1, u, p)
    k3 = f(0, x + SIZE / 2 * k2, u, p)
    k4 = f(0, x + SIZE * k3, u, p)
    return ca.Function("step", [x, u, p], [x + SIZE / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def main() -> int:
    """Run, print, write; 1 where a bar is not met."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/fmu.json")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        values = everywhere("viscous_friction", "coefficient", VISCOUS) | everywhere(
            "coulomb_friction", "level", COULOMB
        )
        values |= {f"speed_scale.joint{k}": SPEED_SCALE for k in range(1, N + 1)}
        model = write_model(folder, "six", N, '["viscous_friction", "coulomb_friction"]', values)
        equations = model_equations(load_model(model), stiff=False)
        write_fmu(equations, folder / "six.fmu", 2)
        slave = Slave(folder / "six.fmu", folder / "six", start())
        found = error(slave, model.with_suffix(".urdf").read_text())
        do_step: Any = ctypes.CDLL(str(next((folder / "six" / "binaries").glob("*/*")))).fmi2DoStep
        do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
        one_step = casadi_step(equations)
        u = np.array([start().get(v.name, v.start) for v in equations.of("input")])
        p = equations.starts("parameter")
        times: dict[str, list[float]] = {"fmu": [], "one call": [], "casadi": []}
        saved = slave.save()
        for _ in range(REPETITIONS):
            slave.restore(saved)
            component, t = slave.fmu.component, slave.time
            began = time.process_time()
            for k in range(STEPS):
                do_step(component, t + k * SIZE, SIZE, 0)
            times["fmu"].append(time.process_time() - began)
            slave.restore(saved)
            began = time.process_time()
            do_step(component, t, STEPS * SIZE, 0)
            times["one call"].append(time.process_time() - began)
            x = np.concatenate([Q, QD])
            began = time.process_time()
            for _ in range(STEPS // 10):
                x = one_step(x, u, p)
            times["casadi"].append((time.process_time() - began) * 10)
        slave.restore(saved)
        slave.close()
    each = {name: float(np.median(values)) / STEPS * 1e6 for name, values in times.items()}
    ratio = float(np.median(np.array(times["casadi"]) / times["fmu"]))
    result = {
        "bench": "fmu",
        "n_joints": N,
        "step": SIZE,
        "microseconds": each["fmu"],
        "microseconds_inside": each["one call"],
        "microseconds_casadi": each["casadi"],
        "times_faster": ratio,
        "error": found,
        "bars": BARS,
    }
    print(f"{N} joints with friction, {1e3 * SIZE:g} ms steps, {REPETITIONS} x {STEPS} steps, {platform.machine()}")
    print(f"FMU, a call of fmi2DoStep        {each['fmu']:8.2f} us a step   (bar {BARS['microseconds']:g})")
    print(f"FMU, 2000 steps inside one call  {each['one call']:8.2f} us a step")
    print(
        f"CasADi from Python               {each['casadi']:8.2f} us a step   {ratio:.1f} x the FMU"
        f" (bar {BARS['times_faster']:g})"
    )
    print(f"error against DOP853             {found:8.1e}             (bar {BARS['error']:g})")
    write_result(path, result)
    met = each["fmu"] <= BARS["microseconds"] and ratio >= BARS["times_faster"] and found <= BARS["error"]
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
