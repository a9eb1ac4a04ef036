"""The regressor of a tree without its zeros: a joint feels the links that it moves, and no other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .inertia import Array

Index = NDArray[np.int_]

OWN = 10
"""Inertial parameters of a link."""


@dataclass(frozen=True, eq=False)
class Regressor:
    """Torque by the links' inertial parameters along a motion.

    Parameters
    ----------
    values : array (n, 10 F)
        For each joint in turn, ten columns for each link that it moves, in the order of the links; F such pairs.
    moves : array of bool (J, L)
        Whether a joint moves a link.
    """

    values: Array
    moves: NDArray[np.bool_]

    def of(self, joint: int) -> tuple[Index, Array]:
        """Which of the 10 L inertial parameters a joint feels (k,), and its torque by them (n, k)."""
        links = np.flatnonzero(self.moves[joint])
        start = OWN * int(self.moves[:joint].sum())
        index = (OWN * links[:, None] + np.arange(OWN)).ravel()
        return index, self.values[:, start : start + len(index)]

    def of_link(self, link: int) -> list[tuple[int, Array]]:
        """Every joint that moves a link, and its torque by the link's ten inertial parameters (n, 10)."""
        found = []
        for joint in np.flatnonzero(self.moves[:, link]):
            start = OWN * int(self.moves[:joint].sum() + self.moves[joint, :link].sum())
            found.append((int(joint), self.values[:, start : start + OWN]))
        return found

    def dense(self) -> Array:
        """With its zeros (n, J, 10 L)."""
        whole = np.zeros((len(self.values), *self.moves.shape, OWN))
        joints, links = np.nonzero(self.moves)
        whole[:, joints, links] = self.values.reshape(len(self.values), -1, OWN)
        return whole.reshape(len(self.values), len(self.moves), -1)
