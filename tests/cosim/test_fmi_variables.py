"""Variables of model descriptions made by hand: names, bounds, starts, units, and what outputs depend on."""

import math
from types import SimpleNamespace

import pytest

from snarelab.cosim.fmi_variables import pint_unit, read_interface
from snarelab.cosim.units import conversion
from snarelab.errors import InputError


def variable(name, causality="input", kind="Real", reference=0, **given):
    fields = {"start": None, "unit": None, "declaredType": None, "description": None, "min": None, "max": None,
              "variability": "continuous", "dimensions": []}  # fmt: skip
    return SimpleNamespace(name=name, valueReference=reference, type=kind, causality=causality, **{**fields, **given})


def dimension(start=None, reference=None):
    return SimpleNamespace(start=start, valueReference=reference)


def read(*variables, outputs=(), units=()):
    description = SimpleNamespace(unitDefinitions=units, modelVariables=list(variables), outputs=list(outputs))
    return read_interface(description, "x.fmu")


def test_a_variable_keeps_its_bounds_start_and_description():
    (one,) = read(variable("a", start="1.5", min="-2", max="3", description="an input", unit="N")).variables
    assert (one.name, one.causality, one.unit, one.start) == ("a", "input", "N", 1.5)
    assert (one.minimum, one.maximum, one.description) == (-2.0, 3.0, "an input")
    (bare,) = read(variable("a")).variables
    assert (bare.start, bare.minimum, bare.maximum, bare.description, bare.unit) == (0.0, -math.inf, math.inf, "", "")


@pytest.mark.parametrize(("text", "value"), [("true", 1.0), ("false", 0.0), ("7", 7.0), (None, 0.0), ("", 0.0)])
def test_starts_are_numbers_or_truth_values(text, value):
    assert read(variable("a", kind="Boolean", start=text)).variables[0].start == value


@pytest.mark.parametrize(
    ("kind", "read_as_number"),
    [("Real", True), ("Int32", True), ("UInt8", True), ("Float32", True), ("Enumeration", True), ("String", False),
     ("Int", False), ("Binary", False), ("XInt8", False)],
)  # fmt: skip
def test_numbers_of_any_size_are_read_and_text_is_left_out_and_told_of_an_input(kind, read_as_number):
    assert len(read(variable("a", "parameter", kind)).variables) == read_as_number
    given = read(variable("a", "input", kind))
    assert (len(given.variables), dict(given.unread)) == ((1, {}) if read_as_number else (0, {"a": kind}))
    assert not read(variable("a", "parameter", kind)).unread


def test_only_inputs_outputs_and_parameters_are_shown_each_in_its_slots():
    names = ("input", "local", "output", "parameter", "independent", "calculatedParameter")
    found = read(*(variable(n[:3], n, reference=i) for i, n in enumerate(names)))
    assert [v.name for v in found.variables] == ["inp", "out", "par"]
    assert {k: [(s.reference, s.names) for s in slots] for k, slots in found.slots.items()} == {
        "input": [(0, ("inp",))],
        "output": [(2, ("out",))],
        "parameter": [(3, ("par",))],
    }


@pytest.mark.parametrize(
    ("variability", "continuous"), [(None, True), ("continuous", True), ("discrete", False), ("fixed", False)]
)
def test_what_varies_smoothly_is_continuous(variability, continuous):
    assert read(variable("a", variability=variability)).slots["input"][0].continuous is continuous


def test_an_array_is_named_by_its_indices_from_one_and_has_one_start_or_one_each():
    given = variable("m", dimensions=[dimension("2"), dimension("3")], start="1 2 3 4 5 6")
    alike = variable("k", dimensions=[dimension(reference=9)], start="8")
    size = variable("n", "parameter", "Int32", 9, start="2")
    found = {v.name: v.start for v in read(given, alike, size).variables if v.name != "n"}
    assert found == {
        "m[1,1]": 1.0,
        "m[1,2]": 2.0,
        "m[1,3]": 3.0,
        "m[2,1]": 4.0,
        "m[2,2]": 5.0,
        "m[2,3]": 6.0,
        "k[1]": 8.0,
        "k[2]": 8.0,
    }


@pytest.mark.parametrize(
    ("lengths", "words"),
    [
        (["0"], r"dimensions \[0\]; 1 to 100000 elements"),
        (["2", "-1"], "1 to 100000 elements"),
        (["1000", "101"], "1 to 100000 elements"),
        (["three"], "a dimension that is no whole number"),
        ([None], "a dimension that is no whole number"),
    ],
)
def test_an_array_of_no_elements_or_of_too_many_is_refused(lengths, words):
    with pytest.raises(InputError, match=rf"^x\.fmu: variable 'm' has .*{words}|^x\.fmu: variable 'm' has {words}"):
        read(variable("m", dimensions=[dimension(n) for n in lengths]))
    assert len(read(variable("m", dimensions=[dimension("1000"), dimension("100")])).variables) == 100_000


def test_outputs_depend_on_inputs_alone_on_none_or_on_what_is_not_said():
    a, b = variable("a"), variable("b", dimensions=[dimension("2")])
    p = variable("p", "parameter")
    shown = [variable(n, "output") for n in ("y", "z", "u", "unlisted")]
    told = [SimpleNamespace(variable=v, dependencies=d) for v, d in zip(shown, ([a, p, b], [], None), strict=False)]
    found = {v.name: v.depends for v in read(a, b, p, *shown, outputs=told).variables}
    assert found["y"] == ("a", "b[1]", "b[2]")
    assert found["z"] == ()
    assert found["u"] is None
    assert found["unlisted"] is None
    assert found["a"] == found["p"] == ()


def test_a_start_that_is_no_number_is_told_with_the_file():
    with pytest.raises(InputError, match=r"^x\.fmu: 'much' is no number; correct the model description$"):
        read(variable("a", start="much"))


def base(factor=1.0, offset=0.0, **powers):
    names = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    return SimpleNamespace(factor=factor, offset=offset, **{name: powers.get(name, 0) for name in names})


def test_a_unit_is_the_variables_own_or_its_types_with_the_base_unit_of_that_name():
    own = variable("a", unit="U", declaredType=SimpleNamespace(unit="N"))
    typed = variable("b", declaredType=SimpleNamespace(unit="N"))
    plain = variable("c", declaredType=SimpleNamespace(unit=None))
    units = [SimpleNamespace(name="U", baseUnit=base(m=1, factor=0.001)), SimpleNamespace(name="N", baseUnit=None)]
    a, b, c = read(own, typed, plain, units=units).variables
    assert conversion(a.unit, "m") == pytest.approx((1e-3, 0.0))
    assert (b.unit, c.unit) == ("N", "")


@pytest.mark.parametrize(
    ("name", "meant", "spelled"),
    [
        ("N.m", base(kg=1, m=2, s=-2), "N*m"),
        ("m/s2", None, "m/s**2"),
        ("m.s-2", None, "m*s**-2"),
        ("N·m", None, "N*m"),
        ("N m", None, "N*m"),
        ("mm", base(m=1, factor=1e-3), "mm"),
        ("mm", base(m=1), "m**1"),  # the base unit rules over the name
        ("blob", None, "blob"),
        ("blob", base(), "1"),
        ("K2", base(K=1, offset=20.0), "K2"),  # no unit has this zero: it stays as it is
    ],
)
def test_a_name_is_kept_where_it_means_the_base_unit_and_written_out_where_not(name, meant, spelled):
    found = pint_unit(name, meant)
    if "**1" in spelled:
        assert conversion(found, "m") == pytest.approx((1.0, 0.0))
        assert found != "mm"
    else:
        assert found == spelled
