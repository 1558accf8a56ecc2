"""Averaged regression rows: what a run says, one block of channels on one grid of a period."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.dataset import Dataset, Signal
from identify.errors import UnusableDataError
from identify.filters import AntiAliasFilter
from identify.fourier import FourierTrajectory
from identify.model import Model, Rows
from identify.noise import NoiseModel, noise_from_scatter
from identify.period import PeriodWindow
from identify.robot import WRENCH_CHANNELS
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Samples:
    """Unaveraged samples of one stream, sorted by their place in the period.

    Attributes:
        rows: model rows at the samples' own instants.
        target: measurements, shape (c, N).
        bin: place in the period, shape (N,).
        period: which period, shape (N,).
        t_s: instants, shape (N,).
    """

    rows: Rows
    target: FloatArray
    bin: FloatArray
    period: FloatArray
    t_s: FloatArray


@dataclass(frozen=True)
class Block:
    """Rows averaged over the periods, for channels that share one grid.

    Attributes:
        channels: names, joints before wrench channels.
        joint: for each channel the joint whose drive it measures, -1 for wrench channels, shape (c,).
        columns: averaged rows, shape (c, P, B).
        known: averaged known part, shape (c, B).
        target: averaged measurement (drive torque under nominal torque constants, or wrench), shape (c, B).
        usable: False where a row must not count (no sample, sign of speed unknown), shape (c, B).
        repeats: how many samples a bin averages, nominally.
        grid_s: instants of the bins from the start of the window [s], shape (B,).
    """

    channels: tuple[str, ...]
    joint: FloatArray
    columns: FloatArray
    known: FloatArray
    target: FloatArray
    usable: FloatArray
    repeats: int
    grid_s: FloatArray

    @property
    def rows(self) -> int:
        """Number of rows that count."""
        return int(self.usable.sum())


def nominal_torque(model: Model, data: Dataset) -> Signal:
    """Give the drives' torques under the nominal torque constants.

    Args:
        model: the model, for gear ratios and constants.
        data: the run.

    Returns:
        Drive torques [N.m or N], values (n, N); efforts as they are where there are no currents.

    Raises:
        UnusableDataError: neither currents nor efforts were recorded.
    """
    if data.current is not None:
        factors = [(j.drive.torque_constant or 1.0) * j.drive.gear_ratio for j in model.robot.joints]
        return Signal(data.current.t_s, data.current.values * np.array(factors)[:, None])
    if data.effort is None:
        raise UnusableDataError(
            f"{data.source} has neither motor currents nor joint efforts, so the {model.kind} model has no "
            "torques to explain; record /motor_currents, or choose --model external where there is a plate."
        )
    if model.robot.coupling is None:
        return data.effort
    # efforts are those of the joints; the drives of a coupled transmission share them, u = D^-T tau
    return Signal(data.effort.t_s, np.linalg.solve(model.robot.drive_matrix.T, data.effort.values))


def _sorted_samples(
    signal: Signal, window: PeriodWindow, bins: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Order samples by their place in the period: order, bin, period, instants."""
    period, place = window.bins_of(signal.t_s, bins)
    order = np.argsort(place, kind="stable")
    return order, place[order], period[order], signal.t_s[order]


def _collect(
    model: Model, trajectory: FourierTrajectory, signal: Signal, window: PeriodWindow, drives: bool
) -> tuple[Samples, FloatArray]:
    """Evaluate the model at every sample's own instant; also mark rows whose sign is unknown."""
    cut = signal.between(window.start_s, window.stop_s)
    bins = _bins(signal, window)
    order, place, period, t = _sorted_samples(cut, window, bins)
    q, qd, qdd = trajectory.evaluate(t)
    rows = model.drive_rows(q, qd, qdd) if drives else model.wrench_rows(q, qd, qdd)
    speed_std = np.abs(model.robot.drive_matrix) @ trajectory.velocity_std
    unknown = model.sign_unknown(qd, speed_std) if drives else np.zeros(cut.values.shape, dtype=bool)
    return Samples(rows, cut.values[:, order], place, period, t), unknown


def _average(values: FloatArray, place: FloatArray, bins: int) -> FloatArray:
    """Average (..., N) over samples of the same bin; bins without a sample become zero."""
    present, starts, counts = np.unique(place, return_index=True, return_counts=True)
    result = np.zeros((*values.shape[:-1], bins))
    result[..., present] = np.add.reduceat(values, starts, axis=-1) / counts
    return result


def _to_block(
    samples: Samples,
    unknown: FloatArray,
    channels: tuple[str, ...],
    joint: FloatArray,
    window: PeriodWindow,
    bins: int,
    anti_alias: AntiAliasFilter | None,
) -> Block:
    counts = np.bincount(samples.bin, minlength=bins)
    usable = np.broadcast_to(counts * 2 > window.periods, (len(channels), bins)) & (
        _average(unknown.astype(float), samples.bin, bins) == 0.0
    )
    columns = _average(samples.rows.columns, samples.bin, bins)
    known = _average(samples.rows.known, samples.bin, bins)
    if anti_alias is not None:  # the model goes through the filter the measurement went through
        columns = anti_alias.apply_periodic(columns, window.period_s)
        known = anti_alias.apply_periodic(known, window.period_s)
    return Block(
        channels,
        joint,
        columns,
        known,
        _average(samples.target, samples.bin, bins),
        usable,
        window.periods,
        np.arange(bins) * window.period_s / bins,
    )


