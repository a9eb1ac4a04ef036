"""An SSP file run by Ecos, a foreign master, and the same loop by hand."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bench.fmu_models import tool_environment


def by_hand(slaves, wires, size, steps, shown):
    """Values ``who::variable`` after so many steps: inputs are held over a step, and all move at once, as Ecos does."""
    for _ in range(steps):
        moved = [
            (target.partition("."), slaves[source.partition(".")[0]].get([source.partition(".")[2]])[0])
            for source, target in wires
        ]
        for (who, _, variable), value in moved:
            slaves[who].set({variable: value})
        for s in slaves.values():
            s.step(size)
    values = [slaves[n.partition("::")[0]].get([n.partition("::")[2]])[0] for n in shown]
    for s in slaves.values():
        s.close()
    return values


def in_ecos(path, size, steps, shown):
    """The same values from Ecos; a test is skipped where it finds no oneTBB."""
    given = ["ecos_ssp", str(path), str(size), str(steps), json.dumps({"outputs": shown})]
    command = [sys.executable, str(Path(__file__).with_name("fmu_tools.py")), *given]
    run = subprocess.run(command, capture_output=True, text=True, env=tool_environment())
    if run.returncode and "libtbb" in run.stderr:
        pytest.skip("ecospy finds no oneTBB: pip install tbb")
    assert run.returncode == 0, run.stdout + run.stderr
    return [float.fromhex(x) for x in run.stdout.split()[-len(shown) :]]
