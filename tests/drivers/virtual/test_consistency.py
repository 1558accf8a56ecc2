"""Noise-free samples belong to one motion: another engine gets the same currents and wrenches from it."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from drivers.virtual.plant_file import load_plant
from drivers.virtual.record import run_motion
from drivers.virtual.trajectories import random_fourier, random_points

_spec = importlib.util.spec_from_file_location("virtual_oracle", Path(__file__).with_name("oracle.py"))
oracle = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(oracle)


def spring(joint, q):
    s = joint.spring
    if s is None:
        return 0.0
    length = np.sqrt(s.radius_a_m**2 + s.radius_b_m**2 - 2 * s.radius_a_m * s.radius_b_m * np.cos(q))
    return s.stiffness_n_m * s.radius_a_m * s.radius_b_m * np.sin(q) * (1 - s.rest_length_m / length)


@pytest.fixture(scope="module")
def run(arm, motion):
    return run_motion(arm.quiet(), motion, 12.0)


def rotors(arm, q, qd, qdd):
    """Rotor torques and momentum rate of the parallel-axis arm, by hand."""
    (n1, n2, n3), (i1, i2, i3) = zip(
        *((j.gear_ratio, j.rotor_inertia_kg_m2) for j in arm.joints), strict=True
    )
    a1, a2, a3 = qdd.T
    v1, v2, v3 = qd.T
    spin, pull = n2 * v2 * i2 + n3 * v3 * i3, n2 * a2 * i2 + n3 * a3 * i3
    joint = np.stack(
        [n1**2 * i1 * a1, n2**2 * i2 * a2 + n3 * i3 * a3, n3 * i3 * a2 + n3**2 * i3 * a3], axis=1
    )
    sine, cosine = np.sin(q[:, 0]), np.cos(q[:, 0])
    moment = np.stack(
        [-sine * pull - cosine * v1 * spin, cosine * pull - sine * v1 * spin, n1 * a1 * i1], axis=1
    )
    return joint, moment


def test_currents_and_wrench_follow_from_the_true_motion(arm, run):
    t_s = np.arange(0.0, 12.0, 0.00713)
    m = run.moments(t_s)
    joint, base = oracle.pinocchio_loads(arm, m.q, m.qd, m.qdd)
    spin, moment = rotors(arm, m.q, m.qd, m.qdd)
    for k, part in enumerate(arm.joints):
        tau = (
            joint[:, k]
            + spin[:, k]
            + part.coulomb_nm * np.sign(m.qd[:, k])
            + part.viscous_nm_s * m.qd[:, k]
        )
        tau += part.offset_nm + spring(part, m.q[:, k])
        seen = run.currents(t_s)[:, k] * part.gear_ratio * part.torque_constant_nm_a
        assert np.abs(seen - tau).max() < 1e-3 * arm.noise.joint_torque_nm[k]
    base[:, 3:] += moment
    error = np.abs(run.wrench(t_s) - base - np.array(arm.plate.offsets)).max(axis=0)
    assert np.all(error < 1e-3 * np.array(arm.noise.wrench))


def test_speed_and_acceleration_are_the_derivatives_of_the_angle(run):
    h = 1e-4
    t_s = np.linspace(0.1, 11.9, 4001)
    before, now, after = (run.moments(t_s + shift) for shift in (-h, 0.0, h))
    assert np.abs((after.q - before.q) / (2 * h) - now.qd).max() < 1e-6
    assert np.abs((after.qd - before.qd) / (2 * h) - now.qdd).max() < 1e-3


def test_the_joint_follows_its_setpoint_but_not_perfectly(run, motion):
    t_s = np.linspace(0.0, 11.9, 3000)
    error = np.abs(run.moments(t_s).q - motion.position(t_s - run.period_s)).max(axis=0)
    assert np.all(error > 1e-4)
    assert np.all(error < 5e-3)


def test_a_periodic_motion_repeats(run):
    t_s = np.linspace(0.0, 1.9, 500)
    first, second = run.moments(t_s), run.moments(t_s + 10.0)
    assert np.abs(first.q - second.q).max() < 1e-8
    assert np.abs(first.qdd - second.qdd).max() < 1e-4


def test_a_stopped_joint_sticks_within_its_friction(arm):
    points = random_points(arm, seed=3, points=4, dwell_s=1.0)
    run = run_motion(arm.quiet(), points, points.duration_s)
    stop_s = points.start_s[1:] - 0.02
    m = run.moments(stop_s)
    assert np.abs(m.qd).max() < 1e-6
    load = run.loads(m).joint_nm
    torque = run.torques(m)
    for k, part in enumerate(arm.joints):
        friction = torque[:, k] - load[:, k] - part.offset_nm - spring(part, m.q[:, k])
        assert np.all(np.abs(friction) < part.coulomb_nm)
        assert np.abs(friction).max() > 0.05 * part.coulomb_nm


def test_friction_is_exact_in_motion(arm, run):
    m = run.moments(np.linspace(0.0, 11.9, 2000))
    assert np.array_equal(m.direction, np.sign(m.qd))


def test_moving_in_small_steps_is_moving_at_once(arm, motion):
    from drivers.virtual.plant import VirtualPlant

    knots = motion.position(np.arange(1, 400) * 4e-3)
    start = motion.position(np.zeros(1))[0]
    whole, parts = (VirtualPlant(arm, start_q=start) for _ in range(2))
    whole.follow(knots)
    for piece in np.array_split(knots, 57):
        parts.follow(piece)
    t_s = np.linspace(0.0, 1.59, 300)
    assert np.allclose(whole.encoders(t_s), parts.encoders(t_s), atol=1e-12)
    assert np.allclose(whole.currents(t_s), parts.currents(t_s), atol=1e-6)


def test_six_axes_run_too():
    plant = load_plant("six_axis")
    run = run_motion(plant.quiet(), random_fourier(plant, 3), 2.0)
    t_s = np.linspace(0.0, 2.0, 200)
    joint, _ = oracle.pinocchio_loads(plant, *(getattr(run.moments(t_s), x) for x in ("q", "qd", "qdd")))
    assert np.allclose(run.loads(run.moments(t_s)).link_nm, joint, atol=3.0)
    assert np.isfinite(run.wrench(t_s)).all()
