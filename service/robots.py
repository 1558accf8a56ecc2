"""Robots by preset name or by path: the file checked, the URDF read, the chain built."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np

from identify.robot import Drive, ForcePlate, Joint, Robot
from identify.rotations import rotation_from_rpy
from identify.urdf import Chain, read_urdf
from service.errors import UsageError
from service.robot_file import JointSection, RobotFile, parse_robot_file


@dataclass(frozen=True)
class LoadedRobot:
    """A robot with the texts it was built from.

    Attributes:
        file: the checked robot file.
        chain: what the URDF says.
        robot: the chain with drives and plate, for identification.
        toml_text: the file as read.
        urdf_text: the URDF as read.
        where: preset name or path, for messages.
    """

    file: RobotFile
    chain: Chain
    robot: Robot
    toml_text: str
    urdf_text: str
    where: str

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.file.name

    @property
    def model_hash(self) -> str:
        """Short digest of both texts: changes when the description changes."""
        return hashlib.sha256((self.toml_text + "\0" + self.urdf_text).encode()).hexdigest()[:16]


def preset_names() -> list[str]:
    """List the presets that ship with the program."""
    folder = resources.files("service") / "presets"
    return sorted(entry.name for entry in folder.iterdir() if (entry / "robot.toml").is_file())


def load_robot(name_or_path: str | Path) -> LoadedRobot:
    """Load a robot.

    Args:
        name_or_path: a preset name, a path to a ``robot.toml``, or a folder that holds one.

    Returns:
        The robot.

    Raises:
        UsageError: no such preset or file, or a fault in it.
        identify.errors.ModelError: the URDF is not supported.
    """
    path = Path(name_or_path)
    if str(name_or_path) in preset_names():
        folder = resources.files("service") / "presets" / str(name_or_path)
        toml_text = (folder / "robot.toml").read_text()
        urdf = parse_robot_file(toml_text, str(name_or_path)).urdf
        return build_robot(toml_text, (folder / urdf).read_text(), str(name_or_path))
    if path.is_dir():
        path = path / "robot.toml"
    if not path.is_file():
        raise UsageError(
            f"Robot '{name_or_path}' is neither a preset ({', '.join(preset_names())}) nor a file; "
            "give a preset name or the path to a robot.toml."
        )
    toml_text = _read(path, "robot file")
    urdf_path = path.parent / parse_robot_file(toml_text, str(path)).urdf
    if not urdf_path.is_file():
        raise UsageError(
            f"Robot file {path} names the URDF '{urdf_path}', which does not exist; correct its 'urdf' key "
            "(a path relative to the robot file)."
        )
    return build_robot(toml_text, _read(urdf_path, "URDF"), str(path))


def _read(path: Path, what: str) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"The {what} {path} cannot be read: {error}.") from error


def build_robot(toml_text: str, urdf_text: str, where: str) -> LoadedRobot:
    """Build a robot from the two texts.

    Args:
        toml_text: the robot file.
        urdf_text: the URDF.
        where: for messages.

    Returns:
        The robot, its joints in the chain's order.
    """
    file = parse_robot_file(toml_text, where)
    chain = read_urdf(urdf_text, [joint.name for joint in file.joint])
    sections = {joint.name: joint for joint in file.joint}
    joints = tuple(_with_drive(joint, index, sections[joint.name], chain, where) for index, joint in enumerate(chain.joints))
    plate = None
    if file.force_plate is not None:
        pose = file.force_plate
        plate = ForcePlate(rotation_from_rpy(pose.rpy), np.array(pose.xyz), pose.tared)
    robot = Robot(
        file.name,
        joints,
        np.array(file.gravity),
        plate,
        _coupling(file, chain),
        chain.parameters if np.isfinite(chain.parameters).any() else None,
    )
    return LoadedRobot(file, chain, robot, toml_text, urdf_text, where)


def _coupling(file: RobotFile, chain: Chain) -> np.ndarray | None:
    """Coupling matrix in the chain's order; the file's order may differ."""
    if file.coupling is None:
        return None
    names = [joint.name for joint in file.joint]
    order = [names.index(joint.name) for joint in chain.joints]
    return np.array(file.coupling)[np.ix_(order, order)]


def _with_drive(joint: Joint, index: int, section: JointSection, chain: Chain, where: str) -> Joint:
    carrier, axis = _rotor_mount(joint, index, section, chain, where)
    drive = Drive(
        gear_ratio=section.gear_ratio,
        torque_constant=section.torque_constant,
        rotor_inertia=section.rotor_inertia,
        # without a stator link the rotor's spin cannot be placed: it stays lumped into the link
        has_rotor=section.rotor_link is not None or section.rotor_inertia is not None,
        rotor_carrier=carrier,
        rotor_axis=axis,
        friction=section.friction,
        offset=section.offset,
        gravity_harmonics=section.gravity_compensation.harmonics if section.gravity_compensation else 0,
    )
    if drive.gravity_harmonics and joint.prismatic:
        raise UsageError(f"Robot file {where}: gravity_compensation of '{joint.name}' needs a revolute joint; remove it.")
    limits = joint.limits
    if section.max_acceleration is not None:
        limits = replace(limits, acceleration=section.max_acceleration)
    return replace(joint, drive=drive, limits=limits)


def _rotor_mount(
    joint: Joint, index: int, section: JointSection, chain: Chain, where: str
) -> tuple[int, np.ndarray]:
    """Carrier link of the stator and the spin axis in its frame (the joint's own axis at zero by default)."""
    link = section.rotor_link
    if link is not None and link not in chain.link_of:
        raise UsageError(
            f"Robot file {where}: rotor_link '{link}' of joint '{joint.name}' is not a link of the URDF, which has: "
            f"{', '.join(chain.link_of)}."
        )
    carrier = chain.link_of[link] if link is not None else index - 1
    if carrier >= index:
        raise UsageError(
            f"Robot file {where}: rotor_link '{link}' of joint '{joint.name}' is moved by that joint itself; "
            "the stator must sit on a link nearer to the base."
        )
    if section.rotor_axis is not None:
        axis = np.array(section.rotor_axis)
        if np.linalg.norm(axis) < 1e-9:
            raise UsageError(f"Robot file {where}: rotor_axis of joint '{joint.name}' has length zero.")
        rotation = chain.pose_of[link][0] if link is not None else np.eye(3)
        return carrier, rotation @ (axis / np.linalg.norm(axis))
    axis = joint.axis
    for k in range(index, carrier, -1):
        axis = chain.joints[k].rotation @ axis
    return carrier, axis
