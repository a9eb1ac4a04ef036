"""Pages in a headless Chromium; whatever they say on its console or ask of the network is an error."""

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from matplotlib.image import imread
from playwright.sync_api import Browser, Frame, Page, sync_playwright

PROGRAM = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")
# A machine for tests has no graphics card: WebGL is drawn by the processor, and a page itself without WebGL's detour.
FLAGS = """--no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --disable-gpu-compositing
--disable-gpu-rasterization --disable-quic --no-first-run --disable-background-networking --disable-component-update
--disable-sync --hide-scrollbars"""


@contextmanager
def started() -> Iterator[Browser]:
    """A browser; the test is skipped where none is installed."""
    if PROGRAM is None:
        pytest.skip("neither chromium nor google-chrome is installed")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=PROGRAM, args=FLAGS.split())
        yield browser
        browser.close()


@contextmanager
def opened(
    browser: Browser,
    path: Path,
    scheme: Literal["light", "dark"] = "light",
    size: tuple[int, int] = (1200, 900),
    scripts: bool = True,
    first: str = "",
) -> Iterator[Page]:
    """A file in a window of its own, `first` run before its scripts. At the end nothing may have been said or asked."""
    context = browser.new_context(
        color_scheme=scheme, viewport={"width": size[0], "height": size[1]}, java_script_enabled=scripts, offline=True
    )
    page, said, asked = context.new_page(), [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.add_init_script(first)
    page.goto(path.resolve().as_uri())
    yield page
    context.close()
    assert [text for text in said if "GL Driver Message" not in text] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def pixels(page: Page) -> np.ndarray:
    """What the window shows, (height, width, 3), 0 to 1."""
    return imread(io.BytesIO(page.screenshot()))[..., :3]


def playing(page: Page) -> Frame:
    """A study page's playback, scrolled to, unpacked and drawn."""
    shown = page.locator("#playback-frame")
    shown.scroll_into_view_if_needed()
    shown.content_frame.locator("body").wait_for()
    frame = shown.element_handle().content_frame()  # of the element in this page: what it shows may still change
    assert frame is not None
    frame.wait_for_load_state()
    drawn(frame)
    return frame


def drawn(playback: Frame | None) -> None:
    """Wait until a playback has been drawn at its time."""
    assert playback is not None
    playback.locator("#bar input:enabled").wait_for()
    playback.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
