"""The air resists a turning link, and the plate feels it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, every_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray
from identify.structure import to_drives


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint, robot = place.joint, scene.robot
    speed = scene.qd[joint]
    axis = scene.links[joint].axis
    drag = -speed * np.abs(speed) * axis  # what the air does to the link
    if robot.joints[joint].prismatic:
        return scene.force_rows(scene.links[joint].origin_m, drag, joint)[:, None]
    result = np.zeros((scene.rows, 1, len(speed)))
    held = np.zeros((robot.n, len(speed)))
    for k in range(joint + 1):
        if not robot.joints[k].prismatic:
            held[k] = -np.sum(scene.links[k].axis * drag, axis=0)
    result[: robot.n, 0] = to_drives(robot, held)
    if scene.has_wrench:
        assert robot.plate is not None
        result[robot.n + 3 :, 0] = -robot.plate.rotation.T @ drag
    return result


EFFECT = Effect(
    name="air_drag",
    where="B",
    parity="O",
    coefficients=(Coefficient("c", "N.m.s2/rad2", +1),),
    columns=_columns,
    places=every_joint,
    sentence="The air resists {place}'s link by {c} times its speed squared, and the plate feels it.",
    reference="c qd |qd| between link and world, so that the plate feels what friction would hide from it",
)
