"""A participant in its own process: it runs beside the others, and if it hangs or dies, only the run ends.

One message a step goes each way. What needs no answer (saving, restoring, forgetting a state) travels with the next
step, and saved states stay in the process, so that a repeated step costs no further messages. A warden stands between
(`snarelab.warden`): whatever a participant has started or written to temporary files goes with it.
"""

import contextlib
import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import weakref
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ..errors import InputError
from ..scratch import scratch_root
from .participant import Participant, StepError

_CHILD = (
    "import sys; from snarelab.warden import guard; link, parent = map(int, sys.argv[1:]); guard(link, parent); "
    "import snarelab.cosim.process as p; p._serve(link)"
)
_FAREWELL = 1.0  # s that a process gets to end by itself
_BURIAL = 10.0  # s for its warden to end what it has left
_START = 60.0  # s for loading engines, where the time-out for steps is shorter
_LARGEST = 256 << 20  # bytes of an answer; what claims more is none


class OwnProcess(Participant):
    """Runs ``make(*arguments, **keywords)`` in a process of its own.

    Parameters
    ----------
    make : callable
        Gives the participant; a class or function that can be imported by name, such as ``Fmu``.
    *arguments, **keywords
        For ``make``; they are pickled.
    timeout : float
        Longest wait for a step [s], after which the process is ended. Where the participant asks for more to initialise
        (`Participant.start_limit`), it has that; for its construction it has at least 60 s.

    Raises
    ------
    InputError
        From ``make``, or where its process does not come up.
    """

    def __init__(
        self, make: Callable[..., Participant], *arguments: Any, timeout: float = 60.0, **keywords: Any
    ) -> None:
        """Start the process and build the participant there."""
        self.made = (make, arguments, keywords)
        self.name, self._timeout = getattr(make, "__name__", "participant"), max(timeout, _START)
        self._step_timeout, self._doing = timeout, "at its start"
        if not timeout > 0:
            raise InputError(f"{self.name}: timeout {timeout} s must be positive")
        here, there = socket.socketpair()
        # A process that dies with half an answer sent would else be waited for without end.
        here.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("@ll", *divmod(int(timeout * 1e6), 10**6)))
        paths = os.pathsep.join(path for path in sys.path if path)
        self._process = subprocess.Popen(
            [sys.executable, "-c", _CHILD, str(there.fileno()), str(os.getpid())],
            stdin=subprocess.DEVNULL,
            pass_fds=[there.fileno()],
            env={**os.environ, "TMPDIR": scratch_root(), "PYTHONPATH": paths},
            start_new_session=True,  # Ctrl-C is for the master, which then closes this process
        )
        there.close()
        self._link = Connection(here.detach())
        self._end = weakref.finalize(self, _end, self._process, self._link)
        self._waiting: list[tuple[str, Any]] = []
        self._tokens = 0
        try:
            facts = self._ask("make", pickle.dumps((make, arguments, keywords)))
        except StepError as error:
            self._end()
            raise InputError(str(error)) from None
        self.name, self.variables, self.can_restore, self.input_order, self.can_halve, self.can_vary_step = facts[:6]
        start, self.unread = facts[6:]
        self._timeout = max(timeout, start)
        self._shown = np.zeros(len(self.names("output")))
        self._inputs: tuple[np.ndarray, ...] | None = None

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Initialise it there."""
        self._shown, self._inputs = self._ask("initialize", (time, dict(parameters or {}))), None
        self._timeout = self._step_timeout

    def set_inputs(self, values: np.ndarray) -> None:
        """Keep the inputs for the next message."""
        self._inputs = (values.copy(),)

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Keep the slopes for the next message."""
        assert self._inputs is not None
        self._inputs = (self._inputs[0], first.copy(), second.copy())

    def set_input_halves(self, first: np.ndarray, second: np.ndarray) -> None:
        """Keep both for the next message."""
        self._inputs = (first.copy(), second.copy())

    def begin(self, time: float, size: float) -> None:
        """Start the step there."""
        self._doing = f"in the step from {time:.9g} s"
        self._send("step", (self._inputs, time, size))

    def finish(self) -> None:
        """Wait for the step."""
        self._shown, self._inputs = self._receive(), None

    def step(self, time: float, size: float) -> None:
        """Step and wait."""
        self.begin(time, size)
        self.finish()

    def outputs(self) -> np.ndarray:
        """The outputs that came with the step, or that follow inputs set since then."""
        if self._inputs is not None:
            self._shown, self._inputs = self._ask("outputs", self._inputs), None
        return self._shown.copy()

    def save(self) -> "_Token":
        """A token for a state that stays in the process."""
        self._tokens += 1
        self._waiting.append(("save", self._tokens))
        return _Token(self._tokens, self._waiting, self._shown, self._inputs)

    def restore(self, state: "_Token") -> None:
        """Return to a state of this process; takes place before the next step."""
        if state.waiting is not self._waiting:
            raise StepError(f"{self.name}: the state belongs to another process; restore one that was saved here")
        self._waiting.append(("restore", state.number))
        self._shown, self._inputs = state.shown, state.inputs

    def close(self) -> None:
        """End the process."""
        if self._process.poll() is None and not self._link.closed:
            with contextlib.suppress(OSError):
                self._link.send(([], ("close", None)))
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_FAREWELL)
        self._kill()

    def _kill(self) -> None:
        """End a process that had its time: its warden waits no longer for it."""
        self._process.terminate()
        self._end()

    def _ask(self, what: str, content: Any) -> Any:
        self._send(what, content)
        return self._receive()

    def _send(self, what: str, content: Any) -> None:
        if self._link.closed:
            raise StepError(f"{self.name}: its process has ended; build the participant anew")
        try:
            self._link.send((self._waiting, (what, content)))
        except OSError:
            raise self._lost() from None
        self._waiting.clear()

    def _receive(self) -> Any:
        try:
            if not self._link.poll(self._timeout):
                self._kill()
                raise StepError(
                    f"{self.name}: gave no answer for {self._timeout:g} s {self._doing}; its process was ended"
                )
            answer = self._link.recv_bytes(_LARGEST)
        except (EOFError, OSError):
            raise self._lost() from None
        try:
            kind, content = pickle.loads(answer)
        except Exception:  # the participant has written to where answers go
            self._kill()
            raise StepError(f"{self.name}: its process gave no proper answer {self._doing}, and was ended") from None
        if kind == "done":
            return content
        raise (InputError if kind == "input" else StepError)(content)

    def _lost(self) -> StepError:
        """What became of the process."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_FAREWELL)
        code = self._process.poll()
        self._kill()
        if code is None:
            return StepError(f"{self.name}: its process broke off {self._doing}, and was ended")
        how = f"was killed by {signal.Signals(-code).name}" if code and code < 0 else f"ended with status {code}"
        return StepError(f"{self.name}: its process {how} {self._doing}")


class _Token:
    """A state kept in the process, forgotten there when nothing here refers to it any more."""

    def __init__(
        self, number: int, waiting: list[Any], shown: np.ndarray, inputs: tuple[np.ndarray, ...] | None
    ) -> None:
        """What was shown here at that moment belongs to the state."""
        self.number, self.waiting, self.shown, self.inputs = number, waiting, shown, inputs

    def __del__(self) -> None:
        """Forget it with the next message."""
        self.waiting.append(("forget", self.number))


def _end(process: subprocess.Popen[bytes], link: Connection) -> None:
    """Hang up, upon which the warden ends everything."""
    link.close()
    try:
        process.wait(_BURIAL)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _serve(descriptor: int) -> None:
    """The other side: answers until told to close, or until nobody is there any more."""
    link = Connection(descriptor)
    participant: Any = None
    states: dict[int, Any] = {}
    while True:
        try:
            waiting, (what, content) = link.recv()
        except EOFError:
            return
        except OSError:  # a participant that closes what is not its own has closed this
            os._exit(1)
        answer: tuple[str, Any]
        try:
            for action, number in waiting:
                if action == "save":
                    states[number] = participant.save()
                elif action == "restore":
                    participant.restore(states[number])
                else:
                    states.pop(number, None)
            if what == "make":
                make, arguments, keywords = pickle.loads(content)
                participant = make(*arguments, **keywords)
                p = participant
                able = p.can_restore, p.input_order, p.can_halve, p.can_vary_step
                answer = "done", (p.name, p.variables, *able, p.start_limit, dict(p.unread))
            elif what == "close":
                states.clear()
                participant.close()
                return
            else:
                answer = "done", _act(participant, what, content)
        except (InputError, StepError) as error:
            answer = "input" if isinstance(error, InputError) else "step", str(error)
        except Exception as error:  # whatever it is, the master is told and the run's data is kept
            answer = "step", f"{type(error).__name__}: {error}"
        try:
            link.send(answer)
        except OSError:
            os._exit(1)


def _act(participant: Participant, what: str, content: Any) -> np.ndarray:
    """Initialise, step, or take inputs; the outputs then."""
    if what == "initialize":
        participant.initialize(*content)
        return participant.outputs()
    inputs, *step = content if what == "step" else (content,)
    if inputs is not None and len(inputs) == 2:
        participant.set_input_halves(*inputs)
    elif inputs is not None:
        participant.set_inputs(inputs[0])
        if len(inputs) > 1:
            participant.set_input_derivatives(*inputs[1:])
    if step:
        participant.step(*step)
    return participant.outputs()
