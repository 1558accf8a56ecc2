"""An independent check of a finished design: other formulas, a finer grid, nothing shared with the search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.bounds import sampled_peak, series_extremes
from identify.excitation.errors import DesignError
from identify.excitation.feasibility import coulomb_levels, workspace_violation
from identify.excitation.information import InformationModel
from identify.excitation.limits import MotionLimits
from identify.excitation.ramp import Ramp, ramp_acceleration
from identify.excitation.reference import drive_torque
from identify.excitation.series import FourierSeries
from identify.excitation.workspace import Workspace
from identify.kinematics import link_motions, rotate
from identify.robot import Robot
from identify.rotations import FloatArray

_TOLERANCE = 1e-9
_POINTS = 20_011  # a prime: shares no instants with the grids of the search


@dataclass(frozen=True)
class Peaks:
    """What the motion reaches, ramps included.

    Attributes:
        lower: least positions, shape (n,).
        upper: greatest positions, shape (n,).
        velocity: shape (n,).
        acceleration: shape (n,).
        effort: reference drive torques [N.m or N], shape (n,).
        clearance_m: least distance to anything [m]; inf where nothing constrains.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray
    clearance_m: float


def ramp_torques(information: InformationModel, series: FourierSeries, ramp: Ramp) -> FloatArray:
    """Peak reference torques during both ramps, Coulomb friction at its worst, shape (n,)."""
    model, theta = information.model, information.reference.theta
    t_s = np.linspace(0.0, ramp.duration_s, 1024)
    peaks = []
    for part in (ramp.evaluate(series, t_s), ramp.evaluate_out(series, t_s)):
        torque = drive_torque(model, theta, *part, np.zeros_like(part[1]))
        peaks.append(sampled_peak(np.concatenate([torque, torque[:, ::-1]], axis=1)))
    return np.max(peaks, axis=0) + coulomb_levels(information)


def verify(
    information: InformationModel,
    limits: MotionLimits,
    workspace: Workspace,
    series: FourierSeries,
    ramp: Ramp,
) -> Peaks:
    """Check a design before it is written.

    Angles, velocities and accelerations come from the exact extremes of the series, distances from the
    kinematics of the regressor instead of the search's own, torques from another grid.

    Args:
        information: for the reference model.
        limits: what must be kept.
        workspace: obstacles.
        series: the motion.
        ramp: its start and stop.

    Returns:
        What is reached.

    Raises:
        DesignError: something is exceeded, with the number.
    """
    robot = information.model.robot
    low, high = series_extremes(series, 0)
    speed, hard = (np.max(np.abs(series_extremes(series, order)), axis=0) for order in (1, 2))
    hard = np.maximum(hard, ramp_acceleration(series, ramp))
    q, qd, qdd = series.evaluate(series.grid_s(_POINTS))
    torque = drive_torque(information.model, information.reference.theta, q, qd, qdd, np.zeros_like(qd))
    effort = np.maximum(
        sampled_peak(torque) + coulomb_levels(information), ramp_torques(information, series, ramp)
    )
    for name, value, limit in (
        ("lower position", -low, -limits.lower),
        ("upper position", high, limits.upper),
        ("velocity", speed, limits.velocity),
        ("acceleration", hard, limits.acceleration),
        ("torque", effort, limits.effort),
    ):
        _check(robot, name, value, limit)
    distance = float("inf")
    if not workspace.empty:
        violated = workspace_violation(robot, workspace, series)
        distance = least_distance_m(robot, workspace, q)
        if violated or distance < workspace.margin_m:
            raise DesignError(
                f"The design fails its check: {violated or distance}; report it with the command."
            )
    return Peaks(low, high, speed, hard, effort, distance)


def _check(robot: Robot, name: str, value: FloatArray, limit: FloatArray) -> None:
    with np.errstate(invalid="ignore"):
        excess = np.where(np.isfinite(limit), value - limit, -np.inf)
    worst = int(np.argmax(excess))
    if excess[worst] > _TOLERANCE * max(1.0, abs(limit[worst])):
        raise DesignError(
            f"The {name} of joint '{robot.joints[worst].name}' would reach "
            f"{value[worst]:.6g}, but {limit[worst]:.6g} is "
            "the limit; leave the limits a smaller share."
        )


def least_distance_m(robot: Robot, workspace: Workspace, q: FloatArray) -> float:
    """Least distance of any sphere from floor, boxes and its pairs over samples (n, N)."""
    still = np.zeros_like(q)
    motions = link_motions(robot, q, still, still)
    centers = [
        np.broadcast_to(s.center_m[:, None], (3, q.shape[1]))
        if s.link < 0
        else motions[s.link].origin_m + rotate(motions[s.link].rotation, s.center_m)
        for s in workspace.spheres
    ]
    least = [np.inf]
    for sphere, center in zip(workspace.spheres, centers, strict=True):
        if sphere.link < 0:
            continue
        if workspace.floor_m is not None:
            least.append(np.min(center[2]) - workspace.floor_m - sphere.radius_m)
        for box in workspace.boxes:
            least.append(np.min(box.distance_m(center)[0]) - sphere.radius_m)
    for i, j in workspace.pairs:
        gap = np.sqrt(np.sum((centers[i] - centers[j]) ** 2, axis=0)).min()
        least.append(gap - workspace.spheres[i].radius_m - workspace.spheres[j].radius_m)
    return float(min(least))
