"""One time cursor for a page's plots and its playback; where it belongs is read off a green mark in the pictures."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from browser import opened, playing
from matplotlib.figure import Figure
from matplotlib.image import imread
from playwright.sync_api import Browser, Frame, Locator, Page, expect
from study_pages import QUANTITIES, TIMES, moving

from snarelab.report.drawing import AFTER, drawing, line, svg
from snarelab.report.time_axes import over_time, time_axes
from snarelab.studies.page import Clock, Picture, Section, write_page

MARK = 3.0
"""Where the green mark stands [s]."""

PACKED = """window.IntersectionObserver = class extends IntersectionObserver {
    observe(element) { window.unpack = () => super.observe(element); }
}"""
"""A page in whose view the playback never comes before `unpack()`: once it shows its time, so do the plots."""


def marked(
    start: float, end: float, width: float, recording: str = "", layout: Literal["constrained"] | None = None
) -> Picture:
    """Two panels side by side, the second an eighth as long; the mark is in both."""
    with drawing():
        figure = Figure(figsize=(width, 2), layout=layout)
        for axes, (first, last) in zip(
            figure.subplots(1, 2), ((start, end), (MARK - (end - start) / 16, MARK + (end - start) / 16)), strict=True
        ):
            line(axes, TIMES, np.sin(TIMES), AFTER)
            if recording:
                over_time(axes, recording)
            axes.axvline(MARK, color="#00ff00", linewidth=3)
            axes.set_xlim(first, last)
        return Picture(svg(figure), f"From {start:g} to {end:g} s {recording}", "Marked.")


class Marked:
    """A study page with three plots, the last of another recording, and a playback of 4 s that opens at 1 s."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.plots = page.locator(".plot").all()
        self.marks = [self._marks(plot) for plot in self.plots]
        """Middles of the green marks of each plot, as pixels from its left edge."""
        assert [len(found) for found in self.marks] == [2, 2, 2]

    def _marks(self, plot: Locator) -> list[float]:
        red, green, blue = np.moveaxis(imread(io.BytesIO(plot.screenshot()))[..., :3], -1, 0)
        columns = np.flatnonzero(((green > 0.9) & (red < 0.3) & (blue < 0.3)).sum(axis=0) > 20)
        return [float(part.mean()) + 0.5 for part in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)]

    def lines(self, plot: int) -> list[float]:
        """Middles of the lines seen in a plot, as pixels from its left edge."""
        return self.plots[plot].evaluate("""plot => [...plot.querySelectorAll(".cursor")]
            .map(line => line.getBoundingClientRect()).filter(box => box.width)
            .map(box => box.x + box.width / 2 - plot.getBoundingClientRect().x)""")

    def at_marks(self, *plots: int) -> None:
        """These plots have lines, on their marks; the others have none."""
        for plot, marks in enumerate(self.marks):
            assert self.lines(plot) == (pytest.approx(marks, abs=1.6) if plot in plots else [])

    def playing(self) -> Frame:
        """The playback, unpacked now."""
        self.page.evaluate("unpack()")
        return playing(self.page)

    def point(self, plot: int, panel: int) -> None:
        """Move the pointer onto a mark."""
        self.plots[plot].scroll_into_view_if_needed()
        box = self.plots[plot].bounding_box()
        assert box is not None
        self.page.mouse.move(box["x"] + self.marks[plot][panel], box["y"] + box["height"] / 2)

    def click(self, plot: int, panel: int) -> None:
        """Click on a mark, and go away with the pointer."""
        self.point(plot, panel)
        self.page.mouse.down()
        self.page.mouse.up()
        self.page.mouse.move(0, 0)


@pytest.fixture
def marked_page(browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request) -> Iterator[Marked]:
    monkeypatch.chdir(tmp_path)
    pictures = [marked(0, 4, 9), marked(2, 10, 6, layout="constrained"), marked(0, 4, 9, "another.csv")]
    sections, clock = [Section("One", (), pictures)], getattr(request, "param", Clock())
    path = write_page("demo", "Test", "It moves.", QUANTITIES, sections, moving().html(1.0), clock=clock)
    with opened(browser, path, size=(1000, 500), first=PACKED) as page:
        yield Marked(page)


