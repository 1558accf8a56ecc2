"""What effects inside a joint share: where they can sit, and what friction the fit leaves beside them."""

from __future__ import annotations

import numpy as np

from identify.physics.effect import Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def every_drive(scene: Scene) -> list[Place]:
    """All joints, where the model explains the drives."""
    return [] if scene.model.kind == "external" else [Place(joint=k) for k in range(scene.robot.n)]


def revolute_drives(scene: Scene) -> list[Place]:
    """All revolute joints, where the model explains the drives."""
    return [place for place in every_drive(scene) if not scene.robot.joints[place.joint].prismatic]


def current_drives(scene: Scene) -> list[Place]:
    """All joints whose motor currents have a known meaning, where the model explains the drives."""
    drives = [joint.drive for joint in scene.robot.joints]
    return [place for place in every_drive(scene) if drives[place.joint].torque_constant is not None]


def fitted(scene: Scene, joint: int, term: str) -> float:
    """Fitted parameter of one joint, 0 where the model has none of that name.

    Args:
        scene: the scene.
        joint: its index.
        term: such as ``coulomb``.

    Returns:
        Its value [SI].
    """
    name = f"{scene.robot.joints[joint].name}.{term}"
    names = [parameter.name for parameter in scene.model.parameters]
    return float(scene.theta[names.index(name)]) if name in names else 0.0


def friction_beside(scene: Scene, joint: int, extra: FloatArray) -> tuple[float, float]:
    """Coulomb and viscous friction that remain once a further friction torque has its own name.

    The fit without that torque has put most of it into the two; least squares over the motion takes it out.

    Args:
        scene: the scene.
        joint: its index.
        extra: the further friction torque on this drive [N.m or N], shape (B,).

    Returns:
        Coulomb [N.m or N] and viscous friction [N.m.s/rad or N.s/m].
    """
    basis = np.stack([scene.direction[joint], scene.speed[joint]], axis=1)
    taken = np.linalg.lstsq(basis, extra, rcond=None)[0]
    coulomb, viscous = fitted(scene, joint, "coulomb"), fitted(scene, joint, "viscous")
    return coulomb - float(taken[0]), viscous - float(taken[1])


def torque_per_ampere(scene: Scene, joint: int) -> float:
    """Drive torque under the true constants per ampere of measured current [N.m/A or N/A]."""
    drive = scene.robot.joints[joint].drive
    return drive.gear_ratio * (drive.torque_constant or 1.0) / float(scene.scale[joint])
