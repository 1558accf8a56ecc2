"""What to expect of a run before it: std of every parameter, volume, condition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.criteria import condition_number, covariance, log_det
from identify.excitation.discriminate import smallest_detectable
from identify.excitation.information import InformationModel
from identify.excitation.limits import MotionLimits
from identify.excitation.mapping import ShapeMapping
from identify.excitation.objective import Problem
from identify.excitation.series import FourierSeries
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Expected:
    """Expected quality of the estimates.

    Attributes:
        std: by parameter name, SI; inf where the motion does not show it.
        log_det_covariance: of parameters and torque constants.
        condition_number: of the whitened regressor with columns of unit norm.
        smallest_detectable: by effect, for a discriminating design.
    """

    std: dict[str, float]
    log_det_covariance: float
    condition_number: float
    smallest_detectable: dict[str, float]


def expected_quality(problem: Problem, series: FourierSeries) -> Expected:
    """Evaluate what a run of this motion will tell.

    Args:
        problem: noise, reference model, number of samples.
        series: the motion.

    Returns:
        The expectation under the stated noise and reference model.
    """
    information = problem.information
    matrix = problem.matrix_of(series)
    count = information.baseline
    own = matrix[:count, :count]
    condition = condition_number(own)
    std = dict.fromkeys(information.all_names, float("inf"))
    variances = np.diag(covariance(own))
    seen = np.isfinite(condition)
    for name, variance in zip(information.names, variances, strict=True):
        std[name] = float(np.sqrt(variance)) if seen else float("inf")
    _rescale_constants(information, std)
    sizes = smallest_detectable(matrix, count, information.effect_columns)
    named = {effect.name: size for effect, size in zip(information.effects, sizes, strict=True)}
    return Expected(std, -log_det(own)[0], condition, named)


def _rescale_constants(information: InformationModel, std: dict[str, float]) -> None:
    """Turn the std of K_nominal / K into that of K [N.m/A], at K = K_nominal."""
    for k in information.free_scales:
        joint = information.model.robot.joints[k]
        std[f"{joint.name}.torque_constant"] *= abs(joint.drive.torque_constant or 1.0)


def plain_series(limits: MotionLimits, fundamental_hz: float, harmonics: int) -> FourierSeries:
    """Give the motion one would draw by hand: joint j a sine at line j, as large as the limits allow."""
    n = len(limits.lower)
    shape = np.zeros((n, 2 * harmonics + 2))
    lines = np.arange(n) % harmonics
    shape[np.arange(n), lines] = 0.5
    shape[np.arange(n), harmonics + lines] = 1.0
    shape[np.arange(n), (lines + 1) % harmonics] += 0.3  # a second line: one alone leaves columns dependent
    shape[:, -2], shape[:, -1] = 0.5, 1.0
    mapping = ShapeMapping(limits, fundamental_hz, harmonics, None)  # type: ignore[arg-type]
    return mapping.series(shape.ravel())


def variances_of(problem: Problem, series: FourierSeries) -> FloatArray:
    """Variances of parameters and torque constants, shape (baseline,)."""
    count = problem.information.baseline
    return np.diag(covariance(problem.matrix_of(series)[:count, :count]))
