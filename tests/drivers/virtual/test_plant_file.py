import tomllib
from pathlib import Path

import numpy as np
import pytest

from drivers.virtual.errors import PlantError
from drivers.virtual.from_robot import plant_from_robot_file, plant_from_urdf
from drivers.virtual.plant_file import PRESETS, JointPlant, load_plant, preset_names
from drivers.virtual.record import record_virtual
from drivers.virtual.robot_description import robot_attachments
from drivers.virtual.trajectories import random_fourier

SHARED = Path(__file__).resolve().parents[4] / "shared/data"

PENDULUM = """
<robot name="pendulum">
  <link name="base"/>
  <link name="arm">
    <inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="hinge" type="continuous">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" velocity="2" effort="20"/>
  </joint>
</robot>
"""


def test_presets_are_there():
    assert {"ir361", "six_axis"} <= set(preset_names())


def test_unknown_keys_are_refused(tmp_path):
    text = (PRESETS / "ir361.toml").read_text().replace("[plate]", "[plate]\nclock_pmm = 3.0")
    (tmp_path / "ir361.urdf").write_text((PRESETS / "ir361.urdf").read_text())
    (tmp_path / "odd.toml").write_text(text)
    with pytest.raises(PlantError, match="clock_pmm"):
        load_plant(tmp_path / "odd.toml")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("mass_kg = 38.0", "mass_kg = -38.0"),
        ("[3.55, 4.03, 1.26]", "[3.55, 4.03]"),
        ('urdf = "ir361.urdf"', ""),
    ],
)
def test_impossible_values_are_refused_in_one_sentence(tmp_path, old, new):
    (tmp_path / "ir361.urdf").write_text((PRESETS / "ir361.urdf").read_text())
    (tmp_path / "odd.toml").write_text((PRESETS / "ir361.toml").read_text().replace(old, new))
    with pytest.raises(PlantError) as caught:
        load_plant(tmp_path / "odd.toml")
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_missing_plant_names_the_presets():
    with pytest.raises(PlantError, match="ir361"):
        load_plant("no_such_robot")


def test_a_urdf_with_inertials_becomes_a_plant():
    joint = JointPlant(name="hinge", gear_ratio=50.0, torque_constant_nm_a=0.1, coulomb_nm=0.5)
    plant = plant_from_urdf("pendulum", PENDULUM, [joint])
    run = record_virtual(plant, random_fourier(plant, 1), periods=1, transient_periods=0)
    assert run.wrench.data["force"][:, 2].mean() == pytest.approx(2.0 * 9.81, abs=2.0)
    guessed = plant_from_urdf("pendulum", PENDULUM)
    assert guessed.joints[0].coulomb_nm == pytest.approx(1.2)


def test_a_urdf_without_inertials_is_refused():
    with pytest.raises(PlantError, match=r"arm.*no inertials"):
        plant_from_urdf("hollow", PENDULUM.replace("inertial>", "nothing>"))


def test_an_unphysical_inertia_is_refused():
    with pytest.raises(PlantError, match="no physical inertials"):
        plant_from_urdf("odd", PENDULUM.replace('izz="0.01"', 'izz="9.0"'))


def test_a_robot_file_with_a_full_urdf_becomes_a_plant(tmp_path):
    (tmp_path / "p.urdf").write_text(PENDULUM)
    (tmp_path / "robot.toml").write_text(
        'name = "p"\nurdf = "p.urdf"\ngravity = [0.0, 0.0, -9.81]\n[force_plate]\nxyz = [0.1, 0.0, 0.0]\n'
        '[[joint]]\nname = "hinge"\ngear_ratio = 80.0\ntorque_constant = 0.2\nrotor_inertia = 1e-5\n'
    )
    plant = plant_from_robot_file(tmp_path / "robot.toml")
    assert plant.joints[0].gear_ratio == 80.0
    assert plant.plate.xyz_m == (0.1, 0.0, 0.0)


@pytest.mark.shared
@pytest.mark.skipif(not SHARED.exists(), reason="the shared recordings are not beside the repository")
def test_the_reference_robot_file_has_no_inertials_and_says_so():
    with pytest.raises(PlantError, match=r"link_1.*no inertials"):
        plant_from_robot_file(SHARED / "ir361/robot.toml")


def test_prismatic_joints_carry_weight_along_their_axis():
    urdf = PENDULUM.replace('type="continuous"', 'type="prismatic"').replace(
        'axis xyz="0 1 0"', 'axis xyz="0 0 1"'
    )
    from drivers.virtual.rigid import RigidPlant

    still = np.zeros((1, 1))
    loads = RigidPlant(plant_from_urdf("lift", urdf)).inverse(still, still, still + 1.0)
    assert loads.joint_nm[0, 0] == pytest.approx(2.0 * 10.81)


def test_the_robot_file_of_a_plant_keeps_its_secrets():
    plant = plant_from_urdf("pendulum", PENDULUM)
    files = robot_attachments(plant)
    table = tomllib.loads(files["robot.toml"].decode())
    assert table["joint"][0]["name"] == "hinge"
    assert b"inertial" not in files[table["urdf"]]
    arm = tomllib.loads(robot_attachments(load_plant("six_axis"))["robot.toml"].decode())
    assert [joint["gear_ratio"] for joint in arm["joint"]][:2] == [121.0, 140.0]
    assert arm["joint"][1]["gravity_compensation"] == {"harmonics": 3}
    assert "coulomb_nm" not in arm["joint"][0]
