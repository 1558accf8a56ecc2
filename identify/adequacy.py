"""Does the model fit? Lack of fit against replicate noise, and a covariance that survives a misfit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from identify.blocks import Block
from identify.noise import NoiseModel
from identify.rotations import FloatArray
from identify.solve import Solution

# a misfit at this level makes intervals that ignore it untrustworthy
SIGNIFICANT = 0.01
# misfits of friction and drives stay correlated over some hundredths of the recording
_CORRELATED_SHARE = 25
_REGIONS = 6  # of position and of speed: enough to follow a friction curve, few enough to add up


@dataclass(frozen=True)
class LackOfFit:
    """Omnibus test of the residual against the scatter between periods.

    Attributes:
        chi2: weighted sum of squares of the averaged residual.
        dof: its degrees of freedom.
        p: probability of such a misfit by noise alone.
        reason: why there is no test, empty where there is one.
    """

    chi2: float | None
    dof: int | None
    p: float | None
    reason: str = ""

    @property
    def fits(self) -> bool:
        """Whether the model passes the test."""
        return self.p is not None and self.p >= SIGNIFICANT


def lack_of_fit(solution: Solution, noises: list[NoiseModel]) -> LackOfFit:
    """Compare the averaged residual with replicate noise.

    Args:
        solution: the fit.
        noises: noise of each block.

    Returns:
        The test; without replicates only the reason why there is none.

    Source:
        Lack of fit with replicates: the weighted sum of squares over its degrees of freedom follows
        F(dof, dof of the noise); Hotelling's correction for the estimated covariance.
    """
    if not all(noise.replicated for noise in noises):
        return LackOfFit(None, None, None, "no replicates: the recording does not repeat, so noise and misfit cannot be told apart")
    if solution.dof <= 0:
        return LackOfFit(None, None, None, "no degrees of freedom are left")
    channels = sum(len(noise.innovation) for noise in noises)
    noise_dof = min(noise.dof for noise in noises)
    chi2 = solution.chi2 * max(noise_dof - channels - 1.0, 1.0) / noise_dof
    p = float(stats.f.sf(chi2 / solution.dof, solution.dof, channels * noise_dof))
    return LackOfFit(chi2, solution.dof, p)


def structured_covariance(
    blocks: tuple[Block, ...], solution: Solution, motion: tuple[FloatArray, ...] | None
) -> FloatArray:
    """Covariance from the residual itself, valid when the residual is structured.

    A misfit of friction keeps its sign over a range of speeds, one of springs over a range of positions:
    scores are therefore also summed over such regions, where a misfit adds up as it does in the estimate.

    Args:
        blocks: averaged rows.
        solution: the fit with whitened Jacobian and residual.
        motion: for every block joint positions and speeds on its grid, shape (2, n, B).

    Returns:
        Sandwich covariance of (theta, free scales) on the identifiable directions, shape (P + k, P + k).

    Source:
        Newey and West, Econometrica 55 (1987): Bartlett weights over the scores' autocovariance;
        Liang and Zeger, Biometrika 73 (1986): sums over clusters.
    """
    solution = solution.unweighted or solution  # the scores are those of the equations that were solved
    size, first = solution.jacobian.shape[1], 0
    meat = np.zeros((size, size))
    for index, block in enumerate(blocks):
        channels, count = block.target.shape
        rows = slice(first, first + channels * count)
        scores = (solution.jacobian[rows] * solution.whitened[rows, None]).reshape(channels, count, size)
        meat += bartlett(scores.sum(axis=0), max(count // _CORRELATED_SHARE, 2))
        if motion is not None:
            meat += _region_clusters(block, scores, motion[index])
        first += channels * count
    return solution.covariance @ meat @ solution.covariance


def _region_clusters(block: Block, scores: FloatArray, motion: FloatArray) -> FloatArray:
    """Outer products of scores summed over regions of each joint's position and speed, its own channel only."""
    meat = np.zeros((scores.shape[2], scores.shape[2]))
    for channel, joint in enumerate(block.joint):
        if joint < 0:
            continue
        for variable in (motion[0, joint], np.abs(motion[1, joint])):
            edges = np.quantile(variable, np.linspace(0.0, 1.0, _REGIONS + 1)[1:-1])
            sums = np.zeros((_REGIONS, scores.shape[2]))
            np.add.at(sums, np.searchsorted(edges, variable), scores[channel])
            meat += sums.T @ sums * _REGIONS / (_REGIONS - 1)
    return meat


def bartlett(scores: FloatArray, lags: int) -> FloatArray:
    """Long-run covariance of periodic scores (B, P), positive semidefinite by construction."""
    count = len(scores)
    taper = np.zeros(count)
    taper[: lags + 1] = 1.0 - np.arange(lags + 1) / (lags + 1.0)
    taper[-lags:] += taper[1 : lags + 1][::-1]
    weights = np.maximum(np.fft.rfft(taper).real, 0.0)
    spectrum = np.fft.rfft(scores, axis=0)
    twice = np.full(len(weights), 2.0)
    twice[0] = 1.0
    if count % 2 == 0:
        twice[-1] = 1.0
    weighted = spectrum * (weights * twice / count)[:, None]
    return (spectrum.conj().T @ weighted).real
