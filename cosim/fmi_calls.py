"""FMI 2.0 and 3.0 behind one interface. Every argument is made once, so that a call costs little more than itself.

FMPy loads the library and starts the instance. The calls of the loop go to the library's functions directly, with
argument objects that are kept and only filled anew.
"""

import ctypes
import itertools
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from ..extras import needed_for
from .fmi_variables import FmiVariable
from .participant import StepError

with needed_for("an FMU"):
    from fmpy import fmi1, fmi2, fmi3

_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Float64": ctypes.c_double,
    "Float32": ctypes.c_float,
    "Integer": ctypes.c_int,
    "Int8": ctypes.c_int8,
    "UInt8": ctypes.c_uint8,
    "Int16": ctypes.c_int16,
    "UInt16": ctypes.c_uint16,
    "Int32": ctypes.c_int32,
    "UInt32": ctypes.c_uint32,
    "Int64": ctypes.c_int64,
    "UInt64": ctypes.c_uint64,
}


@dataclass(frozen=True)
class CompiledCalls:
    """An FMU's functions and arguments, as addresses; ``keep`` holds what they point to.

    Parameters
    ----------
    fmi : int
        2 or 3.
    component, set, get, step : int
        Addresses.
    in_references, out_references : ctypes arrays
    n_in, n_out : int
        Scalars, which may be more than references where variables are arrays.
    failed : callable
        Raises StepError for a call's name, its status, and when it was.
    keep : object
    """

    fmi: int
    component: int
    set: int
    get: int
    step: int
    in_references: Any
    out_references: Any
    n_in: int
    n_out: int
    failed: Callable[[str, int, str], None]
    keep: Any


class Instance:
    """A co-simulation instance.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    folder : str
        Where the FMU is unpacked.
    name : str
        Of the instance, and in messages.

    Raises
    ------
    StepError
        Where the library cannot be loaded or gives no instance.
    """

    def __init__(self, description: Any, folder: str, name: str) -> None:
        """Load and instantiate."""
        self.name, self.major = name, description.fmiMajorVersion
        self.messages: deque[str] = deque(maxlen=5)
        self.dead = ""
        kind = fmi2.FMU2Slave if self.major == 2 else fmi3.FMU3Slave
        try:
            self._fmu: Any = kind(
                guid=description.guid,
                unzipDirectory=folder,
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=name,
            )
            self._instantiate()
        except Exception as error:  # no library, no instance: FMPy raises plain Exception
            raise StepError(f"{name}: cannot be started: {error}{self._said()}") from None
        self.component = ctypes.c_void_p(self._fmu.component)
        self._time, self._size = ctypes.c_double(), ctypes.c_double()
        self.step_arguments = self._step_arguments()
        self._do_step = self.function("DoStep")

    def initialize(self, time: float, set_start: Callable[[], None]) -> None:
        """Initialise at a time [s]; ``set_start`` gives values before it."""
        self.check("Set", self._guard(set_start))
        if self.major == 2:
            self.check("SetupExperiment", self._guard(lambda: self._fmu.setupExperiment(startTime=time)))
        start = {} if self.major == 2 else {"startTime": time}
        self.check("EnterInitializationMode", self._guard(lambda: self._fmu.enterInitializationMode(**start)))
        self.check("ExitInitializationMode", self._guard(self._fmu.exitInitializationMode))

    def vector(self, action: str, type_: str, slots: Sequence[FmiVariable]) -> "Vector":
        """Variables of one type that are set or got together; ``action`` is Set or Get."""
        return Vector(self, action, type_, slots)

    def step(self, time: float, size: float) -> None:
        """One step [s]; raises StepError."""
        self._time.value, self._size.value = time, size
        status = self._do_step(*self.step_arguments)
        if status > 1:
            self.failed("DoStep", status, f" in the step from {time:.9g} s")
        if self.major == 3 and self._flags[1].value:
            raise StepError(f"{self.name}: the FMU asks to end the simulation in the step from {time:.9g} s")

    def state(self) -> ctypes.c_void_p:
        """A pointer to a copy of the state; to be freed."""
        pointer = ctypes.c_void_p()
        self.check("GetFMUstate", self._get_state(self.component, ctypes.byref(pointer)))
        return pointer

    def set_state(self, pointer: ctypes.c_void_p) -> None:
        """Return to a state."""
        self.check("SetFMUstate", self._set_state(self.component, pointer))

    def free_state(self, pointer: ctypes.c_void_p) -> None:
        """Free a state's memory."""
        if not self.dead:
            self._free_state(self.component, ctypes.byref(pointer))

    def serialized(self, pointer: ctypes.c_void_p) -> bytes:
        """A state as bytes."""
        serialize = self._fmu.serializeFMUstate if self.major == 2 else self._fmu.serializeFMUState
        return serialize(pointer)

    def deserialized(self, content: bytes) -> ctypes.c_void_p:
        """A state from bytes; to be freed."""
        deserialize = self._fmu.deSerializeFMUstate if self.major == 2 else self._fmu.deserializeFMUState
        return deserialize(content)

    def close(self) -> None:
        """End the instance as far as its condition allows, and unload the library."""
        if self.dead == "fatal" or self._fmu.component is None:
            return
        if not self.dead:
            self._guard(self._fmu.terminate)
        self.dead = "closed"
        self._fmu.freeInstance()
        self._fmu.component = None

    def prepare_states(self) -> None:
        """Fetch the functions that save and restore; FMUs without the capability may not have them."""
        suffix = "state" if self.major == 2 else "State"
        self._get_state, self._set_state, self._free_state = (
            self.function(f"{verb}FMU{suffix}") for verb in ("Get", "Set", "Free")
        )

    def function(self, name: str) -> Any:
        """A function of the library as its own object, without argument types: arguments are passed unchanged."""
        pointer = self._fmu.dll[f"fmi{self.major}{name}"]
        pointer.restype = ctypes.c_int
        return pointer

    def check(self, name: str, status: int) -> None:
        """Raise StepError for a status above warning."""
        if status > 1:
            self.failed(name, status, "")

    def failed(self, name: str, status: int, when: str) -> None:
        """Raise StepError with the FMU's last message."""
        if status < 0:
            raise StepError(f"{self.name}: the FMU asks to end the simulation{when}")
        label = _STATUS[status] if status < len(_STATUS) else str(status)
        if status >= 4 or status == 3:
            self.dead = "fatal" if status == 4 else "error"
        raise StepError(f"{self.name}: fmi{self.major}{name} returned {label}{when}{self._said()}")

    def _said(self) -> str:
        return f" ({self.messages[-1]})" if self.messages else ""

    def _guard(self, call: Callable[[], Any]) -> int:
        """The status of a call through FMPy, which raises instead."""
        try:
            call()
        except fmi1.FMICallException as error:
            return int(error.status)
        return 0

    def _instantiate(self) -> None:
        if self.major == 3:
            self._fmu.instantiate(logMessage=self._log3)
            return
        number = next(_NUMBERS)
        _LISTENERS[number] = self
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = _LOGGER.logger
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        callbacks.componentEnvironment = number
        self._fmu.instantiate(callbacks=callbacks)

    def hear(self, status: int, message: bytes) -> None:
        """Keep the FMU's message on a call that failed."""
        if status > 0 and message:
            self.messages.append(" ".join(message.decode(errors="replace").split()))

    def _log3(self, _: object, status: int, __: bytes, message: bytes) -> None:
        self.hear(status, message)

    def _step_arguments(self) -> tuple[Any, ...]:
        # The last one before the flags: a state may be set back to before this step.
        if self.major == 2:
            return (self.component, self._time, self._size, ctypes.c_int(0))
        self._flags = (ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double())
        pointers = tuple(ctypes.byref(flag) for flag in self._flags)
        return (self.component, self._time, self._size, ctypes.c_bool(False), *pointers)


