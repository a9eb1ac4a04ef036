"""Variables as an FMU describes them: base units, arrays, and a bound on their number."""

import time
from types import SimpleNamespace

import pytest

from snarelab.cosim.fmi_variables import pint_unit, read_interface
from snarelab.cosim.units import conversion
from snarelab.errors import InputError


def base(factor=1.0, offset=0.0, **powers):
    names = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    return SimpleNamespace(factor=factor, offset=offset, **{name: powers.get(name, 0) for name in names})


@pytest.mark.parametrize(
    ("name", "base_unit", "target", "factor"),
    [
        ("N.m", base(kg=1, m=2, s=-2), "N*m", 1.0),
        ("m/s2", base(m=1, s=-2), "m/s^2", 1.0),
        ("kg.m2", None, "kg*m^2", 1.0),
        ("deg", base(rad=1, factor=0.017453292519943295), "rad", 0.017453292519943295),
        ("U/min", base(rad=1, s=-1, factor=0.10471975511965977), "rad/s", 0.10471975511965977),
        ("C", base(K=1), "K", 1.0),  # not coulomb: the base unit says so
        ("degC", base(K=1, offset=273.15), "degC", 1.0),
        ("", None, "N", 1.0),
    ],
)
def test_units_follow_the_base_unit(name, base_unit, target, factor):
    assert conversion(pint_unit(name, base_unit), target) == pytest.approx((factor, 0.0), rel=1e-9, abs=1e-12)


def test_arrays_are_scalars_with_indices_and_text_inputs_are_left_alone():
    def variable(name, kind, causality, dimensions=(), reference=0, start=None):
        return SimpleNamespace(
            name=name, valueReference=reference, type=kind, causality=causality, start=start, unit=None,
            declaredType=None, description=None, min=None, max=None, variability="continuous",
            dimensions=[SimpleNamespace(start=n, valueReference=None) for n in dimensions],
        )  # fmt: skip

    flow = variable("flow", "Float64", "input", ("2", "2"), 1, "1 2 3 4")
    sums = variable("sum", "Float64", "output", (), 2)
    description = SimpleNamespace(
        unitDefinitions=[],
        modelVariables=[flow, sums],
        outputs=[SimpleNamespace(variable=sums, dependencies=[flow])],
    )
    found = read_interface(description, "x.fmu")
    assert [v.name for v in found.variables] == ["flow[1,1]", "flow[1,2]", "flow[2,1]", "flow[2,2]", "sum"]
    assert [v.start for v in found.variables[:4]] == [1, 2, 3, 4]
    assert found.variables[4].depends == ("flow[1,1]", "flow[1,2]", "flow[2,1]", "flow[2,2]")
    assert not found.unread
    description.modelVariables.append(variable("mode", "String", "input", (), 3))
    found = read_interface(description, "x.fmu")
    assert found.unread == {"mode": "String"}
    assert "mode" not in {v.name for v in found.variables}


def described(variables, outputs=()):
    """A description of FMI 3.0, as FMPy reads it."""
    return SimpleNamespace(unitDefinitions=[], modelVariables=list(variables), outputs=list(outputs))


def array(name, reference, *lengths, causality="output"):
    return SimpleNamespace(
        name=name, valueReference=reference, type="Float64", causality=causality, start=None, unit=None,
        declaredType=None, description=None, min=None, max=None, variability="continuous",
        dimensions=[SimpleNamespace(start=n, valueReference=None) for n in lengths],
    )  # fmt: skip


def test_arrays_have_a_bound_together_that_is_met_before_anything_is_made():
    """2000 of 100 000 elements took a minute and 1.3 GB; each for itself could be read."""
    began = time.process_time()
    with pytest.raises(InputError, match=r"x\.fmu: arrays down to 'a1' have 200000 elements together; 100000 can be"):
        read_interface(described(array(f"a{k}", k, 100_000) for k in range(2000)), "x.fmu")
    inputs = [array("u", 0, 50_000, causality="input")]
    sums = [array(f"y{k}", k + 1) for k in range(200)]
    unknown = [SimpleNamespace(variable=y, dependencies=inputs) for y in sums]
    with pytest.raises(InputError, match="outputs depend on inputs 5050000 times; 5000000 can be read"):
        read_interface(described([*inputs, *sums], unknown), "x.fmu")
    assert len(read_interface(described([array("y", 0, 100_000)]), "x.fmu").variables) == 100_000
    assert time.process_time() - began < 10.0
