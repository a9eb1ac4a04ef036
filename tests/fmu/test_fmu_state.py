"""States as bytes: the same values back, data only, and no code run by whatever else they hold."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from bench.fmu_models import Slave
from snarelab.fmu.hosted import write_hosted
from snarelab.fmu.state import StateError, dumps, loads

RAN = []


@dataclass(frozen=True)
class Inner:
    a: np.ndarray
    b: tuple


class Bomb:
    def __reduce__(self):
        return RAN.append, (1,)


@pytest.mark.parametrize(
    "state",
    [
        None, True, False, 0, -(10**30), 1.5, -0.0, float("inf"), "text é", b"\x00\xff", (), [1, (2.0, None)],
        {"a": [True], 3: {}}, np.float64(2.5), np.int64(-3), np.bool_(True),
    ],
)  # fmt: skip
def test_values_come_back_as_they_were(state):
    found = loads(dumps(state))
    assert type(found) is type(state)
    assert repr(found) == repr(state)


@pytest.mark.parametrize("dtype", ["f8", ">f8", "f4", "i8", "u2", "?", "c16"])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3)])
def test_arrays_come_back_bit_for_bit_and_can_be_written(dtype, shape):
    state = np.random.default_rng(1).normal(size=shape) * 5
    found = loads(dumps(np.asarray(state).astype(dtype)))
    assert found.dtype == np.dtype(dtype).newbyteorder("=")
    np.testing.assert_array_equal(found, np.asarray(state).astype(dtype))
    assert found.flags.writeable


def test_dataclasses_of_the_program_come_back():
    found = loads(dumps(Inner(np.arange(3.0), (1, "x"))))
    assert type(found) is Inner
    np.testing.assert_array_equal(found.a, [0, 1, 2])
    assert found.b == (1, "x")


@pytest.mark.parametrize("state", [Bomb(), {1, 2}, lambda: 1, np.array([Bomb()]), [open], Bomb])
def test_what_is_no_data_is_no_state(state):
    with pytest.raises(StateError, match="a state holds"):
        dumps(state)


def test_no_bytes_run_code():
    """Pickles, damaged states, and classes that are loaded but hold no data."""
    whole = dumps({"a": np.arange(4.0), "b": Inner(np.ones(2), ()), "c": (1, "x", 2.0)})
    rng = np.random.default_rng(2)
    for _ in range(2000):
        damaged = bytearray(whole)
        damaged[int(rng.integers(17, len(whole)))] = int(rng.integers(256))
        data = bytes(damaged[: int(rng.integers(17, len(whole) + 1))]) if rng.random() < 0.5 else bytes(damaged)
        try:
            loads(data)
        except StateError:
            continue
    mark = whole[: whole.index(b"\n") + 1]
    name = f"{Bomb.__module__}:Bomb".encode()
    for data in (
        pickle.dumps(Bomb()),
        mark + pickle.dumps(Bomb()),
        mark + b"D" + len(name).to_bytes(8, "little") + name,
    ):
        with pytest.raises(StateError):
            loads(data)
    for claimed in (b"(", b"[", b"{", b"s", b"b"):
        with pytest.raises(StateError, match="ends too early"):
            loads(mark + claimed + b"\xff" * 7 + b"\x0f")
    with pytest.raises(StateError):
        loads(mark + 1000 * (b"[" + (1).to_bytes(8, "little")) + b"N")
    assert not RAN


def test_a_state_file_of_a_hosted_fmu_runs_no_code(tmp_path):
    """A pickle in place of the state, under the FMU's own header: refused, and the instance goes on."""
    write_hosted("left_oscillator", tmp_path / "x.fmu", 2)
    logged, ran = [], tmp_path / "ran"
    slave = Slave(tmp_path / "x.fmu", tmp_path / "x", {"force": 1.0}, logged=logged)
    slave.step(0.1)
    good = bytes(slave.fmu.serializeFMUstate(slave.fmu.getFMUstate()))
    payload = good[good.index(b"snarelab state") :]

    class Touch:
        def __reduce__(self):
            return open, (str(ran), "w")

    evil = pickle.dumps(Touch())
    head = bytearray(good[: -len(payload)])
    where = head.index(len(payload).to_bytes(8, "little"))
    head[where : where + 8] = len(evil).to_bytes(8, "little")
    state = slave.fmu.deSerializeFMUstate(bytes(head) + evil)
    with pytest.raises(Exception, match=r"status 3|error"):
        slave.fmu.setFMUstate(state)
    assert any("no state of a participant" in line for line in logged)
    assert not ran.exists()
    slave.fmu.setFMUstate(slave.fmu.deSerializeFMUstate(good))
    slave.step(0.1)
    slave.close()
