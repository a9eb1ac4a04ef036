"""Tables as effects: what they give between and beyond their knots, in model files, and what is refused."""

import numpy as np
import pytest
from effect_signals import DT, signals
from inverse_fmu import parted
from scipy.integrate import cumulative_trapezoid

from bench.fmu_models import Slave, write_model
from snarelab.errors import InputError
from snarelab.fmu.export import export
from snarelab.models.empirical import (
    NAME,
    empirical_effect,
    likelihood_of,
    table_values,
    tables_of,
)
from snarelab.models.hidden_state import evaluate_law
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.table import Table, read_words


def even(low, high, n):
    return tuple(np.linspace(low, high, n).tolist())


def test_a_table_meets_its_values_and_a_quadratic_between_them():
    """Cubic convolution reproduces polynomials of second degree (Keys 1981), up to the outermost knots."""
    table = Table(("position",), "", (even(-2, 3, 11),))
    x = np.linspace(-2, 3, 501)
    quadratic = np.polynomial.Polynomial([0.7, -1.3, 0.4])
    np.testing.assert_allclose(table.weights([x]) @ quadratic(np.array(table.knots[0])), quadratic(x), atol=1e-12)
    np.testing.assert_allclose(table.weights([np.array(table.knots[0])]), np.eye(11), atol=1e-12)


def test_beyond_the_knots_the_end_value_is_held():
    table = Table(("position",), "", (even(0, 1, 5),))
    values = np.array([3.0, 1.0, -1.0, 0.5, 7.0])
    np.testing.assert_allclose(table.weights([np.array([-50.0, -1e-9, 1 + 1e-9, 80.0])]) @ values, [3, 3, 7, 7])


@pytest.mark.parametrize(
    ("over", "times", "formula"),
    [
        (("position",), "", lambda s: np.sin(s["q"])),
        (("position",), "direction", lambda s: np.sin(s["q"]) * np.tanh(s["qd"] / (0.002 * s["speed_scale"]))),
        (("speed",), "", lambda s: np.sin(np.abs(s["qd"]))),
        (("load",), "speed", lambda s: np.sin(s["load"] / 9) * s["qd"] / s["speed_scale"]),
        (("load",), "driving", lambda s: np.sin(s["load"] / 9) * np.sign(s["qd"]) * (s["load"] * s["qd"] > 0)),
        (("load",), "braking", lambda s: np.sin(s["load"] / 9) * np.sign(s["qd"]) * (s["load"] * s["qd"] <= 0)),
        (("time",), "", lambda s: np.sin(s["time"])),
        (("distance travelled",), "", lambda s: np.sin(cumulative_trapezoid(np.abs(s["qd"]), dx=DT, initial=0))),
        (("position", "position of b"), "", lambda s: np.sin(s["q"] + 0.5 * s["q_of_1"])),
        (("speed of b", "position"), "", lambda s: np.sin(s["q"] + 0.1 * s["qd_of_1"])),
    ],
)
def test_a_table_of_a_formula_gives_the_formula(over, times, formula):
    """Values are those of a sine at the knots; the law is then that sine along a motion, to the table's step."""
    s = signals()
    s |= {"q_of_1": 1.4 * np.cos(0.9 * s["time"]), "qd_of_1": -1.26 * np.sin(0.9 * s["time"])}
    along = {"position": "q", "load": "load", "time": "time", "position of b": "q_of_1", "speed of b": "qd_of_1"}
    spans = [
        np.array([0, np.abs(s["qd"]).max()]) if c == "speed"
        else np.array([0, np.sum(np.abs(s["qd"])) * DT]) if c == "distance travelled"
        else np.array([s[along[c]].min(), s[along[c]].max()])
        for c in over
    ]  # fmt: skip
    table = Table(over, times, tuple(even(low, high, 81 if len(over) == 1 else 16) for low, high in spans))
    scale = {"load": 1 / 9, "position of b": 0.5, "speed of b": 0.1}
    grid = np.meshgrid(
        *(scale.get(c, 1.0) * np.array(k) for c, k in zip(over, table.knots, strict=True)), indexing="ij"
    )
    effect = empirical_effect([table])
    found = evaluate_law(effect, s, np.sin(sum(grid)).ravel(), DT).values[:, 0]
    keep = np.abs(s["qd"]) > 0.01 * s["speed_scale"] if times else slice(None)  # where a smooth sign equals a sign
    np.testing.assert_allclose(found[keep], formula(s)[keep], atol=5e-3 if len(over) == 1 else 2e-2)


