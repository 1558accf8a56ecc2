"""What the eye should see of a finding: measured residual against model, over the state the effect depends on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.blocks import residual
from identify.diagnosis.augmented import Addition, Augmented
from identify.diagnosis.describe import carrying_channels, contribution
from identify.diagnosis.problem import Problem
from identify.physics.scene import Scene
from identify.robot import WRENCH_CHANNELS
from identify.rotations import FloatArray

_REGIONS = 36
_TRIED = 24  # regions while the variable is chosen
_SHOWN = 0.03  # of the largest value: beyond the last region that reaches it nothing is drawn
_DEPENDS = 0.5  # share of an effect's variance that a state must explain to be its variable


@dataclass(frozen=True)
class FindingCurve:
    """Component plus residual of one effect on its strongest channel.

    Attributes:
        index: which of the effects.
        channel: where it shows most.
        variable: state it depends on, such as ``velocity:joint_2``; ``time`` where there is none.
        unit: of the state.
        value_unit: N.m or N.
        x: middle of every region, shape (k,).
        measured: what the model without this effect leaves there, shape (k,).
        band: std of that by noise, shape (k,).
        model: what the effect says, shape (k,).
        explains: share of the effect's variance that the state explains.
    """

    index: int
    channel: str
    variable: str
    unit: str
    value_unit: str
    x: FloatArray
    measured: FloatArray
    band: FloatArray
    model: FloatArray
    explains: float


def finding_curves(problem: Problem, augmented: Augmented) -> tuple[FindingCurve, ...]:
    """Draw every effect of a joint fit.

    Args:
        problem: the problem.
        augmented: the joint fit.

    Returns:
        One curve an effect.
    """
    rests = _rests(problem, augmented)
    return tuple(
        _curve(problem, augmented, index, item, rests) for index, item in enumerate(augmented.additions)
    )


def _parts(problem: Problem, augmented: Augmented, item: Addition) -> list[FloatArray]:
    """Contribution of an effect to every block in its measurement units, each (c, B)."""
    result = []
    for index, scene in enumerate(problem.scenes):
        columns = problem.enter(index, item.effect.columns(scene, item.place, item.shape))
        result.append(np.tensordot(columns, item.values, axes=([1], [0])))
    return result


def _rests(problem: Problem, augmented: Augmented) -> list[FloatArray]:
    """What the joint fit leaves on every block, measurement units, each (c, B)."""
    effects = [_parts(problem, augmented, item) for item in augmented.additions]
    return [
        residual(block, augmented.theta, augmented.scale) - sum((parts[k] for parts in effects), np.zeros(1))
        for k, block in enumerate(problem.blocks)
    ]


def _place_on(problem: Problem, channel: str) -> tuple[int, int]:
    for index, block in enumerate(problem.blocks):
        if channel in block.channels:
            return index, block.channels.index(channel)
    raise KeyError(channel)


def _curve(
    problem: Problem, augmented: Augmented, index: int, item: Addition, rests: list[FloatArray]
) -> FindingCurve:
    channel = carrying_channels(problem, contribution(problem, item))[0]
    b, c = _place_on(problem, channel)
    block, scene = problem.blocks[b], problem.scenes[b]
    joint = int(block.joint[c])
    factor = 1.0 / augmented.scale[joint] if joint >= 0 else 1.0
    used = block.usable[c]
    model = factor * _parts(problem, augmented, item)[b][c][used]
    measured = factor * rests[b][c][used] + model
    pick = (lambda x: x) if problem.fit.thinning is None else problem.fit.thinning.pick
    name, unit, values, explains = _variable(scene, item, channel, model, lambda x: pick(x)[used])
    inside = _shown(values, model)
    order = np.argsort(values[inside], kind="stable")
    groups = np.array_split(np.flatnonzero(inside)[order], min(_REGIONS, max(int(inside.sum()) // 3, 1)))
    noise = problem.fit.noise_std[channel] / np.sqrt(block.repeats)
    value_unit = (
        scene.robot.joints[joint].torque_unit
        if joint >= 0
        else ("N" if channel.startswith("force") else "N.m")
    )
    return FindingCurve(
        index,
        channel,
        name,
        unit,
        value_unit,
        np.array([values[g].mean() for g in groups]),
        np.array([measured[g].mean() for g in groups]),
        np.array([noise / np.sqrt(len(g)) for g in groups]),
        np.array([model[g].mean() for g in groups]),
        explains,
    )


def _candidates(scene: Scene, item: Addition) -> list[tuple[str, str, FloatArray]]:
    """States an effect may depend on, the most telling first; the time within the period last."""
    result: list[tuple[str, str, FloatArray]] = []
    joints = [item.place.joint] if item.place.joint is not None else list(range(scene.robot.n))
    for k in joints:
        joint = scene.robot.joints[k]
        length = "m" if joint.prismatic else "rad"
        result += [
            (f"velocity:{joint.name}", f"{length}/s", scene.speed[k]),
            (f"position:{joint.name}", length, scene.q[k]),
            (
                f"load against the motion:{joint.name}",
                joint.torque_unit,
                np.abs(scene.load[k]) * scene.direction[k],
            ),
            (f"load:{joint.name}", joint.torque_unit, scene.load[k]),
            (f"acceleration:{joint.name}", f"{length}/s2", scene.qdd[k]),
            (f"motor angle:{joint.name}", "rad", np.mod(scene.motor_angle_rad[k], 2.0 * np.pi)),
        ]
        if scene.model.kind != "external":
            result.append((f"current:{joint.name}", "A", scene.current_a[k]))
    if item.place.joint is None and scene.has_wrench:
        units, rates = ["N"] * 3 + ["N.m"] * 3, scene.ddt(scene.wrench)
        rows = list(zip(WRENCH_CHANNELS, units, scene.wrench, rates, strict=True))
        result += [(f"wrench:{c}", unit, row) for c, unit, row, _ in rows]
        result += [(f"wrench rate:{c}", f"{unit}/s", rate) for c, unit, _, rate in rows]
    return result


def _variable(scene: Scene, item: Addition, channel: str, model: FloatArray, pick) -> tuple[str, str, FloatArray, float]:  # noqa: ANN001
    best: tuple[float, str, str, FloatArray] = (_DEPENDS, "time", "s", pick(scene.t_s))
    own_first = sorted(_candidates(scene, item), key=lambda one: not one[0].endswith(f":{channel}"))
    for name, unit, series in own_first:
        values = pick(series)
        share = _explained(values, model)
        if share > best[0] + 0.02:
            best = (share, name, unit, values)
    return best[1], best[2], best[3], best[0]


def _explained(values: FloatArray, series: FloatArray) -> float:
    """Share of a series' variance that lies between regions of a state."""
    total = float(np.var(series))
    if np.ptp(values) < 1e-9 or total <= 0.0:
        return 0.0
    groups = np.array_split(series[np.argsort(values, kind="stable")], _TRIED * 4)
    return 1.0 - float(np.sum([len(g) * np.var(g) for g in groups if len(g)])) / (len(series) * total)


def _shown(values: FloatArray, model: FloatArray) -> FloatArray:
    """The stretch of the state where the effect acts, with a fifth of its length on either side."""
    active = np.abs(model) > _SHOWN * np.abs(model).max(initial=0.0)
    if not active.any():
        return np.ones(len(values), dtype=bool)
    low, high = np.quantile(values[active], [0.005, 0.995])
    margin = 0.2 * (high - low)
    return (values >= low - margin) & (values <= high + margin)
