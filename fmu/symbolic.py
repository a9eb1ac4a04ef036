"""Algebra on CasADi expressions that the equations of an FMU need."""

import casadi as ca


def solved_symmetric(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solve by L'DL factors from the last row up, which keep a tree's zeros (Featherstone 2008, section 8.5)."""
    n = matrix.shape[0]
    a = [[matrix[i, j] for j in range(n)] for i in range(n)]
    x, inverse, lower = ca.vertsplit(right), [ca.SX(0)] * n, [[ca.SX(0)] * n for _ in range(n)]
    for k in reversed(range(n)):
        inverse[k] = 1 / a[k][k]
        for i in range(k):
            lower[k][i] = a[i][k] * inverse[k]
            for j in range(i + 1):
                a[j][i] = a[j][i] - lower[k][i] * a[j][k]
            x[i] = x[i] - lower[k][i] * x[k]
    for k in range(n):
        x[k] = x[k] * inverse[k]
        for i in range(k):
            x[k] = x[k] - lower[k][i] * x[i]
    return ca.vertcat(*x)


def root(residual: ca.SX, x: ca.SX) -> ca.SX:
    """Where a residual (n,) of x (n,) is zero: Newton's method from zero, one step if it is linear, else forty."""
    function = ca.Function("residual", [x, *(free := _others(residual, x))], [residual, ca.jacobian(residual, x)])
    found = ca.SX(*x.shape)
    for _ in range(40 if any(ca.which_depends(residual, x, 2, False)) else 1):
        value, slope = function(found, *free)
        found = found - ca.solve(slope, value)
    return found


def _others(expression: ca.SX, x: ca.SX) -> list[ca.SX]:
    """Symbols of an expression that are not in x."""
    own = {symbol.name() for symbol in ca.vertsplit(x)}
    return [symbol for symbol in ca.symvar(expression) if symbol.name() not in own]
