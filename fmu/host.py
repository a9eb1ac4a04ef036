"""The Python process of a hosted FMU: builds one participant and answers the FMU's library over a socket.

A copy of this file lies in each hosted FMU, beside ``host.json``, which says what to build, and ``warden.py``, which
ends this process with the importer; the package is imported when the FMU is instantiated. It is where an FMU and the
co-simulation's participants meet; it is run, never imported. See ``hosted.c`` for the messages.
"""

import json
import os
import socket
import struct
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

HELLO, INITIALIZE, STEP, OUTPUTS, SAVE, RESTORE = range(6)
OK, DISCARD, ERROR = 0, 2, 3
_HEAD = struct.Struct("=II")


class Host:
    """One participant and the values set for it."""

    def __init__(self, config: dict[str, Any]) -> None:
        """Import and construct; nothing is initialised."""
        own, package = config["path"]
        if package not in sys.path:  # the package that exported goes before another that is installed here
            sys.path.insert(0, package)
        if own not in sys.path:
            sys.path.append(own)
        module = import_module(config["module"])
        self.numpy = import_module("numpy")
        self.step_error = import_module("snarelab.cosim.participant").StepError
        self.state = import_module("snarelab.fmu.state")
        self.participant = getattr(module, config["class"])(**config["arguments"])
        for causality in ("input", "parameter", "output"):
            if list(self.participant.names(causality)) != config[causality]:
                raise RuntimeError(
                    f"the {causality}s of {config['class']} are no longer those of this FMU; export it again"
                )
        self.n_parameters, self.names = len(config["parameter"]), config["parameter"]
        self.built: bytes | None = None

    def initialize(self, payload: bytes) -> bytes:
        """Time, parameters, inputs; no outputs yet, since reading them may fix where a model starts."""
        split = 8 * (1 + self.n_parameters)
        self._build(payload[:split])
        self.participant.set_inputs(self._vector(payload[split:]))
        return b""

    def step(self, payload: bytes) -> bytes:
        """Time, size, inputs and their slopes; the answer is the outputs at the end."""
        time, size = struct.unpack_from("=2d", payload)
        inputs, slopes = self._vector(payload[16:]).reshape(2, -1)
        self.participant.set_inputs(inputs)
        if slopes.any():
            self.participant.set_input_derivatives(slopes, self.numpy.zeros_like(slopes))
        self.participant.step(time, size)
        return self.numpy.asarray(self.participant.outputs(), float).tobytes()

    def outputs(self, payload: bytes) -> bytes:
        """Inputs; the answer is the outputs that they give at once."""
        self.participant.set_inputs(self._vector(payload))
        return self.numpy.asarray(self.participant.outputs(), float).tobytes()

    def save(self, _: bytes) -> bytes:
        """The state's bytes."""
        return self.state.dumps(self.participant.save())

    def restore(self, payload: bytes) -> bytes:
        """Start time, parameters, state's bytes; a participant that was built otherwise is built anew first."""
        split = 8 * (1 + self.n_parameters)
        state = self.state.loads(payload[split:])
        if self.built != payload[:split]:
            self._build(payload[:split])
        self.built = None  # a restore that fails half-way leaves what must be built anew
        self.participant.restore(state)
        self.built = payload[:split]
        return self.numpy.asarray(self.participant.outputs(), float).tobytes()

    def _build(self, numbers: bytes) -> None:
        time, *values = struct.unpack(f"={1 + self.n_parameters}d", numbers)
        self.built = None
        self.participant.initialize(time, dict(zip(self.names, values, strict=True)))
        self.built = numbers

    def _vector(self, payload: bytes) -> Any:
        return self.numpy.frombuffer(payload).copy()


def _received(link: socket.socket, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        part = link.recv(size - len(data))
        if not part:
            sys.exit(0)  # the importer has freed the instance, or is gone
        data += part
    return bytes(data)


def _guarded() -> socket.socket:
    """The importer's socket, in a process that ends with the importer; a model's standard input is empty."""
    sys.path.pop(0)  # this folder: nothing in it is for the model
    source = Path(__file__).with_name("warden.py")
    warden: dict[str, Any] = {"__name__": "snarelab_warden"}
    exec(compile(source.read_text(encoding="utf-8"), str(source), "exec"), warden)
    link = socket.socket(fileno=os.dup(0))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    warden["guard"](link.fileno(), int(sys.argv[1]))
    return link


def main() -> None:
    """Answer until the importer closes the socket."""
    link = _guarded()
    host: Host | None = None
    while True:
        code, size = _HEAD.unpack(_received(link, _HEAD.size))
        payload = _received(link, size)
        try:
            if code == HELLO:
                config = json.loads((Path(__file__).parent / "host.json").read_text(encoding="utf-8"))
                if config["token"] != payload.decode():
                    raise RuntimeError(f"host.json has the token {config['token']} and the binary {payload.decode()}")
                host, status, answer = Host(config), OK, b""
            else:
                assert host is not None
                calls = {INITIALIZE: host.initialize, STEP: host.step, OUTPUTS: host.outputs}
                status, answer = OK, (calls | {SAVE: host.save, RESTORE: host.restore})[code](payload)
        except BaseException as problem:  # whatever it is, the importer must hear of it
            discarded = host is not None and isinstance(problem, host.step_error)
            words = " ".join(f"{type(problem).__name__}: {problem}".split())
            status, answer = DISCARD if discarded else ERROR, f"{words} (Python {sys.executable})".encode()
        link.sendall(_HEAD.pack(status, len(answer)) + answer)


if __name__ == "__main__":
    main()
