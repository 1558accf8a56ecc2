"""Weighted least squares with torque constants as further unknowns (Gauss-Newton on a bilinear model).

The measured quantity is the current; the torque it stands for is n K I. Written with the nominal constant,
y = n K_nom I = s (Phi theta + known) + noise with s = K_nom / K, so that the noise stays on the
measured side and an errors-in-variables bias cannot arise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.blocks import Block, predict, residual
from identify.noise import NoiseModel, circular_filter
from identify.rotations import FloatArray

_ITERATIONS = 30
_CONVERGED = 1e-9
# below this share of the largest singular value a direction is not seen at all (rounding of averaged rows)
_RANK = 1e-9
_TOUCHED = 1e-5
_CHUNK = 1500  # rows a pass of the orthogonal factorisation


@dataclass(frozen=True)
class Solution:
    """A fit.

    Attributes:
        theta: parameters, shape (P,).
        scale: K_nominal / K of every joint, shape (n,); 1 where not estimated.
        free_scales: joints whose scale was estimated, shape (k,).
        covariance: of (theta, free scales), shape (P + k, P + k), on the identifiable directions.
        identifiable: of (theta, free scales), shape (P + k,).
        null_space: orthonormal directions the data do not see, in scaled columns, shape (P + k, d).
        chi2: weighted sum of squares.
        rank: number of directions seen.
        rows: number of rows used.
        condition_number: of the whitened, column-normalised matrix over the directions seen.
        jacobian: whitened Jacobian, shape (rows, P + k).
        whitened: whitened residuals, shape (rows,).
        unweighted: for ordinary least squares the solution in its own, equal weights, whose normal
            equations the estimate solves; None where the weights are those of the noise.
    """

    theta: FloatArray
    scale: FloatArray
    free_scales: FloatArray
    covariance: FloatArray
    identifiable: FloatArray
    null_space: FloatArray
    chi2: float
    rank: int
    rows: int
    condition_number: float
    jacobian: FloatArray
    whitened: FloatArray
    unweighted: Solution | None = None

    @property
    def dof(self) -> int:
        """Degrees of freedom left."""
        return self.rows - self.rank


def whitened_system(
    blocks: tuple[Block, ...], noises: list[NoiseModel], theta: FloatArray, scale: FloatArray, free: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Form the whitened Jacobian and residual at given parameters.

    Args:
        blocks: averaged rows.
        noises: noise per sample of each block.
        theta: parameters, shape (P,).
        scale: torque-constant scales, shape (n,).
        free: joints whose scale is free, shape (k,).

    Returns:
        Jacobian with respect to (theta, free scales), shape (rows, P + k), and residual, shape (rows,).
    """
    jacobians, rests = [], []
    for block, noise in zip(blocks, noises, strict=True):
        factors = np.where(block.joint >= 0, scale[np.maximum(block.joint, 0)], 1.0)
        unscaled = predict(block.columns, block.known, block.joint, theta, np.ones_like(scale))
        extra = np.zeros((len(block.joint), len(free), unscaled.shape[1]))
        for column, joint in enumerate(free):
            extra[block.joint == joint, column] = unscaled[block.joint == joint]
        jacobian = np.concatenate([factors[:, None, None] * block.columns, extra], axis=1)
        jacobian *= block.usable[:, None, :]
        weight = np.sqrt(block.repeats)
        jacobians.append(weight * noise.whiten(jacobian).transpose(0, 2, 1).reshape(-1, jacobian.shape[1]))
        rests.append(weight * noise.whiten(residual(block, theta, scale)).ravel())
    return np.vstack(jacobians), np.concatenate(rests)


def _triangular(jacobian: FloatArray, rest: FloatArray, norms: FloatArray) -> FloatArray:
    """R factor of [jacobian / norms, rest], chunk by chunk of rows so that each stays in the cache.

    Source:
        Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34(1) 2012 (tall and skinny QR): as stable as QR.
    """
    parts = []
    for first in range(0, max(len(rest), 1), _CHUNK):
        rows = slice(first, first + _CHUNK)
        parts.append(np.linalg.qr(np.column_stack([jacobian[rows] / norms, rest[rows]]), mode="r"))
    return parts[0] if len(parts) == 1 else np.linalg.qr(np.vstack(parts), mode="r")


