"""Damaged files of every kind: read, or refused in one line, with nothing written beside them."""

import re
import warnings

import pytest
from fuzz.readers import CORPUS, READERS, attempt
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ODD = [b"", b"\0", b"nan", b"-inf", b"1e999", b"-1", b"9" * 400, b"2147483648", b"18446744073709551616", b"\xff\xfe"]
ODD += [
    b"\xef\xbb\xbf",
    b"../../x",
    b"/etc/passwd",
    b"[" * 2000,
    b"{" * 2000,
    b"<a>" * 2000,
    b"&b;",
    b"a." * 100,
    b"\r",
]


def truncated(data, at, size, odd):
    return data[:at]


def flipped(data, at, size, odd):
    return data[:at] + bytes(255 - b for b in data[at : at + 1 + size % 8]) + data[at + 1 + size % 8 :]


def zeroed(data, at, size, odd):
    return data[:at] + bytes(min(size, len(data) - at)) + data[at + size :]


def ones(data, at, size, odd):
    return data[:at] + b"\xff" * min(size, len(data) - at) + data[at + size :]


def doubled(data, at, size, odd):
    return data[: at + size] + data[at : at + size] + data[at + size :]


def removed(data, at, size, odd):
    return data[:at] + data[at + size :]


def inserted(data, at, size, odd):
    return data[:at] + odd + data[at:]


def renumbered(data, at, size, odd):
    """The next number of a text is another one."""
    return data[:at] + re.sub(rb"-?\d+(\.\d+)?", odd.replace(b"\\", b""), data[at:], count=1)


def reencoded(data, at, size, odd):
    return data.decode("latin-1").encode(("utf-16", "utf-32", "utf-8", "utf-7")[size % 4])


CHANGES = (truncated, flipped, zeroed, ones, doubled, removed, inserted, renumbered, reencoded)


quick = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)


@pytest.mark.parametrize("reader", sorted(set(READERS) - {"hdf5"}))
@quick
@given(st.data())
def test_damage(reader, tmp_path_factory, data):
    damage(reader, tmp_path_factory, data)


@settings(quick, max_examples=6)  # each read starts a process
@given(st.data())
def test_damage_to_hdf5(tmp_path_factory, data):
    damage("hdf5", tmp_path_factory, data)


def damage(reader, tmp_path_factory, data):
    files = sorted((CORPUS / reader).iterdir())
    content = data.draw(st.sampled_from(files)).read_bytes()
    for change in data.draw(st.lists(st.sampled_from(CHANGES), min_size=1, max_size=4)):
        at = data.draw(st.integers(0, max(len(content) - 1, 0)))
        content = change(content, at, data.draw(st.integers(1, 64)), data.draw(st.sampled_from(ODD)))
    above = tmp_path_factory.mktemp("hostile")
    folder = above / "inside"
    folder.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        attempt(reader, content, folder)
    assert list(above.iterdir()) == [folder]
