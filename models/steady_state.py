"""Where the rate of hidden states is zero.

Newton's method from zero, each step halved until the rate falls: a dead band's corners throw full steps to and fro.
"""

from collections.abc import Callable, Sequence

import numpy as np

_MOST_NEWTON, _MOST_HALVINGS = 200, 40
_SMALL = 1e-8  # of a state: a step of Newton's that is the last, since the next one would be its square


def steady_state(at: Callable[[np.ndarray], Sequence[np.ndarray]], count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """States at which their rate is zero (count,), and their derivative by the parameters (count, p).

    Parameters
    ----------
    at : callable
        Of states (count,): the rate (count, 1), and its derivatives by states (count, count) and by parameters
        (count, p).
    count : int

    Returns
    -------
    tuple of array, or None
        None where no such states are found: a spring that carries nothing.
    """
    x = np.zeros(count)
    rate, by_state, by_parameter = at(x)
    for _ in range(_MOST_NEWTON):
        if not np.isfinite(rate).all():
            break
        try:
            change = np.linalg.solve(by_state, -rate[:, 0])
        except np.linalg.LinAlgError:
            break
        if np.abs(change).max() <= _SMALL * np.abs(x).max():
            _, by_state, by_parameter = at(x + change)
            return x + change, np.linalg.solve(by_state, -by_parameter)
        before = np.linalg.norm(rate)
        for _ in range(_MOST_HALVINGS):
            rate, by_state, by_parameter = at(x + change)
            if np.linalg.norm(rate) < before:
                break
            change = 0.5 * change
        x = x + change
    return None
