import importlib.util
from pathlib import Path

import numpy as np
import pytest

from drivers.virtual.plant_file import PlateSpec, load_plant
from drivers.virtual.rigid import RigidPlant
from drivers.virtual.urdf_tree import rotation_from_rpy

_spec = importlib.util.spec_from_file_location("virtual_oracle", Path(__file__).with_name("oracle.py"))
oracle = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(oracle)


def without_rotors(plant):
    joints = tuple(joint.model_copy(update={"rotor_inertia_kg_m2": 0.0}) for joint in plant.joints)
    return plant.model_copy(update={"joints": joints})


@pytest.mark.parametrize("name", ["ir361", "six_axis"])
def test_links_agree_with_an_independent_engine(name, states):
    plant = without_rotors(load_plant(name))
    q, qd, qdd = states(plant)
    loads = RigidPlant(plant).inverse(q, qd, qdd)
    joint, base = oracle.pinocchio_loads(plant, q, qd, qdd)
    assert np.allclose(loads.joint_nm, joint, atol=1e-6)
    assert np.allclose(loads.wrench, base, atol=1e-6)


@pytest.mark.parametrize("name", ["ir361", "six_axis"])
def test_locked_rotors_are_part_of_their_links(name, states):
    plant = load_plant(name)
    q, qd, qdd = states(plant)
    still = np.zeros_like(q)
    with_rotors = RigidPlant(plant).inverse(q, qd, qdd, rotor=(still, still))
    bare = RigidPlant(without_rotors(plant)).inverse(q, qd, qdd)
    assert np.allclose(with_rotors.link_nm, bare.link_nm, atol=1e-6)
    assert np.allclose(with_rotors.wrench, bare.wrench, atol=1e-6)


def test_standing_still_the_plate_carries_the_weight(arm):
    still = np.zeros((1, 3))
    wrench = RigidPlant(arm).inverse(still, still, still).wrench[0]
    mass_kg = sum(link.mass_kg for link in arm.links)
    moment = 9.81 * sum(link.mass_kg * link.com_m[1] for link in arm.links)
    assert wrench[:3] == pytest.approx([0.0, 0.0, 9.81 * mass_kg], abs=1e-6)
    assert wrench[3] == pytest.approx(moment, abs=1e-6)


def test_the_plates_pose_moves_and_turns_the_wrench(arm, states):
    q, qd, qdd = states(arm, 5)
    rpy, xyz = (0.1, -0.2, 0.5), (0.3, -0.1, -0.05)
    moved = arm.model_copy(update={"plate": PlateSpec(xyz_m=xyz, rpy_rad=rpy)})
    base = RigidPlant(arm).inverse(q, qd, qdd).wrench
    seen = RigidPlant(moved).inverse(q, qd, qdd).wrench
    turn = rotation_from_rpy(rpy)
    assert np.allclose(seen[:, :3] @ turn.T, base[:, :3])
    assert np.allclose(seen[:, 3:] @ turn.T + np.cross(xyz, base[:, :3]), base[:, 3:])


def rotor_share(plant, q, qd, qdd):
    rigid, still = RigidPlant(plant), np.zeros_like(q)
    spinning, locked = rigid.inverse(q, qd, qdd), rigid.inverse(q, qd, qdd, rotor=(still, still))
    return spinning.joint_nm - locked.link_nm, spinning.wrench - locked.wrench


def test_rotors_load_the_joints_as_the_published_equations_say(arm, states):
    """Equations 8 to 10, the parts that come from the rotors' spin."""
    q, qd, qdd = states(arm)
    joint, _ = rotor_share(arm, q, qd, qdd)
    n1, n2, n3 = (j.gear_ratio for j in arm.joints)
    i1, i2, i3 = (j.rotor_inertia_kg_m2 for j in arm.joints)
    a1, a2, a3 = qdd.T
    assert np.allclose(joint[:, 0], n1**2 * i1 * a1, atol=1e-5)
    assert np.allclose(joint[:, 1], n2**2 * i2 * a2 + n3 * i3 * a3, atol=1e-5)
    assert np.allclose(joint[:, 2], i3 * (n3 * a2 + n3**2 * a3), atol=1e-5)


