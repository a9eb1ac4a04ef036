"""The documentation says what the code does: effects, links, targets, models, results and thresholds."""

import ast
import json
import re
import runpy
import shutil
import tomllib

import pytest
from diagnoses import spelt
from documentation import CHANGELOG, DOCS, PAGES, README, ROOT, blocks, read
from made_studies import result_left

import snarelab
from snarelab.cli import main
from snarelab.identification import deciding
from snarelab.models.effects import FAMILIES, effects
from snarelab.models.model_file import load_model
from snarelab.tolerance.study import load_study

ALL = [*PAGES, CHANGELOG]
BUNDLED = ROOT / "studies" / "bundled"


def anchors(page):
    """What GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", read(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def rows(markdown, head):
    """Cells of the table whose first line begins with ``head``."""
    lines = markdown[markdown.index(head) :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines]


def test_pages_from_the_code_are_what_the_code_gives(monkeypatch):
    monkeypatch.syspath_prepend(DOCS)  # the scripts import each other by name, as they do when they are run
    for path, given in runpy.run_path(str(DOCS / "make_pages.py"))["pages"]().items():
        assert read(path) == given, f"{path.name} is stale: run python docs/make_pages.py"


def test_what_looks_alike_is_what_the_columns_give():
    """Shares move a little with the rounding of a fit; pairs near the bar of 80 % may come and go."""
    script = runpy.run_path(str(DOCS / "make_confusions.py"))
    written = json.loads(read(DOCS / "confusions.json"))
    measured = script["alike"]()
    for one, others in written.items():
        for other in {*others, *measured[one]} & set(written):
            shares = others.get(other, script["ALIKE"]), measured[one].get(other, script["ALIKE"])
            assert abs(shares[0] - shares[1]) <= 0.03, f"{one}, {other}: run python docs/make_confusions.py"
    assert measured["sensor_bias"]["asymmetric_friction"] > 0.99  # a level in either direction: the same column


def test_page_of_effects_shows_every_parameter():
    for effect in [law for e in effects().values() for law in (e, e.elsewhere) if law]:
        head = f"| `{effect.name}`<br>{effect.sentence}<br>"
        (row,) = [line for line in read(DOCS / "effects.md").splitlines() if line.startswith(head)]
        assert all(f"`{parameter.name}` [" in row for parameter in effect.parameters)
        assert effect.source in row


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.name)
def test_every_relative_link_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", read(page)):
        if target.startswith("https://"):
            continue
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        assert place.exists(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(place), f"{page.name}: {target}"


def test_every_make_target_mentioned_exists():
    makefile = read(ROOT / "Makefile")
    studies = re.findall(r"^STUDIES := (.*)$", makefile, re.MULTILINE)[0].split()
    known = {*re.findall(r"^([a-z-]+):", makefile, re.MULTILINE), *(f"study-{name}" for name in studies)}
    mentioned = set()
    for page in ALL:
        code = re.findall(r"`([^`\n]+)`|^(make .*)$", read(page), re.MULTILINE)
        for line in (a or b for a, b in code):
            if line.startswith("make "):
                mentioned |= {word for word in line.partition("#")[0].split()[1:] if "=" not in word}
    assert mentioned - {"study-NAME"} <= known
    assert {"demo", "test", "study-emps"} <= mentioned


MODELS = [pytest.param(b, id=f"{page.name}-{k}") for page in ALL for k, (_, b) in enumerate(blocks(page, "toml"))]


@pytest.mark.parametrize("block", MODELS)
def test_every_model_shown_loads(block, tmp_path):
    given = tomllib.loads(block)
    if "participants" in given:  # a system for `snarelab cosim`: test_adding.py and test_cosim_files.py run such
        return
    if "capture" in given:
        study = tmp_path / "study.toml"
        study.write_text(block, encoding="utf-8")
        assert set(load_study(study).ranges) == set(given["ranges"])
        return
    shutil.copy(BUNDLED / "arm3.urdf", tmp_path)
    model = tmp_path / "arm3.toml"
    model.write_text(block if "urdf" in given else f'urdf = "arm3.urdf"\n{block}', encoding="utf-8")
    loaded = load_model(model)
    assert len(loaded.signals) == len(given.get("signals", {}))
    assert all(key.split(".")[0] in {*effects(), "inertia", "speed_scale", "empirical", "std"} for key in loaded.values)


def keys(value):
    """Every key in a JSON value, but for those that begin with x_: stand-ins for names of channels and parameters."""
    if isinstance(value, list):
        return set().union(*map(keys, value))
    if not isinstance(value, dict):
        return set()
    own = {key for key in value if not key.startswith("x_")}
    return own.union(*map(keys, value.values()))


def described(page):
    return set(re.findall(r"\w+", " ".join(re.findall(r"^\| (`[^|]*`) \|", page, re.MULTILINE))))


def test_every_field_of_a_diagnosis_is_described():
    page = read(DOCS / "results.md")
    found = keys(spelt("x_name").to_json())
    assert len(found) > 35
    missing = found - described(page[page.index("## Diagnosis (JSON)") :])
    assert not missing, f"docs/results.md does not describe {missing}"


def test_every_field_of_an_identification_is_described(tmp_path):
    shutil.copy(BUNDLED / "arm3.urdf", tmp_path)
    model, out = tmp_path / "arm3.toml", tmp_path / "out.json"
    model.write_text('urdf = "arm3.urdf"\ninertia = "free"\neffects = ["viscous_friction"]\n')
    recordings = [str(BUNDLED / "holdout.csv"), "--holdout", str(BUNDLED / "train.csv")]
    assert main(["identify", str(model), *recordings, "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    links = found["inertia"]["links"]
    # Lists in place of what is keyed by names of channels and links.
    found |= {"fit": [*found["fit"].values()], "inertia": found["inertia"] | {"links": [*links.values()]}}
    page = read(DOCS / "results.md")
    section = page[page.index("## Identification (JSON)") : page.index("## Diagnosis (JSON)")]
    inertial = set(next(iter(links.values())))
    assert all(f"`{name}`" in section for name in inertial)
    missing = keys(found) - described(section) - inertial
    assert not missing, f"docs/results.md does not describe {missing}"


def test_readme_says_what_can_be_named():
    table = rows(read(README).replace("<!-- end of effects -->", ""), "| family | can be named |")
    assert [row[0] for row in table] == list(FAMILIES)
    assert {name for row in table for name in re.findall(r"`(\w+)`", row[1])} == set(effects())
    for family, now, *planned in table:
        assert all(effects()[name].family == family for name in re.findall(r"`(\w+)`", now))
        assert not set(re.findall(r"`(\w+)`", " ".join(planned))) & set(effects())


def test_the_reference_page_has_every_public_name():
    listed = re.findall(r"auto\w+:: snarelab\.(\w+)$", read(DOCS / "python.md"), re.MULTILINE)
    assert sorted(listed) == snarelab.__all__


def numbers(code, name):
    """Every value that a constant of this name has where it is set to numbers."""
    written = re.findall(rf"^{name} = ([-\d.(].*)$", code, re.MULTILINE)
    return [ast.literal_eval(value) for value in written]


def test_thresholds_are_those_of_the_code():
    """Of the table written from the code, too: each number is set in one place alone."""
    sources = [path for folder in ("recordings", "identification") for path in (ROOT / folder).rglob("*.py")]
    # Captures, encoders and checks have thresholds of their own, under names that mean the same.
    apart = {"snare", "links", "checks"}
    code = "\n".join(read(path) for path in sources if not apart & set(path.relative_to(ROOT).parts))
    page = read(DOCS / "method.md")
    heads = [m.start() for m in re.finditer(re.escape("| constant | value |"), page)]
    decide, others = (rows(page[at:], "| constant | value |") for at in heads)
    assert len(others) > 5
    assert {name.strip("`") for name, _, _ in decide} == {n for n in vars(deciding) if n.isupper()}
    for name, value, _ in (*decide, *others):
        shown = ast.literal_eval(value)
        assert numbers(code, name.strip("`")) == [shown], f"{name} in docs/method.md"


def test_a_threshold_is_found_where_it_is_set_to_numbers():
    code = "A = 0.5\nB = (1, 2.0)\nA = tuple(x)\n    A = 7\nAB = 3\nA = 2\n"
    assert numbers(code, "A") == [0.5, 2]
    assert numbers(code, "B") == [(1, 2.0)]


def test_numbers_named_in_the_method_decide():
    """In capitals in its text: no number is spoken of that there is no more."""
    page = read(DOCS / "method.md")
    named = set(re.findall(r"`([A-Z][A-Z_]+[A-Z])`", page[: page.index("## Numbers that decide")]))
    assert named <= {n for n in vars(deciding) if n.isupper()}
    assert len(named) > 20


def test_results_shown_on_two_pages_are_the_same():
    """The README's sentence on the servo axis: first and last line of the study's table, and the publishers' error."""
    study = read(DOCS / "study-emps.md")
    table = rows(study, "| model | error, training |")
    said = " ".join(read(README).split())
    assert f"falls from {table[0][2]} to {table[-1][2]}" in said
    (theirs,) = re.findall(r"publishers' own model has ([\d.]+) %", said)
    assert f"| {theirs} % |" in study


