"""Run one FMU in another tool, in a process of its own: ``fmu_tools.py TOOL FMU SIZE STEPS JSON``.

JSON has ``start``: values by name, and ``outputs``: names to print as hexadecimal numbers, one a line.
"""

import json
import sys


def fmpy(path, size, steps, start, outputs):
    from fmpy import simulate_fmu

    result = simulate_fmu(
        path, step_size=size, output_interval=size, stop_time=size * steps, start_values=start, output=outputs
    )
    return [float(result[name][-1]) for name in outputs]


def ecospy(path, size, steps, start, outputs):
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("model", path)
        structure.add_parameter_set("start", {f"model::{k}": float(v) for k, v in start.items()})
        with EcosSimulation(structure=structure, step_size=size) as simulation:
            simulation.init(parameter_set="start")
            simulation.step(steps)
            found = [simulation.get_real(f"model::{name}") for name in outputs]
            simulation.terminate()
            return found


def ecos_ssp(path, size, steps, outputs):
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=path, step_size=size) as simulation:
        simulation.init(parameter_set="initialValues")
        simulation.step(steps)
        found = [simulation.get_real(name) for name in outputs]
        simulation.terminate()
        return found


def libcosimpy(path, size, steps, start, outputs):
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(size * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(path, "model"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    references = {v.name.decode(): v.reference for v in execution.slave_variables(slave)}
    for name, value in start.items():
        execution.real_initial_value(slave, references[name], float(value))
    execution.step(steps)
    return list(observer.last_real_values(slave, [references[name] for name in outputs]))


if __name__ == "__main__":
    tool, path, size, steps, given = sys.argv[1:]
    found = globals()[tool](path, float(size), int(steps), **json.loads(given))
    print("\n".join(float(x).hex() for x in found))
