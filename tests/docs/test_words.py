"""Words that went stay away, and the check that says so sees them where a person reads."""

import runpy

import pytest
from documentation import DOCS, read


@pytest.fixture(scope="module")
def check():
    return runpy.run_path(str(DOCS / "check_words.py"))


def test_no_page_docstring_or_message_has_a_word_that_went(check):
    assert [line for path in check["pages"]() for line in check["complaints"](path)] == []


@pytest.mark.parametrize(
    ("name", "text", "lines"),
    [
        ("page.md", "It is fine.\nThe torque is foretold.\n", [2]),
        ("page.md", "The same holds.\n", []),
        ("code.py", '"""The same with noise."""\n', [1]),
        ("code.py", 'x = 1\nraise OSError(f"{x}: is no plain file")\n', [2]),
        ("code.py", 'found = {"foretold": 1}  # a key of a result, which scripts read\n', []),
    ],
)
def test_the_check_sees_words_where_a_person_reads(check, tmp_path, name, text, lines):
    path = tmp_path / name
    path.write_text(text)
    assert [int(line.split(":")[1]) for line in check["complaints"](path)] == lines


def test_the_glossary_uses_one_word_for_one_thing():
    """No word has two lines, and none that has a line is one not to say."""
    lines = [line for line in read(DOCS / "glossary.md").splitlines() if line.startswith("| ")]
    table = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    rows = [row for row in table if len(row) == 3 and row[0] not in ("word", "---")]
    words = [word for word, _, _ in rows]
    assert len(words) == len(set(words)) > 40
    assert not set(words) & {no.strip() for _, _, never in rows for no in never.split(",")}
