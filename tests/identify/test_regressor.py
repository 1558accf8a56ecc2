"""Rigid regressors against an independent engine and against the identities of mechanics."""

import mujoco
import numpy as np
import pytest

from identify.inertia import (
    body_from_parameters,
    inertia_matrix,
    parameters_from_body,
    pseudo_inertia,
    transform_parameters,
)
from identify.regressor import rigid_columns
from identify.rotations import rotation_from_rpy, rpy_from_rotation
from tests.identify import chains

CASES = [(seed, 3 + seed % 5) for seed in range(10)]


def loads(robot, q, qd, qdd):
    columns = rigid_columns(robot, q, qd, qdd)
    pi = robot.reference_parameters.ravel()
    return np.einsum("cpn,p->cn", columns.internal, pi), np.einsum("cpn,p->cn", columns.external, pi)


@pytest.mark.parametrize(("seed", "moving"), CASES)
def test_torques_and_wrench_equal_mujoco(seed, moving):
    description = chains.random_description(seed, moving)
    robot = chains.robot_of(description)
    q, qd, qdd = chains.random_states(seed, moving)
    tau, wrench = loads(robot, q, qd, qdd)
    expected_tau, expected_wrench = chains.oracle_loads(description, q, qd, qdd)
    np.testing.assert_allclose(tau, expected_tau, rtol=1e-9, atol=1e-9 * np.abs(expected_tau).max())
    np.testing.assert_allclose(wrench, expected_wrench, rtol=1e-9, atol=1e-9 * np.abs(expected_wrench).max())


@pytest.mark.parametrize("seed", range(4))
def test_a_displaced_plate_reads_the_same_wrench_in_its_own_frame(seed):
    description = chains.random_description(seed, 4)
    plate = chains.random_plate(seed)
    q, qd, qdd = chains.random_states(seed, 4)
    _, wrench = loads(chains.robot_of(description, plate), q, qd, qdd)
    _, base = chains.oracle_loads(description, q, qd, qdd)
    force = plate.rotation.T @ base[:3]
    torque = plate.rotation.T @ (base[3:] - np.cross(plate.translation_m, base[:3], axisb=0, axisc=0))
    np.testing.assert_allclose(wrench, np.vstack([force, torque]), atol=1e-9 * np.abs(base).max())


@pytest.mark.parametrize(("seed", "moving"), CASES[:5])
def test_power_is_the_rate_of_energy(seed, moving):
    description = chains.random_description(seed, moving)
    robot, motion = chains.robot_of(description), chains.smooth_motion(seed, moving)
    model = mujoco.MjModel.from_xml_string(
        chains.mjcf_text(description)
        .replace("<option ", '<option integrator="Euler" ')
        .replace("<flag ", '<flag energy="enable" ')
    )
    data = mujoco.MjData(model)

    def energy(t):
        q, qd, _ = motion(np.array([t]))
        data.qpos[:] = np.r_[np.zeros(3), 1.0, np.zeros(3), q[:, 0]]
        data.qvel[:] = np.r_[np.zeros(6), qd[:, 0]]
        mujoco.mj_forward(model, data)
        return data.energy.sum()

    for t in np.linspace(0.0, 4.0, 9):
        tau, _ = loads(robot, *motion(np.array([t])))
        step = 1e-4
        rate = (8 * (energy(t + step) - energy(t - step)) - (energy(t + 2 * step) - energy(t - 2 * step))) / (
            12 * step
        )
        assert tau[:, 0] @ motion(np.array([t]))[1][:, 0] == pytest.approx(rate, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("seed", "moving"), CASES[:5])
def test_base_wrench_is_the_rate_of_momentum(seed, moving):
    """Newton and Euler for the whole arm: force less weight is dp/dt, moment less weight's is dL/dt."""
    description = chains.random_description(seed, moving)
    robot, motion = chains.robot_of(description), chains.smooth_motion(seed, moving)
    model = mujoco.MjModel.from_xml_string(chains.mjcf_text(description))
    data = mujoco.MjData(model)

    def momentum(t):
        q, qd, _ = motion(np.array([t]))
        data.qpos[:] = np.r_[np.zeros(3), 1.0, np.zeros(3), q[:, 0]]
        data.qvel[:] = np.r_[np.zeros(6), qd[:, 0]]
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        mass, com = model.body_subtreemass[0], data.subtree_com[0].copy()
        linear = mass * data.subtree_linvel[0]
        return linear, data.subtree_angmom[0] + np.cross(com, linear), mass, com

    for t in np.linspace(0.0, 4.0, 7):
        _, wrench = loads(robot, *motion(np.array([t])))
        step, (_, _, mass, com) = 1e-4, momentum(t)
        rate = [
            (
                8 * (momentum(t + step)[k] - momentum(t - step)[k])
                - (momentum(t + 2 * step)[k] - momentum(t - 2 * step)[k])
            )
            / (12 * step)
            for k in (0, 1)
        ]
        weight = mass * description.gravity
        np.testing.assert_allclose(wrench[:3, 0], rate[0] - weight, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(wrench[3:, 0], rate[1] - np.cross(com, weight), rtol=1e-6, atol=1e-6)


def test_loads_are_linear_in_acceleration_and_gravity():
    robot = chains.robot_of(chains.random_description(3, 5))
    q, qd, qdd = chains.random_states(1, 5)
    zero = np.zeros_like(q)
    whole = rigid_columns(robot, q, qd, qdd)
    speed = rigid_columns(robot, q, qd, zero, gravity=np.zeros(3))
    force = rigid_columns(robot, q, zero, 2.0 * qdd, gravity=np.zeros(3))
    fall = rigid_columns(robot, q, zero, zero)
    for part in ("internal", "external"):
        summed = getattr(speed, part) + 0.5 * getattr(force, part) + getattr(fall, part)
        np.testing.assert_allclose(getattr(whole, part), summed, atol=1e-10)


def test_standing_still_the_plate_carries_the_weight():
    description = chains.Description(chains.random_description(5, 3).bodies, np.array([0.0, 0.0, -9.81]))
    robot = chains.robot_of(description)
    q = chains.random_states(0, 3)[0]
    _, wrench = loads(robot, q, np.zeros_like(q), np.zeros_like(q))
    weight = 9.81 * sum(body.mass for body in description.bodies)
    np.testing.assert_allclose(
        wrench[:3], np.array([0, 0, weight])[:, None] * np.ones(q.shape[1]), atol=1e-9 * weight
    )


@pytest.mark.parametrize("seed", range(5))
def test_inertial_parameters_go_and_come_back(seed):
    rng = np.random.default_rng(seed)
    rotation, com, mass = rotation_from_rpy(rng.normal(size=3)), rng.normal(size=3), 2.5
    inertia = np.diag([0.3, 0.4, 0.5])
    parameters = parameters_from_body(mass, com, inertia, rotation)
    back_mass, back_com, back_inertia = body_from_parameters(parameters)
    assert back_mass == mass
    np.testing.assert_allclose(back_com, com)
    np.testing.assert_allclose(back_inertia, rotation @ inertia @ rotation.T, atol=1e-12)
    shift = rng.normal(size=3)
    there = transform_parameters(parameters, rotation, shift)
    back = transform_parameters(there, rotation.T, -rotation.T @ shift)
    np.testing.assert_allclose(back, parameters, atol=1e-12)
    assert np.linalg.eigvalsh(pseudo_inertia(there)).min() > 0
    assert np.trace(inertia_matrix(there)) > 0
    np.testing.assert_allclose(rotation_from_rpy(rpy_from_rotation(rotation)), rotation, atol=1e-12)
