"""A rotor whose inertia is not what the robot file states."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.effect import Coefficient, Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return scene.rotor_rows(place.joint)[:, None]


def _places(scene: Scene) -> list[Place]:
    """Joints whose rotor inertia is stated; an unstated one is an unknown of the fit already."""
    drives = enumerate(joint.drive for joint in scene.robot.joints)
    return [Place(joint=k) for k, drive in drives if drive.has_rotor and drive.rotor_inertia is not None]


EFFECT = Effect(
    name="rotor_inertia",
    where="B",
    parity="E",
    coefficients=(Coefficient("change", "kg.m2"),),
    columns=_columns,
    places=_places,
    sentence="{place}'s rotor inertia differs from the robot file's by {change}.",
    reference="Verdonck, Swevers, Samin 2001, Eqs. (8)-(13): N^2 in the current, N in the plate",
    constraint=lambda scene, place, values, shape: bool(
        (scene.robot.joints[place.joint].drive.rotor_inertia or 0.0) + values[0] > 0.0
    ),
)
