"""The description of a virtual plant: true inertials, friction, drives, plate, clocks and noise."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from drivers.virtual.errors import PlantError

Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Colour = Annotated[float, Field(gt=-1.0, lt=1.0)]
Correlation = Annotated[float, Field(ge=0.0, lt=1.0)]
ZERO3: Vector3 = (0.0, 0.0, 0.0)
ZERO6: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

PRESETS = Path(__file__).parent / "presets"


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LinkInertial(_Part):
    """Mass, centre of mass and inertia about it of one link, rotor locked, in the link's joint frame."""

    name: str
    mass_kg: Positive
    com_m: Vector3 = ZERO3
    inertia_kg_m2: Vector6
    """xx, yy, zz, xy, xz, yz about the centre of mass."""


class GravitySpring(_Part):
    """A spring between two links: two attachment radii and a rest length, or a Fourier series of torque.

    The exact spring resists with k A B sin(q - phi) (1 - l0 / l) (catalogue of effects, springs).
    """

    stiffness_n_m: NonNegative = 0.0
    radius_a_m: Positive = 0.1
    radius_b_m: Positive = 0.1
    rest_length_m: NonNegative = 0.0
    phase_rad: float = 0.0
    cosine_nm: tuple[float, ...] = ()
    sine_nm: tuple[float, ...] = ()


class JointPlant(_Part):
    """Drive, friction and spring of one joint; torques on the joint side, inertia on the motor side."""

    name: str
    gear_ratio: Annotated[float, Field(gt=0.0)] = 1.0
    torque_constant_nm_a: Positive = 1.0
    rotor_inertia_kg_m2: NonNegative = 0.0
    rotor_link: str | None = None
    rotor_axis: Vector3 | None = None
    coulomb_nm: NonNegative = 0.0
    viscous_nm_s: NonNegative = 0.0
    offset_nm: float = 0.0
    spring: GravitySpring | None = None


class PlateSpec(_Part):
    """Where the plate is in the base frame, its unknown offsets and its own clock."""

    xyz_m: Vector3 = ZERO3
    rpy_rad: Vector3 = ZERO3
    offsets: Vector6 = ZERO6
    clock_ppm: float = 40.0
    clock_phase_s: float = 1.04e-3


class NoiseSpec(_Part):
    """Noise of every channel per sample: std, colour (AR(1) coefficient) and correlation."""

    joint_torque_nm: tuple[NonNegative, ...] = ()
    wrench: Vector6 = (10.54, 10.88, 4.81, 11.61, 11.33, 3.15)  # Verdonck 2001, N and N.m
    joint_ar1: Colour = 0.0
    wrench_ar1: Colour = 0.0
    wrench_correlation: Correlation = 0.0
    joint_correlation: Correlation = 0.0
    encoder_rad: NonNegative = 3e-5
    encoder_resolution_rad: NonNegative = 0.0
    current_resolution_a: NonNegative = 0.0
    wrench_resolution: NonNegative = 0.0


class SamplingSpec(_Part):
    """How the streams are sampled and how they reach the host."""

    rate_hz: Positive = 150.0
    interval_jitter_s: NonNegative = 1.5e-5
    stamp_error_s: NonNegative = 0.0
    loss_rate: Annotated[float, Field(ge=0.0, lt=0.5)] = 5e-4
    latency_s: NonNegative = 2e-3
    latency_jitter_s: NonNegative = 2e-4


class ServoSpec(_Part):
    """The position loop: how the joint lags its setpoint and how a stopped joint keeps its stiction."""

    tick_s: Annotated[float, Field(gt=0.0, le=0.005)] = 2e-3
    bandwidth_hz: Positive = 3.0
    acceleration_lag_s2: NonNegative = 2.5e-4
    stiffness_nm_rad: Positive = 3e5
    stick_speed_rad_s: Positive = 2e-4
    hold_relaxation_s: Positive = 0.5


class PlantSpec(_Part):
    """Everything the virtual robot is: geometry (URDF text), true parameters, sensors."""

    name: str
    urdf_text: str
    gravity_m_s2: Vector3 = (0.0, 0.0, -9.81)
    joints: Annotated[tuple[JointPlant, ...], Field(min_length=1)]
    links: tuple[LinkInertial, ...] = ()
    coupling: tuple[tuple[float, ...], ...] | None = None
    plate: PlateSpec | None = PlateSpec()
    noise: NoiseSpec = NoiseSpec()
    sampling: SamplingSpec = SamplingSpec()
    servo: ServoSpec = ServoSpec()

    @model_validator(mode="after")
    def _consistent(self) -> PlantSpec:
        count = len(self.joints)
        if self.noise.joint_torque_nm and len(self.noise.joint_torque_nm) != count:
            raise ValueError(f"noise.joint_torque_nm needs {count} values, one a joint")
        if self.coupling is not None and any(len(row) != count for row in (*self.coupling, self.coupling)):
            raise ValueError(f"coupling must be {count} x {count}: motor speed per joint speed")
        return self

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of every (n, k) array."""
        return tuple(joint.name for joint in self.joints)

    def quiet(self) -> PlantSpec:
        """Return the same plant with perfect sensors: no noise, quantisation, jitter or loss."""
        noise = NoiseSpec(joint_torque_nm=(0.0,) * len(self.joints), wrench=ZERO6, encoder_rad=0.0)
        sampling = self.sampling.model_copy(
            update={"interval_jitter_s": 0.0, "stamp_error_s": 0.0, "loss_rate": 0.0, "latency_jitter_s": 0.0}
        )
        return self.model_copy(update={"noise": noise, "sampling": sampling})


def preset_names() -> tuple[str, ...]:
    """Names of the virtual plants that come with the product."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.toml")))


def load_plant(name_or_path: str | Path) -> PlantSpec:
    """Read a plant preset or file; its `urdf` names a file beside it.

    Raises:
        PlantError: The file is missing, not TOML, or says something a plant cannot be.
    """
    path = PRESETS / f"{name_or_path}.toml" if str(name_or_path) in preset_names() else Path(name_or_path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        urdf_text = (path.parent / str(table.pop("urdf"))).read_text(encoding="utf-8")
        return PlantSpec(urdf_text=urdf_text, **table)
    except KeyError:
        raise PlantError(f'The plant file {path} names no urdf: add the line urdf = "robot.urdf".') from None
    except (OSError, tomllib.TOMLDecodeError) as error:
        known = ", ".join(preset_names())
        raise PlantError(
            f"Cannot read the plant {name_or_path}: {error}; known presets are {known}."
        ) from None
    except ValidationError as error:
        raise PlantError(f"The plant file {path} is not valid: {_first_fault(error)}") from None


def _first_fault(error: ValidationError) -> str:
    fault: Any = error.errors()[0]
    place = ".".join(str(part) for part in fault["loc"]) or "file"
    return f"{place}: {fault['msg']}."
