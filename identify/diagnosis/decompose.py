"""A recording against another simulator's: what their difference is made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from identify.blocks import Block, periodic_rows, predict
from identify.dataset import Dataset
from identify.diagnosis.augmented import Augmented
from identify.diagnosis.problem import Problem
from identify.errors import NotPeriodicError
from identify.fit import Fit
from identify.fourier import FourierTrajectory, fit_trajectory
from identify.free_motion import FreeOptions, FreeRows, free_rows
from identify.friction import drive_velocity
from identify.ordinary import unit_noise
from identify.period import PeriodWindow, find_window
from identify.rotations import FloatArray
from identify.smoothing import SmoothMotion
from identify.solve import refine

_SAME_MOTION = 0.01  # of a joint's range: closer paths count as one and the samples are subtracted directly
_GRID = 512
_SLOW = 0.02  # of a drive's top speed: below it a simulation is taken to stand or turn


@dataclass(frozen=True)
class Share:
    """What the difference in one channel is made of [N.m or N].

    Attributes:
        difference: RMS of recording less simulation.
        parameters: RMS of what other parameters make of it.
        effects: RMS of the named effects.
        rest: RMS of what is left, noise included.
        noise: of the averaged recording.
        shares: signed shares of the difference's power, which add up to 1: parameters, effects, noise, rest beyond it.
        simulation_rest: what the same model leaves of the simulation on its own motion, RMS.
    """

    difference: float
    parameters: float
    effects: float
    rest: float
    noise: float
    shares: dict[str, float]
    simulation_rest: float


@dataclass(frozen=True)
class Decomposition:
    """A recording compared with a simulation.

    Attributes:
        channels: shares of every channel.
        theta: the model's parameters fitted to the simulation, shape (P,).
        torque_constants: likewise [N.m/A], nan where not estimated, shape (n,).
        same_motion: whether both follow the same path, so that samples could be subtracted.
    """

    channels: dict[str, Share]
    theta: FloatArray
    torque_constants: FloatArray
    same_motion: bool


@dataclass(frozen=True)
class _Rows:
    """Averaged rows of the simulation and its motion."""

    blocks: tuple[Block, ...]
    window: PeriodWindow | None
    trajectory: FourierTrajectory | None
    motion: SmoothMotion | None


def decompose(problem: Problem, augmented: Augmented, simulation: Dataset) -> Decomposition:
    """Split recording less simulation into parameter error, named effects and rest.

    Args:
        problem: the recording's fit prepared for diagnosis.
        augmented: the joint fit with the named effects.
        simulation: the simulator's log; its currents or efforts, and its wrench where the model has one.

    Returns:
        The decomposition. Where the motions differ, the simulation enters through the same model fitted to it.

    Raises:
        UnusableDataError: the simulation lacks what the model explains.
    """
    fit = problem.fit
    simulation = replace(simulation, filters={})  # a simulator has no anti-alias filters
    rows = _rows(fit, simulation)
    free = fit.solution.free_scales if simulation.current is not None else np.empty(0, dtype=int)
    same_blocks = [b.channels for b in rows.blocks] == [b.channels for b in fit.rows.blocks]
    noises = fit.noises if same_blocks else unit_noise(rows.blocks)
    theta, scale = refine(rows.blocks, noises, fit.model.robot.n, free)
    shift_s = _shift(fit, rows)
    ratio = 1.0 / augmented.scale if simulation.current is not None else np.ones(fit.model.robot.n)
    channels: dict[str, Share] = {}
    for index in range(len(fit.rows.blocks)):
        channels |= _block_shares(problem, augmented, index, (rows, theta, scale, ratio, shift_s))
    nominal = np.array([joint.drive.torque_constant or np.nan for joint in fit.model.robot.joints])
    constants = np.full(fit.model.robot.n, np.nan)
    constants[free] = nominal[free] / scale[free]
    return Decomposition(channels, theta, constants, shift_s is not None)


def _rows(fit: Fit, data: Dataset) -> _Rows:
    if fit.window is not None:
        try:
            window = find_window(data, fit.model.robot.joint_names)
            trajectory = fit_trajectory(data.position, window, data.facts.harmonics)
            return _Rows(periodic_rows(fit.model, data, window, trajectory).blocks, window, trajectory, None)
        except NotPeriodicError:
            pass
    bandwidth = fit.motion.bandwidth_hz if fit.motion is not None else None
    formed = free_rows(fit.model, data, FreeOptions(bandwidth))
    return _Rows((_moving(fit, formed),), None, None, formed.motion)


def _moving(fit: Fit, formed: FreeRows) -> Block:
    """Leave out drives that stand: a noise-free simulation tells a direction where friction has none."""
    robot, block = fit.model.robot, formed.block
    speed = np.abs(formed.thinning.pick(drive_velocity(robot, formed.motion.qd)))
    usable = np.array(block.usable)
    for k, joint in enumerate(block.joint):
        if joint >= 0 and robot.joints[joint].drive.friction:
            usable[k] &= speed[joint] > _SLOW * speed[joint].max(initial=0.0)
    return replace(block, usable=usable)


def _shift(fit: Fit, rows: _Rows) -> float | None:
    """Time by which the simulation's motion must be looked up later [s]; None where the motions differ."""
    if fit.window is not None and fit.trajectory is not None and rows.window is not None and rows.trajectory is not None:
        return _periodic_shift(fit.window, fit.trajectory, rows.window, rows.trajectory)
    if fit.motion is None or rows.motion is None:
        return None
    t = fit.motion.t_s - fit.motion.t_s[0] + rows.motion.t_s[0]
    if abs(t[-1] - rows.motion.t_s[-1]) > 0.05 * (t[-1] - t[0]):
        return None
    other = np.stack([np.interp(t, rows.motion.t_s, q) for q in rows.motion.q])
    return float(rows.motion.t_s[0] - fit.motion.t_s[0]) if _close(fit.motion.q, other) else None


