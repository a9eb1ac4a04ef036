"""What a co-simulation leaves behind: energy of its bonds and rows of its record, counted by hand."""

import numpy as np
import pytest

from snarelab.cosim.energy import BondEnergy
from snarelab.cosim.participant import Variable
from snarelab.cosim.participants.formula import Formula
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.record import Event, Record
from snarelab.cosim.system import Connection, PowerBond, System

LINKS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]


@pytest.mark.parametrize(("unit", "watts"), [("N", 1.0), ("kN", 1000.0), ("", 1.0)])
def test_energy_of_a_bond_is_what_the_two_say_of_the_power(unit, watts):
    """The force is 2 to 4 (mean 3), the speed 0.5 to 1.5 (mean 1); held were 5 and 0.25, read with factors -1 and 2."""
    spring = Formula([Variable("v", "input", "m/s"), Variable("f", "output", unit)], lambda u, _: 0.0)
    mass = Formula([Variable("f", "input", unit), Variable("v", "output", "m/s")], lambda u, _: 0.0)
    links = [Connection("spring.f", "mass.f", factor=-1.0), Connection("mass.v", "spring.v", factor=2.0)]
    bonds = [PowerBond("one", "spring.f", "mass.v"), PowerBond("back", "mass.v", "spring.f")]
    system = System({"spring": spring, "mass": mass}, links, bonds=bonds)
    energy = BondEnergy(system)
    assert energy.names == ("one", "back")
    held = np.array([{"mass.f": -5.0, "spring.v": 0.5}[name] for name in system.layout.inputs])
    before, after = (
        np.array([{"spring.f": f, "mass.v": v}[name] for name in system.layout.outputs])
        for f, v in ((2, 0.5), (4, 1.5))
    )
    for _ in range(2):
        energy.add(before, after, held, 0.1)
    made = 2 * 0.1 * watts * (5.0 * 1.0 - 3.0 * 0.25)
    np.testing.assert_allclose(energy.residual, [made, -made], rtol=1e-12)
    np.testing.assert_allclose(energy.exchanged, 2 * 0.1 * watts * 3.0, rtol=1e-12)


def test_what_crosses_is_counted_either_way():
    """A speed against the force: power of -3 W, then 3 W; 0.6 J in all, and no difference as both are held right."""
    system = System(
        {"left": LeftOscillator(), "right": RightOscillator()}, LINKS, bonds=[PowerBond("b", "right.force", "left.v")]
    )
    energy = BondEnergy(system)
    for v in (-1.0, 1.0):
        values = np.array([{"right.force": 3.0, "left.v": v}.get(name, 9.0) for name in system.layout.outputs])
        held = np.array([{"left.force": 3.0, "right.v_left": v}.get(name, 9.0) for name in system.layout.inputs])
        energy.add(values, values, held, 0.1)
    assert energy.exchanged == pytest.approx([0.6])
    assert energy.residual == pytest.approx([0.0])


# The record


def arms(*units, bonds=()):
    """One participant for each unit, all with an output ``q.joint1``."""
    made = {f"arm{i}": Formula([Variable("q.joint1", "output", u)], lambda *_: 0.0) for i, u in enumerate(units)}
    return System(made, [], bonds=bonds)


@pytest.mark.parametrize(
    ("units", "columns"),
    [
        (["rad"], {"q.joint1": 1.0}),
        (["deg"], {"q.joint1": np.pi / 180}),
        (["mm"], {"q.joint1": 1e-3}),  # a slide's
        (["N"], {"arm0.q.joint1 [N]": 1.0}),
        (["m", "mm"], {"arm0.q.joint1 [m]": 1.0, "arm1.q.joint1 [mm]": 1.0}),
    ],
)
def test_a_column_is_a_signal_in_its_own_unit_or_told_with_participant_and_unit(units, columns):
    record = Record(arms(*units))
    record.add(0.0, np.full(len(units), 2.0), np.zeros(0))
    found = record.dataset()
    assert {str(k): float(v[0]) for k, v in found.data_vars.items()} == pytest.approx(
        {name: 2.0 * factor for name, factor in columns.items()}
    )


@pytest.mark.parametrize(("unit", "shown"), [("1", "it.y"), ("", "it.y"), ("N*m", "it.y [N*m]")])
def test_other_columns_are_told_with_their_unit_where_they_have_one(unit, shown):
    record = Record(System({"it": Formula([Variable("y", "output", unit)], lambda *_: 0.0)}, []))
    assert list(record.dataset().data_vars) == [shown]


def test_a_record_grows_and_keeps_every_row_in_order():
    system = System(
        {"left": LeftOscillator(), "right": RightOscillator()}, LINKS, bonds=[PowerBond("b", "right.force", "left.v")]
    )
    record = Record(system)
    for k in range(1030):
        record.add(0.5 * k, 10.0 * k + np.arange(5), np.array([-1.0 * k]))
    window = record.window(2, 3)
    assert window.shape == (5, 7)
    np.testing.assert_array_equal(window[:2, 0], [514.0, 514.5])
    assert record.window(0, 4000).shape == (4000, 7)
    found = record.dataset()
    np.testing.assert_array_equal(found["time"], 0.5 * np.arange(1030))
    for i, name in enumerate(system.layout.outputs):
        (column,) = (v for k, v in found.data_vars.items() if str(k).startswith(name))
        np.testing.assert_array_equal(column, 10.0 * np.arange(1030) + i)
    np.testing.assert_array_equal(found["residual.b [J]"], -1.0 * np.arange(1030))


def test_an_event_is_one_line():
    assert str(Event(0.125, 1e-4, "rejected")) == "0.125 s, step 0.0001 s: rejected"
