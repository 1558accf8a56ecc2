"""Limits of the motion as arrays, with the share of them that a design may use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.errors import DesignError
from identify.robot import Robot
from identify.rotations import FloatArray

# a joint without position limits is moved over one turn (a slider over one metre): more tells nothing new
_TURN, _METRE = np.pi, 0.5
_SMALLEST_SPAN = 1e-4


@dataclass(frozen=True)
class MotionLimits:
    """What the motion must keep at every instant; ``inf`` where nothing binds.

    Attributes:
        lower: positions [rad or m], shape (n,).
        upper: positions, shape (n,).
        velocity: shape (n,).
        acceleration: shape (n,).
        effort: drive torques [N.m or N], shape (n,).
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray

    @property
    def middle(self) -> FloatArray:
        """Pose halfway between the position limits, shape (n,)."""
        return 0.5 * (self.lower + self.upper)


def motion_limits(robot: Robot, share: float = 0.99) -> MotionLimits:
    """Collect the limits of a robot's joints, drawn in towards their middle.

    Args:
        robot: the chain.
        share: part of each limit that may be used; the rest is left to the controllers.

    Returns:
        The limits.

    Raises:
        DesignError: a joint cannot move within its limits.
    """
    if not 0.0 < share <= 1.0:
        raise DesignError(f"The share of the limits is {share:g}, but it must lie above 0 and not above 1.")
    ends = [_span(joint.limits.lower, joint.limits.upper, joint.prismatic) for joint in robot.joints]
    lower, upper = np.array(ends).T
    middle, half = 0.5 * (lower + upper), 0.5 * share * (upper - lower)
    rest = [
        share * np.array([getattr(joint.limits, key) for joint in robot.joints])
        for key in ("velocity", "acceleration", "effort")
    ]
    limits = MotionLimits(middle - half, middle + half, *rest)
    _check(robot, limits)
    return limits


def _span(lower: float, upper: float, prismatic: bool) -> tuple[float, float]:
    reach = _METRE if prismatic else _TURN
    if np.isfinite(lower) and np.isfinite(upper):
        return lower, upper
    if np.isfinite(lower):
        return lower, lower + 2.0 * reach
    return (upper - 2.0 * reach, upper) if np.isfinite(upper) else (-reach, reach)


def _check(robot: Robot, limits: MotionLimits) -> None:
    for k, joint in enumerate(robot.joints):
        span = limits.upper[k] - limits.lower[k]
        unit = "m" if joint.prismatic else "rad"
        if span < _SMALLEST_SPAN:
            raise DesignError(
                f"Joint '{joint.name}' may move over {span:.3g} {unit} only (limits "
                f"{joint.limits.lower:g} to "
                f"{joint.limits.upper:g} {unit}): no motion fits; widen its limits in the URDF, "
                "or make the joint fixed."
            )
        for key, per in (("velocity", "s"), ("acceleration", "s2")):
            value = getattr(limits, key)[k]
            if value <= 0.0:
                raise DesignError(
                    f"Joint '{joint.name}' has the {key} limit {value:g} {unit}/{per}, which allows "
                    "no motion; "
                    "correct it in the URDF or robot file, or leave it out where there is none."
                )
        if limits.effort[k] <= 0.0:
            raise DesignError(
                f"Joint '{joint.name}' has the effort limit {limits.effort[k]:g} "
                f"{joint.torque_unit}, which allows no "
                "motion; correct it in the URDF, or leave it out where there is none."
            )
