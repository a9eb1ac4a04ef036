"""The verdict by itself: what it is of every kind of evidence, whatever is said of it."""

from itertools import permutations, product

import pytest

from snarelab.identification.verdict import gravest, verdict


@pytest.mark.parametrize(
    ("named", "nameless", "faults", "said"),
    [
        ((), (), (), "adequate"),
        ((), ("curve",), (), "unknown_effect"),
        (("backlash",), (), (), "missing_physics"),
        (("backlash",), ("curve", "burst"), (), "missing_physics"),
        ((), (), ("unit",), "data_fault"),
        (("backlash",), ("curve",), ("unit",), "data_fault"),
    ],
)
def test_the_verdict_of_each_kind_of_evidence(named, nameless, faults, said):
    assert verdict(named, nameless, faults) == said


def test_channels_of_two_kinds_give_the_verdict_of_all_their_evidence_at_once():
    kinds = [(named, left) for named, left in product(((), ("a",)), ((), ("b",)))]
    for one, other in product(kinds, kinds):
        together = verdict((*one[0], *other[0]), (*one[1], *other[1]))
        assert gravest(verdict(*one), verdict(*other)) == together


def test_a_fault_of_the_data_outweighs_every_other_verdict():
    others = ("missing_physics", "unknown_effect", "adequate")
    assert {gravest(*order) for order in permutations(("data_fault", *others))} == {"data_fault"}
