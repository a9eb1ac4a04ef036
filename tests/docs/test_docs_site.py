"""The built pages: no warning, no dead link, nothing fetched from elsewhere, every page reached from the menu."""

import os
import re
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from urllib.parse import unquote

import pytest
from documentation import DOCS, EXTRAS, IMPORTED_AS, ROOT, read

PACKAGE = ("cosim", "fmu", "identification", "models", "recordings", "report", "studies", "tolerance")

SERIOUS = ("serious", "critical")


class Page(HTMLParser):
    """Where a page's links lead, what it loads, and its anchors."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], set()
        self.feed(read(path))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag in ("script", "img", "iframe", "source") and given.get("src"):
            self.loaded.append(given["src"])
        if tag == "link" and given.get("rel") != "canonical" and given.get("href"):
            self.loaded.append(given["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The pages, built as ``make docs`` builds them: every warning is an error."""
    pytest.importorskip("sphinx", reason="no Sphinx: pip install '.[dev]'")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E", "-d", out / "tree", DOCS, out / "html"]
    ran = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
    assert ran.returncode == 0, ran.stderr
    return {
        path.relative_to(out / "html").as_posix(): Page(path) for path in (out / "html").rglob("*.html")
    }, out / "html"


def test_every_page_is_built_and_in_the_menu(site):
    pages, _ = site
    for source in [*DOCS.glob("*.md"), *DOCS.glob("*.ipynb")]:
        assert f"{source.stem}.html" in pages
        assert source.stem == "index" or f"{source.stem}.html" in pages["index.html"].links


def test_every_link_inside_the_site_leads_somewhere(site):
    pages, folder = site
    followed = 0
    for name, page in pages.items():
        for link in page.links:
            path, _, anchor = link.partition("#")
            if re.match(r"[a-z]+:", link) or path.startswith("_sources"):
                continue
            place = (folder / name).parent / unquote(path) if path else folder / name
            assert place.is_file(), f"{name}: {link}"
            inside = pages.get(place.resolve().relative_to(folder.resolve()).as_posix())
            assert not anchor or inside is None or unquote(anchor) in inside.anchors, f"{name}: {link}"
            followed += 1
    assert followed > 500


def test_pages_are_no_wider_than_the_screen(site, browser):
    """What is too wide scrolls in a box of its own, and on a large screen nothing does."""
    pages, folder = site
    window = browser.new_page()
    boxes = """[...document.querySelectorAll("article *")]
        .filter(x => ["auto", "scroll"].includes(getComputedStyle(x).overflowX) && x.scrollWidth > x.clientWidth + 2)
        .map(x => x.outerHTML.slice(0, 80))"""
    for name in pages:
        window.goto((folder / name).as_uri())
        for width in (390, 1400):
            window.set_viewport_size({"width": width, "height": 900})
            assert window.evaluate("document.documentElement.scrollWidth") <= width, name
        assert window.evaluate(boxes) == [], name
    window.close()


def test_no_table_of_effects_has_narrow_columns(site, browser):
    _, folder = site
    window = browser.new_page(viewport={"width": 1400, "height": 900})
    window.goto((folder / "effects.html").as_uri())
    widths = window.evaluate("""[...document.querySelectorAll("article td")]
        .filter(x => x.innerText.length > 60).map(x => x.clientWidth)""")
    assert len(widths) > 100
    assert min(widths) >= 200
    window.close()


LOOKS = [("light", 1400), ("dark", 390), ("dark", 1400), ("light", 390)]
KINDS = ("index", "own-robot", "effects", "python", "notebook-arm", "study-emps", "search")
"""One page of each kind, which is looked at in every way; each of the others in one."""


@pytest.mark.slow
@pytest.mark.parametrize("look", LOOKS, ids=lambda look: f"{look[0]}-{look[1]}")
def test_axe_finds_nothing_serious(site, browser, look):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="no axe: pip install '.[dev]'").Axe()
    pages, folder = site
    names = sorted(pages)
    mine = [n for i, n in enumerate(names) if LOOKS[i % len(LOOKS)] == look or n.removesuffix(".html") in KINDS]
    window = browser.new_page(color_scheme=look[0], viewport={"width": look[1], "height": 900})
    for name in mine:
        window.goto((folder / name).as_uri())
        window.evaluate("document.querySelectorAll('details').forEach(x => x.open = true)")
        found = axe.run(window, options={"resultTypes": ["violations"], "iframes": False}).response["violations"]
        serious = [(x["id"], node["html"]) for x in found for node in x["nodes"] if x["impact"] in SERIOUS]
        assert serious == [], name
    window.close()
    assert len(mine) > 12


def test_nothing_is_fetched_from_elsewhere(site):
    pages, folder = site
    for name, page in pages.items():
        for source in page.loaded:
            assert not re.match(r"(https?:)?//", source), f"{name} loads {source}"
    for style in folder.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*['\"]?(https?:)?//", read(style)), style.name
    for script in folder.rglob("*.js"):
        text = read(script)
        assert not re.search(r"(fetch|importScripts|\.src\s*=)\s*\(?\s*['\"`](https?:)?//", text), script.name


@pytest.mark.slow
def test_broken_links_fail_the_build(tmp_path):
    """What the build is trusted with, tried on a page of two links."""
    pytest.importorskip("sphinx", reason="no Sphinx: pip install '.[dev]'")
    shown = read(DOCS / "conf.py")
    (tmp_path / "conf.py").write_text(shown, encoding="utf-8")
    (tmp_path / "_static").mkdir()
    broken = ("#b", "no.md", "no.md#a", "../no.toml")
    for links, good in ((("#a", "conf.py"), True), (broken, False)):
        (tmp_path / "index.md").write_text("# A\n\n" + "\n".join(f"[here]({link})" for link in links) + "\n")
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E", "-b", "dummy"]
        ran = subprocess.run([*command, tmp_path, tmp_path / "out"], capture_output=True, text=True)
        assert (ran.returncode == 0) == good, ran.stderr
    assert ran.stderr.count("[myst.xref_missing]") == len(broken), ran.stderr


def requirements(group):
    """Packages that are asked for to run, extras among them, or to develop."""
    given = tomllib.loads(read(ROOT / "pyproject.toml"))["project"]
    more = given["optional-dependencies"]
    listed = [*given["dependencies"], *(line for extra in EXTRAS for line in more[extra])]
    names = {re.split(r"[<>=\[; ]", line)[0] for line in (listed if group == "run" else more["dev"])}
    return names - {"snarelab"}


def test_every_dependency_has_its_reason():
    page = read(DOCS / "developing.md")
    run, develop = page.split("### To develop")
    for group, text in (("run", run.split("### To run")[1]), ("dev", develop)):
        listed = {
            name for row in re.findall(r"^\| (`.*?) \|", text, re.MULTILINE) for name in re.findall(r"`(.*?)`", row)
        }
        assert requirements(group) <= listed, f"no reason given in docs/developing.md: {requirements(group) - listed}"


def test_every_dependency_to_run_is_imported():
    files = [*ROOT.glob("*.py"), *(path for folder in PACKAGE for path in (ROOT / folder).rglob("*.py"))]
    code = "\n".join(map(read, files))
    imported = set(re.findall(r"^\s*(?:import|from) (\w+)", code, re.MULTILINE))
    imported |= {"distributed"} if "from dask.distributed import" in code else set()
    unused = {name for name in requirements("run") if IMPORTED_AS.get(name, name.replace("-", "_")) not in imported}
    assert not unused, f"nothing in the package imports {unused}: take them out of pyproject.toml"
