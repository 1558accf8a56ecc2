"""Faults by name, to be injected into fake drives at chosen cycles or at random from a seed."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum


class FaultKind(Enum):
    """What can go wrong; the names are used in configuration and reports."""

    LOST_TPDO = "lost_tpdo"
    LOST_RPDO = "lost_rpdo"
    LOST_SYNC = "lost_sync"  # the node (or all nodes) does not see it
    VANISHED_SYNC = "vanished_sync"  # never on the wire, no echo (virtual time only)
    LATE_TPDO = "late_tpdo"
    DUPLICATE_TPDO = "duplicate_tpdo"
    WRONG_LENGTH = "wrong_length"
    EMERGENCY = "emergency"
    SHORT_EMERGENCY = "short_emergency"
    HEARTBEAT_LOSS = "heartbeat_loss"
    DRIVE_FAULT = "drive_fault"
    BLOCKED_AXIS = "blocked_axis"
    DEAF_DRIVE = "deaf_drive"  # ignores quick stop and voltage off from the host
    POWER_LOSS = "power_loss"
    RESTART = "restart"
    BUS_OFF = "bus_off"
    NODE_MISSING = "node_missing"
    WRONG_IDENTITY = "wrong_identity"
    REFUSED_MODE = "refused_mode"


AT_BOOT = frozenset({FaultKind.NODE_MISSING, FaultKind.WRONG_IDENTITY, FaultKind.REFUSED_MODE})


@dataclass(frozen=True)
class Fault:
    """One fault.

    Args:
        kind: what happens.
        node: to which node; None for all of them.
        at: first cycle, counted from where the plan is armed.
        count: for how many cycles.
        code: error code of emergencies and drive faults.
    """

    kind: FaultKind
    node: int | None = None
    at: int = 0
    count: int = 1
    code: int = 0x7305


@dataclass(frozen=True)
class Injected:
    """What was injected where."""

    kind: FaultKind
    node: int
    cycle: int


class FaultPlan:
    """The faults of one session.

    Cycles count from `arm`, which takes the number of the SYNC that is cycle 0; boot faults need no arming.

    Args:
        faults: those at fixed cycles.
        loss: probability that a TPDO is lost, and the same for an RPDO (0 to 1).
        seed: of the random losses.
    """

    def __init__(self, faults: Iterable[Fault] = (), loss: float = 0.0, seed: int = 0) -> None:
        self.faults = tuple(faults)
        self.loss = loss
        self.log: list[Injected] = []
        self._random = random.Random(seed)
        self._origin: int | None = None
        self._at: dict[int, list[Fault]] = {}
        for fault in self.faults:
            if fault.kind not in AT_BOOT:
                for cycle in range(fault.at, fault.at + fault.count):
                    self._at.setdefault(cycle, []).append(fault)

    def arm(self, origin_sync: int) -> None:
        """Let cycle 0 be the SYNC with this number."""
        self._origin = origin_sync

    def cycle(self, sync: int) -> int:
        """The cycle of a SYNC; negative while the plan is not armed."""
        return -1 if self._origin is None else sync - self._origin

    def due(self, cycle: int) -> list[Fault]:
        """Faults of one cycle."""
        return self._at.get(cycle, []) if cycle >= 0 else []

    def at_boot(self, kind: FaultKind, node: int) -> bool:
        """Whether a boot fault hits a node."""
        return any(fault.kind is kind and fault.node in (None, node) for fault in self.faults)

    def hits(self, kind: FaultKind, node: int, cycle: int) -> bool:
        """Whether a fault of this kind hits the node in this cycle; a hit is logged."""
        for fault in self.due(cycle):
            if fault.kind is kind and fault.node in (None, node):
                self.note(kind, node, cycle)
                return True
        return False

    def loses(self, kind: FaultKind, node: int, cycle: int) -> bool:
        """Whether chance takes this frame."""
        if cycle < 0 or self._random.random() >= self.loss:
            return False
        self.note(kind, node, cycle)
        return True

    def note(self, kind: FaultKind, node: int, cycle: int) -> None:
        """Enter an injection into the log."""
        self.log.append(Injected(kind, node, cycle))
