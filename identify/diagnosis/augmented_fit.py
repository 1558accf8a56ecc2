"""The joint fit in the form of a fit: parameters, torque constants and covariance with the named effects in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.adequacy import lack_of_fit, structured_covariance
from identify.diagnosis.augmented import Addition, Augmented
from identify.fit import Fit, TorqueConstant
from identify.robot import Robot
from identify.rotations import FloatArray


@dataclass(frozen=True)
class AugmentedFit:
    """A fit whose parameters were estimated together with effects.

    Attributes:
        fit: the fit; its covariance is that of (parameters, torque constants) with the effects free.
        additions: the effects.
        order: names of what :attr:`covariance` is of: parameters, torque constants, effects.
        covariance: joint covariance, nan where not identifiable, shape (P + n + e, P + n + e).
    """

    fit: Fit
    additions: tuple[Addition, ...]
    order: tuple[str, ...]
    covariance: FloatArray


def augmented_fit(fit: Fit, augmented: Augmented, adequate: bool = True) -> AugmentedFit:
    """Put a joint fit in the place of its baseline.

    Args:
        fit: the baseline.
        augmented: the joint fit.
        adequate: whether what is left passed as noise; otherwise the intervals are widened.

    Returns:
        The fit with the effects' share taken out of parameters, constants and covariance.
    """
    freedom = len(augmented.names)
    solution = replace(
        fit.solution,
        theta=augmented.theta,
        scale=augmented.scale,
        covariance=augmented.baseline_covariance,
        chi2=augmented.chi2,
        whitened=augmented.residual,
        rank=fit.solution.rank + freedom,
    )
    test = lack_of_fit(solution, fit.noises)
    valid = test.fits and adequate
    covariance = augmented.joint_covariance.copy()
    if not valid:
        base = len(augmented.baseline_covariance)
        covariance[:base, :base] += structured_covariance(
            fit.rows.blocks, replace(solution, **_plain(solution)), None
        )
    physical = _physical(fit, augmented, covariance)
    size = len(fit.model.parameters) + fit.model.robot.n
    joint = fit.model.robot.joint_names
    changed = replace(
        fit,
        solution=solution,
        covariance=physical[:size, :size],
        lack_of_fit=test,
        intervals_valid=valid,
        torque_constants=_constants(fit, augmented.scale, physical),
    )
    order = tuple(p.name for p in fit.model.parameters) + tuple(f"{name}.torque_constant" for name in joint)
    return AugmentedFit(
        changed, augmented.additions, order + readable(augmented.names, fit.model.robot), physical
    )


def readable(names: tuple[str, ...], robot: Robot) -> tuple[str, ...]:
    """Write joint names for the joint indices in ``effect@place.parameter``."""
    result = []
    for name in names:
        effect, rest = name.split("@", 1)
        place, parameter = rest.rsplit(".", 1)
        result.append(f"{effect}@{robot.joints[int(place)].name if place.isdigit() else place}.{parameter}")
    return tuple(result)


def _plain(solution: object) -> dict[str, None]:
    """The joint fit is a weighted one: it has no unweighted twin."""
    return {"unweighted": None} if hasattr(solution, "unweighted") else {}


def _physical(fit: Fit, augmented: Augmented, covariance: FloatArray) -> FloatArray:
    """Covariance of (theta, K of all joints, effects): K = K_nominal / s."""
    count, n, free = len(fit.model.parameters), fit.model.robot.n, fit.solution.free_scales
    extra = len(augmented.names)
    jacobian = np.zeros((count + n + extra, len(covariance)))
    jacobian[:count, :count] = np.eye(count)
    for column, joint in enumerate(free):
        nominal = fit.model.robot.joints[joint].drive.torque_constant or 1.0
        jacobian[count + joint, count + column] = -nominal / augmented.scale[joint] ** 2
    jacobian[count + n :, count + len(free) :] = np.eye(extra)
    result = jacobian @ covariance @ jacobian.T
    known = np.zeros(len(result), dtype=bool)
    known[:count] = fit.solution.identifiable[:count]
    known[count + free] = fit.solution.identifiable[count:]
    known[count + n :] = True
    result[~known, :] = np.nan
    result[:, ~known] = np.nan
    return result


def _constants(fit: Fit, scale: FloatArray, physical: FloatArray) -> tuple[TorqueConstant, ...]:
    count, result = len(fit.model.parameters), []
    for k, constant in enumerate(fit.torque_constants):
        if constant.value is not None:
            std = float(np.sqrt(physical[count + k, count + k]))
            constant = replace(constant, value=float((constant.nominal or 1.0) / scale[k]), std=std)
        result.append(constant)
    return tuple(result)
