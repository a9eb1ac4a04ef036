"""What fuzzing started from and what it found: each file is read, or refused in one line; nothing else is touched."""

import warnings

import pytest
from fuzz.readers import CORPUS, READERS, attempt

FILES = sorted(path for reader in READERS for path in (CORPUS / reader).iterdir())


def test_every_reader_has_a_corpus_and_all_of_it_is_small():
    assert {path.parent.name for path in FILES} == set(READERS)
    assert sum(path.stat().st_size for path in CORPUS.rglob("*") if path.is_file()) < 300_000


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_corpus(path, tmp_path):
    folder = tmp_path / "inside"
    folder.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # what engines say of odd files is shown, and is no fault
        refusal = attempt(path.parent.name, path.read_bytes(), folder)
    assert list(tmp_path.iterdir()) == [folder]
    if path.name in ("plain", "nested", "two_joints", "target", "ground", "one"):
        assert not refusal


def test_a_refusal_names_the_mistake(tmp_path):
    line = attempt("model", b'urdf = "arm.urdf"\nbandwidth = 1' + b"0" * 400, tmp_path)
    assert "64 is the most" in line