def test_derivatives_are_those_of_finite_differences():
    """As the contract of the vocabulary's effects asks: by values, and by the load that others depend on."""
    s, rng = signals(), np.random.default_rng(4)
    s |= {"q_of_1": np.cos(s["time"]), "qd_of_1": -np.sin(s["time"])}
    tables = [
        Table(("load",), "direction", (even(-20, 25, 9),)),
        Table(("position", "position of b"), "", (even(-1, 1, 4), even(-1, 1, 5))),
        Table(("distance travelled",), "speed", (even(0, 5, 4),)),
    ]
    effect = empirical_effect(tables)
    p = rng.normal(size=len(effect.parameters))
    made = evaluate_law(effect, s, p, DT)
    for i in (0, 5, 12, 20, 30):
        step = 1e-4 * np.eye(len(p))[i]
        change = (evaluate_law(effect, s, p + step, DT).values - evaluate_law(effect, s, p - step, DT).values) / 2e-4
        np.testing.assert_allclose(made.by_parameter[:, :, i], change, atol=1e-9)
    assert made.by_signal is not None
    ahead, behind = (evaluate_law(effect, s | {"load": s["load"] + h}, p, DT).values for h in (1e-6, -1e-6))
    np.testing.assert_allclose(made.by_signal[:, :, 0], (ahead - behind) / 2e-6, rtol=1e-5, atol=1e-5)


def motion(n, seconds, rate=200.0):
    """Time (n_samples,) and positions (n_samples, n) of sums of sines."""
    t = np.arange(round(seconds * rate)) / rate
    waves = [(0.6 / (1 + 2 * k), 2 * np.pi * f, k) for k, f in enumerate((0.31, 0.83, 1.7))]
    return t, np.stack([sum(a * np.sin(w * (1 + 0.17 * j) * t + p) for a, w, p in waves) for j in range(n)], 1)


ENTRY = """[[empirical]]
at = "joint2"
over = ["position", "speed of joint1"]
times = "direction"
knots = [[-1.0, 0.0, 1.0, 2.0], [-3.0, -2.0, -1.0, 0.0, 1.0]]
values = [[1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0], [2.0, 2.0, 2.0, 2.0, 9.5]]
std = [[0.1, 0.1, 0.1, 0.1, 0.1], [0.1, 0.1, 0.1, 0.1, 0.1], [0.1, 0.1, 0.1, 0.1, 0.1], [0.1, 0.1, 0.1, 0.1, 0.2]]
[[empirical]]
at = "joint2"
over = ["load"]
knots = [[-9.0, 0.0, 9.0, 18.0]]
values = [0.0, 0.1, 0.2, 0.7]
"""


def model_with(folder, entry, name="arm"):
    path = write_model(folder, name, 2, '["viscous_friction"]', {})
    path.write_text(path.read_text() + entry)
    return path


