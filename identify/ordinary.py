"""Ordinary least squares, with a covariance that still knows the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.blocks import Block
from identify.noise import NoiseModel
from identify.rotations import FloatArray
from identify.solve import Solution, solve


def unit_noise(blocks: tuple[Block, ...]) -> list[NoiseModel]:
    """Noise that weighs every channel by its own size: a neutral start where nothing is known yet.

    Args:
        blocks: averaged rows.

    Returns:
        White, uncorrelated noise at a hundredth of every channel's spread.
    """
    result = []
    for block in blocks:
        spread = np.array([np.std(row[use]) if use.any() else 0.0 for row, use in zip(block.target, block.usable, strict=True)])
        size = np.maximum(0.01 * spread, 1e-9 + 1e-3 * spread.max(initial=1.0) * 0.01)
        result.append(NoiseModel(tuple(np.ones(1) for _ in spread), np.diag(size**2), size, 1.0, False))
    return result


def _equal_weights(blocks: tuple[Block, ...]) -> list[NoiseModel]:
    return [
        NoiseModel(tuple(np.ones(1) for _ in block.channels), np.eye(len(block.channels)), np.ones(len(block.channels)), 1.0, False)
        for block in blocks
    ]


def ordinary_least_squares(
    blocks: tuple[Block, ...], noises: list[NoiseModel], joints: int, free_scales: FloatArray
) -> Solution:
    """Fit with equal weights (forces and torques mixed as they are).

    Args:
        blocks: averaged rows.
        noises: the noise, for the covariance only.
        joints: number of joints n.
        free_scales: joints whose torque constant is unknown.

    Returns:
        The solution; its covariance A^-1 (J' S J) A^-1 with A = J' J is that of the noise given, and its
        chi-square is that of the residual under that noise.
    """
    plain = solve(blocks, _equal_weights(blocks), joints, free_scales)
    weighted = solve(blocks, noises, joints, free_scales, (plain.theta, plain.scale))
    meat, first = np.zeros_like(plain.covariance), 0
    rest = []
    for block, noise in zip(blocks, noises, strict=True):
        channels, count = block.target.shape
        rows = slice(first, first + channels * count)
        shaped = plain.jacobian[rows].reshape(channels, count, -1).transpose(0, 2, 1) / np.sqrt(block.repeats)
        coloured = noise.colour_adjoint(shaped).transpose(0, 2, 1).reshape(channels * count, -1) * np.sqrt(block.repeats)
        meat += coloured.T @ coloured
        series = plain.whitened[rows].reshape(channels, count)
        rest.append(noise.whiten(series).ravel())
        first += channels * count
    whitened = np.concatenate(rest)
    return replace(
        plain,
        covariance=plain.covariance @ meat @ plain.covariance,
        chi2=float(whitened @ whitened),
        whitened=whitened,
        jacobian=weighted.jacobian,
        unweighted=plain,
    )
