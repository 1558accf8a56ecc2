"""One full set of bodies among all that have the same base parameters: the nearest to a prior."""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from identify.body_space import BASIS, IDENTITY, SIZE, BodySpace, onto
from identify.rotations import FloatArray

_STEPS = 60
_CONVERGED = 1e-10


def divergence(space: BodySpace, z: FloatArray) -> float:
    """Give the log-det divergence from the prior, sum of tr Z - log det Z - 4; inf outside the possible."""
    rotors = z[SIZE * space.links :]
    if space.margin(z) <= 0.0:
        return float("inf")
    matrices = space.matrices(z)
    bodies = np.trace(matrices, axis1=1, axis2=2) - np.linalg.slogdet(matrices)[1] - 4.0
    return float(bodies.sum() + np.sum(rotors - np.log(rotors) - 1.0))


def _slope_and_curvature(space: BodySpace, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    size = len(z)
    slope, curvature = np.empty(size), np.zeros((size, size))
    for k, matrix in enumerate(space.matrices(z)):
        part = slice(SIZE * k, SIZE * k + SIZE)
        inverse = np.linalg.inv(matrix)
        slope[part] = IDENTITY - np.einsum("aij,ij->a", BASIS, inverse)
        turned = inverse @ BASIS @ inverse
        curvature[part, part] = np.einsum("aij,bij->ab", turned, BASIS)
    rotors = np.arange(SIZE * space.links, size)
    slope[rotors] = 1.0 - 1.0 / z[rotors]
    curvature[rotors, rotors] = 1.0 / z[rotors] ** 2
    return slope, curvature


def nearest_to_prior(space: BodySpace, rows: FloatArray, start: FloatArray) -> FloatArray:
    """Move possible bodies towards the prior without changing their base parameters.

    Args:
        space: coordinates.
        rows: functionals that must keep their value, shape (k, Z).
        start: possible bodies, shape (Z,).

    Returns:
        The bodies nearest to the prior in log-det divergence, shape (Z,).

    Source:
        Lee, Wensing, Park, Geometric robot dynamic identification, IEEE T-RO 36(2) 2020; damped Newton steps.
    """
    free = null_space(rows / np.linalg.norm(rows, axis=1)[:, None]) if len(rows) else np.eye(len(start))
    z, value = start, divergence(space, start)
    if free.shape[1] == 0:
        return onto(rows, rows @ start, z)
    for _ in range(_STEPS):
        slope, curvature = _slope_and_curvature(space, z)
        reduced = free.T @ slope
        step = free @ np.linalg.solve(free.T @ curvature @ free, -reduced)
        decrease = -float(slope @ step)
        if decrease < _CONVERGED:
            break
        length, moved = 1.0, divergence(space, z + step)
        while moved > value - 0.1 * length * decrease and length > 1e-12:
            length *= 0.5
            moved = divergence(space, z + length * step)
        z, value = z + length * step, min(moved, value)
    return onto(rows, rows @ start, z)