def test_a_model_file_keeps_its_tables(tmp_path):
    first = load_model(model_with(tmp_path, ENTRY))
    save_model(first, tmp_path / "again.toml", "a note")
    again = load_model(tmp_path / "again.toml")
    assert first.effects == again.effects
    assert first.values == again.values
    placed = first.effects[-1]
    assert (placed.effect.name, placed.at) == (NAME, "joint2")
    one, two = tables_of(placed.effect)
    assert (one.words, two.words) == ("position and speed of joint1 by direction", "load")
    assert table_values(one, "joint2", again.values)[3, 4] == 9.5
    assert table_values(one, "joint2", again.values, "std.")[3, 4] == 0.2
    assert table_values(two, "joint2", again.values).tolist() == [0.0, 0.1, 0.2, 0.7]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('at = "joint2"\nover = ["load"]', 'at = "joint9"\nover = ["load"]', "2: at = 'joint9'; this model has joint1"),
        ('over = ["load"]', 'over = ["heat"]', "over = .'heat'.; allowed is a list of one or two of position, speed"),
        ('over = ["load"]', 'over = ["load", "load"]', "allowed is a list of one or two"),
        ("speed of joint1", "speed of joint7", "over names 'joint7'; this model has joint1, joint2"),
        ('times = "direction"', 'times = "sign"', "times = 'sign'; allowed are direction, speed, driving, braking"),
        ("0.0, 9.0, 18.0]]", "0.0, 9.0, 17.0]]", "allowed are 4 or more in even, rising steps"),
        ("0.0, 9.0, 18.0]]", "0.0, 9.0, 18.0], [0.0]]", "knots has 2 rows; one a coordinate is allowed, 1 here"),
        ("0.1, 0.2, 0.7]", "0.1, 0.2]", "values has 3 numbers, knots ask for 4"),
        ("0.1, 0.2, 0.7]", "0.1, 0.2, nan]", "values = .* allowed is a list of finite numbers"),
        ("[2.0, 2.0, 2.0, 2.0, 9.5]", "[2.0]", "values = .* allowed is a list of lists of finite numbers"),
        ("[0.1, 0.1, 0.1, 0.1, 0.2]", "[0.1, 0.1, 0.1, 0.1, -0.2]", "std = -0.2; allowed are numbers from 0 up"),
        ("knots = [[-9", 'unit = "N"\nknots = [[-9', "2 has 'unit'; allowed are at, over, times, knots, values, std"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_table_is_one_line(tmp_path, old, new, told):
    assert old in ENTRY
    path = model_with(tmp_path, ENTRY.replace(old, new, 1) if old != "speed of joint1" else ENTRY.replace(old, new))
    with pytest.raises(InputError, match=told) as caught:
        load_model(path)
    assert "\n" not in str(caught.value)


def test_a_capture_has_no_tables(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text('name = "c"\nsystem = "snare_capture"\n' + ENTRY)
    with pytest.raises(InputError, match="belongs to a system with joints, not to 'snare_capture'; take it out"):
        load_model(path)


@pytest.mark.parametrize(
    ("words", "read"),
    [
        ("position, fine", (("position",), "")),
        ("position by direction, narrow", (("position",), "direction")),
        ("load when driving", (("load",), "driving")),
        ("position and position of joint2 by direction", (("position", "position of joint2"), "direction")),
        ("distance since it turned by direction", None),
    ],
)
def test_curves_in_words_are_read_as_tables(words, read):
    assert read_words(words) == read


@pytest.mark.filterwarnings("ignore:the empirical law")
@pytest.mark.parametrize("version", [2, 3])
def test_tables_over_two_joints_follow_in_an_fmu_as_in_simulate(tmp_path, version):
    """Two tables at a joint, one over another joint's speed, one over the load, with a direction, and a third that
    remembers the distance: the FMU is `simulate` to 1e-6 of the torque."""
    entry = ENTRY + (
        '[[empirical]]\nat = "joint1"\nover = ["distance travelled"]\ntimes = "speed"\n'
        "knots = [[0.0, 1.0, 2.0, 3.0]]\nvalues = [0.0, 2.0, 1.0, 3.0]\n"
    )
    path = model_with(tmp_path, entry)
    given = '"viscous_friction.joint1.coefficient" = 1.0\n"viscous_friction.joint2.coefficient" = 2.0\n'
    given += '"speed_scale.joint1" = 4.0\n"speed_scale.joint2" = 5.0\n'
    path.write_text(path.read_text().replace("[parameters]\n", f"[parameters]\n{given}"))
    t, q = motion(2, 4.0)
    assert parted(path, version, t, q) < 1e-6
    # The arm itself: what its drives must give at its start to have no acceleration is what the tables and laws take.
    export(str(path), version, tmp_path / "arm.fmu")
    start = {"start.q.joint1": 0.3, "start.q.joint2": 0.5, "start.qd.joint1": -1.2, "start.qd.joint2": 0.8}
    s = Slave(tmp_path / "arm.fmu", tmp_path / "arm", {**start, "tau.joint1": 3.0, "tau.joint2": -2.0})
    qdd = s.get(["qdd.joint1", "qdd.joint2"])
    back = Slave(
        tmp_path / "x.fmu",
        tmp_path / "x",
        {k.removeprefix("start."): v for k, v in start.items()}
        | dict(zip(["qdd.joint1", "qdd.joint2"], qdd, strict=True)),
    )
    np.testing.assert_allclose(back.get(["tau.joint1", "tau.joint2"]), [3.0, -2.0], atol=1e-6)
    for slave in (s, back):
        slave.close()


def test_score_and_curvature_are_kept_and_saved(tmp_path):
    path = write_model(tmp_path, "arm", 1, "[]", {})
    entry = '[[empirical]]\nat = "joint1"\nover = ["position"]\nknots = [[0.0, 1.0, 2.0, 3.0]]\nvalues = [1, 2, 3, 4]\n'
    lower = "curvature = [4, 1, 5, 2, 0, 6, 0, 1, 2, 7]\n"
    path.write_text(path.read_text() + entry + "score = [1, -1, 2, 0.5]\n" + lower)
    save_model(load_model(path), tmp_path / "again.toml", "again")
    for model in map(load_model, (path, tmp_path / "again.toml")):
        (effect,) = (p.effect for p in model.effects if p.effect.name == NAME)
        seen = likelihood_of(tables_of(effect)[0], "joint1", model.values)
        assert seen is not None
        np.testing.assert_array_equal(seen[0], [[4, 1, 2, 0], [1, 5, 0, 1], [2, 0, 6, 2], [0, 1, 2, 7]])
        np.testing.assert_array_equal(seen[1], [1, -1, 2, 0.5])
    path.write_text(path.read_text().replace(lower, ""))
    with pytest.raises(
        InputError, match=r"curvature has 0 numbers, knots ask for 10; or leave score and curvature out"
    ):
        load_model(path)
