"""Every deciding number has a test that halves and doubles it, in the files beside this one.

Those of captures and of encoders have theirs where these are tested.
"""

from pathlib import Path

from snarelab.identification import deciding


def test_no_number_is_without_a_test():
    files = sorted(Path(__file__).parent.glob("test_deciding_*.py"))
    told = "".join(f.read_text(encoding="utf-8") for f in files)
    assert [n for n in vars(deciding) if n.isupper() and f'"{n}"' not in told] == []