_NUMBERS = itertools.count(1)
_LISTENERS: "WeakValueDictionary[int, Instance]" = WeakValueDictionary()


def _log2(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
    listener = _LISTENERS.get(environment or 0)
    if listener is None:
        fmi2.printLogMessage(environment, name, status, category, message)
    else:
        listener.hear(status, message)


# FMPy formats messages for one logger in the whole process. One that is never freed, and that leaves to FMPy what is
# not ours, keeps instances of FMPy's and of ours apart.
_LOGGER = fmi2.fmi2CallbackFunctions()
_LOGGER.logger = fmi2.fmi2CallbackLoggerTYPE(_log2)
_KEEP = _LOGGER.logger
fmi2.addLoggerProxy(ctypes.byref(_LOGGER))


class Vector:
    """Variables of one type, with the memory for setting and getting them."""

    def __init__(self, instance: Instance, action: str, type_: str, slots: Sequence[FmiVariable]) -> None:
        """Make every argument."""
        boolean = ctypes.c_bool if instance.major == 3 else ctypes.c_int
        if type_ == "Enumeration":
            type_ = "Integer" if instance.major == 2 else "Int64"
        c_type = boolean if type_ == "Boolean" else _TYPES[type_]
        count = sum(len(slot.names) for slot in slots)
        buffer = (c_type * count)()
        self.values = np.ctypeslib.as_array(buffer) if count else np.zeros(0)
        self._whole = type_ not in ("Real", "Float64", "Float32")
        self._boolean = type_ == "Boolean"
        self._instance, self._name = instance, f"{action}{type_}"
        self.function = instance.function(self._name)
        references = (ctypes.c_uint * len(slots))(*(slot.reference for slot in slots))
        self.arguments = (instance.component, references, ctypes.c_size_t(len(slots)), buffer)
        if instance.major == 3:
            self.arguments += (ctypes.c_size_t(count),)

    def set(self, values: np.ndarray) -> None:
        """Set from (n,); whole numbers are rounded, truth is what is not zero."""
        self.values[:] = values != 0 if self._boolean else np.rint(values) if self._whole else values
        status = self.function(*self.arguments)
        if status > 1:
            self._instance.failed(self._name, status, "")

    def get(self) -> np.ndarray:
        """Get (n,); the array is overwritten by the next call."""
        status = self.function(*self.arguments)
        if status > 1:
            self._instance.failed(self._name, status, "")
        return self.values


def address(function: Any) -> int:
    """Where a function of a library is."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0
