"""Well-formed files with absurd content: every value of every key, every type of column, text in any place."""

import json
import re
import warnings
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from fuzz.readers import CORPUS, attempt, one_line
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from snarelab.errors import InputError
from snarelab.recordings import Signal, read_recording
from snarelab.recordings.units import parse_unit

quick = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)

words = st.text(st.characters(codec="utf-8", exclude_characters='"\\', min_codepoint=32), max_size=12)
names = st.sampled_from(["name", "at", "hold", "column", "gain", "body", "point", "weight", "source", "factor", "low"])
numbers = st.one_of(
    st.integers(), st.floats(), st.sampled_from([0, -1, 2**63 - 1, 2**63, 10**400, 1e308, 5e-324, float("nan")])
)
plain = st.one_of(numbers, st.booleans(), words, st.sampled_from(["joint1", "a", "viscous_friction", "arm.urdf", "m"]))
values = st.recursive(
    plain, lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(names, inner, max_size=4)), max_leaves=8
)
NAMES = [
    *("time", "q.joint1", "qd.joint1", "tau.joint1", "q.j [deg]", "q.j [m]", "temp.j [K]", "pos.b.x", "quat.b.w"),
    *("x", "time [ms]", "q.", "q..", "q/joint1", "q.j [9**9**9**9]", "q.j [m", "angle.ring", "t[0]", ""),
]


def toml(value):
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(k)} = {toml(v)}" for k, v in value.items()) + "}"
    return repr(value)


