"""Whether a motion keeps torque limits and distances at every instant, by bounds between samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.bounds import grid_points, sampled_peak
from identify.excitation.information import InformationModel
from identify.excitation.limits import MotionLimits
from identify.excitation.reference import drive_torque
from identify.excitation.series import FourierSeries
from identify.excitation.workspace import Workspace, clearances
from identify.robot import Robot
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Violation:
    """The constraint that is violated most.

    Attributes:
        what: such as ``the torque of joint 'joint_2'``.
        value: what is reached.
        limit: what is allowed.
        unit: of both.
    """

    what: str
    value: float
    limit: float
    unit: str

    def __str__(self) -> str:
        return (
            f"{self.what} reaches {self.value:.4g} {self.unit}, but {self.limit:.4g} {self.unit} is the limit"
        )


def point_bounds(
    robot: Robot, speed: FloatArray, acceleration: FloatArray, reach_m: FloatArray
) -> FloatArray:
    """Bound the acceleration of any point within ``reach_m`` of each link's joint frame.

    Args:
        robot: the chain.
        speed: greatest joint speeds, shape (n,).
        acceleration: greatest joint accelerations, shape (n,).
        reach_m: distance of the point from the joint frame, shape (n,).

    Returns:
        Bounds [m/s2], shape (n,).

    Source:
        Triangle inequality along the chain: |a_k| <= |a_k-1| + (alpha + omega^2) |arm|.
    """
    omega, alpha, here, bounds = 0.0, 0.0, 0.0, []
    for k, joint in enumerate(robot.joints):
        arm = float(np.linalg.norm(joint.translation_m))
        here += (alpha + omega**2) * arm
        if joint.prismatic:
            travel = max(abs(joint.limits.lower), abs(joint.limits.upper))
            travel = travel if np.isfinite(travel) else 1.0
            here += (alpha + omega**2) * travel + 2.0 * omega * speed[k] + acceleration[k]
        else:
            alpha += acceleration[k] + omega * speed[k]
            omega += speed[k]
        bounds.append(here + (alpha + omega**2) * reach_m[k])
    return np.array(bounds)


def torque_peaks(information: InformationModel, series: FourierSeries) -> FloatArray:
    """Greatest torque of every drive, whichever way Coulomb friction points, shape (n,)."""
    model, theta = information.model, information.reference.theta
    q, qd, qdd = series.evaluate(series.grid_s(grid_points(series)))
    smooth = drive_torque(model, theta, q, qd, qdd, np.zeros_like(qd))
    return sampled_peak(smooth) + coulomb_levels(information)


def coulomb_levels(information: InformationModel) -> FloatArray:
    """Coulomb friction of every drive in the reference model [N.m or N], shape (n,)."""
    model, theta = information.model, information.reference.theta
    values = dict(zip([p.name for p in model.parameters], theta, strict=True))
    return np.array([abs(values.get(f"{joint.name}.coulomb", 0.0)) for joint in model.robot.joints])


def torque_violation(
    information: InformationModel, limits: MotionLimits, series: FourierSeries
) -> Violation | None:
    """Name the drive whose torque exceeds its limit most, None if none does."""
    if not np.isfinite(limits.effort).any():
        return None
    peaks = torque_peaks(information, series)
    worst = int(np.argmax(peaks / limits.effort))
    if peaks[worst] <= limits.effort[worst]:
        return None
    joint = information.model.robot.joints[worst]
    return Violation(
        f"the torque of joint '{joint.name}'",
        float(peaks[worst]),
        float(limits.effort[worst]),
        joint.torque_unit,
    )


def least_clearances(
    robot: Robot, workspace: Workspace, series: FourierSeries
) -> tuple[tuple[str, ...], FloatArray]:
    """Bound every distance from below over the whole period.

    Args:
        robot: the chain.
        workspace: bodies and obstacles.
        series: the motion.

    Returns:
        Names, and lower bounds less the margin [m], shape (k,).

    Source:
        A distance from a convex body changes at most as fast as the point moves. Between two samples a step d
        apart the point stays within d^2 / 8 max |acceleration| of its chord, and on a chord of length l with
        distances d0, d1 at its ends the distance is at least (d0 + d1 - l) / 2.
    """
    count = grid_points(series)
    step = series.period_s / count
    q, qd, qdd = series.evaluate(series.grid_s(count))
    found = clearances(robot, workspace, q)
    chord = np.linalg.norm(found.moving_m - np.roll(found.moving_m, -1, axis=2), axis=1)
    between = 0.5 * (found.distance_m + np.roll(found.distance_m, -1, axis=1) - chord)
    return found.names, between.min(axis=1) - step**2 / 8.0 * _greatest_acceleration(
        robot, workspace, qd, qdd
    )


def _greatest_acceleration(robot: Robot, workspace: Workspace, qd: FloatArray, qdd: FloatArray) -> float:
    """Bound the acceleration of a difference of two points: twice the most accelerated point's [m/s2]."""
    reach = np.zeros(robot.n)
    for sphere in workspace.spheres:
        if sphere.link >= 0:
            reach[sphere.link] = max(reach[sphere.link], float(np.linalg.norm(sphere.center_m)))
    return 2.0 * float(point_bounds(robot, np.abs(qd).max(axis=1), np.abs(qdd).max(axis=1), reach).max())


def workspace_violation(robot: Robot, workspace: Workspace, series: FourierSeries) -> Violation | None:
    """Name the two bodies that come nearest, None if all keep their distance."""
    if workspace.empty:
        return None
    names, least = least_clearances(robot, workspace, series)
    worst = int(np.argmin(least))
    if least[worst] >= 0.0:
        return None
    margin = workspace.margin_m
    return Violation(f"the distance between {names[worst]}", float(least[worst]) + margin, margin, "m")
