"""The report in the browser and in the parser; the diagnoses are invented, as input for the rendering only."""

import re
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browser import opened, pixels
from diagnoses import VERDICTS, unbroken
from once import filled
from pages import pictures, read
from playwright.sync_api import Browser

from snarelab.identification.report.page import write_report
from snarelab.report.provenance import provenance

BUNDLED = Path(__file__).resolve().parents[3] / "studies" / "bundled"

SECTIONS = ["answer", "missing", "where", "unseen", "steps", "shape", "candidates", "parameters", "notes"]


@pytest.fixture(scope="module")
def reports(of_this_run: Path) -> dict[str, Path]:
    def write(folder: Path) -> None:
        origin = provenance("snarelab diagnose arm3.toml a.csv", [("Model", BUNDLED / "arm3.toml"), ("Bag", BUNDLED)])
        for verdict, make in VERDICTS.items():
            write_report(make(), folder / f"{verdict}.html", origin)

    folder = filled(of_this_run / "reports", write)
    return {verdict: folder / f"{verdict}.html" for verdict in VERDICTS}


def test_small_and_alone_in_its_folder(reports: dict[str, Path]) -> None:
    files = list(reports["adequate"].parent.iterdir())
    assert sorted(files) == sorted(reports.values())
    assert max(file.stat().st_size for file in files) < 3_000_000


@pytest.mark.parametrize("verdict", VERDICTS)
def test_all_sections_stand_in_order(reports: dict[str, Path], verdict: str) -> None:
    page = read(reports[verdict])
    diagnosis = VERDICTS[verdict]()
    assert [section["id"] for section in page.all("section")] == SECTIONS
    assert page.all("html") == [{"lang": "en"}]
    parts = (
        unbroken(diagnosis.sentence),
        "pick_and_place.csv",
        "What to do next",
        "Files and versions",
        "sha256:",
    )
    places = [page.text.index(part) for part in parts]
    assert places == sorted(places)
    assert all(note in page.text for note in diagnosis.notes)
    assert all(image["alt"] for image in page.all("img"))
    assert len(page.all("table")) == len(page.all("caption"))
    assert all(head.get("scope") in ("col", "row") for head in page.all("th"))
    assert "nan" not in page.text


@pytest.mark.parametrize("verdict", VERDICTS)
def test_needs_nothing_from_elsewhere(reports: dict[str, Path], verdict: str) -> None:
    page = read(reports[verdict])
    kinds = [script.get("class") or script.get("id") for script in page.all("script")]
    assert kinds[-2:] == ["plotting", None]  # Bokeh's, packed, and the page's own; both stand in it
    assert {*kinds[:-2]} == {"zoom"}
    assert page.loaded() == []
    for picture in pictures(page):
        assert set(re.findall(r'href="(.)', picture)) <= {"#", "d"}
        assert not re.search(r"url\((?!#)|@import|<script|<image[^>]*https?:", picture)
    style = re.sub(r"<img[^>]*>", "", reports[verdict].read_text(encoding="utf-8"))
    assert not re.search(r"https?:|url\(|@import", style)


def test_findings_are_told_in_words(reports: dict[str, Path]) -> None:
    text = read(reports["missing_physics"]).text
    for expected in (
        "Stribeck friction at joint5",
        "Torque steps by 14 N·m wherever joint2 turns round",
        "over 99\u202f%",
        "N·m·s/rad",
        "at its bound",
        # Cells of one row, one after the other.
        "joint58\u202f%these recordings cannot tell them apartrepeat the slow part of the motion with 5 kg",
        "joint53\u202f%these recordings tell them apart–",
        "Stribeck friction at joint5, or load dependent friction at joint5",
        "Repeat the slow part of the motion with 5 kg.",
        "Coulomb friction at joint2level 7.01 ± 0.04 N·mover 99\u202f%41.0\u202f%",
        "tau.joint2\u00a0[N·m]" + "7.36" + "0.381" + "7.36" + "0.381" + "0.343" + "25.3\u202f%" + "1.31\u202f%",
        "and 4 more",
        "3 more channels",
    ):
        assert expected in text
    flags = re.findall(r'<span class="flag">([^<]*)', reports["missing_physics"].read_text(encoding="utf-8"))
    assert flags == ["at its bound", "moved"]  # Only joint2's viscous coefficient moved by over two deviations.


def test_verdicts_without_a_name(reports: dict[str, Path]) -> None:
    quiet, unknown = read(reports["adequate"]).text, read(reports["unknown_effect"]).text
    assert "What would have been seen" in quiet
    assert quiet.count("Limits of detection") == 1
    assert "Bursts at 7.5 Hz" in unknown
    for text in (quiet, unknown):
        assert "What is missing" not in text
        assert "model after" not in text