def test_the_pointer_moves_the_lines_of_its_recording(marked_page: Marked) -> None:
    marked_page.point(0, panel=1)
    marked_page.at_marks(0, 1)
    said = marked_page.page.locator(".cursor:visible span:visible")
    assert [text[:4] for text in said.all_inner_texts()] == ["3.00", "3.00"]
    marked_page.point(2, panel=1)
    marked_page.at_marks(2)
    assert said.inner_text() == "3.000 s, another.csv"
    marked_page.page.mouse.move(0, 0)
    marked_page.at_marks()


def test_keys_move_the_lines(marked_page: Marked) -> None:
    keys = marked_page.page.keyboard
    slider = marked_page.page.get_by_role("slider", name="Time in: From 0 to 4 s", exact=True)
    slider.focus()
    assert slider.get_attribute("aria-valuetext") == "no time chosen"
    for key in ["Home", *["PageUp"] * 14, *["ArrowRight"] * 11, "ArrowLeft"]:
        keys.press(key)
    assert slider.get_attribute("aria-valuetext") == "3.000 s"
    assert float(slider.get_attribute("aria-valuenow") or "nan") == pytest.approx(3.0)
    marked_page.at_marks(0, 1)
    keys.press("Home")
    assert [len(marked_page.lines(plot)) for plot in range(3)] == [1, 0, 0]


PLAYED = "time => Math.abs(document.querySelector('#bar input').value - time) < 0.01"
CLOCKS = pytest.mark.parametrize("marked_page", [Clock(), Clock(start=1.0, rate=2.0)], indirect=True)


@CLOCKS
def test_the_playback_moves_the_lines(marked_page: Marked, request: pytest.FixtureRequest) -> None:
    clock = request.node.callspec.params["marked_page"]
    playback = marked_page.playing()
    said = marked_page.plots[0].locator(".cursor:visible span:visible")
    expect(said).to_have_text(f"{clock.start + clock.rate:.3f} s")
    playback.locator("#bar input").fill(f"{(MARK - clock.start) / clock.rate}")
    expect(said).to_have_text("3.000 s")
    marked_page.at_marks(0, 1)
    playback.locator("#bar button").click()
    text = "parseFloat(document.querySelector('.cursor span').textContent)"
    marked_page.page.wait_for_function(f"{text} > {MARK}")


@CLOCKS
def test_a_click_in_a_plot_moves_the_playback(marked_page: Marked, request: pytest.FixtureRequest) -> None:
    clock = request.node.callspec.params["marked_page"]
    playback = marked_page.playing()
    marked_page.click(1, panel=1)
    marked_page.at_marks(0, 1)
    playback.wait_for_function(PLAYED, arg=(MARK - clock.start) / clock.rate)
    marked_page.page.keyboard.press("Home")  # of the plot clicked in: 2 s, where its axis begins
    playback.wait_for_function(PLAYED, arg=(2.0 - clock.start) / clock.rate)
    marked_page.click(2, panel=1)
    marked_page.page.wait_for_timeout(200)
    assert playback.evaluate(PLAYED, (2.0 - clock.start) / clock.rate)  # it does not show that recording
    assert marked_page.lines(2) == pytest.approx(marked_page.marks[2], abs=1.6)


def test_a_time_chosen_before_the_playback_is_unpacked_is_kept(marked_page: Marked) -> None:
    marked_page.click(0, panel=1)
    assert not marked_page.page.locator("#playback-frame").get_attribute("srcdoc")
    marked_page.playing().wait_for_function(PLAYED, arg=MARK)
    marked_page.at_marks(0, 1)


def test_only_lines_over_time_have_the_attribute() -> None:
    with drawing():
        figure = Figure()
        figure.subplots().plot(TIMES, TIMES)
        assert time_axes(svg(figure)) == ""
    assert "&quot;a &lt;b&gt; \\u00e9&quot;" in time_axes(marked(0, 4, 9, "a <b> é").svg)
