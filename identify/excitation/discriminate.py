"""Excitation that tells rival explanations apart, or shows a small effect (T-optimal)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from identify.excitation.criteria import log_det
from identify.rotations import FloatArray

_SHARPNESS = 4.0  # of the smooth minimum over the pairs


@dataclass(frozen=True)
class Discriminating:
    """Distance that is left between effects after the baseline, and the rival, explain what they can.

    With one effect: log of the information on its size that the baseline leaves, whose root is the inverse of
    the smallest detectable size. With several: the least of these over all ordered pairs (effect, rival).

    Attributes:
        baseline: number of columns, the first ones, that belong to the model.
        effects: positions of each effect's columns.

    Source:
        Atkinson, Fedorov, The design of experiments for discriminating between two rival models, Biometrika
        62(1) 1975: the noncentrality ||M X b||^2, a Schur complement of the information matrix.
    """

    baseline: int
    effects: tuple[FloatArray, ...]
    name: str = "discriminating"

    def __call__(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Give the value and its derivative by the matrix."""
        base = np.arange(self.baseline)
        pairs = (
            [(self.effects[0], np.arange(0))]
            if len(self.effects) == 1
            else list(permutations(self.effects, 2))
        )
        values, gradients = [], []
        for effect, rival in pairs:
            value, gradient = self._distance(information, np.concatenate([base, rival]), effect)
            values.append(value)
            gradients.append(gradient)
        scaled = -_SHARPNESS * np.array(values)
        weights = np.exp(scaled - scaled.max())
        soft = (scaled.max() + np.log(weights.sum())) / _SHARPNESS
        weights /= weights.sum()
        return float(soft), -np.tensordot(weights, np.array(gradients), axes=1)

    @staticmethod
    def _distance(information: FloatArray, known: FloatArray, effect: FloatArray) -> tuple[float, FloatArray]:
        """Log determinant of the effect's information beyond the known columns, per column; its gradient."""
        gradient = np.zeros_like(information)
        value = 0.0
        for sign, columns in ((1.0, np.concatenate([known, effect])), (-1.0, known)):
            part, inverse = log_det(information[np.ix_(columns, columns)])
            value += sign * part
            gradient[np.ix_(columns, columns)] += sign * inverse
        return value / len(effect), gradient / len(effect)


def smallest_detectable(
    information: FloatArray, baseline: int, effects: tuple[FloatArray, ...]
) -> list[float]:
    """Smallest size of each effect that would be seen, at 1 % false alarms and 90 % power.

    Args:
        information: of baseline and effect columns, shape (m, m).
        baseline: number of baseline columns.
        effects: positions of each effect's columns.

    Returns:
        One size an effect, of its first column, in that column's unit.

    Source:
        (z_0.99 + z_0.90) / ||M X||, Gaussian noise of known std.
    """
    sizes = []
    for columns in effects:
        known = np.arange(baseline)
        both = np.concatenate([known, columns[:1]])
        gain = log_det(information[np.ix_(both, both)])[0] - log_det(information[np.ix_(known, known)])[0]
        sizes.append(float((2.326348 + 1.281552) * np.exp(-0.5 * gain)))
    return sizes
