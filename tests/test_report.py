"""The report in the browser and in the parser; the diagnoses are invented, as input for the rendering only."""

import base64
import re
import shutil
import subprocess
import time
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from matplotlib.image import imread

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

JOINTS = range(1, 7)
RECORDING = {"train": "excitation_a.csv", "holdout": "pick_and_place.csv"}
SECTIONS = ["missing", "where", "unseen", "steps", "shape", "candidates", "parameters", "notes"]


@cache
def traces(missing: bool) -> tuple[Trace, ...]:
    """Six joints, 60 s at 200 Hz; joints 2 and 5 rub, joint 3 is on a soft spring, the rest is coloured noise."""
    random = np.random.default_rng(7)
    t = np.arange(12_000) / 200
    result = []
    roles: tuple[Literal["train", "holdout"], ...] = ("train", "holdout")
    for role in roles:
        for joint in JOINTS:
            a, f = 0.3 + 0.1 * joint, 0.05 + 0.013 * joint
            q = a * np.sin(2 * np.pi * f * t) + 0.2 * np.sin(2 * np.pi * 0.31 * t + joint)
            qd = np.gradient(q, t)
            qdd = np.gradient(qd, t)
            model = 60 / joint * np.cos(q) + 9 / joint * qdd + 4 * qd
            noise = np.convolve(random.normal(size=t.size + 20), np.hanning(21) / 10.5, "valid") * 0.8 / joint
            extra = np.zeros_like(t)
            if missing and joint in (2, 5):
                extra = 14 / joint * np.tanh(qd / 0.01) + 5 / joint * np.tanh(qd / 0.01) * np.exp(-((qd / 0.1) ** 2))
            if missing and joint == 3:
                extra = 9 * np.exp(-t / 20) * np.sin(2 * np.pi * 7.5 * t) * (np.abs(qdd) > 0.5)
            measured = model + extra + noise
            if joint == 4:
                measured[5000:5600] = np.nan
            result.append(
                Trace(
                    RECORDING[role], role, f"tau.joint{joint}", "N*m", t, q, qd, measured, model, model + 0.95 * extra
                )
            )
    return tuple(result)


def misfit(trace: Trace) -> Misfit:
    scale = np.sqrt(np.nanmean(trace.measured**2))
    before, after = (float(np.sqrt(np.nanmean((trace.measured - m) ** 2))) for m in (trace.before, trace.after))
    return Misfit(before, after, before / scale, after / scale)


def fits(kept: tuple[Trace, ...]) -> tuple[ChannelFit, ...]:
    return tuple(
        ChannelFit(a.channel, a.unit, misfit(a), misfit(b), 0.9 * misfit(a).rms_after)
        for a, b in zip(kept[:6], kept[6:], strict=True)
    )


def candidates(named: tuple[tuple[str, str], ...]) -> tuple[Candidate, ...]:
    names = ["coulomb_friction", "stribeck_friction", "position_dependent_friction", "joint_elasticity", "sensor_bias"]
    pairs = [(name, f"joint{joint}") for name in names for joint in JOINTS]
    shares = np.geomspace(0.41, 0.0001, len(pairs))
    pairs.sort(key=lambda pair: (pair not in named, pair[1][::-1]))
    return tuple(
        Candidate(n, at, float(s), 900 * float(s), (n, at) in named) for (n, at), s in zip(pairs, shares, strict=True)
    )


def missing_physics() -> Diagnosis:
    kept = traces(True)
    findings = (
        Finding(
            "coulomb_friction",
            "joint2",
            1.0,
            0.994,
            {"level": Estimate(7.0123, 0.0432, "N*m")},
            "Torque steps by 14 N·m wherever joint2 turns round, whatever its speed and position.",
            (),
        ),
        Finding(
            "stribeck_friction",
            "joint5",
            0.9,
            0.87,
            {
                "level": Estimate(2.81, 0.061, "N*m"),
                "excess": Estimate(1.04, 0.17, "N*m"),
                "stribeck_speed": Estimate(0.1, 0.0123, "rad/s", at_bound=True),
            },
            "Friction falls from 3.8 to 2.8 N·m as joint5 gains speed, on both recordings alike.",
            (
                Rival("load_dependent_friction", "joint5", 0.08, False, "repeat the slow part of the motion with 5 kg"),
                Rival("coulomb_friction", "joint5", 0.03, True, ""),
            ),
        ),
        Finding(
            "joint_elasticity",
            "joint3",
            0.75,
            0.71,
            {"stiffness": Estimate(5423.0, 61.0, "N*m/rad"), "damping": Estimate(3.2e-5, 4e-6, "N*m*s/rad")},
            "joint3 rings at 7.5 Hz after each acceleration, and the ringing dies out as a spring's would.",
            (Rival("backlash", "joint3", 0.22, True, "reverse joint3 slowly under constant load"),),
        ),
    )
    return Diagnosis(
        verdict="missing_physics",
        sentence="The model leaves out Coulomb friction at joint2 (7.01 ± 0.04 N·m), Stribeck friction at joint5 and "
        "elasticity at joint3; with them the misfit on data never seen falls from 8.9 % to 1.6 %.",
        description="",
        model="arm6",
        effects=findings,
        location=(
            Location(
                "tau.joint2", 0.62, ((0.0, 4.2), (11.8, 13.0), (30.1, 42.4)), "|qd.joint2| < 0.05 rad/s, reversing"
            ),
            Location("tau.joint2", 0.05, ((50.0, 52.0),), "temp.joint2 > 40 °C"),
            Location("tau.joint3", 0.21, ((3.0, 9.5),), "|qdd.joint3| > 0.5 rad/s²"),
            Location("tau.joint5", 0.09, tuple((5.0 * i, 5.0 * i + 1) for i in range(12)), "qd.joint5 changing sign"),
        ),
        fit=fits(kept),
        steps=(
            Step("baseline: viscous_friction on every joint", 0.0873, 0.0891),
            Step("+ coulomb_friction at joint2", 0.0412, 0.0433),
            Step("+ stribeck_friction at joint5", 0.0291, 0.0302),
            Step("+ joint_elasticity at joint3", 0.0154, 0.0161),
        ),
        candidates=candidates(tuple((f.name, f.at) for f in findings)),
        moved=(
            Moved("viscous_friction.joint2.coefficient", "N*m*s/rad", 19.34, 4.021, 0.034),
            Moved("viscous_friction.joint5.coefficient", "N*m*s/rad", 4.05, 4.01, 0.06),
            Moved("inertia.link3.mass", "kg", 3.1234, 3.1239, 0.0021),
        ),
        traces=kept,
        limits=tuple(Limit("coulomb_friction", f"joint{j}", "level", 0.04 * j, "N*m") for j in JOINTS),
        notes=(
            "Condition number 310: every parameter is excited.",
            "joint6 turns by less than 40°: a spring and an imbalance there would look alike.",
        ),
        band=20.0,
    )


