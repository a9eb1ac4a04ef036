"""Any FMU for co-simulation, FMI 2.0 or 3.0, as a participant."""

import ctypes
import shutil
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...fmi.archive import open_fmu
from ...scratch import scratch_folder
from ..fmi_calls import CompiledCalls, Instance, Vector, address
from ..fmi_variables import FmiVariable, read_interface
from ..participant import Causality, Participant, StepError

_START, _TOOL_START = 3.0, 60.0  # s to initialise however short a step may be, without and with a tool to start


class Fmu(Participant):
    """A functional mock-up unit.

    Parameters
    ----------
    path : str or Path
        The ``.fmu`` file.
    name : str
        Of the instance; the file's stem when left out.

    Raises
    ------
    InputError
        Where the archive is unsafe, or no FMU for co-simulation on this platform, with every problem found.

    Notes
    -----
    It runs in this process: an FMU that hangs or crashes takes the process with it. `snarelab.cosim.process.OwnProcess`
    keeps it apart.
    """

    def __init__(self, path: str | Path, name: str = "") -> None:
        """Unpack and read the model description; no code of the FMU runs yet."""
        self.path = Path(path)
        self.name = name or self.path.stem
        self._folder = scratch_folder("fmu-")
        self._remove_folder = weakref.finalize(self, shutil.rmtree, self._folder, True)
        self._description = open_fmu(self.path, self._folder).description
        capable = self._description.coSimulation
        interface = read_interface(self._description, path)
        self.variables, self._slots = interface.variables, interface.slots
        self.can_restore = bool(capable.canGetAndSetFMUstate)
        self.can_vary_step = bool(capable.canHandleVariableCommunicationStepSize)
        self.start_limit = _TOOL_START if capable.needsExecutionTool else _START
        self.unread = interface.unread
        inputs = self._slots["input"]
        self.input_order = 1 if capable.canInterpolateInputs and _continuous(inputs, "Real") else 0
        own = capable.fixedInternalStepSize  # declared by FMI 3.0 only: half a step may not be a multiple of it
        self.can_halve = self.can_vary_step and not own and bool(inputs) and _continuous(inputs, "Float64")
        self._second: np.ndarray | None = None  # inputs of the step's second half, where they are others
        self._instance: Instance | None = None

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Instantiate, set parameters, initialise at a time [s]; raises InputError for a parameter it has not."""
        self.close()
        self.start_parameters(parameters)
        self._instance = Instance(self._description, self._folder, self.name)
        if self.can_restore:
            self._instance.prepare_states()
        self._instance.initialize(time, lambda: self._set_parameters(parameters or {}))
        self._inputs = self._vectors("Set", "input")
        self._outputs = self._vectors("Get", "output")
        self._values = np.zeros(len(self.names("output")))
        if self.input_order:
            self._prepare_derivatives()

    def set_inputs(self, values: np.ndarray) -> None:
        """Set every input."""
        self._second = None
        for vector, where in self._inputs:
            vector.set(values[where])

    def set_input_halves(self, first: np.ndarray, second: np.ndarray) -> None:
        """Set every input for the first half of the step, and keep those for the second."""
        self.set_inputs(first)
        self._second = second

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Set the slopes of every input; FMI 2.0's own extrapolation."""
        self._slopes[:] = first
        assert self._instance is not None
        self._instance.check("SetRealInputDerivatives", self._set_slopes(*self._slope_arguments))

    def step(self, time: float, size: float) -> None:
        """One communication step, or two, each half as long, where inputs change between."""
        assert self._instance is not None
        second = self._second
        if second is None:
            self._instance.step(time, size)
            return
        self._instance.step(time, 0.5 * size)
        self.set_inputs(second)
        self._instance.step(time + 0.5 * size, 0.5 * size)

    def outputs(self) -> np.ndarray:
        """Every output now."""
        for vector, where in self._outputs:
            self._values[where] = vector.get()
        return self._values.copy()

    def save(self) -> "_State":
        """The FMU's own copy of its state."""
        assert self._instance is not None
        return _State(self._instance)

    def restore(self, state: "_State") -> None:
        """Return to a state; one of another instance goes through bytes."""
        assert self._instance is not None
        if state.instance is not self._instance:
            if not self._description.coSimulation.canSerializeFMUstate:
                raise StepError(
                    f"{self.name}: a state of another instance needs canSerializeFMUstate, which it has not"
                )
            state = _State(self._instance, self._instance.deserialized(state.instance.serialized(state.pointer)))
        self._instance.set_state(state.pointer)

    def compiled_calls(self) -> CompiledCalls | None:
        """Addresses for the loop in C, where inputs and outputs are all of double precision."""
        assert self._instance is not None
        if any(slot.type not in ("Real", "Float64") for side in ("input", "output") for slot in self._slots[side]):
            return None
        setter, getter = self._vector("Set", "input"), self._vector("Get", "output")
        step = self._instance.function("DoStep")
        return CompiledCalls(
            fmi=self._instance.major,
            component=self._instance.component.value or 0,
            set=address(setter.function),
            get=address(getter.function),
            step=address(step),
            in_references=setter.arguments[1],
            out_references=getter.arguments[1],
            n_in=len(setter.values),
            n_out=len(getter.values),
            failed=self._instance.failed,
            keep=(setter, getter, step),
        )

    def close(self) -> None:
        """Terminate and free the instance."""
        if self._instance is not None:
            self._instance.close()
            self._instance = None

    def _vector(self, action: str, causality: Causality) -> Vector:
        """All variables of one causality in one vector, where they are real numbers of one type."""
        assert self._instance is not None
        slots = self._slots[causality]
        real = "Real" if self._instance.major == 2 else "Float64"
        return self._instance.vector(action, slots[0].type if slots else real, slots)

    def _vectors(self, action: str, causality: Causality) -> list[tuple[Vector, slice | np.ndarray]]:
        """One vector a type, with its places among the participant's variables of this causality."""
        assert self._instance is not None
        slots = self._slots[causality]
        places = {name: place for place, name in enumerate(self.names(causality))}
        found: list[tuple[Vector, slice | np.ndarray]] = []
        for type_ in dict.fromkeys(slot.type for slot in slots):
            chosen = [slot for slot in slots if slot.type == type_]
            where = np.array([places[name] for slot in chosen for name in slot.names])
            alone = len(chosen) == len(slots)
            found.append((self._instance.vector(action, type_, chosen), slice(None) if alone else where))
        return found

    def _set_parameters(self, values: Mapping[str, float]) -> None:
        assert self._instance is not None
        starts = {v.name: v.start for v in self.variables}
        for slot in self._slots["parameter"]:
            given = [name for name in slot.names if name in values]
            if not given:
                continue
            whole = [values.get(name, starts[name]) for name in slot.names]
            self._instance.vector("Set", slot.type, [slot]).set(np.array(whole))

    def _prepare_derivatives(self) -> None:
        assert self._instance is not None
        slots: Sequence[FmiVariable] = self._slots["input"]
        buffer = (ctypes.c_double * len(slots))()
        self._slopes = np.ctypeslib.as_array(buffer)
        self._set_slopes = self._instance.function("SetRealInputDerivatives")
        self._slope_arguments = (
            self._instance.component,
            (ctypes.c_uint * len(slots))(*(slot.reference for slot in slots)),
            ctypes.c_size_t(len(slots)),
            (ctypes.c_int * len(slots))(*[1] * len(slots)),
            buffer,
        )


def _continuous(slots: Sequence[FmiVariable], type_: str) -> bool:
    return all(slot.continuous and slot.type == type_ for slot in slots)


class _State:
    """A state inside the FMU, given back when nothing refers to it any more."""

    def __init__(self, instance: Instance, pointer: ctypes.c_void_p | None = None) -> None:
        """Take the state now, or hold the one given."""
        self.instance = instance
        self.pointer = pointer or instance.state()

    def __del__(self) -> None:
        """Free it."""
        if hasattr(self, "pointer"):
            self.instance.free_state(self.pointer)
