"""A fit: from a run and a model to parameters, torque constants, covariance, and how far to trust them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from identify.adequacy import LackOfFit, lack_of_fit, structured_covariance
from identify.blocks import Block, PeriodicRows, noise_of, periodic_rows, residual, scatter_tables
from identify.dataset import Dataset
from identify.errors import ModelError, NotPeriodicError
from identify.fourier import FourierTrajectory, fit_trajectory, unfiltered
from identify.free_motion import FreeOptions, Thinning, free_rows
from identify.maximum_likelihood import maximise_likelihood
from identify.model import Model, build_model
from identify.noise import NoiseModel
from identify.ordinary import ordinary_least_squares, unit_noise
from identify.period import PeriodWindow, find_window
from identify.robot import Robot
from identify.rotations import FloatArray
from identify.smoothing import SmoothMotion
from identify.solve import Solution, refine, solve
from identify.warnings import drift_warnings, motion_warnings, solution_warnings

ESTIMATORS = ("markov", "ols", "ml")


@dataclass(frozen=True)
class FitOptions:
    """What to fit and how.

    Attributes:
        kind: ``combined``, ``internal``, ``external``; None takes the richest the data allow.
        estimator: ``markov`` (weighted), ``ols``, ``ml`` (encoder noise too).
        periodic: None decides from the data; False treats the run as non-periodic.
        free: filtering of a non-periodic run.
        nominal_constants: True takes the robot file's torque constants as exact instead of estimating them.
    """

    kind: str | None = None
    estimator: str = "markov"
    periodic: bool | None = None
    free: FreeOptions = field(default_factory=FreeOptions)
    nominal_constants: bool = False


@dataclass(frozen=True)
class TorqueConstant:
    """Torque constant of one joint's motor.

    Attributes:
        joint: its name.
        value: estimate [N.m/A], None where it cannot be known.
        std: its std [N.m/A], None where it cannot be known.
        nominal: of the robot file [N.m/A].
        reason: why there is no value, empty where there is one.
    """

    joint: str
    value: float | None
    std: float | None
    nominal: float | None
    reason: str = ""


@dataclass(frozen=True)
class Fit:
    """Everything a fit found.

    Attributes:
        model: the model.
        data: the run.
        window: its periods, None for a non-periodic run.
        trajectory: its motion as lines, None for a non-periodic run.
        motion: its motion on a grid, None for a periodic run.
        rows: averaged blocks (and samples, where periodic).
        noises: noise per sample of every block.
        solution: parameters and scales under the plain model of noise.
        covariance: of (parameters, torque constants of all joints); nan where not identifiable.
        torque_constants: one a joint.
        lack_of_fit: omnibus test.
        intervals_valid: whether the plain intervals hold.
        warnings: what the reader must know.
        thinning: how a non-periodic run became rows, None for a periodic run.
        tables: scatter between the periods of every block, as (table (c, M, B), degrees of freedom).
    """

    model: Model
    data: Dataset
    window: PeriodWindow | None
    trajectory: FourierTrajectory | None
    motion: SmoothMotion | None
    rows: PeriodicRows
    noises: list[NoiseModel]
    solution: Solution
    covariance: FloatArray
    torque_constants: tuple[TorqueConstant, ...]
    lack_of_fit: LackOfFit
    intervals_valid: bool
    warnings: tuple[str, ...] = field(default=())
    thinning: Thinning | None = None
    tables: tuple[tuple[FloatArray, float], ...] = ()

    @property
    def replicated(self) -> bool:
        """Whether the noise is known from repeats, so that a misfit can be told from it."""
        return all(noise.replicated for noise in self.noises)

    @property
    def theta(self) -> FloatArray:
        """Parameters, nan where not identifiable, shape (P,)."""
        count = len(self.model.parameters)
        return np.where(self.solution.identifiable[:count], self.solution.theta, np.nan)

    @property
    def std(self) -> FloatArray:
        """Std of the parameters, inf where not identifiable, shape (P,)."""
        variance = np.diag(self.covariance)[: len(self.model.parameters)]
        return np.where(np.isfinite(variance), np.sqrt(np.abs(variance)), np.inf)

    @property
    def noise_std(self) -> dict[str, float]:
        """Noise per sample of every channel [N.m or N], under the estimated torque constants."""
        result = {}
        for block, noise in zip(self.rows.blocks, self.noises, strict=True):
            for channel, joint, std in zip(block.channels, block.joint, noise.std, strict=True):
                factor = 1.0 / self.solution.scale[joint] if joint >= 0 else 1.0
                result[channel] = float(std * abs(factor))
        return result

    @property
    def residual_rms(self) -> dict[str, float]:
        """RMS of the averaged residual of every channel [N.m or N]."""
        result = {}
        for block in self.rows.blocks:
            rest = residual(block, self.solution.theta, self.solution.scale)
            for k, (channel, joint) in enumerate(zip(block.channels, block.joint, strict=True)):
                factor = 1.0 / self.solution.scale[joint] if joint >= 0 else 1.0
                used = max(int(block.usable[k].sum()), 1)
                result[channel] = float(np.sqrt(np.sum(rest[k] ** 2) / used) * abs(factor))
        return result

    @property
    def relative_error(self) -> dict[str, float]:
        """100 |u - u_hat| / |u| of every channel over the rows fitted [%]."""
        result = {}
        for block in self.rows.blocks:
            rest = residual(block, self.solution.theta, self.solution.scale)
            size = np.linalg.norm(np.where(block.usable, block.target, 0.0), axis=1)
            share = 100.0 * np.linalg.norm(rest, axis=1) / np.maximum(size, 1e-300)
            result |= dict(zip(block.channels, share.tolist(), strict=True))
        return result


def choose_kind(robot: Robot, data: Dataset, wanted: str | None) -> str:
    """Take the richest model that robot and data allow, unless one is asked for.

    Args:
        robot: the chain.
        data: the run.
        wanted: the kind asked for, or None.

    Returns:
        ``combined``, ``internal`` or ``external``.
    """
    if wanted is not None:
        return wanted
    if robot.plate is None or data.wrench is None:
        return "internal"
    return "combined" if data.drive_signal is not None else "external"


def free_scales(model: Model, data: Dataset, options: FitOptions) -> FloatArray:
    """Joints whose torque constant is an unknown of this fit: currents measured, plate as the standard."""
    if model.kind != "combined" or data.current is None or options.nominal_constants:
        return np.empty(0, dtype=int)
    return np.arange(model.robot.n)


def fit(robot: Robot, data: Dataset, options: FitOptions | None = None, model: Model | None = None) -> Fit:
    """Identify a robot from a run.

    Args:
        robot: the chain with drives and plate.
        data: the run.
        options: what to fit and how.
        model: a prepared model of the kind asked for, to save its structural analysis.

    Returns:
        The fit.

    Raises:
        UnusableDataError: the data cannot answer.
        ModelError: the model does not suit the robot.
    """
    options = options or FitOptions()
    if options.estimator not in ESTIMATORS:
        raise ModelError(f"Estimator '{options.estimator}' is unknown; choose markov, ols or ml.")
    model = model or build_model(robot, choose_kind(robot, data, options.kind))
    warnings = _unknown_scale(model, data)
    window = _window(robot, data, options, warnings)
    if window is None:
        return _fit_free(model, data, options, warnings)
    return _fit_periodic(model, data, window, options, warnings)


def _unknown_scale(model: Model, data: Dataset) -> list[str]:
    """Say so where currents stand for torques without any torque constant."""
    nameless = [joint.name for joint in model.robot.joints if joint.drive.torque_constant is None]
    if model.kind != "internal" or data.current is None or not nameless:
        return []
    return [
        f"No torque constant is known of {', '.join(nameless)}: its current is taken as 1 N.m/A, so every parameter "
        "of that joint is known only up to this factor; add torque_constant to the robot file."
    ]


def _window(robot: Robot, data: Dataset, options: FitOptions, warnings: list[str]) -> PeriodWindow | None:
    if options.periodic is False:
        return None
    stated = data.facts.fundamental_hz is not None
    if not stated and data.kind in ("validation", "free") and options.periodic is None:
        return None
    try:
        return find_window(data, robot.joint_names)
    except NotPeriodicError as error:
        if stated or options.periodic:
            raise
        warnings.append(str(error))
        return None


def _fit_periodic(
    model: Model, data: Dataset, window: PeriodWindow, options: FitOptions, warnings: list[str]
) -> Fit:
    measured = fit_trajectory(data.position, window, data.facts.harmonics)
    trajectory = unfiltered(measured, data.filters.get("position"))
    rows = periodic_rows(model, data, window, trajectory)
    free = free_scales(model, data, options)
    start = refine(rows.blocks, unit_noise(rows.blocks), model.robot.n, free)
    tables = scatter_tables(rows, window.periods, *start)
    noises = noise_of(tables)
    if options.estimator == "ols":
        solution = ordinary_least_squares(rows.blocks, noises, model.robot.n, free)
    elif options.estimator == "ml":
        solution, trajectory, rows = maximise_likelihood(model, data, window, trajectory, noises, free, start)
    else:
        solution = solve(rows.blocks, noises, model.robot.n, free, start)
    warnings += drift_warnings(tables, rows.blocks)
    warnings += motion_warnings(model.robot, *trajectory.evaluate(window.start_s + np.linspace(0, window.period_s, 400)))
    result = Fit(
        model, data, window, trajectory, None, rows, noises, solution, np.empty(0), (),
        lack_of_fit(solution, noises), True, tables=tuple(tables),
    )
    return _conclude(result, warnings)


def _fit_free(model: Model, data: Dataset, options: FitOptions, warnings: list[str]) -> Fit:
    if options.estimator == "ml":
        raise ModelError("Maximum likelihood needs a periodic run; choose --estimator markov or ols.")
    formed = free_rows(model, data, options.free)
    block, motion = formed.block, formed.motion
    free = free_scales(model, data, options)
    blocks, noises = (block,), unit_noise((block,))
    start = refine(blocks, noises, model.robot.n, free)
    for _ in range(2):  # weights from the residual, then once more with the better fit
        noises = [_noise_from_residual(block, *start)]
        start = refine(blocks, noises, model.robot.n, free, start)
    if options.estimator == "ols":
        solution = ordinary_least_squares(blocks, noises, model.robot.n, free)
    else:
        solution = solve(blocks, noises, model.robot.n, free, start)
    warnings.append(
        "The run does not repeat, so no replicate noise exists: noise is estimated from the residual itself, a "
        "misfit cannot be told from noise, and the intervals are widened accordingly. Accelerations come from a "
        f"zero-phase filter of {motion.bandwidth_hz:.3g} Hz."
    )
    warnings += motion_warnings(model.robot, motion.q[:, motion.valid], motion.qd[:, motion.valid], motion.qdd[:, motion.valid])
    rows = PeriodicRows(blocks, ())
    result = Fit(model, data, None, None, motion, rows, noises, solution, np.empty(0), (), lack_of_fit(solution, noises), False,
                 thinning=formed.thinning)
    return _conclude(result, warnings)


def _noise_from_residual(block: Block, theta: FloatArray, scale: FloatArray) -> NoiseModel:
    """Weights from the residual: its size per channel; its colour and correlation may be misfit."""
    rest = residual(block, theta, scale)
    share = max(block.rows / len(block.channels) - len(theta) / len(block.channels), 1.0)
    variance = np.sum(rest**2, axis=1) / share
    variance = np.maximum(variance, 1e-12 * max(float(variance.max(initial=0.0)), 1e-12))
    white = tuple(np.ones(1) for _ in block.channels)
    return NoiseModel(white, np.diag(variance), np.sqrt(variance), share, False)


def _conclude(partial: Fit, warnings: list[str]) -> Fit:
    """Covariance of the physical quantities, torque constants, trust."""
    solution, valid = partial.solution, partial.lack_of_fit.fits
    covariance = solution.covariance
    if not valid:
        covariance = covariance + structured_covariance(partial.rows.blocks, solution, _grid_motion(partial))
        if partial.lack_of_fit.p is not None:
            warnings.append(
                f"The model does not fit: lack of fit p = {partial.lack_of_fit.p:.2g}. Intervals that ignore this are wrong; "
                "they are widened by a covariance that allows for structured residuals. Run residuum diagnose to find what is missing."
            )
    physical = _physical_covariance(partial, covariance)
    constants = _torque_constants(partial, physical)
    warnings += solution_warnings(partial.model, solution, physical)
    return replace(
        partial,
        covariance=physical,
        torque_constants=constants,
        intervals_valid=valid,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def _grid_motion(partial: Fit) -> tuple[FloatArray, ...]:
    """Positions and speeds on every block's grid, each (2, n, B)."""
    result = []
    for block in partial.rows.blocks:
        if partial.trajectory is not None and partial.window is not None:
            q, qd, _ = partial.trajectory.evaluate(partial.window.start_s + block.grid_s)
        else:
            q, qd, _ = partial.motion.at(block.grid_s)  # type: ignore[union-attr]
        result.append(np.stack([q, qd]))
    return tuple(result)