def _close(q: FloatArray, other: FloatArray) -> bool:
    span = max(float(np.ptp(q, axis=1).max()), 1e-9)
    return bool(np.abs(q - other).max() < _SAME_MOTION * span)


def _periodic_shift(
    window: PeriodWindow, trajectory: FourierTrajectory, other: PeriodWindow, other_trajectory: FourierTrajectory
) -> float | None:
    """Phase between two periodic motions, None where they are not the same motion."""
    period = window.period_s
    if abs(other.period_s - period) > 1e-3 * period:
        return None
    grid = np.arange(_GRID) * period / _GRID
    q = trajectory.evaluate(window.start_s + grid)[0]

    def apart(shift_s: float) -> float:
        return float(np.sum((other_trajectory.evaluate(other.start_s + grid + shift_s)[0] - q) ** 2))

    there = other_trajectory.evaluate(other.start_s + grid)[0]
    overlap = np.fft.irfft((np.fft.rfft(there) * np.fft.rfft(q).conj()).sum(axis=0), _GRID)
    coarse = float(np.argmax(overlap)) * period / _GRID
    step = period / _GRID
    shift = float(optimize.minimize_scalar(apart, bounds=(coarse - step, coarse + step), method="bounded").x)
    found = other_trajectory.evaluate(other.start_s + grid + shift)[0]
    return shift if _close(q, found) else None


def _simulated(rows: _Rows, channel: str, block: Block, shift_s: float) -> tuple[FloatArray, FloatArray]:
    """The simulation's own samples of a channel on a block's grid, and where they count."""
    own = next(b for b in rows.blocks if channel in b.channels)
    k = own.channels.index(channel)
    period = rows.window.period_s if rows.window is not None else None
    t = block.grid_s + shift_s
    values = np.interp(t, own.grid_s, own.target[k], period=period)
    return values, np.interp(t, own.grid_s, own.usable[k].astype(float), period=period) > 0.99


def _block_shares(
    problem: Problem, augmented: Augmented, index: int, simulated: tuple[_Rows, FloatArray, FloatArray, FloatArray, float | None]
) -> dict[str, Share]:
    rows, theta, scale, ratio, shift_s = simulated
    fit, block = problem.fit, problem.blocks[index]
    factor = np.where(block.joint >= 0, 1.0 / augmented.scale[np.maximum(block.joint, 0)], 1.0)[:, None]
    other = np.where(block.joint >= 0, ratio[np.maximum(block.joint, 0)], 1.0)[:, None]
    measured = factor * block.target
    expected = factor * predict(block.columns, block.known, block.joint, augmented.theta, augmented.scale)
    rival = other * predict(block.columns, block.known, block.joint, theta, scale)
    effects = np.zeros_like(measured)
    for item in augmented.additions:
        columns = problem.enter(index, item.effect.columns(problem.scenes[index], item.place, item.shape))
        effects += factor * np.tensordot(columns, item.values, axes=([1], [0]))
    tared = fit.model.robot.plate is not None and fit.model.robot.plate.tared
    result = {}
    for k, channel in enumerate(block.channels):
        reference, usable = rival[k], block.usable[k]
        if shift_s is not None:
            values, there = _simulated(rows, channel, block, shift_s)
            reference, usable = other[k] * values, usable & there
        parts = [measured[k] - reference, expected[k] - rival[k], effects[k]]
        picked = [part[usable] - (part[usable].mean() if tared and block.joint[k] < 0 else 0.0) for part in parts]
        noise = fit.noise_std[channel] / np.sqrt(block.repeats)
        result[channel] = _share(*picked, noise, _beyond(rows, channel, theta, scale, other[k, 0]))
    return result


def _beyond(rows: _Rows, channel: str, theta: FloatArray, scale: FloatArray, factor: float) -> float:
    """What the model leaves of the simulation itself, RMS."""
    own = next(b for b in rows.blocks if channel in b.channels)
    k = own.channels.index(channel)
    rest = own.target[k] - predict(own.columns[k : k + 1], own.known[k : k + 1], own.joint[k : k + 1], theta, scale)[0]
    return float(abs(factor) * np.sqrt(np.mean(rest[own.usable[k]] ** 2)))


def _share(difference: FloatArray, parameters: FloatArray, effects: FloatArray, noise: float, beyond: float) -> Share:
    rest = difference - parameters - effects
    power = max(float(difference @ difference), 1e-300)
    parts = {"parameters": parameters, "effects": effects, "rest": rest}
    sizes = {name: float(np.sqrt(np.mean(part**2))) for name, part in parts.items()}
    shares = {name: float(difference @ part) / power for name, part in parts.items()}
    shares["noise"] = float(np.clip(noise**2 * len(difference) / power, 0.0, max(shares["rest"], 0.0)))
    shares["rest"] -= shares["noise"]
    return Share(float(np.sqrt(power / len(difference))), noise=noise, shares=shares, simulation_rest=beyond, **sizes)