def rotor_momentum(arm, q, qd):
    """Spin momentum of the IR 361's rotors about the base's axes (equations 11 to 13)."""
    (n1, n2, n3), (i1, i2, i3) = zip(
        *((j.gear_ratio, j.rotor_inertia_kg_m2) for j in arm.joints), strict=True
    )
    y_axis = np.stack([-np.sin(q[:, 0]), np.cos(q[:, 0]), np.zeros(len(q))], axis=1)
    z_axis = np.tile([0.0, 0.0, 1.0], (len(q), 1))
    along_y = n2 * qd[:, 1] * i2 + n3 * qd[:, 2] * i3
    return z_axis * (n1 * qd[:, 0] * i1)[:, None] + y_axis * along_y[:, None]


def test_the_plate_feels_the_rate_of_the_rotors_momentum(arm, states):
    q, qd, qdd = states(arm)
    _, wrench = rotor_share(arm, q, qd, qdd)
    h = 1e-5
    later = rotor_momentum(arm, q + h * qd + 0.5 * h * h * qdd, qd + h * qdd)
    sooner = rotor_momentum(arm, q - h * qd + 0.5 * h * h * qdd, qd - h * qdd)
    assert np.allclose(wrench[:, 3:], (later - sooner) / (2 * h), atol=1e-5)
    assert np.allclose(wrench[:, :3], 0.0, atol=1e-6)
    assert np.abs(wrench[:, 3:]).max() > 0.3


def test_joint_power_is_the_rate_of_the_links_energy(arm, states):
    plant = without_rotors(arm)
    q, qd, qdd = states(plant)
    power = np.sum(RigidPlant(plant).inverse(q, qd, qdd).joint_nm * qd, axis=1)
    h = 1e-5
    later = oracle.pinocchio_energy(plant, q + h * qd + 0.5 * h * h * qdd, qd + h * qdd)
    sooner = oracle.pinocchio_energy(plant, q - h * qd + 0.5 * h * h * qdd, qd - h * qdd)
    assert np.allclose(power, (later - sooner) / (2 * h), rtol=1e-5, atol=1e-3)


def test_a_coupled_transmission_spins_the_rotor_by_both_joints(arm, states):
    coupling = ((94.147, 0.0, 0.0), (0.0, 103.235, 0.0), (0.0, 51.441, 51.441))
    coupled = arm.model_copy(update={"coupling": coupling})
    q, _, qdd = states(arm, 10)
    still = np.zeros_like(q)
    joint, _ = rotor_share(coupled, q, still, qdd)
    spin = 51.441 * (qdd[:, 1] + qdd[:, 2])
    i3 = arm.joints[2].rotor_inertia_kg_m2
    extra = i3 * 51.441 * spin
    assert np.allclose(joint[:, 2], extra + i3 * 51.441 * qdd[:, 1], rtol=1e-6)


def test_the_bearing_moment_of_joint_one_is_the_moment_above_it(arm, states):
    q, qd, qdd = states(arm, 5)
    loads = RigidPlant(arm).inverse(q, qd, qdd, tilting=True)
    base = arm.links[0]
    weight = 9.81 * base.mass_kg
    force = loads.wrench[:, :3] - [0.0, 0.0, weight]
    about_origin = loads.wrench[:, 3:] - np.cross(base.com_m, [0.0, 0.0, weight])
    above = about_origin - np.cross([0.0, 0.0, 1.02], force)
    assert np.allclose(loads.tilting_nm[:, 0], np.linalg.norm(above[:, :2], axis=1), rtol=1e-3)


def test_the_reference_arms_base_parameters_are_the_published_ones(arm):
    """Kr111, Kd2, b31, b32 and b21 of the paper's table, from the inertials by hand."""

    def about_joint(link):
        x, y, z = link.com_m
        squares = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
        return np.array(link.inertia_kg_m2[:3]) + link.mass_kg * squares

    one, two, three = (about_joint(link) for link in arm.links[1:])
    upper, lower = arm.links[3], arm.links[2]
    reach = 0.48
    carried = upper.mass_kg * reach**2
    assert one[2] + two[0] + carried + three[0] == pytest.approx(18.2649, abs=2e-3)
    assert two[2] - two[0] - carried == pytest.approx(-10.2864, abs=2e-3)
    assert upper.mass_kg * np.array(upper.com_m)[[0, 2]] == pytest.approx([0.6208, 2.8214], abs=1e-3)
    assert lower.mass_kg * lower.com_m[2] + upper.mass_kg * reach == pytest.approx(16.7748, abs=1e-3)
