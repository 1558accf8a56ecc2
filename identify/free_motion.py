"""Rows of a run that does not repeat: parallel filtering of measurements and model, then decimation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import interpolate, signal

from identify.blocks import Block, nominal_torque
from identify.dataset import Dataset, Signal
from identify.errors import UnusableDataError
from identify.friction import drive_velocity
from identify.model import Model, Rows
from identify.robot import WRENCH_CHANNELS
from identify.rotations import FloatArray
from identify.smoothing import SmoothMotion, smooth


@dataclass(frozen=True)
class FreeOptions:
    """How a non-periodic run is filtered.

    Attributes:
        bandwidth_hz: cut-off of the differentiating filter; chosen from the spectrum when None.
        decimate: keep every so many samples after parallel low-pass filtering; chosen when None.
        trim: samples dropped at either end.
        start_s: use the run from here on [s from its first sample].
        stop_s: use the run up to here.
        slow: leave out drive rows at lower speeds [rad/s or m/s]: creeping friction is not Coulomb's.
    """

    bandwidth_hz: float | None = None
    decimate: int | None = None
    trim: int = 0
    start_s: float | None = None
    stop_s: float | None = None
    slow: float = 0.0


@dataclass(frozen=True)
class Thinning:
    """How series on the motion's grid become rows: ends dropped, low-passed, every so many kept."""

    trim: int
    factor: int

    def apply(self, series: FloatArray) -> FloatArray:
        """Thin series, shape (..., N)."""
        return _decimate(series[..., self.trim : series.shape[-1] - self.trim], self.factor)

    def pick(self, series: FloatArray) -> FloatArray:
        """Take the same instants without filtering."""
        return series[..., self.trim : series.shape[-1] - self.trim][..., :: self.factor]


@dataclass(frozen=True)
class FreeRows:
    """One block of a non-periodic run, and the motion it rests on."""

    block: Block
    motion: SmoothMotion
    thinning: Thinning


def _on_grid(source: Signal, grid: FloatArray) -> FloatArray:
    """Bring a stream onto the grid by cubic splines; outside its span its end values hold."""
    clipped = np.clip(grid, source.t_s[0], source.t_s[-1])
    return interpolate.CubicSpline(source.t_s, source.values, axis=1)(clipped)


def _covered(source: Signal, grid: FloatArray) -> FloatArray:
    """Tell which grid instants lie inside a stream and away from its gaps."""
    inside = (grid >= source.t_s[0]) & (grid <= source.t_s[-1])
    nearest = np.clip(np.searchsorted(source.t_s, grid), 1, len(source.t_s) - 1)
    return inside & (source.t_s[nearest] - source.t_s[nearest - 1] < 5.0 / source.rate_hz)


def _decimate(series: FloatArray, factor: int) -> FloatArray:
    """Low-pass without phase and keep every ``factor``-th sample, shape (..., N)."""
    if factor == 1:
        return series
    return signal.decimate(series, factor, n=8, ftype="iir", axis=-1, zero_phase=True)


def cut(data: Dataset, options: FreeOptions) -> Dataset:
    """Cut a run to the stretch asked for."""
    if options.start_s is None and options.stop_s is None:
        return data
    first = data.position.t_s[0]
    span = (first + (options.start_s or 0.0), first + (options.stop_s if options.stop_s is not None else np.inf))
    parts = {
        key: None if stream is None else stream.between(*span)
        for key, stream in (("position", data.position), ("current", data.current), ("effort", data.effort), ("wrench", data.wrench))
    }
    if len(parts["position"].t_s) == 0:
        raise UnusableDataError(f"{data.source} has no samples between {options.start_s} s and {options.stop_s} s; choose another stretch.")
    return replace(data, **parts)


def free_rows(model: Model, data: Dataset, options: FreeOptions = FreeOptions()) -> FreeRows:
    """Form regression rows from a run without a period.

    Args:
        model: the model.
        data: the run.
        options: bandwidth, decimation, trimming.

    Returns:
        One block (one replicate) and the smoothed motion.

    Source:
        Gautier, Janot, Vandanjon, IEEE T-CST 21(2) 2013 (parallel filtering and decimation).
    """
    data = cut(data, options)
    position = data.position
    if "position" in data.filters:
        shift = data.filters["position"].delay_at_zero_s
        position = Signal(position.t_s - shift, position.values)
    motion = smooth(position, options.bandwidth_hz)
    factor = options.decimate or max(1, int(0.8 * motion.rate_hz / (2.5 * motion.bandwidth_hz)))
    channels, joint, rows, target, usable = _stacked(model, data, motion, options.slow)
    thinning = Thinning(options.trim, factor)
    block = Block(
        channels,
        joint,
        thinning.apply(rows.columns),
        thinning.apply(rows.known),
        thinning.apply(target),
        thinning.pick(usable),
        1,
        thinning.pick(motion.t_s),
    )
    if block.rows < 2 * len(model.parameters):
        raise UnusableDataError(
            f"{data.source} leaves {block.rows} usable rows for {len(model.parameters)} parameters after filtering; record longer."
        )
    return FreeRows(block, motion, thinning)


def _stacked(
    model: Model, data: Dataset, motion: SmoothMotion, slow: float
) -> tuple[tuple[str, ...], FloatArray, Rows, FloatArray, FloatArray]:
    """Model rows, targets and usability on the motion's grid for all channels of the model."""
    grid, columns, known, targets, usable = motion.t_s, [], [], [], []
    if model.kind != "external":
        torque = nominal_torque(model, data)
        rows = model.drive_rows(motion.q, motion.qd, motion.qdd)
        speed_std = np.abs(model.robot.drive_matrix) @ motion.velocity_std
        rubs = np.array([bool(joint.drive.friction) for joint in model.robot.joints])[:, None]
        lost = model.sign_unknown(motion.qd, speed_std)
        lost |= (np.abs(drive_velocity(model.robot, motion.qd)) < slow) & rubs
        _add(data, "current", rows, motion.rate_hz, columns, known)
        targets.append(_on_grid(torque, grid))
        usable.append((motion.valid & _covered(torque, grid)) & ~lost)
    if model.kind != "internal":
        if data.wrench is None:
            raise UnusableDataError(f"{data.source} has no force-plate wrench; choose --model internal.")
        rows = model.wrench_rows(motion.q, motion.qd, motion.qdd)
        _add(data, "wrench", rows, motion.rate_hz, columns, known)
        targets.append(_on_grid(data.wrench, grid))
        usable.append(np.broadcast_to(motion.valid & _covered(data.wrench, grid), (6, len(grid))))
    joint = np.concatenate([np.arange(model.robot.n)] * (model.kind != "external") + [np.full(6, -1)] * (model.kind != "internal"))
    names = model.robot.joint_names * (model.kind != "external") + WRENCH_CHANNELS * (model.kind != "internal")
    return names, joint, Rows(np.concatenate(columns), np.concatenate(known)), np.concatenate(targets), np.concatenate(usable)


def _add(data: Dataset, stream: str, rows: Rows, rate_hz: float, columns: list, known: list) -> None:
    """Append rows, put through the anti-alias filter that their measurement went through."""
    anti_alias = data.filters.get(stream)
    columns.append(rows.columns if anti_alias is None else anti_alias.apply(rows.columns, rate_hz))
    known.append(rows.known if anti_alias is None else anti_alias.apply(rows.known, rate_hz))
