"""Is the rest noise? Generic tests that need no name, and what a leftover depends on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from identify.diagnosis.candidates import log_chance
from identify.diagnosis.problem import Problem
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_REGIONS = 12  # of a curve of residual against state
_BANDS = (4, 12, 40)  # lowest lines summed: slow structure stands out where the omnibus test is blind


@dataclass(frozen=True)
class Structure:
    """A generic test of one channel that stood out.

    Attributes:
        channel: its name.
        variable: what the residual depends on, such as ``position:joint_1`` or ``time``.
        gain: chi-square of the curve.
        width: its degrees of freedom.
        p_value: over all generic tests of the run.
        centres: middle of every region in the variable's unit, shape (k,); empty for ``time``.
        curve: fitted residual there [N.m or N], shape (k,).
        band: std of the curve by noise, shape (k,).
    """

    channel: str
    variable: str
    gain: float
    width: int
    p_value: float
    centres: FloatArray
    curve: FloatArray
    band: FloatArray


@dataclass(frozen=True)
class Adequacy:
    """What is left after the named effects.

    Attributes:
        p_value: smallest over all generic tests, corrected for their number.
        channel_p: omnibus probability of every channel.
        structures: the generic tests that stood out, strongest first.
        excess: chi-square above its expectation, by channel.
    """

    p_value: float
    channel_p: dict[str, float]
    structures: tuple[Structure, ...]
    excess: dict[str, float]


def variables_of(scene: Scene) -> dict[str, FloatArray]:
    """States that a leftover may depend on, each shape (B,)."""
    result = {}
    for k, joint in enumerate(scene.robot.joints):
        if np.ptp(scene.q[k]) < 1e-6:
            continue
        result[f"position:{joint.name}"] = scene.q[k]
        result[f"velocity:{joint.name}"] = scene.speed[k]
        result[f"acceleration:{joint.name}"] = scene.qdd[k]
        result[f"load:{joint.name}"] = scene.load[k]
    return result


def _omnibus(problem: Problem, basis: FloatArray, residual: FloatArray) -> tuple[dict[str, float], dict[str, float]]:
    """Chi-square of every channel's rows against its degrees of freedom."""
    probability, excess = {}, {}
    for block in problem.blocks:
        for k, channel in enumerate(block.channels):
            rows = problem.channel_slices[channel]
            dof = float(block.usable[k].sum()) - float(np.sum(basis[rows] ** 2))
            chi2 = float(residual[rows] @ residual[rows])
            probability[channel] = float(stats.chi2.sf(chi2, max(dof, 1.0)))
            excess[channel] = chi2 - dof
    return probability, excess


def _time_tests(problem: Problem, residual: FloatArray) -> list[tuple[str, str, float, int]]:
    """Sums over the lowest lines of every channel's whitened residual."""
    result = []
    for channel, rows in problem.channel_slices.items():
        part = residual[rows]
        power = 2.0 * np.abs(np.fft.rfft(part)) ** 2 / len(part)
        for band in _BANDS:
            count = min(band, len(power) - 2)
            result.append((channel, "time", float(power[1 : 1 + count].sum()), 2 * count))
    return result


def _curve_columns(
    problem: Problem, block_index: int, channel: int, values: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Whitened columns of the regions of a state on one channel (times a weight), and the regions' labels."""
    block = problem.blocks[block_index]
    edges = np.quantile(values, np.linspace(0.0, 1.0, _REGIONS + 1)[1:-1])
    labels = np.searchsorted(edges, values)
    raw = [np.zeros((len(b.channels), _REGIONS, b.target.shape[1])) for b in problem.blocks]
    raw[block_index][channel, labels, np.arange(len(labels))] = block.usable[channel] * weight
    return problem.whiten(raw), labels


def _curve_test(
    problem: Problem, basis: FloatArray, residual: FloatArray, where: tuple[int, int], variable: str, values: FloatArray
) -> Structure:
    """Test one channel's residual as a curve over regions of a state; friction curves turn with the direction."""
    block_index, channel = where
    scene, joint = problem.scenes[block_index], problem.blocks[block_index].joint[where[1]]
    odd = variable.startswith("friction:")
    weight = scene.direction[max(joint, 0)] if odd else np.ones(len(scene.t_s))
    if problem.fit.thinning is not None:
        values, weight = problem.fit.thinning.pick(values), problem.fit.thinning.pick(weight)
    block = problem.blocks[block_index]
    columns, labels = _curve_columns(problem, block_index, channel, values, weight)
    inside = basis.T @ columns
    squares, vectors = np.linalg.eigh(columns.T @ columns - inside.T @ inside)  # of the columns off the basis
    seen = squares > 1e-6 * max(float(np.sum(columns**2, axis=0).max()), 1e-300)
    toward = (vectors[:, seen].T @ (columns.T @ residual)) / np.sqrt(squares[seen])
    curve = vectors[:, seen] @ (toward / np.sqrt(squares[seen]))
    band = np.sqrt(np.sum(vectors[:, seen] ** 2 / squares[seen], axis=1))
    centres = np.array([values[labels == k].mean() if (labels == k).any() else np.nan for k in range(_REGIONS)])
    gain, width = float(toward @ toward), int(seen.sum())
    return Structure(block.channels[channel], variable, gain, width, 1.0, centres, curve, band)


def examine(problem: Problem, basis: FloatArray, residual: FloatArray, curves: bool = True) -> Adequacy:
    """Test what is left without naming it.

    Args:
        problem: the problem.
        basis: baseline and named effects, orthonormal, shape (rows, r).
        residual: what is left, whitened, shape (rows,).
        curves: whether to test curves against states as well (slower).

    Returns:
        The adequacy; probabilities are corrected for the number of tests made (Holm's first step).
    """
    probability, excess = _omnibus(problem, basis, residual)
    found: list[Structure] = []
    empty = np.empty(0)
    for channel, variable, gain, width in _time_tests(problem, residual):
        found.append(Structure(channel, variable, gain, width, 1.0, empty, empty, empty))
    if curves:
        for block_index, block in enumerate(problem.blocks):
            states = variables_of(problem.scenes[block_index])
            for channel in range(len(block.channels)):
                if block.joint[channel] >= 0:
                    own = problem.scene.robot.joints[block.joint[channel]].name
                    states = states | {f"friction:{own}": problem.scenes[block_index].q[block.joint[channel]]}
                for variable, values in states.items():
                    if np.ptp(values) == 0.0 or (variable.startswith("friction:") and block.channels[channel] != variable[9:]):
                        continue
                    found.append(_curve_test(problem, basis, residual, (block_index, channel), variable, values))
    count = len(found) + len(probability)
    corrected = [
        Structure(s.channel, s.variable, s.gain, s.width, _corrected(log_chance(np.array(s.gain), max(s.width, 1)), count), s.centres, s.curve, s.band)
        for s in found
    ]
    corrected.sort(key=lambda s: (s.p_value, -s.gain / max(s.width, 1)))
    smallest = min([s.p_value for s in corrected] + [_corrected(np.log(max(p, 1e-300)), count) for p in probability.values()])
    return Adequacy(smallest, probability, tuple(s for s in corrected if s.p_value < 0.05), excess)


def _corrected(log_p: float, count: int) -> float:
    return float(min(1.0, count * np.exp(max(float(log_p), -690.0))))
