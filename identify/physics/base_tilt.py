"""The base does not stand level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_STEP_RAD = 1e-4
_SMALL_RAD = 0.2  # beyond this nobody calls it a tilt


def _across(gravity: FloatArray) -> FloatArray:
    """Two unit axes across gravity, the base's x and y where it hangs along z, shape (2, 3)."""
    down = gravity / np.linalg.norm(gravity)
    first = np.eye(3)[int(np.argmin(np.abs(down)))]
    first = first - down * (down @ first)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(-down, first)])


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    gravity = scene.robot.gravity
    parts = []
    for axis in _across(gravity):
        change = _STEP_RAD * np.linalg.norm(gravity) * axis
        ahead = scene.with_robot(replace(scene.robot, gravity=gravity + change))
        behind = scene.with_robot(replace(scene.robot, gravity=gravity - change))
        parts.append((ahead - behind) / (2.0 * _STEP_RAD))
    return np.stack(parts, axis=1)


def _where_gravity_is(scene: Scene) -> list[Place]:
    """The whole robot, where drives and plate are fitted together.

    The drives alone do not know the first link's first moment, which a tilt brings into play.
    """
    felt = np.linalg.norm(scene.robot.gravity) > 1e-6
    return [Place()] if felt and scene.has_wrench else []


EFFECT = Effect(
    name="base_tilt",
    where="B",
    parity="E",
    coefficients=(Coefficient("gx", "rad"), Coefficient("gy", "rad")),
    columns=_columns,
    places=_where_gravity_is,
    sentence="The base is not level: gravity leans by {gx} along its x and {gy} along its y axis.",
    reference="gravity (gx, gy, -1) g for small angles",
    constraint=lambda scene, place, values, shape: bool(np.linalg.norm(values) < _SMALL_RAD),
)
