"""What the terminal says of a diagnosis: names with probability and values, and what could not be told apart."""

from diagnoses import adequate, missing_physics

from snarelab.identification.summary import printed


def test_names_stand_with_their_probability_and_values():
    lines = printed(missing_physics()).splitlines()
    (found,) = [line for line in lines if line.startswith("  Stribeck friction at joint5 ")]
    assert " 87 % " in found
    assert "level 2.81 ± 0.06 N·m" in found
    assert sum("probability" in line for line in lines) == 1


def test_what_cannot_be_told_apart_is_said_with_what_would_part_it():
    """A rival that the recordings can tell apart is not."""
    text = printed(missing_physics())
    said = text.partition("what these recordings cannot tell apart\n")[2]
    assert said.strip() == (
        "Stribeck friction at joint5, or load dependent friction at joint5; to separate them: repeat the slow part of "
        "the motion with 5 kg"
    )


def test_an_adequate_model_has_no_table():
    assert "probability" not in printed(adequate())
