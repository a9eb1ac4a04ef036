"""Every kind of page in a browser: axe's findings, the keyboard, paper, no scripts; its console and the network."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browser import opened, playing
from diagnoses import VERDICTS, unbroken
from once import filled
from playwright.sync_api import Browser, Page
from proof_answers import several
from study_pages import QUANTITIES, moving, picture
from tolerance_toy import toy_results, toy_study

from proof.page import write_page as write_proof
from proof.score import score
from proof.seal import Seal
from snarelab.fmu.description import ModelInfo
from snarelab.fmu.equations import ModelVariable
from snarelab.fmu.page import page as fmu_page
from snarelab.identification.diagnosis import Diagnosis, FrictionCurve
from snarelab.identification.report.page import write_report
from snarelab.report.provenance import Provenance
from snarelab.studies.page import Section, write_page
from snarelab.tolerance.report import summarise

KINDS = [*VERDICTS, "study", "fmu", "tolerance", "proof"]
AXE = {"resultTypes": ["violations"], "iframes": False}  # between frames of a file axe cannot talk: each by itself

# Everything that can be used, and is to be seen; a frame counts by what is in it.
CONTROLS = """() => [...document.querySelectorAll("a[href],button,input,select,summary,[tabindex='0']")]
    .filter(x => x.checkVisibility({visibilityProperty: true}) && !x.disabled).map((x, i) => x.dataset.seen = `${i}`)"""

# What was opened has its size two frames later, and what scrolls can then be reached by key.
LAID_OUT = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


def drawn(page: Page) -> None:
    """On a narrow window a plot that comes into sight is drawn anew and hides its picture; let all be drawn."""
    for plate in page.locator(".plate:has(.zoom-button):visible").all():
        plate.scroll_into_view_if_needed()
        plate.locator(".drawn[data-ready]").wait_for()


def wider(page: Page) -> list[str]:
    """Tables, plots, or the page itself, that are wider than there is room for."""
    return page.evaluate("""[...document.querySelectorAll(".scroll,.plate,body,html")]
        .filter(x => x.checkVisibility() && x.scrollWidth > x.clientWidth + 1).map(x => x.outerHTML.slice(0, 80))""")


ORIGIN = Provenance(
    "snarelab diagnose arm.toml " + "a_recording_of_some_length.csv " * 4 + "--holdout b.csv --report r.html",
    tuple((role, f"{role}.csv", "0" * 64) for role in ("Model", "Robot", "Training", "Training", "Held-out")),
    (("snarelab", "0.1.0"), ("Python", "3.13.1"), ("casadi", "3.8.2"), ("drake", "1.51.1"), ("numpy", "2.4.6")),
)


def crowded() -> Diagnosis:
    """Twenty names on ten joints of a diagnosis, each with three values, rivals that are alike, and curves."""
    made = VERDICTS["missing_physics"]()
    speed = np.linspace(-1.0, 1.0, 61)
    curve = FrictionCurve(
        "joint5",
        "joint",
        ("viscous_friction", "stribeck_friction"),
        speed,
        speed + np.tanh(speed / 0.1),
        np.full(61, 0.1),
        "N*m",
        (speed, np.tanh(speed / 0.1)),
        (speed[::6], speed[::6], np.full(11, 0.2)),
    )
    names = tuple(replace(made.effects[1], at=f"joint{5 + k}", probability=0.95 - 0.01 * k) for k in range(20))
    return replace(made, effects=names, curves=(curve,))


@pytest.fixture(scope="module")
def pages(of_this_run: Path) -> dict[str, Path]:
    folder = filled(of_this_run / "pages", write_all)
    others = {
        "study": folder / "build" / "studies" / "demo" / "report.html",
        "tolerance": folder / "captures" / "report.html",
    }
    return {kind: folder / f"{kind}.html" for kind in (*KINDS, "crowded")} | others


def write_all(folder: Path) -> None:
    for name, make in (*VERDICTS.items(), ("crowded", crowded)):
        write_report(make(), folder / f"{name}.html", ORIGIN)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        sections = [Section("Motion", ["What moves."], [picture()])]
        write_page("demo", "Test", "It moves.", QUANTITIES, sections, moving().html(1.0))
    variables = (
        ModelVariable("torque", "input", "N*m", 0.0, "torque of the motor"),
        ModelVariable("stiffness", "parameter", "N*m/rad", 5400.0, "of the spring", 0.0),
        ModelVariable("speed", "output", "rad/s", 0.0, "of the link"),
    )
    about = ModelInfo(
        "elastic_joint", "joint", "A joint on a spring", "0", 0.001, 1.0, True, False, False, True, "joint.c"
    )
    (folder / "fmu.html").write_text(fmu_page(about, variables, 3), encoding="utf-8")
    captures = toy_results(folder / "captures", toy_study(folder))
    summarise(toy_study(folder), captures)
    answers, found = several()
    scores = {name: score(answers, found) for name in ("snarelab", "joint_bic")}
    seal, content = Seal.make(answers, [1] * 12, [], 90500), {"seconds_a_diagnosis": 5.0}
    write_proof(folder / "proof.html", answers, scores, seal, content, found)


@pytest.mark.parametrize(
    ("kind", "scheme", "width"),
    [
        *((kind, "light", 1400) for kind in KINDS),
        *(pytest.param(kind, "dark", 390, marks=pytest.mark.slow) for kind in KINDS),
        # What these two show is what any page has.
        *(pytest.param(kind, "dark", 1400, marks=pytest.mark.slow) for kind in ("missing_physics", "study")),
        *(pytest.param(kind, "light", 390, marks=pytest.mark.slow) for kind in ("missing_physics", "study")),
    ],
)
def test_axe_finds_nothing_serious(browser: Browser, pages: dict[str, Path], kind: str, scheme, width: int) -> None:
    with opened(browser, pages[kind], scheme, (width, 900)) as page:
        page.evaluate("document.querySelectorAll('details').forEach(x => x.open = true)")
        page.evaluate(LAID_OUT)
        frames = [page.main_frame, playing(page)] if kind == "study" else [page.main_frame]
        for frame in frames:
            found = Axe().run(frame, options=AXE).response
            assert len(found["violations"]) < 5
            serious = [x for x in found["violations"] if x["impact"] in ("serious", "critical")]
            assert [(x["id"], node["html"]) for x in serious for node in x["nodes"]] == []


@pytest.mark.parametrize(
    ("kind", "width"), [*zip(VERDICTS, (400, 1200, 1200), strict=True), ("study", 400), ("study", 1200)]
)
def test_tab_reaches_every_control(browser: Browser, pages: dict[str, Path], kind: str, width: int) -> None:
    with opened(browser, pages[kind], size=(width, 900)) as page:
        if width < 640:
            drawn(page)
        frames = [page.main_frame, playing(page)] if kind == "study" else [page.main_frame]
        wanted = [{*frame.evaluate(CONTROLS)} for frame in frames]
        assert all(len(controls) >= 3 for controls in wanted)
        reached = [set[str]() for _ in frames]
        page.evaluate("window.scrollTo(0, 0)")
        for _ in range(
            2 * sum(map(len, wanted)) + 20
        ):  # what scrolls is a stop as well, and the ring may start anywhere
            page.keyboard.press("Tab")
            for frame, seen in zip(frames, reached, strict=True):
                seen.add(frame.evaluate("document.activeElement.dataset.seen"))
        assert [controls - seen for controls, seen in zip(wanted, reached, strict=True)] == [set()] * len(frames)


@pytest.mark.parametrize("kind", [*VERDICTS, "study"])
@pytest.mark.parametrize("unfold", [False, True])
def test_paper_hides_only_what_is_folded_and_cuts_nothing(
    browser: Browser, pages: dict[str, Path], kind: str, unfold: bool
) -> None:
    with opened(browser, pages[kind], "dark", (680, 1010)) as page:  # A4 less its margins, at 96 dots an inch
        page.locator(".times").first.focus()
        page.keyboard.press("End")
        if unfold:
            page.evaluate("document.querySelectorAll('details').forEach(x => x.open = true)")
        page.emulate_media(media="print")
        folded = page.locator("details").count()
        assert page.locator("details:visible").count() == (folded if unfold else 0)
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        assert not page.locator(".cursor:visible,.times:visible,nav:visible,iframe:visible").count()
        hidden = page.evaluate("""() => [...document.querySelectorAll("body *")]
            .filter(x => !x.closest("nav,script,style,noscript,.on-screen,.zoom-button,.cursor,.times,.bar"))
            .filter(x => !x.closest("details:not([open])"))
            .filter(x => !x.getBoundingClientRect().height || !x.checkVisibility({contentVisibilityAuto: true}))
            .map(x => x.outerHTML.slice(0, 80))""")
        assert [element for element in hidden if not element.startswith(("<col", "<br"))] == []
        assert wider(page) == []
        assert page.locator(".on-paper:visible").count() == (kind == "study") + (folded > 0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_phone_shows_every_table_and_plot_whole(browser: Browser, pages: dict[str, Path], kind: str) -> None:
    with opened(browser, pages[kind], size=(390, 900)) as page:
        page.evaluate("document.querySelectorAll('details').forEach(x => x.open = true)")
        page.evaluate(LAID_OUT)
        assert wider(page) == []
        unsaid = page.evaluate("""[...document.querySelectorAll(".stacks tbody td")].filter(cell => {
            const head = cell.closest("table").querySelector("thead tr").cells[cell.cellIndex].textContent;
            return getComputedStyle(cell, "::before").content !== JSON.stringify(head + " ");
        }).map(cell => cell.outerHTML)""")
        assert unsaid == []


@pytest.mark.parametrize("name", [*VERDICTS, "crowded"])
def test_the_answer_is_one_printed_sheet(browser: Browser, pages: dict[str, Path], name: str) -> None:
    with opened(browser, pages[name], size=(680, 1009)) as page:  # A4 less its margins
        page.emulate_media(media="print")
        answer = page.locator("#answer").bounding_box()
        assert answer is not None
        assert answer["y"] + answer["height"] <= 1009


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_crowded_answer_is_whole_on_a_phone(browser: Browser, pages: dict[str, Path], scheme) -> None:
    with opened(browser, pages["crowded"], scheme, (390, 900)) as page:
        assert wider(page) == []
        assert page.locator("#answer tbody tr").count() == 8
        text = page.locator("#answer").inner_text()
        assert "And 12 more" in text
        # The page's script makes what scrolls reachable by key once it is laid out.
        page.wait_for_function(
            "[...document.querySelectorAll('.scroll,.plate')]"
            ".every(x => x.scrollWidth <= x.clientWidth || x.tabIndex === 0)"
        )
        found = Axe().run(page.main_frame, options=AXE).response
        assert [x["id"] for x in found["violations"] if x["impact"] in ("serious", "critical")] == []


@pytest.mark.slow
def test_without_scripts_the_plots_are_plain(browser: Browser, pages: dict[str, Path]) -> None:
    with opened(browser, pages["missing_physics"], scripts=False) as page:
        sentence = unbroken(VERDICTS["missing_physics"]().sentence)
        assert " ".join(page.locator("h1,h1+p").all_inner_texts()) == sentence
        assert page.locator(".plot img:visible").count() > 5
        assert page.locator(".cursor,.times,[tabindex]").count() == 0