def test_the_servo_axis_on_its_page_is_what_the_study_left():
    """Every line of both tables."""

    def percent(share):
        return f"{100 * share:.2f} %"

    result = result_left("emps")
    if result is None:
        pytest.skip("no result of today's sources: make study-emps")
    page = read(DOCS / "study-emps.md")
    steps = [[s["label"], percent(s["train"]), percent(s["holdout"])] for s in result["steps"]]
    assert rows(page, "| model | error, training |") == steps
    here = {row[0]: row[1:3] for row in rows(page, "| | published | here |")}
    of = {q["name"]: q for q in result["quantities"]}
    for line, name in (
        ("mass [kg]", "mass"),
        ("viscous coefficient [N·s/m]", "coefficient"),
        ("Coulomb level [N]", "level"),
        ("offset [N]", "offset"),
    ):
        assert here[line] == [f"{of[name][x]:.4f}".replace("-", "−") for x in ("paper", "ours")]
    for line, name in (("fitted", "train"), ("held out", "holdout")):
        own = of[f"relative_error_{name}"]
        assert here[f"relative force error, {line}"] == [percent(own[x]) for x in ("paper", "ours")]
    assert of["relative_error_held_out"]["ours"] == result["steps"][-1]["holdout"]


def test_the_readme_is_short():
    assert len(read(README).splitlines()) <= 100
