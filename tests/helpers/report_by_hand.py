"""Small invented diagnoses for a report's sections, and what stands in a section's tables."""

import re
from dataclasses import replace
from html import unescape
from typing import Any

import numpy as np
from diagnoses import spelt

from snarelab.identification.diagnosis import Trace

T = np.arange(200) / 100
WAVE = np.where(np.arange(200) % 2, 1.0, -1.0)
"""Its RMS is one."""


def diagnosis(**changes):
    """One where nothing is said but what a test is about."""
    empty = {"effects": (), "location": (), "fit": (), "steps": (), "candidates": (), "moved": (), "traces": ()}
    return replace(spelt("x"), **({**empty, "limits": (), "notes": (), "description": ""} | changes))


def trace(channel, before, after, role: Any = "holdout", measured=4.0, recording="b.csv"):
    """A channel whose residual has these RMS before and after; its measurement's RMS is 4."""
    reading = measured * WAVE
    return Trace(recording, role, channel, "N*m", T, T, T, reading, reading - before * WAVE, reading - after * WAVE)


def rows(content):
    """Cells of the body's rows, as text."""
    body = "".join(re.findall(r"<tbody>(.*?)</tbody>", content, re.S))
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.S) for row in re.findall(r"<tr>(.*?)</tr>", body, re.S)]
    return [[unescape(re.sub(r"<[^>]*>", "", cell)) for cell in row] for row in cells]


def heads(content):
    return [unescape(x) for x in re.findall(r'scope="col"[^>]*>([^<]*)', content)]
