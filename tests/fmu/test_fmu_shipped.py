"""FMUs that are shipped: both versions, a page for each, and one that lists them; a faulty one is an error."""

import pytest

from snarelab.fmu import shipped
from snarelab.fmu.elements import ELEMENTS

NAME = sorted(ELEMENTS)[0]


@pytest.fixture
def one(monkeypatch):
    """One element, and no participant."""
    monkeypatch.setattr(shipped, "ELEMENTS", {NAME: ELEMENTS[NAME]})
    monkeypatch.setattr(shipped, "participant_names", tuple)


@pytest.mark.usefixtures("one")
def test_both_versions_are_written_with_their_pages_and_listed(tmp_path):
    written = shipped.build(tmp_path / "fmus")
    assert [path.name for path in written] == [f"{NAME}-fmi2.fmu", f"{NAME}-fmi3.fmu"]
    listed = (tmp_path / "fmus/index.html").read_text(encoding="utf-8")
    for path in written:
        assert path.stat().st_size > 0
        assert f'href="{path.stem}.html"' in listed
        assert "<html" in path.with_suffix(".html").read_text(encoding="utf-8")
    assert listed.count("C, alone") == 2


@pytest.mark.usefixtures("one")
def test_a_fault_that_fmpy_finds_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(shipped, "validate_fmu", lambda path: ["no model identifier"])
    with pytest.raises(RuntimeError, match=r"-fmi2\.fmu: no model identifier"):
        shipped.build(tmp_path)
