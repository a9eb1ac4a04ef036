"""What the bench of constants moves, and whom it asks."""

from bench.moved_constants import DECIDING, asked, constants, moved
from snarelab.identification import deciding

TEXT = '''"""Über alles."""
A = 0.5
"""A half."""
ROUNDS = 4
ONE = 1
PAIRS = ((0.04, -0.005), (1, 2e-3))
ORDER = ("a", 1)
WORDS = "x"
OTHER = 2 * A
lower = 3.0
NONE = 0.0
A = 7.0
'''


def run(text: str) -> dict:
    found: dict = {}
    exec(text, found)
    return found


def test_every_number_of_a_constant_is_moved_and_no_other():
    assert constants(TEXT) == ["A", "ROUNDS", "ONE", "PAIRS"]
    before = run(TEXT.replace("A = 7.0\n", ""))
    for name, factor, wanted in (
        ("A", 0.5, 0.25),
        ("ROUNDS", 0.5, 2),
        ("ROUNDS", 2.0, 8),
        ("ONE", 0.5, 0),
        ("PAIRS", 2.0, ((0.08, -0.01), (2, 0.004))),
    ):
        after = run(moved(TEXT, name, factor).replace("A = 7.0\n", ""))
        assert after[name] == wanted
        rest = {k for k in before if k.isupper()} - {name, "OTHER"}
        assert all(after[k] == before[k] for k in rest)
    assert moved(TEXT, "A", 2.0).splitlines()[0] == TEXT.splitlines()[0]


def test_constants_that_decide_are_all_there_and_each_has_its_test(request):
    root = request.config.rootpath
    names = constants((root / DECIDING).read_text(encoding="utf-8"))
    assert set(names) == {n for n in vars(deciding) if n.isupper()}
    for name in names:
        assert all(t.startswith("tests/identification/test_deciding_") for t in asked(DECIDING, name, root))
        assert asked(DECIDING, name, root)
    assert asked("identification/nuisance/bursts.py", "FEWEST", root)
    assert not [t for t in asked("identification/deciding.py", "GATE", root) if "docs" in t]
