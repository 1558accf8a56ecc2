"""Friction that gives elastically before it slides."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive, friction_beside
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_MOST = 2.0  # an elastic part beyond the whole friction would drive; the rest is room for noise


def _turning_points(scene: Scene, joint: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where a drive turns round: index of the first sample after, its angle there, its angle at the turn.

    The turn lies where the cubic through angle and speed of both neighbours stands still.
    """
    angle = scene.robot.drive_matrix[joint] @ scene.q
    speed, step = scene.speed[joint], scene.step_s
    last, v0 = np.roll(angle, 1), np.roll(speed, 1)
    after = np.flatnonzero(np.where(v0 >= 0.0, 1, -1) != np.where(speed >= 0.0, 1, -1))
    if not scene.periodic:
        after = after[after > 0]
    start, end, u0, u1 = last[after], angle[after], v0[after] * step, speed[after] * step
    share = u0 / np.where(u0 == u1, 1.0, u0 - u1)
    rise = end - start
    cubic, square = u0 + u1 - 2.0 * rise, 3.0 * rise - 2.0 * u0 - u1
    return after, angle, start + share * (u0 + share * (square + share * cubic))


def _state(scene: Scene, joint: int, slide: float) -> FloatArray:
    """Dahl's state as a share of its limit: it forgets with the distance since each turn; twice around."""
    after, angle, turn = _turning_points(scene, joint)
    count = len(angle)
    side = np.where(scene.speed[joint] >= 0.0, 1.0, -1.0)
    state = side.copy()
    if len(after) == 0:
        return state
    stops = np.append(after[1:], after[0] + count if scene.periodic else count)
    before = side[after[0] - 1]
    for _ in range(2 if scene.periodic else 1):
        for k, (first, stop) in enumerate(zip(after, stops, strict=True)):
            index = np.arange(first, stop) % count
            s = side[first]
            state[index] = s + (before - s) * np.exp(-np.abs(angle[index] - turn[k]) / slide)
            to_next = abs(turn[(k + 1) % len(turn)] - turn[k])
            before = s + (before - s) * np.exp(-to_next / slide)
    return state


def _column(scene: Scene, joint: int, slide: float) -> FloatArray:
    return _state(scene, joint, slide) - scene.direction[joint]


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, _column(scene, place.joint, shape["xs"]))


def _part_of_the_friction(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    coulomb, _ = friction_beside(scene, place.joint, values[0] * _column(scene, place.joint, shape["xs"]))
    return bool(values[0] <= _MOST * max(coulomb, 0.0))


EFFECT = Effect(
    name="presliding_friction",
    where="I",
    parity="X",
    coefficients=(Coefficient("f", "N.m", +1),),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place} gives elastically before it slides: after each reversal {f} of its friction builds up "
        "only over {xs}."
    ),
    reference="Al-Bender & Swevers, CSM 28(6) 2008; Dahl: dz/dt = v (1 - sgn(v) z / xs), friction f z / xs",
    shapes=(Shape("xs", "rad", (5e-5, 1.2e-4, 2.8e-4, 6.6e-4, 1.5e-3, 3.6e-3, 8.5e-3, 2e-2)),),
    constraint=_part_of_the_friction,
)
