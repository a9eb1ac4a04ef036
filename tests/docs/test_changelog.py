"""The changelog is assembled from fragments, and one version stands everywhere."""

import re
import runpy

import pytest
from documentation import CHANGELOG, DOCS, ROOT, read

import snarelab

BEFORE = "# Changelog\n\nWhat changed.\n\n## [0.1.0] - 2026-11-21\n\n### Added\n\n- All.\n"


@pytest.fixture(scope="module")
def make():
    return runpy.run_path(str(DOCS / "make_changelog.py"))


def tree(folder, **fragments):
    (folder / "changelog.d").mkdir()
    (folder / "changelog.d" / "README.md").write_text("One file a change.\n")
    (folder / "CHANGELOG.md").write_text(BEFORE)
    for name, text in fragments.items():
        (folder / "changelog.d" / f"{name.replace('_', '.')}.md").write_text(text)
    return folder


def test_a_release_is_made_of_its_fragments(make, tmp_path):
    root = tree(tmp_path, b_fixed="A crash.\n", z_added="A law.\nIt has two lines.\n", a_added="A command.\n")
    make["release"](root, "0.2.0", "2026-12-01")
    assert (root / "CHANGELOG.md").read_text() == BEFORE.replace(
        "## [0.1.0]",
        "## [0.2.0] - 2026-12-01\n\n### Added\n\n- A command.\n- A law.\n  It has two lines.\n\n"
        "### Fixed\n\n- A crash.\n\n## [0.1.0]",
    )
    assert [path.name for path in (root / "changelog.d").iterdir()] == ["README.md"]


@pytest.mark.parametrize("name", ["law_new", "law_added_txt", "added"])
def test_a_file_that_is_no_fragment_is_named_and_nothing_written(make, tmp_path, name):
    root = tree(tmp_path, **{name: "A law."})
    with pytest.raises(ValueError, match="is no fragment"):
        make["release"](root, "0.2.0", "2026-12-01")
    assert (root / "CHANGELOG.md").read_text() == BEFORE


def test_an_empty_fragment_is_none_and_a_release_has_one(make, tmp_path):
    root = tree(tmp_path, law_added=" \n")
    with pytest.raises(ValueError, match=r"law\.added\.md is no fragment"):
        make["release"](root, "0.2.0", "2026-12-01")
    (root / "changelog.d" / "law.added.md").unlink()
    with pytest.raises(ValueError, match="holds no fragment"):
        make["release"](root, "0.2.0", "2026-12-01")


def test_every_fragment_here_can_be_assembled(make):
    assert make["section"]("9.9.9", "2030-01-01", make["fragments"](ROOT / "changelog.d")).startswith("## [9.9.9]")


def test_one_version_stands_everywhere():
    (cited,) = re.findall(r"^version: (\S+)$", read(ROOT / "CITATION.cff"), re.MULTILINE)
    assert re.findall(r"^## \[([^]]+)\]", read(CHANGELOG), re.MULTILINE)[0] == snarelab.__version__ == cited
