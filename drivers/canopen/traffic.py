"""Everything that arrives on the bus, sorted to whom it concerns; heartbeats kept going meanwhile."""

from __future__ import annotations

from drivers.canopen.assembler import CycleAssembler
from drivers.canopen.config import BusConfig
from drivers.canopen.emergency import decode_emergency
from drivers.canopen.frame import (
    EMERGENCY,
    ERROR_BUS_OFF,
    HEARTBEAT,
    NMT,
    SDO_ANSWER,
    SYNC,
    Frame,
    error_text,
)
from drivers.canopen.heartbeat import BOOT_UP, OPERATIONAL, HeartbeatProducer, HeartbeatWatch
from drivers.canopen.ledger import Ledger
from drivers.canopen.link import Link
from drivers.canopen.network import LinkNetwork
from drivers.canopen.report import CauseKind
from drivers.errors import BusOffError

START, STOP, PRE_OPERATIONAL, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x82
_ALIVE = bytes([OPERATIONAL])


class Traffic:
    """The host's side of the bus below the cycle: one thread, no foreign callbacks, nothing swallowed."""

    def __init__(self, link: Link, config: BusConfig, ledger: Ledger) -> None:
        nodes = [axis.node for axis in config.axes]
        self.link = link
        self.ledger = ledger
        self.assembler = CycleAssembler(nodes)
        self.network = LinkNetwork(link, self.dispatch)
        self.heartbeats = HeartbeatWatch(nodes, config.heartbeat_lost_ms * 1_000_000)
        self.echo_ns: int | None = None
        self.bus_off = False
        self._axis_of = {axis.node: axis.name for axis in config.axes}
        self._pdos = self.assembler.identifiers
        self._producer = HeartbeatProducer(config.heartbeat_ms * 1_000_000)
        self._beat_identifier = HEARTBEAT + config.host_node

    def command(self, command: int) -> None:
        """Send an NMT command to every configured drive, and to no other node."""
        for node in self._axis_of:
            self.link.send(NMT, bytes([command, node]))

    def beat(self) -> None:
        """Send our heartbeat when it is due."""
        if self._producer.due(self.link.now_ns()):
            self.link.send(self._beat_identifier, _ALIVE)

    def run_until(self, deadline_ns: int) -> None:
        """Take what arrives until `deadline_ns`, beating meanwhile.

        Raises:
            LinkError: the adapter failed.
            BusOffError: the controller is off the bus.
        """
        receive, dispatch = self.link.receive, self.dispatch
        while True:
            self.beat()
            slice_ns = min(deadline_ns, self._producer.next_ns)
            while (frame := receive(slice_ns)) is not None:
                dispatch(frame)
            if slice_ns >= deadline_ns:
                return

    def wait_echo(self, deadline_ns: int) -> int | None:
        """The instant at which our own SYNC was on the bus [ns]; None when it did not appear in time."""
        while self.echo_ns is None:
            frame = self.link.receive(deadline_ns)
            if frame is None:
                return None
            self.dispatch(frame)
        return self.echo_ns

    def dispatch(self, frame: Frame) -> None:
        """Sort one frame."""
        identifier = frame.identifier
        if frame.error:
            self._error_frame(frame)
        elif identifier in self._pdos:
            self.assembler.add(frame)
        elif identifier == SYNC:
            self._sync(frame)
        elif EMERGENCY < identifier < EMERGENCY + 0x80:
            self._emergency(frame)
        elif SDO_ANSWER < identifier < SDO_ANSWER + 0x80:
            self.network.notify(identifier, bytearray(frame.data), frame.stamp_ns * 1e-9)
        elif HEARTBEAT < identifier < HEARTBEAT + 0x80:
            self._heartbeat(frame)

    def check_heartbeats(self) -> None:
        """Trip for every drive whose heartbeat is overdue."""
        now_ns = self.link.now_ns()
        for node in self.heartbeats.overdue(now_ns):
            axis = self._axis_of[node]
            text = f"The drive of {axis} (node {node}) has no heartbeat any more: off, reset or unplugged."
            self.ledger.trip(CauseKind.HEARTBEAT, text, now_ns, axis)

    def _sync(self, frame: Frame) -> None:
        if frame.own:
            self.echo_ns = frame.stamp_ns
            return
        text = "Another device on the bus produces SYNC too; there must be one producer only."
        self.ledger.trip(CauseKind.FOREIGN_SYNC, text, frame.stamp_ns)

    def _heartbeat(self, frame: Frame) -> None:
        node = frame.identifier - HEARTBEAT
        self.heartbeats.heard(node, frame.data, frame.stamp_ns)
        if node in self._axis_of and frame.data[:1] == bytes([BOOT_UP]):
            axis = self._axis_of[node]
            text = f"The drive of {axis} (node {node}) restarted by itself; check its supply."
            self.ledger.trip(CauseKind.RESTARTED, text, frame.stamp_ns, axis)

    def _emergency(self, frame: Frame) -> None:
        node = frame.identifier - EMERGENCY
        emergency = decode_emergency(node, frame.data, frame.stamp_ns)
        self.ledger.emergencies.append(emergency)
        if not emergency.clears and node in self._axis_of:
            axis = self._axis_of[node]
            what = f"{emergency.code:04X}h, {emergency.text}"
            text = f"The drive of {axis} (node {node}) sent emergency {what}."
            self.ledger.trip(CauseKind.EMERGENCY, text, frame.stamp_ns, axis)

    def _error_frame(self, frame: Frame) -> None:
        text = error_text(frame.identifier)
        self.ledger.error_frames[text] = self.ledger.error_frames.get(text, 0) + 1
        if not frame.identifier & ERROR_BUS_OFF:
            return  # the controller retries by itself; what is lost shows as missing
        self.bus_off = True
        error = BusOffError(f"error frame with {text}")
        self.ledger.trip(CauseKind.BUS_OFF, str(error), frame.stamp_ns)
        raise error
