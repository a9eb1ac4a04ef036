"""How often a name is right: the map that is counted, how it is tested on generators left out, and how it is read."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from proof import calibrate
from proof.counting import Row, counted, fitted, of_effects, of_lines, probability
from snarelab.identification import reliability

TRUE = (-2.0, 0.6, 1.5, 0.7)


def drawn(count, seed=0, generator="a", logit=TRUE):
    """Names whose being right is logistic in their evidence, as it is."""
    rng = np.random.default_rng(seed)
    evidence = zip(rng.uniform(1, 300, count), rng.uniform(0.3, 8, count), rng.uniform(0.02, 0.98, count), strict=True)
    some = [Row(g, h, s, False, generator) for g, h, s in evidence]
    right = rng.random(count) < probability(logit, some)
    return [row._replace(right=bool(x)) for row, x in zip(some, right, strict=True)]


def test_the_map_that_names_follow_is_found():
    """Of 20 000 names; their deviations are about 0.1, 0.03 and 0.04."""
    assert fitted(drawn(20_000)) == pytest.approx(TRUE, abs=0.15)


def test_the_map_has_the_highest_penalised_likelihood():
    """Against its own definition, written out: no small step in any direction is likelier."""
    rows = drawn(400, seed=1)
    share = np.array([r.share for r in rows])
    x = np.column_stack([np.log1p([r.gain for r in rows]), np.log([r.held for r in rows]), np.log(share / (1 - share))])
    mean, right = x.mean(axis=0), np.array([r.right for r in rows])

    def value(level, slopes):
        p = 1 / (1 + np.exp(-(level + x @ slopes)))
        about_the_mean = level + mean @ slopes
        return np.sum(np.log(np.where(right, p, 1 - p))) - 0.05 * (about_the_mean**2 + slopes @ slopes)

    level, *slopes = fitted(rows)
    assert min(slopes) > 0.1  # at no bound
    best = value(level, np.array(slopes))
    for step in np.concatenate([np.eye(4), -np.eye(4)]) * 1e-2:
        assert value(level + step[0], slopes + step[1:]) < best


def test_names_that_were_never_wrong_are_not_certain():
    """Nor worse than a coin: twenty of them."""
    rows = [row._replace(right=True) for row in drawn(20)]
    found = probability(fitted(rows), rows)
    assert np.all(found > 0.9)
    assert np.all(found < 0.999)


@pytest.mark.parametrize(("evidence", "slope", "most"), [("gain", 1, 10), ("held", 2, 10), ("share", 3, 1)])
def test_more_evidence_never_makes_a_name_less_likely(evidence, slope, most):
    """Where the smaller were right and the larger wrong, that evidence counts for nothing."""
    plain = Row(10.0, 2.0, 0.5, True, "a")
    rows = [plain._replace(**{evidence: x * most}, right=x < 0.5) for x in np.linspace(0.1, 1, 40)]
    logit = fitted(rows)
    assert logit[slope] == 0
    assert probability(logit, rows[:1]) == pytest.approx(np.mean([r.right for r in rows]), abs=0.05)


def test_evidence_against_a_name_counts_as_none():
    one, other = Row(-5.0, -2.0, -0.1, True, "a"), Row(0.0, 1e-3, 1e-3, True, "a")
    assert probability(TRUE, [one]) == probability(TRUE, [other])
    assert fitted([one, *drawn(30)]) == fitted([other, *drawn(30)])


def test_the_skill_of_a_generator_is_that_of_a_map_which_never_saw_it():
    """1 - Brier / Brier of its own frequency. Where names of b are right against their evidence, a's map does worse
    on them than that constant."""
    a, b = drawn(2000, 2), drawn(400, 3, "b")
    found = counted([*a, *b])
    assert found.logit == fitted([*a, *b])
    right = np.array([r.right for r in b])
    constant = np.mean(right) * (1 - np.mean(right))
    skills = [1 - np.mean((probability(x, b) - right) ** 2) / constant for x in (fitted(a), TRUE)]
    assert found.skill["b"] == pytest.approx(skills[0])
    assert found.skill["b"] == pytest.approx(skills[1], abs=0.03)  # the map that they follow predicts no better
    assert skills[1] > 0.1
    assert set(found.skill) == {"a", "b"}
    against = [row._replace(right=not row.right) for row in b]
    skill = counted([*a, *against]).skill["b"]
    assert skill is not None
    assert skill < 0


def test_one_generator_alone_has_no_skill_nor_one_whose_names_are_all_right():
    assert counted(drawn(50)).skill == {"a": None}
    b = [row._replace(right=True) for row in drawn(20, 4, "b")]
    assert counted([*drawn(50), *b]).skill["b"] is None


@pytest.mark.parametrize("rows", [[], [Row(np.nan, 1.0, 0.5, True, "a")], [Row(1.0, np.inf, 0.5, True, "a")]])
def test_nothing_is_counted_of_nothing(rows):
    with pytest.raises(ValueError, match="no n"):
        counted(rows)


def test_the_program_reads_the_map_as_it_was_counted(monkeypatch):
    logit = fitted(drawn(300))
    monkeypatch.setattr(reliability, "_stored", lambda: {"logit": list(logit)})
    rows = [*drawn(20, 7), Row(-1.0, -3.0, 1.0, True, "a"), Row(0.0, 0.0, 0.0, True, "a")]
    assert [reliability.of_name(r.gain, r.held, r.share) for r in rows] == pytest.approx(
        probability(logit, rows).tolist()
    )


def effect(name, at, gain: Any = 12.0, margin=3.0, rivals=()):
    own = {"name": name, "at": at, "gain": gain, "margin": margin, "explained": 0.4}
    others = [{"name": n, "at": p, "probability": 0.1, "separable": s} for n, p, s in rivals]
    return {**own, "probability": 0.5, "parameters": {}, "rivals": others}


def test_names_of_encoders_are_left_out_and_old_ones_without_evidence_refused():
    both = [effect("backlash", "joint1"), effect("sensor_delay", "q_link.joint1", None, 0.9)]
    assert of_effects(both, [True, False], "x") == [Row(12.0, 3.0, 0.4, True, "x")]
    old = {k: v for k, v in both[0].items() if k != "gain"}
    with pytest.raises(ValueError, match="backlash at joint1 was kept without gain, margin and explained"):
        of_effects([old], [True], "x")


def line(effects, concealed, background=(), generator="drives"):
    truth = {"generator": generator, "group": "single", "disturbance": {"kind": "white"}, "effects": concealed}
    truth |= {"background": list(background), "known": {}}
    return {"case": "0007", "verdict": "missing_physics", "effects": effects, "truth": truth, "seconds": 1.0}


def test_of_the_second_generator_a_class_is_right_and_what_is_true_of_every_case_is_left_out():
    told = [
        effect("coulomb_friction", "joint1", 1.0, 1.5, [("makkar_friction", "joint1", False)]),
        effect("torque_ripple", "joint2", 2.0, 2.5, [("makkar_friction", "joint1", True)]),
        effect("payload_mass", "link2", 3.0, 3.5),
    ]
    concealed = [{"name": "makkar_friction", "at": "joint1", "size": 1.0, "values": {}}]
    rows = of_lines([line(told, concealed, ["payload_mass"])])
    assert rows == [Row(1.0, 1.5, 0.4, True, "drives"), Row(2.0, 2.5, 0.4, False, "drives")]
    assert len(of_lines([line(told, concealed)])) == 3
    with pytest.raises(ValueError, match=r"^0007: "):
        of_lines([line([{k: v for k, v in told[0].items() if k != "margin"}], concealed)])


def test_the_command_says_what_was_counted(tmp_path, monkeypatch, capsys):
    stored, lines = tmp_path / "reliability.json", tmp_path / "drives.jsonl"
    stored.write_text('{"logit": [0, 0, 0, 0]}')
    right = {"name": "coulomb_friction", "at": "joint1", "size": 1.0, "values": {}}
    cases = [line([effect("coulomb_friction", f"joint{1 + k % 3}", 5.0 + k)], [right]) for k in range(9)]
    lines.write_text("".join(json.dumps(x) + "\n" for x in [*cases, line([], [])]))
    monkeypatch.setattr(calibrate, "JSON", stored)
    monkeypatch.setattr("sys.argv", ["calibrate", "--cases", "0", "--drives", str(lines)])
    assert calibrate.main() == 0
    made = json.loads(stored.read_text())
    assert made["logit"] == list(fitted(of_lines(cases)))
    assert made["counted"]["generators"] == {
        "drives": {"cases": 10, "names": 9, "right": 3, "skill": None, "skill_of_the_map_before": pytest.approx(-0.125)}
    }  # a coin's Brier score is 1/4, that of the frequency of 3 of 9 is 2/9
    assert made["counted"]["command"] == f"python -m proof.calibrate --cases 0 --drives {lines}"
    before = stored.read_text()
    lines.write_text("")
    assert calibrate.main() == 2
    assert "no name was told" in capsys.readouterr().err
    assert stored.read_text() == before


def test_a_map_that_predicts_a_generator_left_out_no_better_is_not_stored(tmp_path, monkeypatch, capsys):
    """Of two generators, in whose names the same evidence speaks against each other; and of two that agree."""
    stored = tmp_path / "reliability.json"
    text = '{"logit": [0, 0, 0, 0]}'
    monkeypatch.setattr(calibrate, "JSON", stored)

    def left_after(right_where_played) -> str:
        stored.write_text(text)
        files = [tmp_path / "drives.jsonl", tmp_path / "played.jsonl"]
        for file, name, right in zip(files, ("drives", "played"), (lambda k: k > 20, right_where_played), strict=True):
            some = []
            for k in range(40):
                at = "joint1" if right(k) else "joint2"
                own = line(
                    [effect("backlash", at, 5.0 + 10 * k)],
                    [{"name": "backlash", "at": "joint1", "size": 1.0, "values": {}}],
                    generator=name,
                )
                some.append(own)
            file.write_text("".join(json.dumps(x) + "\n" for x in some))
        monkeypatch.setattr("sys.argv", ["calibrate", "--cases", "0", "--drives", *map(str, files)])
        done = calibrate.main()
        assert ("stays" in capsys.readouterr().out) == (done == 1)
        return stored.read_text()

    assert left_after(lambda k: k < 20) == text
    made = json.loads(left_after(lambda k: k > 18))
    assert {name: g["right"] for name, g in made["counted"]["generators"].items()} == {"drives": 19, "played": 21}


def test_names_of_the_proofs_own_generator_are_judged_as_the_proof_judges_them(tmp_path, monkeypatch):
    """Two cases, of which the first conceals what is named."""
    found = [
        {"effects": [effect("backlash", "joint2", 7.0, 1.5)]},
        {"effects": [effect("backlash", "joint1", 8.0, 2.5)]},
    ]
    truths = [SimpleNamespace(truths=[SimpleNamespace(name="backlash", at=at, also=())]) for at in ("joint2", "joint3")]
    monkeypatch.setattr(calibrate, "ProcessPoolExecutor", lambda *_: _Nobody())
    monkeypatch.setattr(calibrate, "prepare", lambda *_: (truths, [tmp_path] * 2, SimpleNamespace(answers="")))
    monkeypatch.setattr(calibrate, "fill", lambda *_: found)
    monkeypatch.setattr(calibrate, "score", lambda *_: SimpleNamespace(figures={}))
    assert calibrate.own(2, 1, 1, print) == [Row(7.0, 1.5, 0.4, True, "mujoco"), Row(8.0, 2.5, 0.4, False, "mujoco")]


class _Nobody:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


def test_stored_map_rises_with_evidence_and_is_never_certain():
    grid = ((0.0, 1.0, 0.01), (10.0, 1.0, 0.01), (10.0, 5.0, 0.01), (10.0, 5.0, 0.5), (1000.0, 30.0, 0.9))
    more = [reliability.of_name(*evidence) for evidence in grid]
    assert np.all(np.diff(more) >= 0)
    assert 0 < more[0] < more[-1] < 1
