"""The design: limits, noise and a reference model in, the most telling feasible motion out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from identify.excitation.criteria import (
    CRITERIA,
    AOptimal,
    Balanced,
    ConditionNumber,
    Criterion,
    DOptimal,
)
from identify.excitation.discriminate import Discriminating
from identify.excitation.errors import DesignError
from identify.excitation.expected import Expected, expected_quality, plain_series, variances_of
from identify.excitation.feasibility import torque_violation, workspace_violation
from identify.excitation.information import (
    InformationModel,
    NamedEffect,
    NoiseLevels,
    information_model,
    noise_levels,
)
from identify.excitation.limits import MotionLimits, motion_limits
from identify.excitation.mapping import ShapeMapping, unit_waves
from identify.excitation.objective import Problem
from identify.excitation.ramp import Ramp, shortest_ramp
from identify.excitation.reference import (
    ReferenceModel,
    reference_from_description,
    reference_from_estimate,
)
from identify.excitation.search import Progress, feasible_series, search
from identify.excitation.series import FourierSeries
from identify.excitation.verify import Peaks, ramp_torques, verify
from identify.excitation.workspace import Workspace, check_workspace
from identify.model import Model, build_model
from identify.robot import Robot
from identify.rotations import FloatArray

_GRID_PER_LINE = 16  # information grid points a line and period: finer changes log det by less than 0.01
_FINE_PER_LINE = 40  # with effects: what happens near standstill needs more instants
_DECIMALS = 10
_MOST_HARMONICS = 50


@dataclass(frozen=True)
class DesignOptions:
    """What is wanted.

    Attributes:
        harmonics: lines of the series.
        fundamental_hz: repetition rate [Hz].
        rate_hz: sampling rate of the run [Hz].
        periods: periods that the run will average.
        criterion: one of :data:`identify.excitation.criteria.CRITERIA`.
        seed: of the random starts.
        starts: number of random starts.
        refined: number of them that are optimised to the end.
        share: part of the joints' limits that may be used.
        workspace: obstacles.
        effects: for the discriminating criterion; ``NAME:PLACE`` of the catalogue, or columns of one's own.
        noise: std per channel; what is missing is assumed.
        noise_source: where ``noise`` comes from.
        reference: parameter values by name of an earlier estimate; None takes the URDF or a guess.
        reference_source: where ``reference`` comes from.
        warm_start: a motion to start from besides.
        start_pose: joint positions where the arm stands before the run; None where it does not matter.
    """

    harmonics: int = 5
    fundamental_hz: float = 0.1
    rate_hz: float = 150.0
    periods: int = 16
    criterion: str = "d"
    seed: int = 0
    starts: int = 5
    refined: int = 2
    share: float = 0.99
    workspace: Workspace = field(default_factory=Workspace)
    effects: tuple[str | NamedEffect, ...] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    noise_source: str = "the robot file"
    reference: Mapping[str, float] | None = None
    reference_source: str = ""
    warm_start: FourierSeries | None = None
    start_pose: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Design:
    """A finished, checked excitation.

    Attributes:
        robot: its name.
        joints: their names.
        series: the motion.
        ramp: start and stop.
        options: what was wanted.
        model: kind of the model it is optimal for.
        limits: that were kept, share included.
        peaks: what the motion reaches.
        expected: quality of the estimates.
        plain: the same for a motion drawn by hand.
        plain_series: that motion.
        reference: expected parameter values.
        noise: per channel.
        evaluations: of the objective and its gradient.
        interrupted: whether the operator stopped the search.
    """

    robot: str
    joints: tuple[str, ...]
    series: FourierSeries
    ramp: Ramp
    options: DesignOptions
    model: str
    limits: MotionLimits
    peaks: Peaks
    expected: Expected
    plain: Expected
    plain_series: FourierSeries
    reference: ReferenceModel
    noise: NoiseLevels
    evaluations: int
    interrupted: bool


def _check_options(robot: Robot, options: DesignOptions) -> None:
    if options.criterion not in CRITERIA:
        raise DesignError(f"Criterion '{options.criterion}' is unknown; choose {', '.join(CRITERIA)}.")
    if not 1 <= options.harmonics <= _MOST_HARMONICS:
        raise DesignError(f"{options.harmonics} harmonics were asked for; give 1 to {_MOST_HARMONICS}.")
    for name, value in (("fundamental", options.fundamental_hz), ("rate", options.rate_hz)):
        if not (np.isfinite(value) and value > 0.0):
            raise DesignError(f"The {name} is {value:g} Hz; give a positive frequency.")
    for name, number in (
        ("starts", options.starts),
        ("refined starts", options.refined),
        ("periods", options.periods),
    ):
        if number < 1:
            raise DesignError(f"The number of {name} is {number}; give at least 1.")
    samples = options.rate_hz / options.fundamental_hz
    least = 4 * options.harmonics
    if samples < least:
        raise DesignError(
            f"A period of {1 / options.fundamental_hz:g} s holds {samples:.4g} samples at "
            f"{options.rate_hz:g} Hz, but "
            f"{options.harmonics} harmonics need at least {least}; lower the fundamental to "
            f"{options.rate_hz / least:.4g} Hz, or raise the rate."
        )
    if options.criterion == "discriminating" and not options.effects:
        raise DesignError("The discriminating criterion needs at least one effect; name it as NAME:JOINT.")
    if options.warm_start is not None and len(options.warm_start.offset) != robot.n:
        raise DesignError(
            f"The warm start moves {len(options.warm_start.offset)} joints, but robot "
            f"'{robot.name}' has {robot.n}; "
            "give a design for this robot."
        )


def _check_start(robot: Robot, limits: MotionLimits, pose: tuple[float, ...] | None) -> None:
    if pose is None:
        return
    if len(pose) != robot.n:
        raise DesignError(
            f"The start pose has {len(pose)} positions, but robot '{robot.name}' has {robot.n} joints."
        )
    for joint, position in zip(robot.joints, pose, strict=True):
        if not joint.limits.lower <= position <= joint.limits.upper:
            raise DesignError(
                f"The start position {position:g} of joint '{joint.name}' lies outside its "
                f"limits {joint.limits.lower:g} "
                f"to {joint.limits.upper:g}; move the arm inside them first."
            )


def _criterion(
    options: DesignOptions, information: InformationModel, problem: Problem, plain: FourierSeries
) -> Criterion:
    if options.criterion == "a":
        return AOptimal(variances_of(problem, plain))
    if options.criterion == "condition":
        return ConditionNumber()
    if options.criterion == "balanced":
        return Balanced(_without_compensation(information))
    if options.criterion == "discriminating":
        return Discriminating(information.baseline, information.effect_columns)
    return DOptimal()


def _effects(model: Model, reference: ReferenceModel, options: DesignOptions) -> tuple[NamedEffect, ...]:
    if options.criterion != "discriminating":
        return ()
    from identify.excitation.physics_effects import (
        catalogue_effect,
    )  # the catalogue is large: loaded when asked for

    return tuple(
        effect
        if isinstance(effect, NamedEffect)
        else catalogue_effect(model, reference, 1.0 / options.fundamental_hz, effect)
        for effect in options.effects
    )


def _without_compensation(information: InformationModel) -> FloatArray:
    groups = {p.name: p.group for p in information.model.parameters}
    keep = [groups.get(name) != "gravity_compensation" for name in information.names]
    return np.flatnonzero(keep)


def prepare(robot: Robot, options: DesignOptions) -> Problem:
    """Set the problem up: everything but the search.

    Args:
        robot: the chain with drives and plate.
        options: what is wanted.

    Returns:
        The problem.

    Raises:
        DesignError: options or limits allow no design.
    """
    _check_options(robot, options)
    limits = motion_limits(robot, options.share)
    _check_start(robot, limits, options.start_pose)
    check_workspace(robot, options.workspace)
    model = build_model(robot, "combined" if robot.plate is not None else "internal")
    if options.reference is None:
        reference = reference_from_description(model, limits)
    else:
        reference = reference_from_estimate(model, options.reference, options.reference_source)
    noise = noise_levels(model, options.noise, options.noise_source)
    effects = _effects(model, reference, options)
    information = information_model(model, noise, reference, limits, effects)
    grid = max((_FINE_PER_LINE if effects else _GRID_PER_LINE) * options.harmonics, 64)
    waves = unit_waves(options.fundamental_hz, options.harmonics, grid)
    mapping = ShapeMapping(limits, options.fundamental_hz, options.harmonics, waves)
    samples = options.periods * options.rate_hz / options.fundamental_hz
    problem = Problem(information, DOptimal(), mapping, options.workspace, samples)
    plain = plain_series(limits, options.fundamental_hz, options.harmonics)
    return replace(problem, criterion=_criterion(options, information, problem, plain))


def design(
    robot: Robot,
    options: DesignOptions | None = None,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Design:
    """Design a periodic excitation.

    Args:
        robot: the chain with drives and plate.
        options: what is wanted; defaults where not given.
        executor: spreads the starts over processes; the result does not depend on it.
        progress: told the best value so far.

    Returns:
        The best motion found, checked at every instant by a path of its own.

    Raises:
        DesignError: no feasible motion, with the number that binds.

    Source:
        Verdonck, Swevers, Samin 2001, section 3 (periodic excitation (14), D-optimality under motion limits);
        Swevers et al., Optimal robot excitation and identification, IEEE Trans. Robotics Autom. 13(5) 1997.
    """
    options = options or DesignOptions()
    problem = prepare(robot, options)
    outcome = search(
        problem, options.seed, options.starts, options.refined, executor, progress, options.warm_start
    )
    if not np.isfinite(outcome.best.value):
        raise DesignError(_why_infeasible(problem, outcome.best.series))
    return _finished(problem, options, outcome.best.series, outcome.evaluations, outcome.interrupted)


def _finished(
    problem: Problem, options: DesignOptions, series: FourierSeries, evaluations: int, interrupted: bool
) -> Design:
    information, limits = problem.information, problem.mapping.limits
    series = series.rounded(_DECIMALS)
    series, ramp = _with_ramp(problem, series)
    peaks = verify(information, limits, problem.workspace, series, ramp)
    plain = plain_series(limits, options.fundamental_hz, options.harmonics)
    return Design(
        information.model.robot.name,
        information.model.robot.joint_names,
        series,
        ramp,
        options,
        information.model.kind,
        limits,
        peaks,
        expected_quality(problem, series),
        expected_quality(problem, feasible_series(problem, plain) or plain),
        plain,
        information.reference,
        information.noise,
        evaluations,
        interrupted,
    )


def _with_ramp(problem: Problem, series: FourierSeries) -> tuple[FourierSeries, Ramp]:
    """Find a ramp; where no duration keeps accelerations and torques, make the motion a little smaller."""
    limits = problem.mapping.limits
    for size in (1.0, 0.999, 0.995, 0.99, 0.98, 0.95):
        smaller = series if size == 1.0 else series.shrunk(size).rounded(_DECIMALS)
        try:
            ramp = shortest_ramp(smaller, limits)
        except DesignError:
            continue
        while ramp.duration_s <= 4.0 * series.period_s:
            if (ramp_torques(problem.information, smaller, ramp) <= limits.effort).all():
                return smaller, ramp
            ramp = Ramp(2.0 * ramp.duration_s)
    return series, shortest_ramp(series, limits)


def _why_infeasible(problem: Problem, series: FourierSeries) -> str:
    """Say which constraint leaves no motion, with its number, at the pose the motion would shrink to."""
    still = series.shrunk(0.0)
    torque = torque_violation(problem.information, problem.mapping.limits, still)
    touching = workspace_violation(problem.information.model.robot, problem.workspace, still)
    what = (
        torque
        or touching
        or torque_violation(problem.information, problem.mapping.limits, series.shrunk(0.02))
    )
    return (
        f"No motion of robot '{problem.information.model.robot.name}' is feasible: even at rest {what}; "
        "loosen that limit, or correct the reference model or the workspace."
    )
