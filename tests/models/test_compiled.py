"""Functions over many samples: shapes, the library cache, and what happens without a compiler."""

import threading
import warnings

import casadi as ca
import numpy as np
import pytest

from snarelab.errors import InputError
from snarelab.models import c_library, compiled
from snarelab.models.compiled import CompilerNotice, SampleFunction


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "snarelab"


def doubled() -> SampleFunction:
    x, shift = ca.SX.sym("x", 2), ca.SX.sym("shift")
    return SampleFunction(
        ca.Function("sin", [x, shift], [2 * x + shift, x @ ca.DM([[1, 2, 3]])], ["x", "shift"], ["a", "b"])
    )


def filtered() -> SampleFunction:
    """x' = [x1 + u, sin(x0) / 2 + gain]: the state a sample later."""
    x, u, gain = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("gain")
    after = ca.vertcat(x[1] + u, ca.sin(x[0]) / 2 + gain)
    return SampleFunction(ca.Function("filtered", [x, u, gain], [after], ["x", "u", "gain"], ["after"]))


def check_filtered():
    inputs = np.random.default_rng(2).normal(size=(40, 1))
    expected = [[0.3, -0.2]]
    for (u,) in inputs:
        x = expected[-1]
        expected.append([x[1] + u, np.sin(x[0]) / 2 + 0.1])
    states = filtered().scan(np.array([0.3, -0.2]), inputs, np.array([0.1]))
    np.testing.assert_allclose(states, expected, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(filtered().scan(np.array([1.0, 2.0]), inputs[:0], np.array([0.1])), [[1.0, 2.0]])


def check_doubled():
    x = np.arange(10.0).reshape(5, 2)[:, ::-1]  # not contiguous
    shifted, outer = doubled()(x, np.array([0.5]))
    np.testing.assert_array_equal(shifted, 2 * x[:, :, None] + 0.5)
    np.testing.assert_array_equal(outer, x[:, :, None] * [1.0, 2.0, 3.0])
    assert doubled()(np.empty((0, 2)), np.array([0.5]))[1].shape == (0, 2, 3)


@pytest.mark.parametrize("fault", ["absent", "no words", "cannot say its version", "cannot compile", "no cache"])
def test_without_a_working_compiler_there_is_a_notice_and_the_same_answer(tmp_path, monkeypatch, fault):
    name = {"absent": "no-such-compiler", "no words": "'cc", "cannot say its version": "false"}.get(fault, "")
    if fault == "cannot compile":
        script = tmp_path / "broken-cc"
        script.write_text('#!/bin/sh\n[ "$1" = --version ] && exit 0\necho "no licence" >&2\nexit 1\n')
        script.chmod(0o700)
        name = str(script)
    if fault == "no cache":
        (tmp_path / "cache").write_text("a file where the folder should be")
    monkeypatch.setenv("SNARELAB_CC", name)
    compiled._notify.cache_clear()
    with pytest.warns(CompilerNotice, match={"cannot compile": "no licence"}.get(fault, "")) as caught:
        check_doubled()
    assert len(caught) == 1


def test_scan_in_the_virtual_machine(monkeypatch):
    monkeypatch.setenv("SNARELAB_CC", "none")
    compiled._notify.cache_clear()
    with pytest.warns(CompilerNotice):
        check_filtered()


def test_scan_hands_each_state_to_the_next_sample():
    check_filtered()
    with pytest.raises(InputError, match=r"filtered: input 'x' has shape \(3,\)"):
        filtered().scan(np.zeros(3), np.zeros((5, 1)), np.zeros(1))
    with pytest.raises(ValueError, match="not its first input a sample later"):
        doubled().scan(np.zeros(2), np.zeros((5, 1)))


@pytest.mark.usefixtures("compiler")
def test_a_damaged_library_is_rebuilt(own_cache):
    check_doubled()
    (library,) = own_cache.iterdir()
    whole = library.read_bytes()
    for damage in (b"", b"no library", whole[: len(whole) // 2], whole[:2000] + b"\0" * 8 + whole[2008:]):
        library.unlink()  # never in place: it is loaded
        library.write_bytes(damage)
        check_doubled()
        assert c_library._intact(library)
    before = library.stat().st_mtime_ns
    check_doubled()
    assert library.stat().st_mtime_ns == before  # found, not built again


@pytest.mark.usefixtures("compiler")
def test_threads_that_build_the_same_library_do_not_clash(own_cache):
    faults: list[Exception] = []

    def build():
        try:
            check_doubled()
        except Exception as fault:  # a thread's fault must reach the test, whatever it is
            faults.append(fault)

    threads = [threading.Thread(target=build) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not faults
    assert len(list(own_cache.iterdir())) == 1


def test_sample_functions_check_their_inputs():
    function = doubled()
    for inputs, said in [
        ((np.zeros((5, 2)),), "1 inputs given, 2 wanted"),
        ((np.zeros((5, 3)), np.zeros(1)), r"input 'x' has shape \(5, 3\)"),
        ((np.zeros((5, 2)), np.zeros((4, 1))), r"\[4, 5\] samples"),
        ((np.zeros(2), np.zeros(1)), r"\[\] samples"),
    ]:
        with pytest.raises(InputError, match=said):
            function(*inputs)


LANES = 128


def bumps() -> SampleFunction:
    """A matrix and a number of a sample and of numbers that all samples share; tanh is the code's own in lanes."""
    x, shared = ca.SX.sym("x", 2), ca.SX.sym("shared", 2)
    slope = ca.tanh(x / shared[0])
    outputs = [slope @ ca.DM([[1, 2, 3]]), shared[1] * x[0]]
    return SampleFunction(ca.Function("bumps", [x, shared], outputs), lanes=True)


@pytest.mark.parametrize("n_samples", [0, 1, LANES - 1, LANES, LANES + 1, 5 * LANES + 7])
@pytest.mark.parametrize("compiler", ["", "none"])
def test_side_by_side_is_one_by_one(monkeypatch, compiler, n_samples):
    monkeypatch.setenv("SNARELAB_CC", compiler)
    x, shared = np.random.default_rng(1).normal(size=(n_samples, 2)), np.array([0.3, 2.0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CompilerNotice)
        matrix, number = bumps()(x, shared)
    assert matrix.shape == (n_samples, 2, 3)
    assert number.shape == (n_samples, 1, 1)
    np.testing.assert_allclose(matrix, np.tanh(x / 0.3)[:, :, None] * [1.0, 2.0, 3.0], rtol=1e-15, atol=0)
    np.testing.assert_array_equal(number[:, 0, 0], 2 * x[:, 0])
    shared_by_sample = np.stack([np.full(n_samples, 0.3), np.arange(float(n_samples))], 1)
    np.testing.assert_array_equal(bumps()(x, shared_by_sample)[1][:, 0, 0], np.arange(n_samples) * x[:, 0])


def test_tanh_of_its_own_is_the_c_librarys_to_rounding():
    """Within 3 units in the last place from where tanh(x) = x to where it is 1, odd, and NaN where x is."""
    size = np.concatenate([np.geomspace(1e-300, 800, 20_001), [0.0, 5e-324, 20.0, np.inf]])
    x = ca.SX.sym("x")
    function = SampleFunction(ca.Function("curve", [x], [ca.tanh(x)]), lanes=True)
    found = function(np.concatenate([size, -size])[:, None])[0][:, 0, 0]
    wanted = np.tanh(size.astype(np.longdouble))
    error = np.abs(found[: len(size)] - wanted) / np.spacing(np.maximum(wanted.astype(float), 5e-324))
    assert np.max(error) <= 3
    np.testing.assert_array_equal(found[len(size) :], -found[: len(size)])
    assert np.isnan(function(np.full((5, 1), np.nan))[0]).all()


def test_a_function_side_by_side_has_no_order_to_scan_in():
    x = ca.SX.sym("x")
    with pytest.raises(ValueError, match="side by side"):
        SampleFunction(ca.Function("f", [x], [2 * x]), lanes=True).scan(np.zeros(1))
