"""Links that move otherwise than their motors, which the encoders follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.model import Model
from identify.physics.scene import Scene
from identify.robot import Robot
from identify.rotations import FloatArray

_OF_LINKS = ("inertial", "gravity_compensation")


def links_along(scene: Scene, joint: int, dq: FloatArray, dqd: FloatArray, dqdd: FloatArray) -> FloatArray:
    """Derivative of all rows along a motion of the links alone; rotors and friction stay with the motor.

    Args:
        scene: the scene.
        joint: index of the gear that lets its output move by more than its motor.
        dq: that change per unit coefficient, shape (B,).
        dqd: its rate, shape (B,).
        dqdd: its second rate, shape (B,).

    Returns:
        Shape (rows, B).
    """
    at_q, at_qd, at_qdd = _derivatives(scene, joint)
    return at_q * dq + at_qd * dqd + at_qdd * dqdd


def _derivatives(scene: Scene, joint: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows per unit of the gear's excess angle, rate and second rate; they serve every shape of it."""
    store = scene.__dict__.setdefault("_loose_links", {})  # as cached_property does, one entry a joint
    if joint not in store:
        bare = _bodies_alone(scene)
        # one motor's gear turns the joints as its column of the inverse drive matrix says
        unit = np.linalg.inv(scene.robot.drive_matrix)[:, joint, None] * np.ones((1, scene.q.shape[1]))
        none = np.zeros_like(unit)
        store[joint] = (
            bare.along(unit, none, none),
            bare.along(none, unit, none),
            bare.along(none, none, unit),
        )
    return store[joint]


def _bodies_alone(scene: Scene) -> Scene:
    """The scene without friction, offsets and rotors."""
    keep = np.array([parameter.group in _OF_LINKS for parameter in scene.model.parameters])
    model = scene.model
    changed = Model(_without_known_rotors(scene.robot), model.kind, model.structure, model.parameters)
    return replace(scene, model=changed, theta=np.where(keep, scene.theta, 0.0))


def _without_known_rotors(robot: Robot) -> Robot:
    """Unknown rotors are left out by their parameters instead: the parameters must stay as they are."""
    joints = []
    for joint in robot.joints:
        unknown = joint.drive.has_rotor and joint.drive.rotor_inertia is None
        joints.append(replace(joint, drive=replace(joint.drive, has_rotor=unknown)))
    return replace(robot, joints=tuple(joints))
