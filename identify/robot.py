"""The robot as identification sees it: a serial chain, its drives, its plate."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from identify.errors import ModelError
from identify.rotations import FloatArray

FRICTION_TERMS = ("coulomb", "viscous", "asymmetric_viscous", "joint_coulomb", "joint_viscous")
WRENCH_CHANNELS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


@dataclass(frozen=True)
class Limits:
    """Limits of one joint; ``inf`` where the description states none."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    acceleration: float = np.inf
    effort: float = np.inf


@dataclass(frozen=True)
class Drive:
    """Motor, gear and losses of one joint.

    Attributes:
        gear_ratio: motor speed per joint speed [-] ([rad/m] for a prismatic joint).
        torque_constant: nominal, motor side [N.m/A]; None where currents are not to be used.
        rotor_inertia: motor side [kg.m2]; None where it is to be estimated.
        has_rotor: False leaves the rotor to the link's own inertia.
        rotor_carrier: index of the link that carries the stator, -1 for the base.
        rotor_axis: unit spin axis in the carrier's frame, shape (3,).
        friction: terms of :data:`FRICTION_TERMS`.
        offset: whether a constant torque is estimated.
        gravity_harmonics: harmonics of the Fourier gravity compensation (Eq. 15), 0 for none.
    """

    gear_ratio: float = 1.0
    torque_constant: float | None = None
    rotor_inertia: float | None = None
    has_rotor: bool = False
    rotor_carrier: int = -1
    rotor_axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    friction: tuple[str, ...] = ("coulomb", "viscous")
    offset: bool = True
    gravity_harmonics: int = 0


@dataclass(frozen=True)
class Joint:
    """One moving joint of the chain and the link it carries (fixed joints are merged).

    Attributes:
        name: the joint's name.
        link: the carried link's name; its frame is the joint frame.
        prismatic: True for a sliding joint (positions in m, efforts in N).
        rotation: the joint frame's axes in the parent link's frame at zero, shape (3, 3).
        translation_m: its origin in the parent link's frame [m], shape (3,).
        axis: unit axis in the joint frame, shape (3,).
        limits: position, velocity, acceleration, effort.
        drive: motor, gear, losses.
    """

    name: str
    link: str
    prismatic: bool
    rotation: FloatArray
    translation_m: FloatArray
    axis: FloatArray
    limits: Limits = field(default_factory=Limits)
    drive: Drive = field(default_factory=Drive)

    @property
    def torque_unit(self) -> str:
        """Unit of this joint's generalised force."""
        return "N" if self.prismatic else "N.m"

    @property
    def velocity_unit(self) -> str:
        """Unit of this joint's speed."""
        return "m/s" if self.prismatic else "rad/s"


@dataclass(frozen=True)
class ForcePlate:
    """Pose of the plate in the robot's base frame, and whether its offsets are unknown."""

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    tared: bool = True


@dataclass(frozen=True)
class Robot:
    """A serial chain on a base.

    Attributes:
        name: the robot's name.
        joints: from base to tip.
        gravity: acceleration of free fall in the base frame [m/s2], shape (3,).
        plate: the force plate under the base, None where there is none.
        coupling: motor speed per joint speed, shape (n, n); None for one motor a joint.
        reference_parameters: link parameters of the reference model, shape (n, 10), nan where the
            description has none.
    """

    name: str
    joints: tuple[Joint, ...]
    gravity: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    plate: ForcePlate | None = None
    coupling: FloatArray | None = None
    reference_parameters: FloatArray | None = None

    def __post_init__(self) -> None:
        if not self.joints:
            raise ModelError(f"Robot '{self.name}' has no moving joint: nothing can be identified.")
        if self.coupling is not None and abs(np.linalg.det(self.drive_matrix)) < 1e-9:
            raise ModelError(
                f"The coupling matrix of robot '{self.name}' is singular: two motors would move the same "
                "combination of joints; give motor speed per joint speed, row by motor, column by joint."
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names from base to tip."""
        return tuple(joint.name for joint in self.joints)

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the moving links from base to tip."""
        return tuple(joint.link for joint in self.joints)

    @property
    def motor_matrix(self) -> FloatArray:
        """Motor speed per joint speed, shape (n, n): the coupling, or the gear ratios on the diagonal."""
        if self.coupling is not None:
            return self.coupling
        return np.diag([joint.drive.gear_ratio for joint in self.joints])

    @property
    def drive_matrix(self) -> FloatArray:
        """Motor speed over its own gear ratio per joint speed, shape (n, n); identity if uncoupled."""
        ratios = np.array([joint.drive.gear_ratio for joint in self.joints])
        return self.motor_matrix / ratios[:, None]

    @property
    def channels(self) -> tuple[str, ...]:
        """Joint names, then the six wrench channels where there is a plate."""
        return self.joint_names + (WRENCH_CHANNELS if self.plate is not None else ())
