"""Friction on a joint's own side behind a coupled transmission."""

import dataclasses

import numpy as np

from identify.friction import drive_velocity, internal_columns
from identify.model import build_model
from identify.parameters import internal_parameters
from identify.robot import Drive, Joint, Robot


def wrist():
    friction = ("joint_coulomb", "joint_viscous", "coulomb", "viscous")
    joints = tuple(
        Joint(f"joint_{k}", f"link_{k}", False, np.eye(3), np.array([0.0, 0.0, 0.2]), axis, drive=Drive(30.0, friction=friction))
        for k, axis in enumerate((np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])))
    )
    return Robot("wrist", joints, coupling=np.array([[30.0, 0.0], [30.0, 30.0]]))


def test_its_power_is_that_of_the_joint_not_of_the_motor():
    robot, rng = wrist(), np.random.default_rng(3)
    q, qd = rng.normal(size=(2, 2, 50))
    columns = internal_columns(robot, q, qd)
    speed = drive_velocity(robot, qd)
    names = [p.name for p in internal_parameters(robot)]
    for k, own in enumerate(qd):
        power = np.sum(columns[:, names.index(f"joint_{k}.joint_viscous")] * speed, axis=0)
        np.testing.assert_allclose(power, own**2, atol=1e-12)
        power = np.sum(columns[:, names.index(f"joint_{k}.viscous")] * speed, axis=0)
        np.testing.assert_allclose(power, speed[k] ** 2, atol=1e-12)


def test_without_a_coupling_it_is_the_motors_own():
    robot = dataclasses.replace(wrist(), coupling=None)
    q, qd = np.random.default_rng(4).normal(size=(2, 2, 20))
    columns, names = internal_columns(robot, q, qd), [p.name for p in internal_parameters(robot)]
    joint, motor = (columns[:, names.index(f"joint_1.{term}")] for term in ("joint_coulomb", "coulomb"))
    np.testing.assert_array_equal(joint, motor)


def test_an_unknown_joint_direction_spares_every_drive_that_it_reaches():
    robot = wrist()
    qd = np.array([[1.0, 0.0], [1.0, 1.0]])
    unknown = build_model(robot, "internal").sign_unknown(qd, np.full(2, 1e-6))
    assert unknown[:, 0].tolist() == [False, False]
    assert unknown[0, 1]  # joint 0 stands still: its friction on drive 0 has no direction
