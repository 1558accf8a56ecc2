"""The message types of a log: their ros2msg texts, and those texts as flat lists of fields."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

JOINT_STATE = "sensor_msgs/msg/JointState"
MOTOR_CURRENTS = "residuum_msgs/msg/MotorCurrents"
WRENCH = "geometry_msgs/msg/WrenchStamped"
DRIVE_RAW = "residuum_msgs/msg/DriveRaw"
FORCE_PLATE_RAW = "residuum_msgs/msg/ForcePlateRaw"
CLOCK_SYNC = "residuum_msgs/msg/ClockSync"
EVENT = "residuum_msgs/msg/Event"

JOINT_STATES_TOPIC = "/joint_states"
CURRENTS_TOPIC = "/motor_currents"
WRENCH_TOPIC = "/force_plate/wrench"
SETPOINTS_TOPIC = "/joint_setpoints"
DRIVE_RAW_TOPIC = "/drive/raw"
FORCE_PLATE_RAW_TOPIC = "/force_plate/raw"
CLOCK_SYNC_TOPIC = "/clock_sync"
EVENTS_TOPIC = "/events"

TOPIC_SCHEMAS = {
    JOINT_STATES_TOPIC: JOINT_STATE,
    CURRENTS_TOPIC: MOTOR_CURRENTS,
    WRENCH_TOPIC: WRENCH,
    SETPOINTS_TOPIC: JOINT_STATE,
    DRIVE_RAW_TOPIC: DRIVE_RAW,
    FORCE_PLATE_RAW_TOPIC: FORCE_PLATE_RAW,
    CLOCK_SYNC_TOPIC: CLOCK_SYNC,
    EVENTS_TOPIC: EVENT,
}

_NESTED = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
}

_BODIES = {
    JOINT_STATE: "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort",
    MOTOR_CURRENTS: "std_msgs/Header header\nstring[] name\nfloat64[] current",
    WRENCH: "std_msgs/Header header\ngeometry_msgs/Wrench wrench",
    # Raw streams keep what the wire carried: counts before scaling, and every clock that saw the sample.
    DRIVE_RAW: "std_msgs/Header header\nstring[] name\nuint64 device_stamp\nint64 host_receive_ns\n"
    "uint32 cycle\nint32[] position\nint32[] velocity\nint32[] current\nuint32[] status_word\n"
    "int32[] demand\nint32[] target\nuint32[] flags\nint64[] receive_ns",
    FORCE_PLATE_RAW: "std_msgs/Header header\nuint64 device_stamp\nint64 host_receive_ns\nuint32 counter\n"
    "uint32 status_word\nint32[] counts\nfloat32[] values\nfloat32 temperature\nuint32 segment\nuint32 lost\n"
    "float64[] wrench",
    CLOCK_SYNC: "std_msgs/Header header\nstring device\nuint64 device_stamp\nint64 host_receive_ns\n"
    "int64 mapped_ns\nfloat64 uncertainty_s",
    EVENT: "std_msgs/Header header\nstring name\nstring severity\nuint32 cycle\nstring text",
}


@dataclass(frozen=True)
class Field:
    """One primitive of a message: dotted name, primitive type, and whether it is a sequence."""

    name: str
    kind: str
    sequence: bool


def _nested_types(body: str) -> list[str]:
    """The types a body refers to, each once, in order of first use."""
    found: list[str] = []
    for line in body.splitlines():
        kind = line.split()[0]
        if kind in _NESTED:
            found += [kind, *_nested_types(_NESTED[kind])]
    return list(dict.fromkeys(found))


@cache
def definition(schema: str) -> str:
    """The full ros2msg text of a type, nested types appended as the MCAP registry asks."""
    body = _BODIES[schema]
    rule = "=" * 80
    return "\n".join([body, *(f"{rule}\nMSG: {kind}\n{_NESTED[kind]}" for kind in _nested_types(body))])


def _flatten(body: str, prefix: str) -> list[Field]:
    fields: list[Field] = []
    for line in body.splitlines():
        kind, name = line.split()
        if kind in _NESTED:
            fields += _flatten(_NESTED[kind], f"{prefix}{name}.")
        else:
            fields.append(Field(prefix + name, kind.removesuffix("[]"), kind.endswith("[]")))
    return fields


@cache
def fields(schema: str) -> tuple[Field, ...]:
    """The primitives of a known type in wire order.

    Raises:
        KeyError: the type is not one this project writes or reads.
    """
    return tuple(_flatten(_BODIES[schema], ""))


def canonical_schema(name: str) -> str:
    """The type's full name, for logs that spell ``sensor_msgs/JointState``."""
    parts = name.split("/")
    full = f"{parts[0]}/msg/{parts[-1]}" if len(parts) > 1 else name
    return full if full in _BODIES else name
