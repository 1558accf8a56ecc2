"""Optimality criteria as smooth functions of the information matrix, all to be minimised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from identify.rotations import FloatArray

CRITERIA = ("d", "a", "condition", "balanced", "discriminating")
_POWER = 6.0  # of the smooth maximum over eigenvalues
_RIDGE = 1e-13  # of the unit diagonal: lets a start without rank be evaluated and left


class Criterion(Protocol):
    """A function of the information matrix."""

    name: str

    def __call__(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Give the value and its derivative by the (symmetric) matrix, shape (m, m)."""
        ...


def _normalised(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit-diagonal matrix and the scale that makes it so."""
    diagonal = np.diag(information)
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-300 + 1e-20 * diagonal.max(initial=0.0)))
    return information * np.outer(scale, scale) + _RIDGE * np.eye(len(scale)), scale


def log_det(information: FloatArray) -> tuple[float, FloatArray]:
    """Log determinant and its derivative, the inverse; by Cholesky of the unit-diagonal matrix."""
    if len(information) == 0:
        return 0.0, np.zeros((0, 0))
    unit, scale = _normalised(information)
    try:
        factor = cho_factor(unit, lower=True)
    except np.linalg.LinAlgError:  # rounding has eaten the smallest eigenvalue
        factor = cho_factor(unit + 1e-9 * np.eye(len(scale)), lower=True)
    inverse = cho_solve(factor, np.eye(len(scale)))
    value = 2.0 * np.sum(np.log(np.diag(factor[0]))) - 2.0 * np.sum(np.log(scale))
    return float(value), inverse * np.outer(scale, scale)


@dataclass(frozen=True)
class DOptimal:
    """Log determinant of the parameters' covariance: the volume of their joint confidence region."""

    name: str = "d"

    def __call__(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Give the value and its derivative by the matrix."""
        value, inverse = log_det(information)
        return -value, -inverse


@dataclass(frozen=True)
class AOptimal:
    """Log of the mean variance, each in units of its variance on a plain reference motion.

    Attributes:
        unit_variance: variances that count as one, shape (m,).
    """

    unit_variance: FloatArray
    name: str = "a"

    def __call__(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Give the value and its derivative by the matrix."""
        _, inverse = log_det(information)
        relative = inverse / self.unit_variance[:, None]
        mean = float(np.trace(relative)) / len(relative)
        return float(np.log(mean)), -(inverse @ relative) / (mean * len(relative))


@dataclass(frozen=True)
class ConditionNumber:
    """Log of the condition number of the whitened regressor with columns of unit norm."""

    name: str = "condition"

    def __call__(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Give the value and its derivative by the matrix."""
        unit, scale = _normalised(information)
        values, vectors = np.linalg.eigh(unit)
        values = np.maximum(values, _RIDGE)
        large, small = values**_POWER, values**-_POWER
        value = (np.log(large.sum()) + np.log(small.sum())) / (2.0 * _POWER)
        weight = 0.5 * (large / large.sum() - small / small.sum()) / values
        by_unit = (vectors * weight) @ vectors.T
        gradient = by_unit * np.outer(scale, scale)
        gradient[np.diag_indices(len(scale))] -= np.sum(by_unit * unit, axis=1) * scale**2
        return float(value), gradient


@dataclass(frozen=True)
class Balanced:
    """Log determinant of the covariance plus a multiple of the log condition number.

    Attributes:
        columns: that the condition number is taken over; a gravity compensation's harmonics are left out,
            since their likeness over the joint's range is the arm's and not the motion's.
        weight: of the log condition number: 5 % less of it is worth about one nat.
    """

    columns: FloatArray
    weight: float = 20.0
    name: str = "balanced"

    def __call__(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Give the value and its derivative by the matrix."""
        block = np.ix_(self.columns, self.columns)
        value, gradient = DOptimal()(information)
        condition, by_block = ConditionNumber()(information[block])
        gradient = gradient.copy()
        gradient[block] += self.weight * by_block
        return value + self.weight * condition, gradient


def condition_number(information: FloatArray) -> float:
    """Condition number of the whitened regressor with columns of unit norm; inf without full rank."""
    values = np.linalg.eigvalsh(_normalised(information)[0])
    return float(np.sqrt(values[-1] / values[0])) if values[0] > 10.0 * _RIDGE else float("inf")


def covariance(information: FloatArray) -> FloatArray:
    """Covariance of the estimates, shape (m, m)."""
    return log_det(information)[1]
