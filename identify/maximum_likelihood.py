"""Maximum likelihood with noise on the encoders as well as on torques and wrench.

The trajectory's Fourier coefficients join the unknowns; the encoders' own fit is their prior. With noiseless
encoders the coefficients cannot move and the estimate is the Markov estimate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.blocks import Block, PeriodicRows, periodic_rows, predict
from identify.dataset import Dataset
from identify.fourier import FourierTrajectory
from identify.model import Model, Rows
from identify.noise import NoiseModel
from identify.period import PeriodWindow
from identify.rotations import FloatArray
from identify.solve import Solution, solve

_ITERATIONS = 6
_CONVERGED = 1e-3  # change of any coefficient, in its own std
_STEP = 1e-6  # relative step of the central differences of the model along positions, speeds, accelerations


def _coefficients(trajectory: FourierTrajectory) -> FloatArray:
    """Stack offset, cosine, sine of every joint, shape (n, 1 + 2 L)."""
    return np.concatenate([trajectory.offset[:, None], trajectory.cosine, trajectory.sine], axis=1)


def _with_coefficients(trajectory: FourierTrajectory, values: FloatArray) -> FourierTrajectory:
    lines = len(trajectory.lines)
    return replace(trajectory, offset=values[:, 0], cosine=values[:, 1 : 1 + lines], sine=values[:, 1 + lines :])


def _coefficient_std(trajectory: FourierTrajectory) -> FloatArray:
    """Std of the coefficients from the encoder noise, shape (n, 1 + 2 L)."""
    lines = len(trajectory.lines)
    per_unit = np.concatenate([[1.0], np.full(2 * lines, np.sqrt(2.0))]) / np.sqrt(trajectory.samples)
    return trajectory.noise_std[:, None] * per_unit


def _block_rows(model: Model, block: Block, motion: FloatArray) -> Rows:
    parts = []
    if (block.joint >= 0).any():
        parts.append(model.drive_rows(*motion))
    if (block.joint < 0).any():
        parts.append(model.wrench_rows(*motion))
    return Rows(np.concatenate([p.columns for p in parts]), np.concatenate([p.known for p in parts]))


def _motion_sensitivity(
    model: Model, block: Block, motion: FloatArray, theta: FloatArray, scale: FloatArray
) -> FloatArray:
    """Derivatives of the prediction along q, qd, qdd of every joint, shape (3, n, c, B)."""
    result = np.zeros((3, model.robot.n, *block.target.shape))
    sizes = np.maximum(np.abs(motion).max(axis=2), 1e-3) * _STEP
    for order in range(3):
        for joint in range(model.robot.n):
            moved = np.zeros_like(motion)
            moved[order, joint] = sizes[order, joint]
            ahead, behind = (_block_rows(model, block, motion + sign * moved) for sign in (1.0, -1.0))
            difference = predict(ahead.columns, ahead.known, block.joint, theta, scale) - predict(
                behind.columns, behind.known, block.joint, theta, scale
            )
            result[order, joint] = difference / (2.0 * sizes[order, joint])
    # the sign of the speed jumps: a difference across the jump is no derivative
    limit = 50.0 * np.median(np.abs(result), axis=-1, keepdims=True) + 1e-9
    return np.where(np.abs(result) > np.maximum(limit, 1e4 * np.ones_like(limit)), 0.0, result)


def _coefficient_jacobian(trajectory: FourierTrajectory, t_s: FloatArray, sensitivity: FloatArray) -> FloatArray:
    """Chain rule to the Fourier coefficients of all joints, shape (c, n (1 + 2 L), B)."""
    cosines, sines = trajectory.basis(t_s)
    w = trajectory.omega_rad_s[:, None]
    one, zero = np.ones((1, len(t_s))), np.zeros((1, len(t_s)))
    basis = (
        np.concatenate([one, cosines, sines]),
        np.concatenate([zero, -w * sines, w * cosines]),
        np.concatenate([zero, -(w**2) * cosines, -(w**2) * sines]),
    )
    stacked = sum(sensitivity[order][:, :, None, :] * basis[order][None, None] for order in range(3))
    n, channels, size, count = stacked.shape
    return stacked.transpose(1, 0, 2, 3).reshape(channels, n * size, count)


def maximise_likelihood(
    model: Model,
    data: Dataset,
    window: PeriodWindow,
    trajectory: FourierTrajectory,
    noises: list[NoiseModel],
    free_scales: FloatArray,
    start: tuple[FloatArray, FloatArray],
) -> tuple[Solution, FourierTrajectory, PeriodicRows]:
    """Fit parameters, torque-constant scales and trajectory together.

    Args:
        model: the model.
        data: the run.
        window: its periods.
        trajectory: the encoders' own fit.
        noises: noise of torques and wrench.
        free_scales: joints whose torque constant is unknown.
        start: first parameters and scales.

    Returns:
        The solution (covariance marginal over the trajectory), the refined trajectory, its rows.

    Source:
        Verdonck, Swevers, Samin 2001, section 5; Olsen, Swevers, Verdonck, IJRR 21(2) 2002.
    """
    measured, std = _coefficients(trajectory), _coefficient_std(trajectory)
    current, (theta, scale) = trajectory, start
    for _ in range(_ITERATIONS):
        rows = periodic_rows(model, data, window, current)
        solution = solve(rows.blocks, noises, model.robot.n, free_scales, (theta, scale))
        theta, scale = solution.theta, solution.scale
        along = _whitened_coefficients(model, rows, noises, current, window, theta, scale) * std.ravel()
        joint, coefficients = _joint_step(solution, along, (measured - _coefficients(current)).ravel() / std.ravel())
        theta, scale = theta + joint[: len(theta)], scale.copy()
        scale[solution.free_scales] += joint[len(theta) :]
        current = _with_coefficients(current, _coefficients(current) + coefficients.reshape(std.shape) * std)
        if np.abs(coefficients).max() < _CONVERGED:
            break
    rows = periodic_rows(model, data, window, current)
    final = solve(rows.blocks, noises, model.robot.n, free_scales, (theta, scale))
    return _marginal(final, along), current, rows


def _whitened_coefficients(
    model: Model,
    rows: PeriodicRows,
    noises: list[NoiseModel],
    trajectory: FourierTrajectory,
    window: PeriodWindow,
    theta: FloatArray,
    scale: FloatArray,
) -> FloatArray:
    """Whitened Jacobian along the Fourier coefficients, shape (rows, n (1 + 2 L))."""
    parts = []
    for block, noise in zip(rows.blocks, noises, strict=True):
        t = window.start_s + block.grid_s
        sensitivity = _motion_sensitivity(model, block, np.stack(trajectory.evaluate(t)), theta, scale)
        jacobian = _coefficient_jacobian(trajectory, t, sensitivity) * block.usable[:, None, :]
        whitened = np.sqrt(block.repeats) * noise.whiten(jacobian)
        parts.append(whitened.transpose(0, 2, 1).reshape(-1, jacobian.shape[1]))
    return np.vstack(parts)


def _joint_step(solution: Solution, along: FloatArray, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gauss-Newton step of (theta, scales) and of the coefficients, in units of their std."""
    size = solution.jacobian.shape[1]
    norms = np.linalg.norm(solution.jacobian, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    upper = np.hstack([solution.jacobian / norms, along])
    lower = np.hstack([np.zeros((along.shape[1], size)), np.eye(along.shape[1])])
    matrix, right = np.vstack([upper, lower]), np.concatenate([solution.whitened, prior])
    step = np.linalg.lstsq(matrix, right, rcond=1e-9)[0]
    return step[:size] / norms, step[size:]


def _marginal(solution: Solution, along: FloatArray) -> Solution:
    """Widen the covariance by what the trajectory's uncertainty adds (Schur complement)."""
    inner = np.eye(along.shape[1]) + along.T @ along
    root = np.linalg.cholesky(inner)
    across = np.linalg.solve(root, along.T @ solution.jacobian)
    information = solution.jacobian.T @ solution.jacobian - across.T @ across
    norms = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(norms, norms)
    values, vectors = np.linalg.eigh(scaled)
    seen = values > 1e-14 * values[-1]
    half = vectors[:, seen] / np.sqrt(values[seen]) / norms[:, None]
    # the likelihood's chi-square: the residual with the trajectory's freedom taken out
    projected = np.linalg.solve(root, along.T @ solution.whitened)
    return replace(solution, covariance=half @ half.T, chi2=float(solution.chi2 - projected @ projected))
