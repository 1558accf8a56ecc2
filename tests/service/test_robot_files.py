"""Robot files: what is accepted, and how the rest is refused."""

import numpy as np
import pytest

from identify.structure import find_structure
from service.robots import load_robot, preset_names
from tests.service import synthetic_logs as logs


@pytest.fixture
def robot(tmp_path):
    """The reference robot's files, to be spoilt; gives the path of the robot file."""
    loaded = load_robot("ir361")

    def make(old="", new="", urdf_old="", urdf_new=""):
        assert old in loaded.toml_text
        assert urdf_old in loaded.urdf_text
        (tmp_path / "robot.toml").write_text(
            loaded.toml_text.replace(old, new, 1) if old else loaded.toml_text + new
        )
        (tmp_path / "ir361.urdf").write_text(loaded.urdf_text.replace(urdf_old, urdf_new))
        return tmp_path / "robot.toml"

    return make


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return logs.write(logs.recording(), tmp_path_factory.mktemp("log") / "run.mcap")


def test_the_preset_is_the_reference_robot():
    assert "ir361" in preset_names()
    robot = load_robot("ir361").robot
    assert [j.drive.gear_ratio for j in robot.joints] == [94.147, 103.235, 51.441]
    assert [j.drive.rotor_carrier for j in robot.joints] == [-1, 0, 1]
    assert [j.drive.gravity_harmonics for j in robot.joints] == [0, 3, 0]


def test_a_path_or_its_folder_will_do(robot, tmp_path):
    assert load_robot(robot()).model_hash == load_robot(tmp_path).model_hash


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("gear_ratio = 94.147", "gear_ration = 94.147", "did you mean 'gear_ratio'"),
        ("rotor_inertia = 1.10e-3", "rotor_inertai = 1e-3", "did you mean 'rotor_inertia'"),
        ("[force_plate]", "[forceplate]", "did you mean 'force_plate'"),
        ("gear_ratio = 94.147", "gear_ratio = 0", "gear_ratio must not be zero"),
        ("gear_ratio = 94.147", 'gear_ratio = "high"', "gear_ratio"),
        ("gear_ratio = 94.147", "gear_ratio = nan", "gear_ratio"),
        ("rotor_inertia = 1.10e-3", "rotor_inertia = -1.0", "rotor_inertia"),
        ('rotor_link = "base_link"', 'rotor_link = "bass_link"', "is not a link of the URDF"),
        ('rotor_link = "base_link"', 'rotor_link = "link_2"', "nearer to the base"),
        ('name = "joint_2"', 'name = "joint_9"', "joint_9"),
        ('name = "joint_2"', 'name = "joint_1"', "described twice"),
        ('friction = ["coulomb", "viscous"]', 'friction = ["stiction"]', "friction"),
        ('urdf = "ir361.urdf"', 'urdf = "none.urdf"', "does not exist"),
        ('name = "ir361"', 'name = "ir361', "not valid TOML"),
        ("harmonics = 3", "harmonics = 40", "harmonics"),
    ],
)
def test_faults_in_the_robot_file(robot, log, capsys, old, new, hint):
    assert hint in logs.refused(capsys, 2, "identify", log, "--robot", robot(old, new))


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ('type="revolute"', 'type="planar"', "planar"),
        ("</robot>", "", "not well-formed"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "length zero"),
        ('<parent link="link_2"/>', '<parent link="link_1"/>', "branches"),
        ('<child link="link_3"/>', '<child link="link_7"/>', "link_7"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 zero 1"/>', "0 zero 1"),
    ],
)
def test_faults_in_the_urdf(robot, log, capsys, old, new, hint):
    path = robot(urdf_old=old, urdf_new=new)
    assert hint in logs.refused(capsys, 2, "identify", log, "--robot", path)


def test_a_fixed_tool_is_merged_into_its_link(robot):
    tool = (
        '<link name="tool"><inertial><mass value="2"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
        '<joint name="flange" type="fixed"><parent link="link_3"/><child link="tool"/>'
        '<origin xyz="0 0 0.1"/></joint></robot>'
    )
    robot = load_robot(robot(urdf_old="</robot>", urdf_new=tool)).robot
    assert robot.n == 3
    np.testing.assert_allclose(robot.reference_parameters[2, :4], [2.0, 0.0, 0.0, 0.2])
    assert robot.reference_parameters[2, 4] == pytest.approx(0.1 + 2 * 0.1**2)


def test_a_coupled_robot_follows_the_chains_order(robot):
    matrix = "coupling = [[94.0, 0, 0], [0, 103.0, 0], [0, -51.0, 51.0]]\n"
    loaded = load_robot(robot('name = "ir361"', matrix + 'name = "ir361"'))
    np.testing.assert_array_equal(loaded.robot.motor_matrix[2], [0.0, -51.0, 51.0])
    assert find_structure(loaded.robot).counts["combined"] == 34


def test_a_singular_coupling_is_refused(robot, log, capsys):
    matrix = "coupling = [[94.0, 0, 0], [0, 103.0, 51.0], [0, 103.0, 51.0]]\n"
    path = robot('name = "ir361"', matrix + 'name = "ir361"')
    assert "singular" in logs.refused(capsys, 2, "identify", log, "--robot", path)
