"""Small robots whose designs take a fraction of a second."""

from dataclasses import replace

import numpy as np
import pytest

from identify.excitation.design import DesignOptions, design, prepare
from identify.excitation.series import FourierSeries
from identify.robot import Drive, ForcePlate, Joint, Limits, Robot

DRIVE = {"torque_constant": 0.2, "gear_ratio": 100.0}


def joint(name, xyz, axis, limits, **drive):
    return Joint(
        name, f"link_{name}", False, np.eye(3), np.array(xyz), np.array(axis), limits, Drive(**drive)
    )


@pytest.fixture(scope="session")
def two_axes():
    """A turntable with a shoulder on a tared plate."""
    return Robot(
        "two",
        (
            joint("yaw", (0, 0, 0.5), (0, 0, 1.0), Limits(-1.5, 1.5, 1.2, 5.0, 200.0), **DRIVE),
            joint("pitch", (0, 0, 0.1), (0, 1.0, 0), Limits(-0.8, 1.0, 1.0, 4.0, 300.0), **DRIVE),
        ),
        plate=ForcePlate(),
    )  # fmt: skip


@pytest.fixture(scope="session")
def with_limits():
    """Replace the limits of one joint."""

    def change(robot, index, **limits):
        joints = list(robot.joints)
        joints[index] = replace(joints[index], limits=replace(joints[index].limits, **limits))
        return replace(robot, joints=tuple(joints))

    return change


@pytest.fixture(scope="session")
def problem(two_axes):
    return prepare(two_axes, DesignOptions(harmonics=3, fundamental_hz=0.2))


@pytest.fixture(scope="session")
def quick():
    """Options of a small search."""
    return DesignOptions(harmonics=3, fundamental_hz=0.2, starts=2, refined=1)


@pytest.fixture(scope="session")
def random_series():
    rng = np.random.default_rng(11)
    return FourierSeries(0.1, rng.normal(size=3), rng.normal(size=(3, 4)), rng.normal(size=(3, 4)))


@pytest.fixture(scope="session")
def found(two_axes, quick):
    """A finished design."""
    return design(two_axes, quick)