@pytest.mark.parametrize(
    ("verdict", "scheme"),
    [("missing_physics", "light"), ("missing_physics", "dark"), ("adequate", "light"), ("unknown_effect", "dark")],
)
def test_opens_in_a_browser(browser: Browser, reports: dict[str, Path], verdict: str, scheme) -> None:
    with opened(browser, reports[verdict], scheme, (1200, 3200)) as page:
        assert " ".join(page.locator("h1,h1+p").all_inner_texts()) == unbroken(VERDICTS[verdict]().sentence)
        shown = np.rint(pixels(page) * 255).astype(np.uint8)
    assert shown.shape == (3200, 1200, 3)
    assert (shown[5, 5].max() < 40) if scheme == "dark" else (shown[5, 5].min() > 240)
    colour = (0xD5, 0x5E, 0x00) if verdict == "missing_physics" else (0x00, 0x72, 0xB2)
    assert np.sum(np.all(shown == colour, axis=-1)) > 500  # The lines of the figures: the pictures did load.
    assert (np.mean(np.all(shown == 255, axis=-1)) < 0.01) == (scheme == "dark")  # Plates are as dark as the page.


def test_the_plot_zooms_and_takes_others_of_its_recording_along(browser: Browser, reports: dict[str, Path]) -> None:
    """Drawn by Bokeh where a reader asks; all plots of a recording show the same stretch; the picture comes back."""
    with opened(browser, reports["missing_physics"], "dark", (1400, 1000)) as page:
        buttons = page.locator(".zoom-button:visible")
        whole = page.evaluate("document.documentElement.scrollWidth")
        for k in (0, 2):  # the answer's, and another of the same held-out recording
            buttons.nth(k).click()
            page.locator("[data-ready]").nth(k // 2).wait_for()
        ranges = "[...Bokeh.documents].map(d => [...d.roots()[0].references()].find(m => m.tags?.[0] === 'time'))"
        assert page.evaluate(f"{ranges}.map(r => r.tags[1])") == ["pick_and_place.csv"] * 2
        page.evaluate(f"{ranges}[0].setv({{start: 10, end: 12}})")
        assert page.evaluate(f"{ranges}.map(r => [r.start, r.end])") == [[10, 12]] * 2
        paper = page.evaluate(
            "[...Bokeh.documents[0].roots()[0].references()].find(m => m.tags?.[0] === 'zoom').background_fill_color"
        )
        assert paper == "#14181c"
        assert page.evaluate("document.documentElement.scrollWidth") == whole
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [x["id"] for x in found if x["impact"] in ("serious", "critical")] == []
        buttons.nth(0).click()
        assert page.locator(".plot img").first.is_visible()


def test_on_a_phone_plots_are_whole(browser: Browser, reports: dict[str, Path]) -> None:
    with opened(browser, reports["missing_physics"], size=(390, 844)) as page:
        page.locator(".plate").first.scroll_into_view_if_needed()
        page.locator("[data-ready]").first.wait_for()
        cut = "[...document.querySelectorAll('.plate')].filter(x => x.scrollWidth > x.clientWidth + 1).length"
        assert page.evaluate(cut) == 0
        assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_the_answer_is_the_first_printed_sheet(browser: Browser, reports: dict[str, Path]) -> None:
    """A4 less its margins at 96 dots an inch: what stands up to the end of the answer fits on it."""
    with opened(browser, reports["missing_physics"], size=(680, 1010)) as page:
        page.emulate_media(media="print")
        assert page.evaluate("document.querySelector('#answer').getBoundingClientRect().bottom + scrollY") < 1010


def test_a_report_is_few_sheets(browser: Browser, reports: dict[str, Path]) -> None:
    """Six joints: twice as many before what is folded was left out, and pictures were cut to size."""
    with opened(browser, reports["missing_physics"]) as page:
        sheets = page.pdf(format="A4", prefer_css_page_size=True).count(b"/Type /Page\n")
        assert 2 <= sheets <= 8


def test_on_a_phone_the_legend_is_whole(browser: Browser, reports: dict[str, Path]) -> None:
    with opened(browser, reports["missing_physics"], size=(390, 844)) as page:
        page.locator(".plate").first.scroll_into_view_if_needed()
        page.locator("[data-ready]").first.wait_for()
        page.wait_for_timeout(300)
        fits = page.evaluate("""() => {
          const views = [];
          const walk = view => { views.push(view); for (const child of view.children?.() ?? []) walk(child); };
          for (const root of Object.values(Bokeh.index).concat(...(Bokeh.index.roots ?? []))) walk(root);
          return views.filter(x => x.model?.type === "Legend").map(x => [x.bbox.right, x.parent.bbox.right]);
        }""")
        assert fits
        assert all(own <= plot for own, plot in fits)