def _bins(signal: Signal, window: PeriodWindow) -> int:
    return max(round(signal.rate_hz * window.period_s), 4)


@dataclass(frozen=True)
class PeriodicRows:
    """Averaged blocks of a periodic run with the samples they came from."""

    blocks: tuple[Block, ...]
    samples: tuple[tuple[Samples, ...], ...]


def periodic_rows(model: Model, data: Dataset, window: PeriodWindow, trajectory: FourierTrajectory) -> PeriodicRows:
    """Average a run's rows and measurements over its periods.

    The model's rows are averaged at the very instants of the measurements, so that clocks which drift
    between the streams, jitter and lost samples need no interpolation.

    Args:
        model: the model.
        data: the run.
        window: its steady periods.
        trajectory: its motion.

    Returns:
        One block where all channels share a rate, else one a stream.
    """
    parts: list[tuple[Samples, Block]] = []
    if model.kind != "external":
        signal = nominal_torque(model, data)
        samples, unknown = _collect(model, trajectory, signal, window, drives=True)
        names, joints, anti_alias = model.robot.joint_names, np.arange(model.robot.n), data.filters.get("current")
        parts.append((samples, _to_block(samples, unknown, names, joints, window, _bins(signal, window), anti_alias)))
    if model.kind != "internal":
        if data.wrench is None:
            raise UnusableDataError(
                f"{data.source} has no force-plate wrench, so the {model.kind} model has nothing to explain there; "
                "choose --model internal."
            )
        samples, unknown = _collect(model, trajectory, data.wrench, window, drives=False)
        none, anti_alias, bins = np.full(6, -1), data.filters.get("wrench"), _bins(data.wrench, window)
        parts.append((samples, _to_block(samples, unknown, WRENCH_CHANNELS, none, window, bins, anti_alias)))
    if len(parts) == 2 and parts[0][1].target.shape[1] == parts[1][1].target.shape[1]:
        return PeriodicRows((_stack(parts[0][1], parts[1][1]),), ((parts[0][0], parts[1][0]),))
    return PeriodicRows(tuple(block for _, block in parts), tuple((samples,) for samples, _ in parts))


def _stack(first: Block, second: Block) -> Block:
    """Put the channels of two blocks on one grid."""
    return replace(
        first,
        channels=first.channels + second.channels,
        joint=np.concatenate([first.joint, second.joint]),
        columns=np.concatenate([first.columns, second.columns]),
        known=np.concatenate([first.known, second.known]),
        target=np.concatenate([first.target, second.target]),
        usable=np.concatenate([first.usable, second.usable]),
    )


def predict(columns: FloatArray, known: FloatArray, joint: FloatArray, theta: FloatArray, scale: FloatArray) -> FloatArray:
    """Predict channels in the units of the measurement.

    Args:
        columns: rows, shape (c, P, N).
        known: known part, shape (c, N).
        joint: joint of each channel or -1, shape (c,).
        theta: parameters, shape (P,).
        scale: nominal over true torque constant of every joint, shape (n,).

    Returns:
        Shape (c, N).
    """
    factors = np.where(joint >= 0, scale[np.maximum(joint, 0)], 1.0)
    return factors[:, None] * (np.tensordot(columns, theta, axes=([1], [0])) + known)


def residual(block: Block, theta: FloatArray, scale: FloatArray) -> FloatArray:
    """Averaged measurement minus prediction, zero on rows that do not count, shape (c, B)."""
    rest = block.target - predict(block.columns, block.known, block.joint, theta, scale)
    return np.where(block.usable, rest, 0.0)


def scatter_tables(
    rows: PeriodicRows, periods: int, theta: FloatArray, scale: FloatArray
) -> list[tuple[FloatArray, float]]:
    """Tabulate what differs between the periods, the model's motion between instants taken out.

    Args:
        rows: blocks and samples.
        periods: number of periods M.
        theta: parameters of a first fit.
        scale: torque-constant scales of that fit.

    Returns:
        For every block: residual by channel, period and bin minus its mean over the periods,
        shape (c, M, B), and its degrees of freedom per channel.
    """
    result = []
    for block, group in zip(rows.blocks, rows.samples, strict=True):
        bins, tables, dof, first = block.target.shape[1], [], np.inf, 0
        for samples in group:
            count = len(samples.target)
            joint = block.joint[first : first + count]
            rest = samples.target - predict(samples.rows.columns, samples.rows.known, joint, theta, scale)
            rest = rest - _average(rest, samples.bin, bins)[:, samples.bin]
            table = np.zeros((count, periods, bins))
            inside = (samples.period >= 0) & (samples.period < periods)
            table[:, samples.period[inside], samples.bin[inside]] = rest[:, inside]
            tables.append(np.where(block.usable[first : first + count, None, :], table, 0.0))
            dof = min(dof, float(len(samples.bin) - len(np.unique(samples.bin))))
            first += count
        result.append((np.concatenate(tables), dof))
    return result


def noise_of(tables: list[tuple[FloatArray, float]]) -> list[NoiseModel]:
    """Noise of every block, per sample."""
    return [noise_from_scatter(table, dof) for table, dof in tables]
