"""The report from awkward diagnoses: text that looks like markup, next to no data, a folder that is not there."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest

from snarelab.errors import InputError
from snarelab.identification.diagnosis import (
    Candidate,
    ChannelFit,
    Diagnosis,
    Estimate,
    Finding,
    Limit,
    Location,
    Misfit,
    Moved,
    Rival,
    Step,
    Trace,
)
from snarelab.identification.report.page import write_report

HOSTILE = '<script>alert("1")</script> & $x_1$ \'臂'


def spelt(text: str) -> Diagnosis:
    """A small diagnosis in which every text is the same."""
    t = np.arange(400) / 100
    speed = np.cos(t)
    misfit = Misfit(1.0, 0.1, 0.5, 0.05)
    traces = [
        Trace(text, role, text, text, t, np.sin(t), speed, np.sign(speed), 0 * t, np.tanh(9 * speed))
        for role in ("train", "holdout")
    ]
    rival = Rival(text, text, 0.1, False, text)
    return Diagnosis(
        verdict="missing_physics",
        sentence=text,
        description=text,
        model=text,
        effects=(Finding(text, text, 0.95, 0.9, {text: Estimate(1.0, 0.1, text)}, text, (rival,)),),
        location=(Location(text, 0.5, ((1.0, 2.0),), text),),
        fit=(ChannelFit(text, text, misfit, misfit, 0.1),),
        steps=(Step(text, 0.5, 0.5), Step(text, 0.05, 0.05)),
        candidates=(Candidate(text, text, 0.4, 1.0, True),),
        moved=(Moved(text, text, 1.0, 2.0, 0.1),),
        traces=tuple(traces),
        limits=(Limit(text, text, text, 0.1, text),),
        notes=(text,),
        band=20.0,
    )


class Text(HTMLParser):
    """The elements' names, and the text as read."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def pictures(path: Path) -> list[bytes]:
    found = re.findall(r'src="data:image/svg\+xml;base64,([^"]*)"', path.read_text(encoding="utf-8"))
    return [base64.b64decode(data) for data in found]


def test_text_from_outside_stays_text(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_report(spelt(HOSTILE), path)
    page = Text(path)
    assert "script" not in page.tags
    # Effects, parameters and rivals are put in words, which takes the underscore out.
    assert page.text.count(HOSTILE) + page.text.count(HOSTILE.replace("_", " ")) > 25
    assert len(pictures(path)) == 5
    for picture in pictures(path):
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
    page = Text(tmp_path / "report.html")
    assert page.tags.count("img") == 2
    assert page.tags.count("section") == 8
    assert "No channel has a position or speed to draw against" in page.text
    assert "nan" not in page.text


def test_the_users_plot_settings_neither_show_nor_change(tmp_path: Path) -> None:
    with mpl.rc_context({"axes.facecolor": "#123456", "text.usetex": True, "svg.fonttype": "path"}):
        settings = dict(mpl.rcParams)
        write_report(spelt("arm"), tmp_path / "report.html")
        assert dict(mpl.rcParams) == settings
    assert not any(b"#123456" in picture for picture in pictures(tmp_path / "report.html"))


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent.*does not exist"):
        write_report(spelt("arm"), tmp_path / "absent" / "report.html")
    (tmp_path / "taken").mkdir()
    with pytest.raises(InputError, match=r"taken: cannot be written"):
        write_report(spelt("arm"), tmp_path / "taken")
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]
