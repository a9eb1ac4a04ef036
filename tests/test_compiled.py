"""Functions over many samples: shapes, the library cache, and what happens without a compiler."""

import threading

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


def check_doubled():
    x = np.arange(10.0).reshape(5, 2)[:, ::-1]  # not contiguous
    shifted, outer = doubled()(x, np.array([0.5]))
    np.testing.assert_array_equal(shifted, 2 * x[:, :, None] + 0.5)
    np.testing.assert_array_equal(outer, x[:, :, None] * [1.0, 2.0, 3.0])
    assert doubled()(np.empty((0, 2)), np.array([0.5]))[1].shape == (0, 2, 3)


@pytest.mark.parametrize("fault", ["absent", "cannot say its version", "cannot compile", "no cache"])
def test_without_a_working_compiler_there_is_a_notice_and_the_same_answer(tmp_path, monkeypatch, fault):
    name = {"absent": "no-such-compiler", "cannot say its version": "false"}.get(fault, "")
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


def test_a_damaged_library_is_rebuilt(own_cache):
    check_doubled()
    (library,) = own_cache.iterdir()
    whole = library.read_bytes()
    for damage in (b"", b"no library", whole[: len(whole) // 2], whole[:2000] + b"\0" * 8 + whole[2008:]):
        library.unlink()  # never in place: it is loaded
        library.write_bytes(damage)
        check_doubled()
        assert c_library.intact(library)
    before = library.stat().st_mtime_ns
    check_doubled()
    assert library.stat().st_mtime_ns == before  # found, not built again


def test_threads_that_build_the_same_library_do_not_clash(own_cache):
    faults: list[Exception] = []

    def build():
        try:
            check_doubled()
        except Exception as fault:
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
