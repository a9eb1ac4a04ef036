"""A study's page and its playback, as a reader and a browser see them."""

import io
import json
import re
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from browser import drawn, opened, pixels, playing
from matplotlib.image import imread
from playwright.sync_api import Browser
from pydrake.geometry import Sphere
from study_pages import QUANTITIES, moving, picture

from snarelab.errors import InputError
from snarelab.report.playback import Playback
from snarelab.studies.outcome import Quantity, write_result
from snarelab.studies.page import Section, write_page


def test_page_says_the_finding_first_and_explains_the_kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    section = Section("Motion", ["What <it> shows."], [picture()])
    found = "The pin ends 8 mm & less off. It took 2.5 s. Nothing else moved."
    path = write_page("demo", "Suspended test", found, QUANTITIES, [section])
    assert path == Path("build/studies/demo/report.html")
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    text = path.read_text(encoding="utf-8")
    assert "<h1>The pin ends 8 mm &amp; less off.</h1>\n<p>It took 2.5 s. Nothing else moved.</p>" in text
    assert text.index("<h1>") < text.index("<table>") < text.index("data:image/svg+xml")
    plain = re.sub(r'<span class="said">(.*?)</span>', r"\1", text)  # words may take several lines, numbers not
    rows = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", plain)]
    assert rows[1] == ["first contact", "s", "2.6", "2.57", "2.55 to 2.61", "calibrated"]
    assert rows[2] == ["final radial y", "m", "0.01", "0.00797", "", "predicted"]
    assert rows[3] == ["named", "", "–", "joint_elasticity at joint2, &lt;odd&gt;", "", "reference"]
    assert all(f"<dt>{kind}</dt>" in text for kind in ("calibrated", "predicted", "reference"))
    assert "What &lt;it&gt; shows." in text
    assert not re.findall(r"(?:src|href)=\"?http", text)
    assert "iframe" not in text
    result = write_result("demo", QUANTITIES, 1.0)
    first, *_, named = json.loads(result.read_text())["quantities"]
    assert (first["paper"], named["ours"]) == (2.6, "joint_elasticity at joint2, <odd>")


@pytest.mark.parametrize(
    ("paper", "words"), [(None, "the paper has no number for it."), (0.0027, "it measures something else.")]
)
def test_reference_is_explained_by_what_stands_beside_it(tmp_path, monkeypatch, paper, words):
    monkeypatch.chdir(tmp_path)
    spread = Quantity("mean_spread_y", "m", 0.0031, "reference", paper)
    text = write_page("demo", "Suspended test", "It swings.", [spread]).read_text(encoding="utf-8")
    (said,) = re.findall(r"<dt>reference</dt><dd>(.*?)</dd>", text)
    assert said.endswith(words)
    assert ("no number" in said) is (paper is None)


@pytest.mark.parametrize(
    ("times", "positions", "words"),
    [
        ([0.0, 0.0], np.zeros((2, 3)), "times must increase"),
        ([-1.0, 0.0], np.zeros((2, 3)), "from zero on"),
        ([0.0, 1.0], np.zeros((3, 3)), "2 times need as many values"),
        ([0.0, 1.0], np.zeros((2, 2)), "each of shape"),
        ([0.0, 1.0], [[0, 0, 0], [0, np.nan, 0]], "not finite"),
    ],
)
def test_unusable_motion_is_refused(times: list[float], positions: list[list[float]], words: str) -> None:
    scene = Playback()
    scene.body("ball", Sphere(0.1), "#ff0000")
    with pytest.raises(InputError, match=words):
        scene.move("ball", times, positions)


def test_names_and_curves_are_checked() -> None:
    scene = Playback()
    scene.body("ball", Sphere(0.1), "#ff0000")
    with pytest.raises(InputError, match="'ball' is taken"):
        scene.body("ball", Sphere(0.1), "#ff0000")
    with pytest.raises(InputError, match=r"shape \(1, 1, 3\)"):
        scene.curve("cable", 0.01, [0.0], np.zeros((1, 1, 3)), "#0000ff")


def extent(shown: np.ndarray, channel: int) -> tuple[float, float]:
    """First and last column of the pixels of one pure colour, 0 (left) to 1; NaN where there is none."""
    others = np.delete(shown, channel, axis=2).max(axis=2)
    columns = np.flatnonzero(np.any((shown[..., channel] > 0.35) & (others < 0.25), axis=0)) / shown.shape[1]
    return (columns[0], columns[-1]) if columns.size else (np.nan, np.nan)


