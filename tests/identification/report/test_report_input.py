"""The report from awkward diagnoses: text that looks like markup, next to no data, a folder that is not there."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from diagnoses import spelt
from pages import pictures, read

from snarelab.errors import InputError
from snarelab.identification.diagnosis import Trace
from snarelab.identification.report.page import write_report

HOSTILE = '<script>alert("1")</script> & $x_1$ \'臂'


def test_text_from_outside_stays_text(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_report(spelt(HOSTILE), path)
    page = read(path)
    kinds = [script.get("class") or script.get("id") for script in page.all("script")]
    assert {*kinds[:-2]} == {"zoom"}
    assert kinds[-2:] == ["plotting", None]  # the page's own
    # Effects, parameters and rivals are put in words, which takes the underscore out.
    assert page.text.count(HOSTILE) + page.text.count(HOSTILE.replace("_", " ")) > 25
    assert len(pictures(page)) == 5
    for picture in pictures(page):
        tree = ElementTree.fromstring(picture)
        assert not any(element.tag.endswith("script") for element in tree.iter())
        assert "$x" in "".join(tree.itertext())


def test_draws_what_little_there_is(tmp_path: Path) -> None:
    still, nothing = np.zeros(50), np.full(50, np.nan)
    trace = Trace("a.csv", "holdout", "force", "N", np.arange(50.0), still, nothing, still, still, still)
    bare = replace(
        spelt("quiet"),
        verdict="adequate",
        effects=(),
        location=(),
        fit=(),
        steps=(),
        candidates=(),
        moved=(),
        traces=(trace, replace(trace, channel="empty", measured=nothing)),
        limits=(),
        notes=(),
    )
    write_report(bare, tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    assert len(page.all("img")) == 2
    assert len(page.all("section")) == 9
    assert "No channel has a position or speed to draw against" in page.text
    assert "nan" not in page.text


def test_the_users_plot_settings_neither_show_nor_change(tmp_path: Path) -> None:
    with mpl.rc_context({"axes.facecolor": "#123456", "text.usetex": True, "svg.fonttype": "path"}):
        settings = dict(mpl.rcParams)
        write_report(spelt("arm"), tmp_path / "report.html")
        assert dict(mpl.rcParams) == settings
    assert not any("#123456" in picture for picture in pictures(read(tmp_path / "report.html")))


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent.*does not exist"):
        write_report(spelt("arm"), tmp_path / "absent" / "report.html")
    (tmp_path / "taken").mkdir()
    with pytest.raises(InputError, match=r"taken: cannot be written"):
        write_report(spelt("arm"), tmp_path / "taken")
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]
