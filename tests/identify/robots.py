"""The reference robot with inertials, for tests that need a truth."""

from dataclasses import replace

import numpy as np

from identify.inertia import parameters_from_body
from identify.robot import Robot
from service.robots import load_robot

# plausible bodies: mass [kg], centre of mass [m], principal moments [kg.m2] and their rpy [rad]
_BODIES = (
    (38.0, (0.05, 0.03, -0.10), (5.4, 5.1, 6.0), (0.02, 0.03, 0.01)),
    (36.0, (0.02, 0.10, 0.25), (4.5, 4.3, 0.6), (0.05, -0.04, 0.02)),
    (13.0, (0.04, -0.03, 0.19), (0.52, 0.49, 0.13), (0.03, 0.05, -0.02)),
)
COULOMB, VISCOUS, OFFSET = (41.2, 35.63, 14.196), (21.3, 18.46, 6.466), (1.7, -2.3, 0.8)


def link_truth():
    from identify.rotations import rotation_from_rpy

    return np.array(
        [parameters_from_body(m, np.array(c), np.diag(i), rotation_from_rpy(r)) for m, c, i, r in _BODIES]
    )


def ir361() -> Robot:
    return replace(load_robot("ir361").robot, reference_parameters=link_truth())


def drives_changed(robot, **fields) -> Robot:
    return replace(robot, joints=tuple(replace(j, drive=replace(j.drive, **fields)) for j in robot.joints))


def true_theta(model, truth):
    """Values of a model's parameters from raw ones (``link_2.mx``, ``joint_1.coulomb``, ...)."""
    return np.array(
        [sum(share * truth[name] for name, share in p.definition.items()) for p in model.parameters]
    )


def raw_truth(robot, plate=(2.1, -3.4, 5.2, 1.3, -2.2, 0.7)):
    from identify.inertia import PARAMETERS
    from identify.robot import WRENCH_CHANNELS

    truth = {
        f"{link}.{name}": value
        for link, row in zip(robot.link_names, robot.reference_parameters, strict=True)
        for name, value in zip(PARAMETERS, row, strict=True)
    }
    for k, joint in enumerate(robot.joints):
        truth |= {
            f"{joint.name}.coulomb": COULOMB[k % 3],
            f"{joint.name}.viscous": VISCOUS[k % 3],
            f"{joint.name}.offset": OFFSET[k % 3],
            f"{joint.name}.rotor_inertia": 1.0e-3 * (1 + 0.1 * k),
        }
        for harmonic in range(1, joint.drive.gravity_harmonics + 1):
            truth |= {
                f"{joint.name}.gravity_cos_{harmonic}": 12.0 / harmonic,
                f"{joint.name}.gravity_sin_{harmonic}": -60.0 / harmonic**2,
            }
    return truth | {f"plate.{c}.offset": value for c, value in zip(WRENCH_CHANNELS, plate, strict=True)}
