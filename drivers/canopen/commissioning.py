"""Bring one drive from pre-operational to ready for cyclic operation, every write read back."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.canopen import objects as od
from drivers.canopen.node import DriveNode
from drivers.canopen.objects import Entry, PdoMap
from drivers.canopen.profile import DriveProfile, interpolation_time
from drivers.canopen.units import DriveScaling
from drivers.errors import HardwareError, IdentityError, ModeRefusedError

_INVALID = 1 << 31  # bit of a PDO's identifier entry: the PDO does not exist
_EVERY_SYNC = 1  # transmission type
_QUICK_STOP_THEN_OFF = 2  # 605Ah: slow down on the quick stop ramp, then switch on disabled
_ABORT_BY_QUICK_STOP = 3  # 6007h: on loss of the host, quick stop
_OWN_RPDOS, _OWN_TPDOS = 1, 2  # PDOs used; the others up to four are switched off
_PDO_COUNT = 4


@dataclass(frozen=True)
class Identity:
    """Who a drive says it is (1018h, 1008h)."""

    vendor: int
    product: int
    revision: int
    serial: int
    device_name: str


def check_identity(node: DriveNode, profile: DriveProfile) -> Identity:
    """Read 1018h and compare it with the profile and, where given, the configured serial number.

    Raises:
        IdentityError: another device answers.
    """
    identity = Identity(
        vendor=node.read(od.VENDOR),
        product=node.read(od.PRODUCT),
        revision=node.read_or(od.REVISION, 0) or 0,
        serial=node.read_or(od.SERIAL, 0) or 0,
        device_name=node.read_text(0x1008),
    )
    wanted = {"vendor": profile.vendor, "product": profile.product, "serial": node.axis.serial}
    for what, expected in wanted.items():
        found = getattr(identity, what)
        if expected is not None and found != expected:
            raise IdentityError(
                f"The {node.where} says {what} {found:#x} where {expected:#x} is configured; "
                "two drives may be swapped, or the profile is for another make."
            )
    return identity


def read_scaling(node: DriveNode) -> DriveScaling:
    """The drive's own scaling objects; what it lacks is taken as one to one.

    Raises:
        HardwareError: the rated current or the encoder resolution is zero, so nothing can be converted.
    """
    feed = node.read_or(od.FEED, None)
    scaling = DriveScaling(
        rated_current_ma=node.read(od.RATED_CURRENT),
        rated_torque_mnm=node.read_or(od.RATED_TORQUE, 0) or 0,
        encoder_counts=node.read(od.ENCODER_INCREMENTS),
        encoder_revolutions=node.read_or(od.ENCODER_REVOLUTIONS, 1) or 1,
        gear_motor=node.read_or(od.GEAR_MOTOR, 1) or 1,
        gear_shaft=node.read_or(od.GEAR_SHAFT, 1) or 1,
        polarity=node.read_or(od.POLARITY, 0) or 0,
        feed=feed,
        feed_shaft=node.read_or(od.FEED_SHAFT, 1) if feed is not None else None,
    )
    if scaling.rated_current_ma == 0 or scaling.encoder_counts == 0:
        raise HardwareError(
            f"The {node.where} has no rated current (6075h) or no encoder resolution (608Fh); "
            "its motor data must be commissioned before its counts mean anything."
        )
    return scaling


def configure_pdos(node: DriveNode, mode: int) -> None:
    """Map RPDO1, TPDO1 and TPDO2 for every SYNC and switch the drive's other PDOs off."""
    for pdo in (od.receive_map(mode), od.STATUS_MAP, od.MOTION_MAP):
        configure_pdo(node, pdo)
    for first, used in ((0x1400, _OWN_RPDOS), (0x1800, _OWN_TPDOS)):
        for index in range(first + used, first + _PDO_COUNT):
            _switch_off(node, index)


def configure_pdo(node: DriveNode, pdo: PdoMap) -> None:
    """Switch one PDO off, map it, and switch it on again, as CiA 301 orders it."""
    identifier = pdo.identifier + node.axis.node
    cob = Entry(pdo.parameter_index, 1, "I", f"{pdo.name} identifier")
    count = Entry(pdo.mapping_index, 0, "B", f"{pdo.name} number of entries")
    node.put(cob, identifier | _INVALID)
    node.write(Entry(pdo.parameter_index, 2, "B", f"{pdo.name} transmission type"), _EVERY_SYNC)
    node.write(count, 0)
    for sub, entry in enumerate(pdo.entries, start=1):
        node.write(Entry(pdo.mapping_index, sub, "I", f"{pdo.name} entry {sub}"), entry.mapping)
    node.write(count, len(pdo.entries))
    node.write(cob, identifier)


def _switch_off(node: DriveNode, parameter_index: int) -> None:
    cob = Entry(parameter_index, 1, "I", "unused PDO identifier")
    value = node.read_or(cob, None)
    if value is not None and not value & _INVALID:
        node.put(cob, value | _INVALID)


def configure_timing(node: DriveNode, profile: DriveProfile, period_us: int) -> None:
    """Tell the drive the SYNC period where its profile says (1006h or 60C2h)."""
    if profile.period_object == "1006h":
        node.change(od.CYCLE_PERIOD, period_us)
    elif profile.period_object == "60C2h":
        value, exponent = interpolation_time(period_us) or (0, 0)
        node.change(od.INTERPOLATION_EXPONENT, exponent)
        node.change(od.INTERPOLATION_VALUE, value)


def configure_safety(node: DriveNode, host_node: int, heartbeat_ms: int, lost_ms: int) -> None:
    """Heartbeats both ways, and what the drive does when the host falls silent: quick stop."""
    node.change(od.QUICK_STOP_OPTION, _QUICK_STOP_THEN_OFF)
    node.change(od.ABORT_OPTION, _ABORT_BY_QUICK_STOP)
    node.change(od.HEARTBEAT_PRODUCER, heartbeat_ms)
    node.change(od.HEARTBEAT_CONSUMER, host_node << 16 | lost_ms)


def select_mode(node: DriveNode, profile: DriveProfile, timeout_s: float) -> int:
    """Ask for the profile's modes in order until 6061h shows one of them.

    Returns:
        The mode the drive is in.

    Raises:
        ModeRefusedError: none was taken.
    """
    shown = 0
    for mode in profile.modes:
        shown = _try_mode(node, mode, timeout_s)
        if shown == mode:
            return mode
    asked = " or ".join(str(mode) for mode in profile.modes)
    raise ModeRefusedError(
        f"The {node.where} was asked for mode {asked} but 6061h shows {shown}; "
        "choose a profile whose mode the drive supports (6502h lists them)."
    )


def _try_mode(node: DriveNode, mode: int, timeout_s: float) -> int:
    try:
        node.change(od.MODE, mode)
    except HardwareError:
        return node.read(od.MODE_DISPLAY)
    deadline_ns = node.now_ns() + round(timeout_s * 1e9)
    shown = node.read(od.MODE_DISPLAY)
    while shown != mode and node.now_ns() < deadline_ns:
        shown = node.read(od.MODE_DISPLAY)
    return shown
