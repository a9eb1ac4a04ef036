"""An elastic link: the turn of its far end, about some of its axes, under the moment that it transmits."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

TURNS = 3  # about the length, and about two axes across it


def elastic_link(
    name: str, axes: tuple[int, ...], sentence: str, equation: str, source: str, experiment: str
) -> Effect:
    """The law of a link whose far end turns about some of its axes, by a spring and a damper alike about each.

    As a joint's elasticity, the turn is how far the far end is behind a rigid link's: what lies beyond, with its
    inertia about the far end, follows on the spring. Far below the frequency of the two it is moment / stiffness.
    """
    count = len(axes)
    turns, rates = tuple(f"turn_{k}" for k in axes), tuple(f"turn_rate_{k}" for k in axes)

    def second(s: Symbols, p: Symbols) -> ca.SX:
        turn, rate = (ca.vertcat(*(s[x] for x in names)) for names in (turns, rates))
        own = list(axes)
        inertia = ca.reshape(s["inertia_beyond"], TURNS, TURNS)[own, own]
        return ca.solve(inertia, s["moment"][own] - p["damping"] * rate - p["stiffness"] * turn)

    def rate(s: Symbols, p: Symbols) -> list[ca.SX]:
        return [*(s[x] for x in rates), *ca.vertsplit(second(s, p))]

    def law(s: Symbols, p: Symbols) -> ca.SX:
        columns = [[s[x] for x in turns], [s[x] for x in rates], ca.vertsplit(second(s, p))]
        found = ca.SX(3 * TURNS, 1)
        for order, column in enumerate(columns):
            for k in range(count):
                found[order * TURNS + axes[k]] = -column[k]
        return found

    return Effect(
        name=name,
        family="structure and mass",
        at="beam",
        sentence=sentence,
        equation=equation,
        source=source,
        # The joint that the link carries feels part of the moment: its torque may be far below, never above.
        parameters=(
            Parameter(
                "stiffness", "N*m/rad", "moment per turn of the far end", zero=300.0, low=2.0, high=1e6,
                grid=(10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0), relative_to="rate",
            ),
            # A structure damps little: one start is enough.
            Parameter(
                "damping", "N*m*s/rad", "moment per turning rate", zero=0.1, low=0.0, high=1e4, grid=(0.1,),
                relative_to="rate",
            ),
        ),
        law=law,
        states=(*turns, *rates),
        rate=rate,
        acts_on="position",
        experiment=experiment,
    )  # fmt: skip
