"""Rotors: the published equations, coupled transmissions, energy and momentum."""

from dataclasses import replace

import numpy as np
import pytest

from identify.regressor import rigid_columns
from identify.robot import Drive
from identify.structure import to_drives
from tests.identify import chains
from tests.identify.robots import ir361

N1, N2, N3 = 94.147, 103.235, 51.441
IM1, IM2, IM3 = 1.10e-3, 1.10e-3, 0.62e-3


@pytest.fixture(scope="module")
def states():
    return chains.random_states(4, 3, 50)


def test_drive_torques_are_equations_8_to_10(states):
    """What a carried rotor adds as a plain body is the link's own; here it is added to link 2's Iyy."""
    robot, (_, (q1dd, q2dd, q3dd)) = ir361(), (states[1], states[2])
    columns = rigid_columns(robot, *states)
    rotor = np.einsum("cpn,p->cn", columns.rotor_internal, [IM1, IM2, IM3])
    carried = IM3 * columns.internal[:, 17]  # link_2.Iyy
    assert np.allclose(rotor[0], N1**2 * IM1 * q1dd)  # (8)
    paper = (1 + N2**2) * IM2 * q2dd + IM3 * (q2dd + N3 * q3dd)  # (9); its "1 +" is 1e-4 of the term
    assert np.allclose(rotor[1] + carried[1], paper - IM2 * q2dd, rtol=1e-12)
    assert np.allclose(rotor[2], IM3 * (N3 * q2dd + N3**2 * q3dd))  # (10)


def test_base_torques_are_equations_11_to_13(states):
    robot, (q, qd, qdd) = ir361(), states
    (q1, _, _), (q1d, q2d, q3d), (q1dd, q2dd, q3dd) = q, qd, qdd
    columns = rigid_columns(robot, q, qd, qdd)
    rotor = np.einsum("cpn,p->cn", columns.rotor_external, [IM1, IM2, IM3])
    carried_xy = IM3 * columns.external[3:5, 17]
    spin, rate = IM2 * N2 * q2d + IM3 * (q2d + N3 * q3d), IM2 * N2 * q2dd + IM3 * (q2dd + N3 * q3dd)
    assert np.allclose(rotor[3] + carried_xy[0], -rate * np.sin(q1) - q1d * spin * np.cos(q1))
    assert np.allclose(rotor[4] + carried_xy[1], rate * np.cos(q1) - q1d * spin * np.sin(q1))
    assert np.allclose(rotor[5], N1 * IM1 * q1dd)
    assert np.array_equal(rotor[:3], np.zeros_like(rotor[:3]))  # spinning makes no force


def test_the_gear_ratio_enters_currents_squared_and_the_plate_once(states):
    robot = ir361()
    doubled = replace(
        robot,
        joints=tuple(
            replace(j, drive=replace(j.drive, gear_ratio=2 * j.drive.gear_ratio)) for j in robot.joints
        ),
    )
    once, twice = rigid_columns(robot, *states), rigid_columns(doubled, *states)
    assert np.allclose(twice.rotor_external, 2 * once.rotor_external)
    assert np.allclose(twice.rotor_internal[0, 0], 4 * once.rotor_internal[0, 0])


def test_coupled_rotors_on_the_base_follow_lagrange(states):
    """Motors on the base: T = sum Im (C qd)^2 / 2, so tau = C' Im C qdd; u . D qd = tau . qd for drives."""
    rng = np.random.default_rng(0)
    coupling = np.diag([N1, N2, N3]) @ (np.eye(3) + 0.4 * rng.normal(size=(3, 3)))
    robot = ir361()
    joints = tuple(
        replace(j, drive=replace(j.drive, rotor_carrier=-1, rotor_axis=np.array([0.0, 0.0, 1.0])))
        for j in robot.joints
    )
    coupled = replace(robot, joints=joints, coupling=coupling)
    inertia = np.array([IM1, IM2, IM3])
    columns = rigid_columns(coupled, *states)
    tau = np.einsum("cpn,p->cn", columns.rotor_internal, inertia)
    assert np.allclose(tau, coupling.T @ np.diag(inertia) @ coupling @ states[2])
    u = to_drives(coupled, tau)
    assert np.allclose(
        np.sum(u * (coupled.drive_matrix @ states[1]), axis=0), np.sum(tau * states[1], axis=0)
    )
    motor = (
        np.array([j.drive.gear_ratio for j in joints])[:, None] * inertia[:, None] * (coupling @ states[2])
    )
    assert np.allclose(u, motor)  # each drive feels just its own rotor


@pytest.mark.parametrize("seed", range(6))
def test_rotors_on_any_chain_obey_energy_and_momentum(seed):
    n, rng = 4, np.random.default_rng(seed)
    drives = [
        Drive(
            gear_ratio=float(rng.uniform(20, 120)),
            has_rotor=True,
            rotor_carrier=int(rng.integers(-1, k)),
            rotor_axis=(a := rng.normal(size=3)) / np.linalg.norm(a),
            friction=(),
            offset=False,
        )
        for k in range(n)
    ]
    robot = chains.robot_of(chains.random_description(seed, n), drives=drives)
    if seed % 2:
        robot = replace(robot, coupling=robot.motor_matrix @ (np.eye(n) + 0.2 * rng.normal(size=(n, n))))
    inertia, motion = rng.uniform(1e-4, 1e-3, n), chains.smooth_motion(seed, n)
    for t in np.linspace(0.0, 3.0, 7):
        state = motion(np.array([t]))
        columns = rigid_columns(robot, *state)
        power = np.einsum("cpn,p->cn", columns.rotor_internal, inertia)[:, 0] @ state[1][:, 0]
        moment = np.einsum("cpn,p->cn", columns.rotor_external, inertia)[3:, 0]
        energy_rate, momentum_rate = (
            _rate(lambda s, k=k: _stored(robot, inertia, motion, s)[k], t) for k in (0, 1)
        )
        assert power == pytest.approx(energy_rate, rel=1e-6, abs=1e-6)
        np.testing.assert_allclose(moment, momentum_rate, rtol=1e-6, atol=1e-6)


def _stored(robot, inertia, motion, t):
    """Energy Im (s^2 / 2 + s w.e) and spin momentum Im s e of all rotors."""
    from identify.kinematics import link_motions

    state = motion(np.array([t]))
    links = link_motions(robot, *state)
    energy, momentum = 0.0, np.zeros(3)
    for k, joint in enumerate(robot.joints):
        spin, carrier = (robot.motor_matrix[k] @ state[1])[0], joint.drive.rotor_carrier
        axis = (
            joint.drive.rotor_axis
            if carrier < 0
            else links[carrier].rotation[:, :, 0] @ joint.drive.rotor_axis
        )
        turning = np.zeros(3) if carrier < 0 else links[carrier].omega[:, 0]
        energy += inertia[k] * (0.5 * spin**2 + spin * (turning @ axis))
        momentum = momentum + inertia[k] * spin * axis
    return energy, momentum


def _rate(function, t, step=1e-4):
    return (
        8 * (function(t + step) - function(t - step)) - (function(t + 2 * step) - function(t - 2 * step))
    ) / (12 * step)