def _physical_covariance(partial: Fit, covariance: FloatArray) -> FloatArray:
    """Covariance of (theta, K of all joints): K = K_nominal / s, nan rows where not identifiable."""
    robot, solution = partial.model.robot, partial.solution
    count, n = len(partial.model.parameters), robot.n
    jacobian = np.zeros((count + n, covariance.shape[0]))
    jacobian[:count, :count] = np.eye(count)
    for column, joint in enumerate(solution.free_scales):
        nominal = robot.joints[joint].drive.torque_constant or 1.0
        jacobian[count + joint, count + column] = -nominal / solution.scale[joint] ** 2
    result = jacobian @ covariance @ jacobian.T
    known = np.zeros(count + n, dtype=bool)
    known[:count] = solution.identifiable[:count]
    known[count + solution.free_scales] = solution.identifiable[count:]
    result[~known, :] = np.nan
    result[:, ~known] = np.nan
    return result


def _torque_constants(partial: Fit, covariance: FloatArray) -> tuple[TorqueConstant, ...]:
    robot, solution, count = partial.model.robot, partial.solution, len(partial.model.parameters)
    reason = _why_no_constants(partial)
    result = []
    for k, joint in enumerate(robot.joints):
        nominal = joint.drive.torque_constant
        variance = covariance[count + k, count + k]
        if reason or not np.isfinite(variance):
            result.append(TorqueConstant(joint.name, None, None, nominal, reason or _UNSEEN_CONSTANT))
            continue
        value = (nominal or 1.0) / solution.scale[k]
        result.append(TorqueConstant(joint.name, float(value), float(np.sqrt(variance)), nominal))
    return tuple(result)


_UNSEEN_CONSTANT = "the force plate does not see enough of this joint's motion in this run to fix its torque scale"


def _why_no_constants(partial: Fit) -> str:
    if partial.model.kind == "internal":
        return (
            "without the force plate the overall scale of the torques is not identifiable: "
            "currents and inertias can be scaled together"
        )
    if partial.model.kind == "external":
        return "the external model does not use the motor currents"
    if len(partial.solution.free_scales) == 0 and partial.data.current is not None:
        return "the nominal constants were taken as exact, as asked"
    if partial.data.current is None:
        return "the log has joint efforts instead of motor currents, so the constants were applied before recording"
    return ""
