"""Normal equations with some of their unknowns free: the Schur complement, sound where columns are alike."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]


def schur(matrix: Array, score: Array, before: int) -> tuple[Array, Array]:
    """Curvature and score of the last columns with the ``before`` first ones free: a Schur complement.

    Directions of the first unknowns that the recordings do not determine are left out: they would add rounding only.
    The curvature returned is positive semidefinite, whatever the rounding.
    """
    scale = np.sqrt(np.maximum(np.diag(matrix)[:before], np.finfo(float).tiny))
    size, turn = eigh(matrix[:before, :before] / np.outer(scale, scale))
    sound = size > before * np.finfo(float).eps * size.max(initial=0.0)
    turn = turn[:, sound] / np.sqrt(size[sound]) / scale[:, None]
    cross = matrix[before:, :before] @ turn
    size, own = eigh(matrix[before:, before:] - cross @ cross.T)
    return (own * np.maximum(size, 0.0)) @ own.T, score[before:] - cross @ (turn.T @ score[:before])
