"""Bring every drive of a bus up: present, identified, configured, operational."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.canopen import objects as od
from drivers.canopen.commissioning import (
    Identity,
    check_identity,
    configure_pdos,
    configure_safety,
    configure_timing,
    read_scaling,
    select_mode,
)
from drivers.canopen.config import AxisConfig, BusConfig
from drivers.canopen.heartbeat import OPERATIONAL
from drivers.canopen.network import PumpedSdoClient
from drivers.canopen.node import DriveNode
from drivers.canopen.profile import DriveProfile
from drivers.canopen.traffic import RESET_COMMUNICATION, START, Traffic
from drivers.canopen.units import AxisUnits, DriveScaling, axis_units
from drivers.errors import NodeMissingError

_LOOK_NS = 5_000_000  # how often a wait looks whether it is over [ns]


@dataclass(frozen=True)
class BootedAxis:
    """One drive as found and configured.

    Args:
        position: 6064h at boot [counts].
    """

    name: str
    node: int
    identity: Identity
    scaling: DriveScaling
    units: AxisUnits
    mode: int
    position: int


@dataclass(frozen=True)
class BootReport:
    """What the whole bus answered at boot; goes into the log.

    Args:
        period_ns: SYNC period [ns], the same on every drive.
    """

    axes: tuple[BootedAxis, ...]
    period_ns: int

    @property
    def rate_hz(self) -> float:
        """SYNC rate [Hz] as commanded; the true one comes from the stamps."""
        return 1e9 / self.period_ns


def find_nodes(traffic: Traffic, timeout_s: float) -> None:
    """Reset the communication of every configured drive and wait until each one reports.

    Raises:
        NodeMissingError: some did not.
    """
    traffic.heartbeats.forget()
    traffic.command(RESET_COMMUNICATION)
    _wait(traffic, timeout_s, None)


def start_nodes(traffic: Traffic, timeout_s: float) -> None:
    """Make every drive operational and wait until its heartbeat says so.

    Raises:
        NodeMissingError: some did not get there.
    """
    traffic.command(START)
    _wait(traffic, timeout_s, OPERATIONAL)


def _wait(traffic: Traffic, timeout_s: float, wanted: int | None) -> None:
    states = traffic.heartbeats.state
    deadline_ns = traffic.link.now_ns() + round(timeout_s * 1e9)

    def absent() -> list[int]:
        return [node for node, state in states.items() if state is None or wanted not in (None, state)]

    while absent() and traffic.link.now_ns() < deadline_ns:
        traffic.run_until(min(deadline_ns, traffic.link.now_ns() + _LOOK_NS))
    if absent():
        raise NodeMissingError(tuple(absent()), timeout_s)


def open_node(traffic: Traffic, axis: AxisConfig, timeout_s: float) -> DriveNode:
    """The SDO access of one axis."""
    return DriveNode(axis, PumpedSdoClient(traffic.network, axis.node, timeout_s, traffic.beat))


def configure_axis(node: DriveNode, profile: DriveProfile, config: BusConfig, period_us: int) -> BootedAxis:
    """Identify and configure one drive, every write read back."""
    identity = check_identity(node, profile)
    scaling = read_scaling(node)
    mode = select_mode(node, profile, config.deadlines.mode_s)
    configure_pdos(node, mode)
    configure_timing(node, profile, period_us)
    configure_safety(node, config.host_node, config.heartbeat_ms, config.heartbeat_lost_ms)
    axis = node.axis
    units = axis_units(
        scaling, axis.gear_ratio, axis.direction, profile.velocity_in_rpm, profile.current_follows_polarity
    )
    return BootedAxis(axis.name, axis.node, identity, scaling, units, mode, node.read(od.POSITION))
