"""All fake drives of a bus, their plant and their faults; free of any clock or adapter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from drivers.canopen.fake.axis import InertiaAxis, InertiaPlant, Plant
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.drive import NEVER_NS, FakeDrive
from drivers.canopen.fake.faults import Fault, FaultKind, FaultPlan

_SYNC = 0x080
_FOREIGN_VENDOR = 0xBAD

Outgoing = tuple[int, int, bytes]  # ready time [ns], identifier, data


class Fleet:
    """Takes the host's frames and times, collects the drives' answers in `outbox`.

    Args:
        data: one nameplate for each drive.
        plant: what they move, axes in the same order; plain inertias by default.
        plan: faults to inject.
    """

    def __init__(
        self, data: Sequence[DriveData], plant: Plant | None = None, plan: FaultPlan | None = None
    ) -> None:
        self.plan = plan if plan is not None else FaultPlan()
        self.plant: Plant = plant if plant is not None else InertiaPlant([InertiaAxis() for _ in data])
        pairs = zip(data, self.plant.axes, strict=True)
        self.drives = [FakeDrive(self._nameplate(plate), axis) for plate, axis in pairs]
        self.outbox: list[Outgoing] = []
        self.next_timer_ns = NEVER_NS
        self.sync = -1
        self.bus_off = False
        self._present = {
            drive.node: drive
            for drive in self.drives
            if not self.plan.at_boot(FaultKind.NODE_MISSING, drive.node)
        }
        self._held: list[tuple[int, bytes]] = []  # TPDOs kept back until the next SYNC

    def drive(self, node: int) -> FakeDrive:
        """The drive with this node number."""
        return next(drive for drive in self.drives if drive.node == node)

    @property
    def stopped(self) -> bool:
        """Whether no drive follows set points or moves on its ramp."""
        return all(drive.at_rest for drive in self.drives)

    def power_on(self, now_ns: int) -> None:
        """Switch all drives on."""
        for drive in self._present.values():
            drive.power_on(now_ns)
        self._collect()

    def take(self, identifier: int, data: bytes, now_ns: int) -> None:
        """Take one frame of the host."""
        service, node = identifier & 0x780, identifier & 0x7F
        if identifier == _SYNC:
            self._take_sync(now_ns)
        elif identifier == 0:
            self._take_nmt(data, now_ns)
        elif service == 0x700:
            for drive in self._present.values():
                drive.on_host_heartbeat(node, now_ns)
        elif node in self._present:
            self._take_addressed(self._present[node], service, identifier, data, now_ns)
        self._collect()

    def tick(self, now_ns: int) -> None:
        """Let time limits act that are due."""
        self.plant.advance_to(now_ns)
        for drive in self._present.values():
            if drive.next_timer_ns <= now_ns:
                drive.on_timer(now_ns)
        self._collect()

    def _nameplate(self, plate: DriveData) -> DriveData:
        if self.plan.at_boot(FaultKind.WRONG_IDENTITY, plate.node):
            plate = replace(plate, vendor=_FOREIGN_VENDOR, serial=plate.serial + 1)
        if self.plan.at_boot(FaultKind.REFUSED_MODE, plate.node):
            plate = replace(plate, modes=(1,))
        return plate

    def _take_nmt(self, data: bytes, now_ns: int) -> None:
        self.plant.advance_to(now_ns)
        for node, drive in self._present.items():
            if len(data) == 2 and data[1] in (0, node):
                drive.on_nmt(data[0], now_ns)

    def _take_addressed(
        self, drive: FakeDrive, service: int, identifier: int, data: bytes, now_ns: int
    ) -> None:
        if service == 0x600:
            drive.on_sdo(data, now_ns)
            return
        cycle = self.plan.cycle(self.sync)
        if self.plan.hits(FaultKind.LOST_RPDO, drive.node, cycle):
            return
        if self.plan.loss and self.plan.loses(FaultKind.LOST_RPDO, drive.node, cycle):
            return
        drive.on_rpdo(identifier, data, now_ns)

    def _take_sync(self, now_ns: int) -> None:
        self.sync += 1
        plan, cycle = self.plan, self.plan.cycle(self.sync)
        self.plant.advance_to(now_ns)
        held, self._held = self._held, []
        self.outbox += [(now_ns, identifier, data) for identifier, data in held]
        due = plan.due(cycle)
        for fault in due:
            self._strike(fault, cycle, now_ns)
        for drive in tuple(self._present.values()):
            if due and plan.hits(FaultKind.LOST_SYNC, drive.node, cycle):
                continue
            if drive.outbox:
                self._collect_from(drive)
            drive.on_sync(now_ns)
            if due or plan.loss:
                drive.outbox = self._spoil(drive, cycle)
            self._collect_from(drive)

    def _strike(self, fault: Fault, cycle: int, now_ns: int) -> None:
        """Faults that befall a whole drive, or the bus."""
        if fault.kind is FaultKind.BUS_OFF:
            self.bus_off = True
            self.plan.note(fault.kind, 0, cycle)
        actions = {
            FaultKind.EMERGENCY: lambda drive: drive.emergency(fault.code, now_ns),
            FaultKind.SHORT_EMERGENCY: lambda drive: drive.emergency(fault.code, now_ns, 3),
            FaultKind.HEARTBEAT_LOSS: lambda drive: setattr(drive, "muted", True),
            FaultKind.DRIVE_FAULT: lambda drive: drive.trip(fault.code, now_ns),
            FaultKind.BLOCKED_AXIS: lambda drive: setattr(drive, "blocked", True),
            FaultKind.DEAF_DRIVE: lambda drive: setattr(drive.section, "deaf_to_quick_stop", True),
            FaultKind.POWER_LOSS: lambda drive: self._present.pop(drive.node),
            FaultKind.RESTART: lambda drive: drive.on_nmt(0x81, now_ns),
        }
        action = actions.get(fault.kind)
        if action is None:
            return
        for drive in tuple(self._present.values()):
            if fault.node in (None, drive.node):
                action(drive)
                self.plan.note(fault.kind, drive.node, cycle)

    def _spoil(self, drive: FakeDrive, cycle: int) -> list[Outgoing]:
        """Lose, delay, double or cut the PDOs that a drive just made."""
        plan, kept = self.plan, []
        lost, late, double, cut = (
            plan.hits(kind, drive.node, cycle)
            for kind in (
                FaultKind.LOST_TPDO,
                FaultKind.LATE_TPDO,
                FaultKind.DUPLICATE_TPDO,
                FaultKind.WRONG_LENGTH,
            )
        )
        for ready_ns, identifier, data in drive.outbox:
            if not 0x180 <= identifier < 0x580:
                kept.append((ready_ns, identifier, data))
            elif lost or (plan.loss and plan.loses(FaultKind.LOST_TPDO, drive.node, cycle)):
                continue
            elif late:
                self._held.append((identifier, data))
            else:
                kept.append((ready_ns, identifier, data[:6] if cut else data))
                if double:
                    kept.append((ready_ns, identifier, data))
        return kept

    def _collect(self) -> None:
        next_ns = NEVER_NS
        for drive in self._present.values():
            if drive.outbox:
                self._collect_from(drive)
            if drive.next_timer_ns < next_ns:
                next_ns = drive.next_timer_ns
        self.next_timer_ns = next_ns

    def _collect_from(self, drive: FakeDrive) -> None:
        self.outbox += drive.outbox
        drive.outbox = []
