"""Other tools' sparse regression for `bench/formulas.py`: PySINDy's optimizers over the same dictionary, and PySR."""

import importlib.util
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snarelab.identification.formula_terms import Term, dictionary
from snarelab.models.table import Table

Array = NDArray[np.float64]
Found = list[tuple[Term, Array]]

THRESHOLDS = tuple(np.geomspace(0.01, 0.5, 8).tolist())
"""Of a coefficient, as a share of what its column would need to be the whole table."""
MOST_COLUMNS = tuple(range(1, 8))
"""Of FROLS, which takes a column at a time."""


def missing() -> list[str]:
    """Rivals that are not installed."""
    return [name for name in ("pysindy", "pysr") if importlib.util.find_spec(name) is None]


def knots_of(table: Table) -> list[Array]:
    """Coordinates of its values, each (k,)."""
    return [g.ravel() for g in np.meshgrid(*map(np.array, table.knots), indexing="ij")]


def pysindy_formulas(table: Table, values: Array, std: Array, which: str) -> dict[float, Found]:
    """Terms and coefficients by threshold, of ``STLSQ`` or ``SR3``, or by most columns, of ``FROLS``."""
    import pysindy

    terms, x, weight = list(dictionary(table)), knots_of(table), 1 / std
    parts = [t.columns(x) for t in terms]
    columns = np.hstack(parts) * weight[:, None]
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    # Thresholds near an end are one column where one knot lies beyond: FROLS divides by what is left of the second.
    alike = np.tril(np.abs((columns / size).T @ (columns / size)) > 1 - 1e-9, -1)
    columns[:, alike.any(axis=1)] = 0.0
    kept = np.flatnonzero(np.any(columns != 0, axis=0))
    target = values * weight
    scale = float(np.linalg.norm(target))
    found = {}
    for threshold in MOST_COLUMNS if which == "FROLS" else THRESHOLDS:
        made: Any
        if which == "FROLS":
            made = pysindy.FROLS(max_iter=int(threshold), alpha=1e-6)
        elif which == "STLSQ":
            made = pysindy.STLSQ(threshold=threshold, alpha=1e-3)
        else:
            made = pysindy.SR3(reg_weight_lam=0.5 * threshold**2, regularizer="L0", relax_coeff_nu=1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a threshold leaves no term, or an iteration ends early
            try:
                made.fit((columns / size)[:, kept], (target / scale)[:, None])
            except ValueError as error:
                if "linearly dependent" not in str(error):
                    raise
                found[threshold] = []  # FROLS ends where what it has taken spans a column: no formula
                continue
        whole = np.zeros(columns.shape[1])
        whole[kept] = np.asarray(made.coef_, float).ravel() * scale / size[kept]
        cuts = np.cumsum([p.shape[1] for p in parts])[:-1]
        split = np.split(whole, cuts)
        found[threshold] = [(t, v) for t, v in zip(terms, split, strict=True) if np.any(v != 0)]
    return found


def pysr_values(table: Table, values: Array, std: Array, at: Sequence[Array], seconds: float) -> Array:
    """PySR's formula at coordinates ``at``, each (n,): searched for some seconds, chosen by its own rule."""
    import pysr  # pyright: ignore[reportMissingImports]

    model = pysr.PySRRegressor(
        niterations=10**6,
        timeout_in_seconds=seconds,
        binary_operators=["+", "*", "max"],
        unary_operators=["sin", "exp", "abs", "sign"],
        deterministic=True,
        parallelism="serial",
        random_state=0,
        progress=False,
        verbosity=0,
    )
    model.fit(np.stack(knots_of(table), 1), values, weights=std**-2)
    return np.asarray(model.predict(np.stack(at, 1)), float)
