"""The drives and the plate that a robot file stands for: real ones, or the virtual robot's."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from daq.host_clock import HostClock
from daq.limits import Limits, limits_of
from daq.ports import Clock, Drives, Plate
from drivers.canopen.bus import DriveBus
from drivers.canopen.config import AxisConfig, BusConfig, CanConfig, Deadlines
from drivers.errors import ConfigError
from drivers.force_plate.mounting import Mounting
from drivers.force_plate.port import SerialPlate
from drivers.force_plate.protocols import protocol_named
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.effects.registry import effect_class
from drivers.virtual.from_robot import plant_from_robot_file
from drivers.virtual.plant_file import PlantSpec, PlateSpec, load_plant
from drivers.virtual.plant_file import preset_names as plant_names
from service.errors import HardwareMissingError, UsageError
from service.robots import LoadedRobot

DEFAULT_RATE_HZ = 150.0


@dataclass(frozen=True)
class Bench:
    """What a run moves and reads."""

    drives: Drives
    plate: Plate | None
    clock: Clock
    is_virtual: bool
    foresee: Callable[[np.ndarray], None] = lambda targets_rad: None
    """Tell a simulation the set points (n, k) to come."""
    close: Callable[[], None] = lambda: None
    """End what the bench itself started."""


def limits_for(loaded: LoadedRobot) -> Limits:
    """The limits of URDF and robot file, in the order of the chain."""
    joints = loaded.robot.joints
    keys = ("lower", "upper", "velocity", "acceleration")
    return limits_of(
        [joint.name for joint in joints],
        *([getattr(joint.limits, key) for joint in joints] for key in keys),
        following=loaded.file.limits.following_error,
        envelope=loaded.file.limits.envelope,
    )


def real_bench(loaded: LoadedRobot, rate_hz: float) -> Bench:
    """Drives and plate as the robot file connects them; the CAN adapter is opened, nothing is sent.

    Raises:
        HardwareMissingError: the robot file says nothing of its hardware.
        UsageError: it says too little.
        drivers.errors.DriverError: the adapter cannot be opened, or the drives cannot run at that rate.
    """
    config = bus_config(loaded, rate_hz)
    plate = real_plate(loaded)
    return Bench(DriveBus(config), plate, HostClock(), is_virtual=False)


def bus_config(loaded: LoadedRobot, rate_hz: float) -> BusConfig:
    """The bus that a robot file describes."""
    section = loaded.file.bus
    if section is None:
        raise HardwareMissingError(
            f"Robot {loaded.where} has no [bus] section, so its drives are unknown; describe the bus and "
            "give every joint its node, or add --virtual to record the virtual robot."
        )
    if loaded.file.coupling is not None:
        raise UsageError(
            f"Robot {loaded.where} has coupled transmissions: their joints cannot be commanded one by one "
            "yet; record with your own controller and import the log."
        )
    can = {"interface", "channel", "bitrate_hz", "own_echo", "kernel_sync", "options"}
    try:
        return BusConfig(
            can=CanConfig(**section.model_dump(include=can)),
            axes=tuple(_axis(loaded, joint.name) for joint in loaded.robot.joints),
            rate_hz=rate_hz,
            deadlines=Deadlines(**section.deadlines),
            **section.model_dump(exclude={*can, "rate_hz", "deadlines"}),
        )
    except ValueError as error:
        raise UsageError(f"Robot {loaded.where}: the bus cannot be used: {_first_line(error)}.") from error


def _axis(loaded: LoadedRobot, name: str) -> AxisConfig:
    joint = next(section for section in loaded.file.joint if section.name == name)
    if joint.node is None:
        raise UsageError(
            f"Robot {loaded.where}: joint '{name}' has no node; give it the node number of its drive."
        )
    if joint.gear_ratio < 0:
        raise UsageError(
            f"Robot {loaded.where}: joint '{name}' has a negative gear_ratio; on a bus make it positive and "
            "set direction = -1, which turns the current as well."
        )
    return AxisConfig(
        name=name, node=joint.node, gear_ratio=joint.gear_ratio, direction=-1 if joint.direction < 0 else 1,
        profile=joint.drive_profile, serial=joint.drive_serial,
    )


def _first_line(error: ValueError) -> str:
    found = getattr(error, "errors", None)
    return str(found()[0]["msg"]) if found else str(error)


def real_plate(loaded: LoadedRobot) -> Plate | None:
    """The plate that a robot file connects, None where there is none."""
    section = loaded.file.force_plate
    if section is None or section.connection is None:
        return None
    link = section.connection
    protocol = protocol_named(link.protocol, **link.settings)
    return SerialPlate(protocol, link.port, Mounting(link.rotation, link.is_action))


def plant_for(loaded: LoadedRobot) -> PlantSpec:
    """The virtual robot of a robot file: the built-in plant of that name, else the URDF's own inertials.

    Raises:
        UsageError: neither is there.
    """
    names = loaded.robot.joint_names
    if loaded.name in plant_names():
        plant = load_plant(loaded.name)
        if plant.joint_names == names:
            return _as_mounted(plant, loaded)
    try:
        return plant_from_robot_file(loaded.where)
    except ConfigError as error:
        raise UsageError(
            f"Robot {loaded.where} cannot be simulated: {error} A virtual robot needs inertials in its URDF."
        ) from error


def _as_mounted(plant: PlantSpec, loaded: LoadedRobot) -> PlantSpec:
    """The plant on the plate, and under the gravity, that the robot file states."""
    section = loaded.file.force_plate
    plate = None
    if section is not None:
        offsets = (plant.plate or PlateSpec()).model_dump(exclude={"xyz_m", "rpy_rad"})
        plate = PlateSpec(xyz_m=section.xyz, rpy_rad=section.rpy, **offsets)
    return plant.model_copy(update={"plate": plate, "gravity_m_s2": loaded.file.gravity})


def virtual_bench(
    loaded: LoadedRobot, rate_hz: float, seed: int, effects: Sequence[EffectSpec] = (),
    start_q: np.ndarray | None = None,
) -> Bench:
    """The virtual robot behind fake drives and a fake plate, in virtual time."""
    from drivers.virtual.bench import open_bench

    made = open_bench(plant_for(loaded), rate_hz, seed, effects, start_q)
    return Bench(made.drives, made.plate, made.clock, is_virtual=True, foresee=made.drives.foresee)


def parse_effect(text: str) -> EffectSpec:
    """Read ``name``, ``name:place`` or ``name:place=size``; without a size, the middle of its range.

    The place is a joint, a plate channel or a pair of channels, as the effect has it; ``name:place=a,key=b``
    sets further parameters by name.

    Raises:
        UsageError: not of that form.
        drivers.errors.ConfigError: no such effect.
    """
    head, _, sizes = text.partition("=")
    name, _, place = head.partition(":")
    kind = effect_class(name.strip())
    parameters: dict[str, float] = {}
    for index, part in enumerate(part for part in sizes.split(",") if part.strip()):
        key, is_named, value = part.partition("=")
        if not is_named:
            key, value = kind.size, part
        if index and not is_named:
            raise UsageError(f"The effect '{text}' gives two sizes; name the second one, as in =1,key=2.")
        try:
            parameters[key.strip()] = float(value)
        except ValueError as error:
            raise UsageError(f"The effect '{text}' has the size '{value}', which is no number.") from error
    spot = place.strip() or None
    where = {"joint": {"joint": spot}, "none": {}}.get(kind.place, {"channel": spot})
    if kind.place == "none" and spot:
        raise UsageError(f"The effect '{name}' acts on the whole robot; leave its place '{spot}' out.")
    return EffectSpec(name.strip(), parameters=parameters, **where)


def software_version() -> str:
    """Version of this program, for the log."""
    return importlib.metadata.version("residuum")
