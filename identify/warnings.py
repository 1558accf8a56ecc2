"""What a fit must tell besides its numbers: drift, poor motions, unseen and weak parameters."""

from __future__ import annotations

import numpy as np
from scipy import stats

from identify.blocks import Block
from identify.model import Model
from identify.noise import noise_from_scatter
from identify.robot import Robot
from identify.rotations import FloatArray
from identify.solve import Solution

_ALARM = 0.001  # level of each warning's test, over all its channels
_STILL = 2e-4  # travel below which a joint does not move [rad or m]
_RETRACED = 0.8
_WEAK = 0.5  # relative std beyond which an estimate says little


def drift_warnings(
    tables: list[tuple[FloatArray, float]], blocks: tuple[Block, ...]
) -> list[str]:
    """Test whether the channels' means change from period to period more than their noise allows.

    Args:
        tables: scatter between the periods of every block.
        blocks: the blocks, for names.

    Returns:
        One sentence a channel that drifts.
    """
    result = []
    channels = sum(len(block.channels) for block in blocks)
    for (table, dof), block in zip(tables, blocks, strict=True):
        means = table.mean(axis=2)
        periods, count = table.shape[1:]
        if periods < 3:
            continue
        ramp = np.arange(periods) - (periods - 1) / 2.0
        slope = means @ ramp / (ramp @ ramp)
        # the drift itself must not pass for slow noise: judge it by what happens within the periods
        within = noise_from_scatter(table - means[:, :, None], dof).spectrum_at_zero()
        std = np.sqrt(within / count / (ramp @ ramp))
        p = 2.0 * stats.norm.sf(np.abs(slope) / np.maximum(std, 1e-300))
        for k in np.flatnonzero(p * channels < _ALARM):
            result.append(
                f"Channel {block.channels[k]} drifts by {slope[k]:.3g} per period (p = {p[k]:.1e}): warm-up, plate drift or a "
                "moving offset; let the robot and the plate settle, or see residuum diagnose."
            )
    return result


def motion_warnings(robot: Robot, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> list[str]:
    """Look for motions that cannot tell a model's parameters apart, however well conditioned they look.

    Args:
        robot: the chain.
        q: positions, shape (n, N).
        qd: velocities, shape (n, N).
        qdd: accelerations, shape (n, N).

    Returns:
        Sentences.
    """
    result = []
    moving = np.flatnonzero(np.ptp(q, axis=1) > _STILL)
    for k in sorted(set(range(robot.n)) - set(moving.tolist())):
        result.append(
            f"Joint {robot.joints[k].name} does not move (travel {np.ptp(q[k]):.1e}): its friction and what only its motion "
            "shows cannot be identified from this run."
        )
    if len(moving) < 2:
        return result
    scaled = q[moving] / np.ptp(q[moving], axis=1)[:, None]
    spread = np.linalg.svd(scaled - scaled.mean(axis=1, keepdims=True), compute_uv=False)
    if spread[-1] < 1e-2 * spread[0]:
        result.append(
            "The joints move in proportion to each other, on a lower-dimensional set of postures: the fit may look well "
            "conditioned and still fail on another trajectory; excite the joints independently (residuum design)."
        )
    elif _retraced_share(scaled) > _RETRACED:
        result.append(
            "The motion goes back along its own path, so all postures lie on one curve: the fit may look well conditioned "
            "and still fail on another trajectory; excite sines and cosines of every joint (residuum design)."
        )
    return result


def _retraced_share(scaled: FloatArray) -> float:
    """Share of the postures met again the other way round; laps in the same direction do not count."""
    step = max(scaled.shape[1] // 400, 1)
    points = scaled[:, ::step]
    count = points.shape[1]
    distance = np.sqrt(((points[:, :, None] - points[:, None, :]) ** 2).sum(axis=0))
    lag = np.abs(np.arange(count)[:, None] - np.arange(count)[None, :])
    lag = np.minimum(lag, count - lag)
    stepwise = np.median(np.linalg.norm(np.diff(points, axis=1), axis=0))
    far_along = lag > 0.05 * count
    heading = np.gradient(points, axis=1)
    close = (distance < max(0.01, 1.5 * stepwise)) & (heading.T @ heading < 0.0)
    # around the turning points neighbours in time are neighbours in space: leave them out
    return float((close & far_along).any(axis=1).mean() / 0.9)


def solution_warnings(model: Model, solution: Solution, covariance: FloatArray) -> list[str]:
    """Name what cannot be identified and what is identified only weakly.

    Args:
        model: the model.
        solution: the fit.
        covariance: of (theta, torque constants), nan where not identifiable.

    Returns:
        Sentences.
    """
    count = len(model.parameters)
    unseen = [p.name for p, seen in zip(model.parameters, solution.identifiable[:count], strict=True) if not seen]
    result = []
    if unseen:
        shown = ", ".join(unseen[:12]) + (f" and {len(unseen) - 12} more" if len(unseen) > 12 else "")
        result.append(f"Not identifiable from this run (std inf): {shown}; the motion does not show them separately.")
    std = np.sqrt(np.diag(covariance)[:count])
    weak = _weak_groups(model, solution.theta, std)
    if weak:
        result.append(
            f"Weakly determined one by one, only their sum over the motion is known well: {', '.join(weak)}; "
            "widen that joint's range to tell them apart."
        )
    for joint, factor in zip(model.robot.joints, solution.scale, strict=True):
        if factor <= 0.0:
            result.append(f"The torque constant of {joint.name} comes out negative: check the sign of its current and of its gear ratio.")
    return result


def _weak_groups(model: Model, theta: FloatArray, std: FloatArray) -> list[str]:
    """Offsets and gravity harmonics of a joint whose std exceeds half their value."""
    compensated = {joint.name for joint in model.robot.joints if joint.drive.gravity_harmonics}
    result = []
    for name in sorted(compensated):
        members = [k for k, p in enumerate(model.parameters) if p.joint == name and p.group in ("offset", "gravity_compensation")]
        if any(std[k] > _WEAK * abs(theta[k]) for k in members):
            result.append(f"{name}.offset and {name}.gravity_*")
    return result
