"""A balancing spring that the robot file does not know."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.crank import rod
from identify.physics.drives import revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    turned = scene.q[place.joint] - shape["phi"]
    stretch, lever = rod(turned)
    return only_joint(scene, place.joint, np.stack([lever, lever * stretch]))


def _places(scene: Scene) -> list[Place]:
    """Revolute joints without a stated compensation: where there is one, the fit holds it already."""
    joints = scene.robot.joints
    return [place for place in revolute_drives(scene) if joints[place.joint].drive.gravity_harmonics == 0]


EFFECT = Effect(
    name="gravity_compensation_spring",
    where="I",
    parity="E",
    # the spring tightened in its shortest place, and tightening by its stiffness: k > 0, no push
    coefficients=(Coefficient("preload", "N.m", +1), Coefficient("stiffness", "N.m", +1)),
    columns=_columns,
    places=_places,
    sentence=(
        "{place} is balanced by a spring that the robot file does not state, with its dead centre at {phi}: "
        "{preload} from its preload and {stiffness} from its stretch."
    ),
    reference="k A B sin(q - phi) (1 - l0/l) = k A B sin(q - phi)/l ((l_min - l0) + (l - l_min))",
    shapes=(Shape("phi", "rad", (-2.7, -1.8, -0.9, 0.0, 0.9, 1.8, 2.7, 3.6)),),
)