def _step(jacobian: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Solve one linearised problem: step, column norms, singular values, right vectors."""
    norms = np.linalg.norm(jacobian, axis=0)
    norms = np.where(norms > 1e-12 * norms.max(initial=1e-300), norms, np.inf)
    r = _triangular(jacobian, rest, norms)
    _, values, right = np.linalg.svd(r[:, :-1], full_matrices=False)
    seen = values > _RANK * values[0]
    projected = right @ (r[:, :-1].T @ r[:, -1])
    step = right[seen].T @ (projected[seen] / values[seen] ** 2)
    return step / norms, norms, values, right


@dataclass(frozen=True)
class _Gram:
    """Inner products of one block's time-whitened columns: rows of the problem are needed only once.

    Attributes:
        products: of (columns, known, target) between channels, shape (c, P + 2, c, P + 2).
        weight: inverse innovation covariance, shape (c, c).
        joint: joint of each channel or -1, shape (c,).
    """

    products: FloatArray
    weight: FloatArray
    joint: FloatArray


def _gram(block: Block, noise: NoiseModel) -> _Gram:
    weight = np.linalg.inv(noise.innovation)
    channels, size = len(block.joint), block.columns.shape[1] + 2
    parts = []
    for k, taps in enumerate(noise.filters):
        rows = np.concatenate([block.columns[k], block.known[k][None], block.target[k][None]])
        if not block.usable[k].all():
            rows *= block.usable[k]
        parts.append(rows if len(taps) == 1 else circular_filter(taps, rows))
    products = np.zeros((channels, size, channels, size))
    if np.count_nonzero(noise.innovation - np.diag(np.diag(noise.innovation))) == 0:
        for k, rows in enumerate(parts):  # independent channels meet only themselves
            products[k, :, k] = rows @ rows.T
    else:
        flat = np.concatenate(parts)
        products = (flat @ flat.T).reshape(products.shape)
    return _Gram(block.repeats * products, weight, block.joint)


def _normal_step(
    grams: list[_Gram], theta: FloatArray, scale: FloatArray, free: FloatArray
) -> tuple[FloatArray, float]:
    """One Gauss-Newton step from inner products; also the relative size of the step."""
    size, parameters = len(theta) + len(free), len(theta)
    normal, right = np.zeros((size, size)), np.zeros(size)
    for gram in grams:
        factors = np.where(gram.joint >= 0, scale[np.maximum(gram.joint, 0)], 1.0)
        maps = np.zeros((len(factors), parameters + 2, size))  # Jacobian of a channel = its columns @ map
        rests = np.concatenate([-factors[:, None] * theta, -factors[:, None], np.ones((len(factors), 1))], axis=1)
        for channel, factor in enumerate(factors):
            maps[channel, np.arange(parameters), np.arange(parameters)] = factor
            for column in np.flatnonzero(free == gram.joint[channel]):
                maps[channel, :parameters, parameters + column] = theta
                maps[channel, parameters, parameters + column] = 1.0
        weighted = np.einsum("ab,apbq->apbq", gram.weight, gram.products)
        toward = np.tensordot(weighted, maps, axes=([2, 3], [0, 1]))
        normal += np.tensordot(maps, toward, axes=([0, 1], [0, 1]))
        right += np.tensordot(toward, rests, axes=([0, 1], [0, 1]))
    diagonal = np.sqrt(np.diag(normal))
    inverse = np.where(diagonal > 1e-12 * diagonal.max(initial=1e-300), 1.0 / np.maximum(diagonal, 1e-300), 0.0)
    values, vectors = np.linalg.eigh(normal * np.outer(inverse, inverse))
    seen = values > 1e-14 * values[-1]  # squared singular values: rounding, the last step settles the rank
    step = vectors[:, seen] @ ((vectors[:, seen].T @ (right * inverse)) / values[seen])
    return inverse * step, float(np.linalg.norm(step))


def refine(
    blocks: tuple[Block, ...],
    noises: list[NoiseModel],
    joints: int,
    free_scales: FloatArray,
    start: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Find parameters and scales by Gauss-Newton steps on inner products (no covariance).

    Args:
        blocks: averaged rows.
        noises: noise per sample of each block.
        joints: number of joints n.
        free_scales: joints whose torque constant is unknown, shape (k,).
        start: parameters and scales to start from.

    Returns:
        Parameters (P,) and scales (n,).
    """
    grams = [_gram(block, noise) for block, noise in zip(blocks, noises, strict=True)]
    free = np.asarray(free_scales, dtype=int)
    theta, scale = start if start is not None else (np.zeros(blocks[0].columns.shape[1]), np.ones(joints))
    scale = scale.copy()
    theta = theta + _normal_step(grams, theta, scale, free[:0])[0]
    for _ in range(_ITERATIONS if len(free) else 1):
        step, size = _normal_step(grams, theta, scale, free)
        theta = theta + step[: len(theta)]
        scale[free] += step[len(theta) :]
        if size < _CONVERGED * np.sqrt(sum(block.rows for block in blocks)):
            break
    return theta, scale


def solve(
    blocks: tuple[Block, ...],
    noises: list[NoiseModel],
    joints: int,
    free_scales: FloatArray,
    start: tuple[FloatArray, FloatArray] | None = None,
) -> Solution:
    """Fit parameters and torque-constant scales, with their covariance.

    Args:
        blocks: averaged rows.
        noises: noise per sample of each block.
        joints: number of joints n.
        free_scales: joints whose torque constant is unknown, shape (k,).
        start: parameters and scales to start from.

    Returns:
        The solution; its last step is an orthogonal factorisation of the rows themselves.

    Source:
        Markov estimate (Phi' S^-1 Phi)^-1, Verdonck, Swevers, Samin 2001, section 5.
    """
    free = np.asarray(free_scales, dtype=int)
    theta, scale = refine(blocks, noises, joints, free, start)
    jacobian, rest = whitened_system(blocks, noises, theta, scale, free)
    step, *factors = _step(jacobian, rest)
    theta, scale = theta + step[: len(theta)], scale.copy()
    scale[free] += step[len(theta) :]
    return _summarise(blocks, theta, scale, free, (jacobian, rest - jacobian @ step), tuple(factors))


def _summarise(
    blocks: tuple[Block, ...],
    theta: FloatArray,
    scale: FloatArray,
    free: FloatArray,
    system: tuple[FloatArray, FloatArray],
    factors: tuple[FloatArray, FloatArray, FloatArray],
) -> Solution:
    """Covariance and what is seen, from column norms, singular values and right vectors of the Jacobian."""
    jacobian, rest = system
    norms, values, right = factors
    seen = values > _RANK * values[0]
    inverse_norms = np.where(np.isfinite(norms), 1.0 / norms, 0.0)
    root = (right[seen] / values[seen, None]) * inverse_norms
    null_space = right[~seen].T
    identifiable = (np.linalg.norm(null_space, axis=1) < _TOUCHED) & np.isfinite(norms)
    return Solution(
        theta,
        scale,
        free,
        root.T @ root,
        identifiable,
        null_space,
        float(rest @ rest),
        int(seen.sum()),
        sum(block.rows for block in blocks),
        float(values[0] / values[seen][-1]),
        jacobian,
        rest,
    )
