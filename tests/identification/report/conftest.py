"""What the tests of a report's sections share."""

import pytest

from snarelab.identification.report import findings, fit


@pytest.fixture
def asked(monkeypatch):
    """What the pictures were asked to show, in order; none is drawn."""
    seen = []
    for module, name in (
        (fit, "before_and_after"),
        (fit, "residual_curves"),
        (fit, "steps"),
        (fit, "candidates"),
        (findings, "residual_over_time"),
    ):
        monkeypatch.setattr(module, name, lambda *given: seen.append(given) or b"<svg/>")
    return seen
