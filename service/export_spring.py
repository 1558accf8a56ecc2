"""A gravity compensation as the cubic joint spring a simulator can hold, and what the cubic leaves over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.export_model import DriveTerms, FloatArray

_GRID = 401
_WIDEST_RAD = np.pi  # a joint without limits: one turn


@dataclass(frozen=True)
class JointSpring:
    """Spring torque k1 x + k2 x^2 + k3 x^3 with x = q - rest position, as the drive feels it.

    Attributes:
        rest_rad: position without torque [rad].
        stiffness: k1 [N.m/rad], k2 [N.m/rad2], k3 [N.m/rad3].
        left_over_nm: largest torque within the joint's range that the cubic does not hold [N.m].
    """

    rest_rad: float
    stiffness: tuple[float, float, float]
    left_over_nm: float

    def torque_nm(self, q: FloatArray) -> FloatArray:
        """Torque [N.m] the drive gives against the spring at positions q (N,)."""
        x = q - self.rest_rad
        k1, k2, k3 = self.stiffness
        return x * (k1 + x * (k2 + x * k3))


def joint_spring(drive: DriveTerms, lower_rad: float, upper_rad: float) -> JointSpring | None:
    """Fit a cubic spring to gravity compensation and offset together over the joint's range.

    Args:
        drive: what acts inside the joint.
        lower_rad: lower end of the range [rad], -inf where there is none.
        upper_rad: upper end [rad].

    Returns:
        The spring; None where the joint has no compensation or no cubic has a rest position.
    """
    if len(drive.cosine) == 0:
        return None
    q = np.linspace(max(lower_rad, -_WIDEST_RAD), min(upper_rad, _WIDEST_RAD), _GRID)
    wanted = drive.offset + drive.compensation_nm(q)
    middle = 0.5 * (q[0] + q[-1])
    cubic = np.polynomial.Polynomial.fit(q, wanted, 3).convert()
    roots = cubic.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    if len(real) == 0:
        return None
    rest = float(real[np.argmin(np.abs(real - middle))])
    stiffness = (
        float(cubic.deriv(1)(rest)),
        float(cubic.deriv(2)(rest) / 2),
        float(cubic.deriv(3)(rest) / 6),
    )
    spring = JointSpring(rest, stiffness, 0.0)
    return JointSpring(rest, stiffness, float(np.abs(wanted - spring.torque_nm(q)).max()))