def adequate() -> Diagnosis:
    kept = traces(False)
    return replace(
        missing_physics(),
        verdict="adequate",
        sentence="Nothing is left out that these recordings can show: the misfit on data never seen is 1.6 %.",
        effects=(),
        location=(),
        fit=fits(kept),
        steps=(Step("baseline", 0.0154, 0.0161),),
        candidates=candidates(()),
        moved=(),
        traces=kept,
    )


def unknown_effect() -> Diagnosis:
    known = missing_physics()
    kept = tuple(replace(trace, after=trace.before) for trace in known.traces)
    return replace(
        known,
        verdict="unknown_effect",
        sentence="Something is left out at joint3 that no name in the vocabulary explains.",
        description="Bursts at 7.5 Hz, 9 N·m at first, after accelerations above 0.5 rad/s².",
        effects=(),
        location=known.location[2:3],
        fit=fits(kept),
        steps=known.steps[:1],
        candidates=candidates(()),
        moved=(),
        traces=kept,
    )


VERDICTS = {"missing_physics": missing_physics, "adequate": adequate, "unknown_effect": unknown_effect}


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("reports")
    begin = time.process_time()
    for verdict, make in VERDICTS.items():
        write_report(make(), folder / f"{verdict}.html")
    assert time.process_time() - begin < 30  # About 2 s each on one free core; only against a slip by an order.
    return {verdict: folder / f"{verdict}.html" for verdict in VERDICTS}


class Page(HTMLParser):
    """Elements with their attributes, the text, and whether every element that opens is closed."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self, markup: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(markup)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def read(path: Path) -> Page:
    return Page(path.read_text(encoding="utf-8"))


def pictures(page: Page) -> list[str]:
    return [base64.b64decode((image["src"] or "").split(",", 1)[1]).decode() for image in page.all("img")]


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
    assert page.text.index(diagnosis.sentence) < page.text.index("pick_and_place.csv") < page.text.index("Where")
    assert all(note in page.text for note in diagnosis.notes)
    assert all(image["alt"] for image in page.all("img"))
    assert len(page.all("table")) == len(page.all("caption"))
    assert all(head.get("scope") in ("col", "row") for head in page.all("th"))
    assert "nan" not in page.text


@pytest.mark.parametrize("verdict", VERDICTS)
def test_needs_nothing_from_elsewhere(reports: dict[str, Path], verdict: str) -> None:
    page = read(reports[verdict])
    assert page.all("script") == []
    for _, attributes in page.elements:
        for name in ("src", "href", "srcset", "data", "action", "poster"):
            assert (attributes.get(name) or "#").startswith(("#", "data:"))
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


BROWSER = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")
FLAGS = """--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
--disable-component-update --disable-sync --hide-scrollbars --enable-logging=stderr --window-size=1200,3200"""


@pytest.mark.skipif(BROWSER is None, reason="neither chromium nor google-chrome is installed")
@pytest.mark.parametrize(
    ("verdict", "dark"), [("missing_physics", 0), ("missing_physics", 1), ("adequate", 0), ("unknown_effect", 1)]
)
def test_opens_in_a_browser(tmp_path: Path, reports: dict[str, Path], verdict: str, dark: int) -> None:
    shot = tmp_path / "shot.png"
    command = [
        BROWSER or "",
        *FLAGS.split(),
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--blink-settings=preferredColorScheme={1 - dark}",
        f"--screenshot={shot}",
        "--dump-dom",
        reports[verdict].as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "CONSOLE" not in done.stderr
    assert VERDICTS[verdict]().sentence in done.stdout

    pixels = np.rint(imread(shot)[..., :3] * 255).astype(np.uint8)
    assert pixels.shape == (3200, 1200, 3)
    assert (pixels[5, 5].max() < 40) if dark else (pixels[5, 5].min() > 240)
    drawn = (0xD5, 0x5E, 0x00) if verdict == "missing_physics" else (0x00, 0x72, 0xB2)
    assert np.sum(np.all(pixels == drawn, axis=-1)) > 500  # The lines of the figures: the pictures did load.
    assert np.mean(np.all(pixels == 255, axis=-1)) > 0.15  # Their white plates, on dark paper too.