def outcome(reader, text, tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return attempt(reader, text.encode(errors="surrogatepass"), tmp_path_factory.mktemp(reader))


@pytest.mark.parametrize(
    "file", ["model/plain", "model/rig", "model/floating", "model/snare", "study/ground", "system/plain"]
)
@quick
@given(st.data(), values)
def test_any_value_at_any_key(file, tmp_path_factory, data, value):
    lines = (CORPUS / file).read_text().splitlines()
    where = data.draw(st.sampled_from([k for k, line in enumerate(lines) if "=" in line]))
    lines[where] = lines[where].partition("=")[0] + "= " + toml(value)
    outcome(file.partition("/")[0], "\n".join(lines), tmp_path_factory)


@pytest.mark.parametrize("file", ["model/plain", "study/ground", "system/plain"])
@quick
@given(st.dictionaries(st.one_of(names, words), values, max_size=4))
def test_any_table(file, tmp_path_factory, table):
    first = "".join(f"{toml(k)} = {toml(v)}\n" for k, v in table.items())
    outcome(file.partition("/")[0], first + (CORPUS / file).read_text(), tmp_path_factory)


@quick
@given(values)
def test_any_json(tmp_path_factory, value):
    assert outcome("results_identity", json.dumps(value), tmp_path_factory)


@pytest.mark.parametrize(
    "file", ["urdf/two_joints", "ssp_description/nested", "fmu_description/fmi2", "fmu_description/fmi3"]
)
@quick
@given(
    st.data(), st.one_of(plain.map(str), st.sampled_from(["", "1 2", "1 2 nan", "0 0 0", "1e308 1e308 1e308", "fixed"]))
)
def test_any_attribute(file, tmp_path_factory, data, value):
    root = ElementTree.fromstring((CORPUS / file).read_bytes())
    element = data.draw(st.sampled_from([e for e in root.iter() if e.attrib]))
    key = data.draw(st.sampled_from(sorted(element.attrib)))
    if data.draw(st.booleans()):
        element.set(key, re.sub(r"[\x00-\x1f\ufffe\uffff]", "", value))
    elif data.draw(st.booleans()):
        del element.attrib[key]
    else:
        element.append(ElementTree.Element(element.tag))
    outcome(file.partition("/")[0], ElementTree.tostring(root, encoding="unicode"), tmp_path_factory)


def accepted(path):
    """What was read is finite or missing, float64, over a time that increases; or the refusal is one line."""
    signals = {"time": Signal("t[0]", "ms"), "tau.joint1": Signal("x", gain="q.j [m")}
    for mapped in (None, signals):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                found = read_recording(path, mapped)
        except InputError as error:
            one_line(error)
            continue
        assert np.all(np.diff(found["time"].to_numpy()) > 0)
        for values in found.data_vars.values():
            assert values.dtype == np.float64
            assert not np.isinf(values).any()


arrays = hnp.arrays(
    st.one_of(hnp.scalar_dtypes(), hnp.byte_string_dtypes(max_len=4)),
    hnp.array_shapes(min_dims=0, max_dims=3, max_side=4),
)


@settings(quick, max_examples=8)  # each read starts a process
@given(st.dictionaries(st.sampled_from([n for n in NAMES if n]), arrays, max_size=5))
def test_any_hdf5_dataset(tmp_path_factory, table):
    path = tmp_path_factory.mktemp("h5") / "run.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(4.0)
        for name, values in table.items():
            try:
                file[name] = values
            except (TypeError, ValueError, OSError):  # what HDF5 cannot hold, and names that are there
                continue
    accepted(path)


@quick
@given(st.dictionaries(st.from_regex(r"[a-z][a-z_]{0,5}", fullmatch=True), arrays, max_size=5), st.booleans())
def test_any_matlab_variable(tmp_path_factory, table, compressed):
    path = tmp_path_factory.mktemp("mat") / "run.mat"
    kept = {name: values for name, values in table.items() if values.dtype.kind in "biufcS"}
    scipy.io.savemat(path, {"time": np.arange(4.0), "q": kept or 1.0}, do_compression=compressed)
    accepted(path)


columns = st.one_of(
    st.lists(st.floats(), min_size=4, max_size=4).map(pa.array),
    st.lists(st.one_of(st.none(), st.integers(-(2**63), 2**63 - 1)), min_size=4, max_size=4).map(
        lambda x: pa.array(x, pa.int64())
    ),
    st.lists(st.integers(-(2**63), 2**63 - 1), min_size=4, max_size=4).map(lambda x: pa.array(x, pa.timestamp("us"))),
    st.lists(st.lists(st.integers(0, 9)), min_size=4, max_size=4).map(lambda x: pa.array(x, pa.list_(pa.int64()))),
    st.lists(words, min_size=4, max_size=4).map(pa.array),
    st.just(pa.array([{"a": 1}] * 4)),
    st.just(pa.array([None] * 4)),
)


@quick
@given(st.lists(st.tuples(st.sampled_from(NAMES), columns), max_size=5))
def test_any_parquet_column(tmp_path_factory, table):
    path = tmp_path_factory.mktemp("parquet") / "run.parquet"
    headers = ["time", *(name for name, _ in table)]
    pq.write_table(pa.Table.from_arrays([pa.array([0.0, 1.0, 2.0, 3.0]), *(c for _, c in table)], headers), path)
    accepted(path)


cells = st.one_of(numbers.map(str), words, st.sampled_from(["", "NaN", "1_0", '"', '"1"', "#REF!", "1,5", "\t", "\r"]))


@quick
@given(
    st.lists(st.sampled_from(NAMES), min_size=1, max_size=4),
    st.lists(st.lists(cells, max_size=5), max_size=6),
    st.data(),
)
def test_any_csv(tmp_path_factory, header, rows, data):
    separator, end = data.draw(st.sampled_from(",;\t")), data.draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = end.join(separator.join(line) for line in [header, *rows])
    path = tmp_path_factory.mktemp("csv") / "run.csv"
    path.write_bytes(text.encode(data.draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])), "replace"))
    accepted(path)


@quick
@given(st.text(st.sampled_from("mskgNrad123456789*^/() .-e°²⁹%"), max_size=30))
def test_any_unit(text):
    try:
        parse_unit(text, "column", Path("run.csv"))
    except InputError as error:
        one_line(error)


@pytest.mark.parametrize(
    "text", ["9**9**9**9", "m**(9**9**9)", "9⁹⁹⁹⁹⁹⁹⁹⁹⁹", "9 ** 99 ** 99", "(9*m)**99", "2**99", "m**999999", "9^99"]
)
def test_units_that_would_never_be_worked_out(text):
    with pytest.raises(InputError, match="unknown to pint"):
        parse_unit(text, "column", Path("run.csv"))


@pytest.mark.parametrize("text", ["m/s^2", "kg*m**2", "1/s", "N·m", "°C", "m²", "%", "rad", "(kg*m)/s**2", "m**0.5"])
def test_units_that_are_in_use(text):
    parse_unit(text, "column", Path("run.csv"))
