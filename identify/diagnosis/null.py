"""Null distribution of the best candidate of a whole family, by simulation in the span of its columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.diagnosis.candidates import Trial, log_chance
from identify.rotations import FloatArray

_DRAWS = 2000


@dataclass(frozen=True)
class FamilyNull:
    """How extreme the best of a family becomes by noise alone.

    Attributes:
        effective: number of independent tests that the family amounts to.
    """

    effective: float

    def p_value(self, log_p: float) -> float:
        """Turn the best single probability into that of the whole family (Sidak with the effective number)."""
        single = np.exp(min(log_p, 0.0))
        if single < 1e-12:
            return float(min(1.0, self.effective * single)) or float(np.exp(max(log_p, -700.0)))
        return float(-np.expm1(self.effective * np.log1p(-min(single, 1.0 - 1e-12))))


def family_null(trials: list[Trial], rng: np.random.Generator) -> FamilyNull:
    """Simulate the family's best under noise.

    The whitened residual's projections on all candidates' bases are jointly Gaussian with the bases' inner
    products as covariance, so no recordings need be simulated.

    Args:
        trials: all trials of the family (all shapes).
        rng: source of the draws.

    Returns:
        The null distribution.
    """
    if not trials:
        return FamilyNull(1.0)
    stacked = np.hstack([item.basis for item in trials]).astype(np.float32)
    gram = (stacked.T @ stacked).astype(float)
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = root @ rng.standard_normal((len(values), _DRAWS))
    best = np.zeros(_DRAWS)
    first = 0
    for item in trials:
        width = len(item.kept)
        part = draws[first : first + width]
        log_p = log_chance(np.sum(part**2, axis=0), width)
        signs = np.array([item.effect.coefficients[k].sign for k in item.kept])
        if signs.any():
            fitted = np.linalg.solve(item.triangle, part)
            log_p = np.where((signs[:, None] * fitted >= 0.0).all(axis=0), log_p, 0.0)
        best = np.minimum(best, log_p)
        first += width
    return FamilyNull(_effective_number(best))


def _effective_number(log_p: FloatArray) -> float:
    """Effective number of tests from the quantiles of the family's best: the largest that any quantile asks for."""
    numbers = []
    for level in (0.5, 0.1, 0.03):
        quantile = np.exp(np.quantile(log_p, level))
        numbers.append(np.log1p(-level) / np.log1p(-min(quantile, 1.0 - 1e-9)))
    return float(max(1.0, *numbers))
