"""The end effector's control program: its table is read and refused, and its states come and go by the clock."""

import numpy as np
import pytest

from snarelab.cosim.participants.control_program import ControlProgram
from snarelab.cosim.state_table import SENSORS, read_table, table_of
from snarelab.errors import InputError

TABLE = {
    "period": 0.1,
    "start": "PUSH",
    "states": {
        "PUSH": {
            "carriage": 5.0,
            "motor": True,
            "leave": [
                {"when": ["force > 100", "switches < 3"], "to": "BACK", "at_most": 2},
                {"when": ["force > 100", "switches < 3"], "to": "OUT"},
                {"when": ["switches = 3"], "to": "HOLD", "during": 0.3},
            ],
            "timeout": {"after": 5.0, "to": "OUT"},
        },
        "BACK": {"carriage": -10.0, "motor": True, "leave": [{"when": ["moved < -10"], "to": "PUSH"}]},
        "HOLD": {"force": 500.0, "gain": 0.01, "most": 2.0, "motor": True},
        "OUT": {"brake": True, "ring": -8.0},
    },
}


def program():
    return ControlProgram(table_of(TABLE))


def look(p, time, **sensors):
    """One period with these sensors; the outputs by name."""
    names = p.names("input")
    p.set_inputs(np.array([sensors.get(name.replace(".", "_"), 0.0) for name in names]))
    p.step(time, 0.1)
    return dict(zip(p.names("output"), p.outputs(), strict=True))


def test_the_built_in_table_has_the_design_pages_states_and_every_one_ends_somewhere():
    table = read_table()
    assert table.period == 0.01
    assert table.names[0] == table.start == "CLOSE"
    way = ["CLOSE", "SLIDE", "PULL", "SEAT", "PRELOAD", "LATCH", "LATCHED"]
    assert [name for name in table.names if name in way] == way
    assert table.states["SEAT"].leave[1].at_most == 2
    ends = {name for name, state in table.states.items() if not state.leave and not state.timeout}
    assert ends == {"LATCHED", "ABORTED", "STUCK"}
    for state in table.states.values():  # nothing waits for ever
        assert state.name in ends or state.after < np.inf
        assert {c.sensor for way in state.leave for c in way.when} <= set(SENSORS)


def test_two_back_offs_and_then_out():
    p, now, seen = program(), 0.0, []
    travel = 0.0
    for _ in range(40):
        out = look(p, now, force_motor=150.0, travel=travel)
        travel += out["speed"] * 0.3
        now += 0.1
        seen.append(p.state)
    assert [s for k, s in enumerate(seen) if k == 0 or s != seen[k - 1]][:6] == ["BACK", "PUSH", "BACK", "PUSH", "OUT"]
    assert out["brake"] == 1
    assert out["rate.ring"] == pytest.approx(-np.deg2rad(8.0))
    assert out["state"] == 3


def test_a_condition_must_hold_for_its_time_without_a_gap():
    p = program()
    for k, switches in enumerate([3, 3, 2, 3, 3, 3]):
        assert look(p, 0.1 * k, switches=switches)["state"] == 0
    assert look(p, 0.6, switches=3)["state"] == 2
    assert p.events() == ("PUSH -> HOLD: switches = 3",)
    assert look(p, 0.7, force_motor=450.0)["speed"] == pytest.approx(0.5e-3)  # gain times what is missing
    assert look(p, 0.8, force_motor=0.0)["speed"] == pytest.approx(2e-3)  # bounded
    assert p.events() == ()


def test_a_timeout_and_the_next_event():
    p = program()
    assert p.next_event(0.0) == pytest.approx(0.1)
    for k in range(51):
        assert p.next_event(0.1 * k) == pytest.approx(0.1 * (k + 1))
        out = look(p, 0.1 * k)
    assert (p.state, out["motor"]) == ("OUT", 0)


def test_a_saved_program_goes_on_alike():
    p = program()
    look(p, 0.0, switches=3)
    state = p.save()
    first = [look(p, 0.1 * k, switches=3)["state"] for k in range(1, 5)]
    p.restore(state)
    assert [look(p, 0.1 * k, switches=3)["state"] for k in range(1, 5)] == first
    assert first[-1] == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"states": {"A": {"leave": [{"when": ["forse > 1"], "to": "A"}]}}}, "no sensor 'forse'; nearest is 'force'"),
        ({"states": {"A": {"leave": [{"when": ["force > x"], "to": "A"}]}}}, "condition 'force > x'; write a sensor"),
        ({"states": {"A": {"leave": [{"when": ["force > 1"], "to": "B"}]}}}, "no state 'B'; nearest is 'A'"),
        ({"states": {"A": {"timeout": {"after": -1.0, "to": "A"}}}}, "timeout.after is -1.0; give a number from 0 up"),
        ({"states": {"A": {"brake": 1}}}, "brake is 1; give true or false"),
        ({"states": {"A": {"force": 1.0}}}, "force needs gain"),
        ({"states": {"A": {"force": 1.0, "carriage": 1.0}}}, "has both carriage and force"),
        ({"states": {"A": {"rinq": 1.0}}}, "no key 'rinq'; nearest is 'ring'"),
        ({"states": {}}, "there are no states"),
        ({"start": "Z", "states": {"A": {}}}, "start: no state 'Z'"),
    ],
)
def test_a_table_that_cannot_be_is_refused(change, message):
    with pytest.raises(InputError) as error:
        table_of(change)
    assert message in str(error.value)


def test_a_broken_file_is_told_by_its_name(tmp_path):
    path = tmp_path / "program.toml"
    path.write_text("states = [")
    with pytest.raises(InputError, match=r"program\.toml"):
        read_table(path)