def test_playback_shows_each_time_in_a_browser(browser: Browser, tmp_path: Path) -> None:
    scene = moving()
    seen = []
    for start in (1.0, 3.0):
        path = tmp_path / f"{start}.html"
        path.write_text(scene.html(start), encoding="utf-8")
        with opened(browser, path, size=(600, 440)) as page:
            drawn(page.main_frame)
            seen.append(pixels(page)[:398])  # the bar below
    red, blue, green = (extent(seen[0], channel) for channel in (0, 2, 1))
    # Seen along x from behind, +y is to the left. The picture's height spans 75 degrees, at a distance of 0.6 m.
    scale = 398 / 600 / (2 * 0.6 * np.tan(np.radians(37.5)))
    assert np.mean(red) == pytest.approx(0.5 - 0.15 * scale, abs=0.01)  # y = 0.15 at 1 s
    assert blue[0] == pytest.approx(0.5 - 0.1125 * scale, abs=0.01)  # reaches 0.1125 at 1 s, right end at 0
    assert blue[1] == pytest.approx(0.5, abs=0.01)
    assert np.diff(green)[0] == pytest.approx(0.2 * scale, abs=0.012)  # a post of 0.2 m that lies
    assert np.isnan(extent(seen[1], 0)[0])  # hidden from 2 s on
    assert extent(seen[1], 2)[0] == pytest.approx(0.5 - 0.2375 * scale, abs=0.01)


def test_page_unpacks_its_playback_in_a_browser(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_page("demo", "Test", "It moves.", QUANTITIES, [Section("One", (), [picture()])], moving().html(1.0))
    assert path.stat().st_size < 3e6
    with opened(browser, path, size=(1000, 1600)) as page:
        playback = playing(page)
        shown = pixels(page)
        playback.locator("#meshcat-pane").focus()
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        drawn(playback)
        shifted = pixels(page)
    # The view goes right by 20 pixels a key, and what is in it goes left.
    assert extent(shifted[700:], 0)[0] - extent(shown[700:], 0)[0] == pytest.approx(-0.1, abs=0.02)
    assert all(np.isfinite(extent(shown[700:], channel)[0]) for channel in range(3))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_scene_is_as_the_page_and_paper_has_a_light_still(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheme: Literal["light", "dark"]
) -> None:
    """Of the time and the view that were shown last."""
    monkeypatch.chdir(tmp_path)
    path = write_page("demo", "Test", "It moves.", QUANTITIES, [Section("One", (), [picture()])], moving().html(1.0))
    with opened(browser, path, scheme, (680, 1000)) as page:
        playing(page)
        page.wait_for_function("document.getElementById('playback-still')?.naturalWidth > 100")
        other = "light" if scheme == "dark" else "dark"
        for now in (scheme, other):
            page.emulate_media(color_scheme=now)
            drawn(page.locator("#playback-frame").element_handle().content_frame())
            sky = imread(io.BytesIO(page.locator("#playback-frame").screenshot()))[20:-60, 5:25, :3]
            assert sky.max() < 0.3 if now == "dark" else sky.min() > 0.8
        page.emulate_media(color_scheme=scheme, media="print")
        still = page.locator("#playback-still")
        assert still.is_visible()
        assert "at 1.00 s" in page.locator("#playback-said").inner_text()
        still.scroll_into_view_if_needed()
        shown = imread(io.BytesIO(still.screenshot()))[..., :3]
        assert all(np.isfinite(extent(shown, channel)[0]) for channel in range(3))  # red, green and blue are seen
        assert shown[5:-5, 5:25].min() > 0.8


@pytest.mark.parametrize(("width", "beside"), [(1500, True), (1200, False)])
def test_on_a_wide_window_the_playback_stays_beside_the_plots(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: int, beside: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    sections = [Section(name, (), [picture()] * 3) for name in ("One", "Two")]
    path = write_page("demo", "Test", "It moves.", QUANTITIES, sections, moving().html(1.0))
    with opened(browser, path, size=(width, 900)) as page:
        last = page.locator(".plate img").last
        last.scroll_into_view_if_needed()
        frame, plot = page.locator("#playback-frame").bounding_box(), last.bounding_box()
        assert frame is not None
        assert plot is not None
        assert (0 <= frame["y"] <= frame["y"] + frame["height"] <= 900) == beside
        assert (frame["x"] > plot["x"] + plot["width"]) == beside
        assert page.evaluate("document.documentElement.scrollWidth") <= width
