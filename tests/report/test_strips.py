"""What is kept of a picture's axes over time, and a study page that zooms by it."""

from pathlib import Path

import numpy as np
import pytest
from browser import opened
from matplotlib.figure import Figure
from playwright.sync_api import Browser
from study_pages import QUANTITIES, TIMES, moving

from snarelab.report.drawing import AFTER, BEFORE, MEASURED, drawing, line, svg
from snarelab.report.time_axes import over_time
from snarelab.studies.page import Picture, Section, write_page

LONG = np.linspace(0.0, 20.0, 20001)


def picture(change=lambda axes: None):
    """Two strips of two recordings, the first with a level and a window; ``change`` is made to the second."""
    with drawing():
        figure = Figure(figsize=(6, 3))
        upper, lower = figure.subplots(2)
        line(upper, LONG, np.sin(LONG), MEASURED, label="measured")
        line(upper, LONG, 0.9 * np.sin(LONG), AFTER, label="model")
        upper.axhline(0.5, color=BEFORE, label="published")
        upper.axvspan(3.0, 4.0)
        upper.set_xlim(0, 20)
        upper.set_title("torque, run A")
        upper.set_ylabel("torque [N·m]")
        over_time(upper, "A")
        line(lower, LONG, np.cos(LONG), AFTER)
        over_time(lower, "B")
        change(lower)
        return svg(figure)


def test_every_sample_of_every_line_is_kept_with_its_words_and_colours():
    upper, lower = picture().strips
    assert (upper.title, upper.recording, lower.title, lower.recording) == ("torque, run A: torque [N·m]", "A", "", "B")
    assert [(c.label, c.colour) for c in upper.curves] == [
        ("measured", "ink"),
        ("model", AFTER.lower()),
        ("published", BEFORE.lower()),
    ]
    assert np.array_equal(upper.curves[0].values, np.sin(LONG))  # not what was thinned to be drawn
    assert (upper.curves[2].time.tolist(), upper.curves[2].values.tolist()) == ([0, 20], [0.5, 0.5])
    assert upper.windows == [(3.0, 4.0)]


@pytest.mark.parametrize(
    "change",
    [
        lambda axes: axes.fill_between(LONG, -1, 1),
        lambda axes: axes.annotate("here", (1, 1)),
        lambda axes: axes.axvline(2.0),
        lambda axes: axes.set_yscale("log"),
        lambda axes: axes.set_label(""),  # not over time
    ],
)
def test_a_picture_that_holds_more_than_lines_over_time_is_not_drawn_again(change):
    assert picture(change).strips == ()


@pytest.mark.parametrize(("scheme", "paper"), [("light", "#fff"), ("dark", "#14181c")])
def test_a_study_page_zooms_each_recording_by_itself(browser: Browser, tmp_path: Path, monkeypatch, scheme, paper):
    monkeypatch.chdir(tmp_path)
    with drawing():
        figure = Figure(figsize=(6, 2))
        line(figure.subplots(), TIMES, np.sin(TIMES), AFTER)
        own = svg(figure)
    shown = [Picture(own, "Motion over time", "It moves."), Picture(picture(), "Torque over time", "Two runs.")]
    sections = [Section("Motion", [], shown)]
    path = write_page("demo", "Test", "It moves.", QUANTITIES, sections, moving().html(1.0)).resolve()
    assert path.stat().st_size < 3e6
    with opened(browser, path, scheme, (1400, 1000)) as page:
        assert page.locator(".zoom-button:visible").count() == 2
        page.locator(".zoom-button").nth(1).click()
        page.locator("[data-ready]").wait_for()
        models = "[...[...Bokeh.documents][0].roots()[0].references()]"
        ranges = page.evaluate(f"{models}.filter(m => m.tags?.[0] === 'time').map(r => [r.tags[1], r.start, r.end])")
        assert sorted(ranges) == [["A", 0, 20], ["B", 0, 20]]
        assert page.evaluate(f"{models}.find(m => m.tags?.[0] === 'zoom').background_fill_color") == paper
        text = page.locator("#origin").inner_text()
    assert "make study-demo" in text
    assert "snarelab 0." in text
