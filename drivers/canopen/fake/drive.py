"""A fake CiA 402 drive: a device that answers frames, keeps time limits, and moves an axis."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from drivers.canopen.fake import power
from drivers.canopen.fake.axis import Axis
from drivers.canopen.fake.contents import DriveData, build_dictionary
from drivers.canopen.fake.dictionary import Abort, key
from drivers.canopen.fake.power import PowerSection
from drivers.canopen.fake.ramp import StopRamp
from drivers.canopen.fake.sdo_server import SdoServer

NEVER_NS = 1 << 62

_BOOT, _STOPPED, _OPERATIONAL, _PRE_OPERATIONAL = 0, 4, 5, 127
_CONTROL, _STATUS, _MODE_SHOWN = key(0x6040), key(0x6041), key(0x6061)
_DEMAND, _POSITION, _VELOCITY = key(0x6062), key(0x6064), key(0x606C)
_CURRENT, _TARGET, _POINT, _ERROR = key(0x6078), key(0x607A), key(0x60C1, 1), key(0x603F)
_WINDOW, _ABORT_OPTION, _PRODUCER, _CONSUMER = key(0x6065), key(0x6007), key(0x1017), key(0x1016, 1)

_REMOTE, _FOLLOWS, _FOLLOWING_ERROR = 1 << 9, 1 << 12, 1 << 13
_TICK_NS = 1_000_000  # how often the quick stop ramp moves the set point [ns]
_SDO_LATENCY_NS = 300_000
_HEARTBEAT_LOST, _LENGTH_ERROR, _FOLLOWING_CODE = 0x8130, 0x8210, 0x8611


@dataclass(frozen=True)
class _Pdo:
    identifier: int
    layout: struct.Struct
    keys: tuple[int, ...]


class FakeDrive:
    """One drive. Frames and times go in, `outbox` collects (ready time [ns], identifier, data).

    Args:
        data: its nameplate and behaviour.
        axis: what it moves.
    """

    def __init__(self, data: DriveData, axis: Axis) -> None:
        self.data = data
        self.axis = axis
        self.node = data.node
        self.outbox: list[tuple[int, int, bytes]] = []
        self.next_timer_ns = NEVER_NS
        self.muted = False  # sends no heartbeat
        self.blocked = False  # the axis does not move
        self.section = PowerSection()
        self.dictionary = build_dictionary(data)
        self._server = SdoServer(self.dictionary)
        self._values = self.dictionary.values
        self._rad_per_count = data.rad_per_count
        self._nmt = _BOOT
        self._tpdos: list[_Pdo] = []
        self._rpdos: dict[int, _Pdo] = {}
        self._pending: dict[int, bytes] = {}
        self._beat_ns = self._host_limit_ns = self._tick_ns = NEVER_NS
        self._ramp: StopRamp | None = None
        self._following_error = False
        self._previous_demand = 0
        self.dictionary.on_write.update({key(0x6060): self._take_mode, _CONTROL: self._take_word})
        self.dictionary.before_read = self._refresh

    @property
    def enabled(self) -> bool:
        """Whether the power stage is in 'operation enabled'."""
        return self.section.bits == power.ENABLED

    @property
    def at_rest(self) -> bool:
        """Whether it neither follows set points nor is still on its stop ramp."""
        return not self.enabled and self._ramp is None

    def power_on(self, now_ns: int) -> None:
        """Boot: one boot-up message, then pre-operational with default communication objects."""
        self.dictionary.reset_communication()
        self._host_limit_ns = NEVER_NS
        self._pending.clear()
        self._emit(now_ns, 0x700 + self.node, bytes([_BOOT]))
        self._nmt = _PRE_OPERATIONAL
        self._beat_ns = NEVER_NS
        self._plan_timer()

    def on_nmt(self, command: int, now_ns: int) -> None:
        """Take an NMT command."""
        if command in (0x81, 0x82):
            self._lose_host(now_ns)
            self.power_on(now_ns)
            return
        state = {0x01: _OPERATIONAL, 0x02: _STOPPED, 0x80: _PRE_OPERATIONAL}.get(command)
        if state is None or state == self._nmt:
            return
        if self._nmt == _OPERATIONAL:
            self._lose_host(now_ns)
        self._nmt = state
        if state == _OPERATIONAL:
            self._compile()
        self._beat(now_ns)

    def on_sdo(self, request: bytes, now_ns: int) -> None:
        """Answer an SDO request unless stopped."""
        if self._nmt in (_OPERATIONAL, _PRE_OPERATIONAL):
            answer = self._server.answer(request)
            if answer is not None:
                self._emit(now_ns + _SDO_LATENCY_NS, 0x580 + self.node, answer)
            self._plan_beat(now_ns)

    def on_host_heartbeat(self, node: int, now_ns: int) -> None:
        """Note the host's heartbeat; the first one starts the watch (CiA 301)."""
        setting = self._values[_CONSUMER]
        if setting >> 16 == node and setting & 0xFFFF:
            self._host_limit_ns = now_ns + (setting & 0xFFFF) * 1_000_000
            self._plan_timer()

    def on_rpdo(self, identifier: int, data: bytes, now_ns: int) -> None:
        """Keep a set point until the next SYNC; one of another length is reported and not used."""
        pdo = self._rpdos.get(identifier)
        if pdo is None or self._nmt != _OPERATIONAL:
            return
        if len(data) != pdo.layout.size:
            self.emergency(_LENGTH_ERROR, now_ns)
            return
        self._pending[identifier] = data

    def on_sync(self, now_ns: int) -> None:
        """Apply what was received, sample, and send the mapped values."""
        if self._nmt != _OPERATIONAL:
            return
        values = self._values
        self._previous_demand = values[_DEMAND]
        if self._pending:
            for identifier, data in self._pending.items():
                pdo = self._rpdos[identifier]
                values.update(zip(pdo.keys, pdo.layout.unpack(data), strict=True))
            self._pending.clear()
            if self.section.take(values[_CONTROL]):
                self._state_changed(now_ns)
            if self.enabled and self._ramp is None:
                self._follow()
        self._refresh()
        if self.enabled:
            self._watch_following(now_ns)
        ready_ns = now_ns + self.data.latency_ns
        for pdo in self._tpdos:
            payload = pdo.layout.pack(*[values[address] for address in pdo.keys])
            self.outbox.append((ready_ns, pdo.identifier, payload))

    def on_timer(self, now_ns: int) -> None:
        """Do what is due: heartbeat, the host's deadline, the stop ramp."""
        if now_ns >= self._beat_ns:
            self._beat(now_ns)
        if now_ns >= self._host_limit_ns:
            self._host_limit_ns = NEVER_NS
            self.emergency(_HEARTBEAT_LOST, now_ns)
            self._lose_host(now_ns)
        if now_ns >= self._tick_ns:
            self._tick(now_ns)
        self._plan_timer()

    def trip(self, code: int, now_ns: int) -> None:
        """Fall into fault with an error code: report it and stop the axis on the ramp."""
        self.emergency(code, now_ns)
        if self.enabled:
            self._start_ramp(now_ns)
        self.section.bits = power.FAULT

    def emergency(self, code: int, now_ns: int, length: int = 8) -> None:
        """Send an emergency message; a short one leaves out its last bytes."""
        self._values[_ERROR] = code
        self._emit(now_ns, 0x080 + self.node, (struct.pack("<HB", code, 1) + bytes(5))[:length])

    def _emit(self, ready_ns: int, identifier: int, data: bytes) -> None:
        self.outbox.append((ready_ns, identifier, data))

    def _follow(self) -> None:
        values = self._values
        source = _POINT if values[_MODE_SHOWN] == 7 else _TARGET
        values[_DEMAND] = values[source]
        if not self.blocked:
            self.axis.set_target(values[_DEMAND] * self._rad_per_count)

    def _state_changed(self, now_ns: int) -> None:
        bits = self.section.bits
        if bits == power.QUICK_STOP:
            self._start_ramp(now_ns)
        elif bits == power.ENABLED:
            self._following_error = False

    def _refresh(self) -> None:
        values = self._values
        position_rad, current_a, velocity_rad_s = self.axis.sample()
        values[_POSITION] = round(position_rad / self._rad_per_count)
        values[_VELOCITY] = round(velocity_rad_s / self._rad_per_count)
        per_mille = current_a * 1e6 / self.data.rated_current_ma
        values[_CURRENT] = max(-32768, min(32767, round(per_mille)))
        if not self.enabled and self._ramp is None:
            values[_DEMAND] = values[_POSITION]
        values[_STATUS] = self._status_word()

    def _status_word(self) -> int:
        word = self.section.bits | _REMOTE
        if self.enabled:
            word |= _FOLLOWS
        if self._following_error:
            word |= _FOLLOWING_ERROR
        return word

    def _watch_following(self, now_ns: int) -> None:
        window = self._values[_WINDOW]
        if abs(self._previous_demand - self._values[_POSITION]) > window and not self._following_error:
            self._following_error = True
            self.trip(_FOLLOWING_CODE, now_ns)
            self._values[_STATUS] = self._status_word()

    def _lose_host(self, now_ns: int) -> None:
        """6007h: quick stop when the host is gone, or switch off, or carry on."""
        option = self._values[_ABORT_OPTION]
        if not self.enabled or option == 0:
            return
        if option == 3:
            self.section.bits = power.QUICK_STOP
            self._start_ramp(now_ns)
        else:
            self.section.bits = power.FAULT if option == 1 else power.SWITCH_ON_DISABLED

    def _start_ramp(self, now_ns: int) -> None:
        position_rad, _, velocity_rad_s = self.axis.sample()
        self._ramp = StopRamp(position_rad, velocity_rad_s, self.data.quick_stop_rad_s2)
        self._tick_ns = now_ns + _TICK_NS
        self._plan_timer()

    def _tick(self, now_ns: int) -> None:
        assert self._ramp is not None
        target_rad = self._ramp.advance(_TICK_NS * 1e-9)
        if not self.blocked:
            self.axis.set_target(target_rad)
        self._values[_DEMAND] = round(target_rad / self._rad_per_count)
        self._tick_ns = now_ns + _TICK_NS
        if self._ramp.at_rest:
            self._ramp, self._tick_ns = None, NEVER_NS
            if self.section.bits == power.QUICK_STOP:
                self.section.bits = power.SWITCH_ON_DISABLED  # 605Ah = 2

    def _take_mode(self, mode: int) -> None:
        if mode in self.data.modes:
            self._values[_MODE_SHOWN] = mode
        elif self.data.refuses_modes_aloud:
            raise Abort(0x06090030)

    def _take_word(self, word: int) -> None:
        self.section.take(word)

    def _beat(self, now_ns: int) -> None:
        if not self.muted:
            self._emit(now_ns, 0x700 + self.node, bytes([self._nmt]))
        self._beat_ns = NEVER_NS
        self._plan_beat(now_ns)

    def _plan_beat(self, now_ns: int) -> None:
        period_ms = self._values[_PRODUCER]
        if period_ms == 0:
            self._beat_ns = NEVER_NS
        elif self._beat_ns == NEVER_NS:
            self._beat_ns = now_ns + period_ms * 1_000_000
        self._plan_timer()

    def _plan_timer(self) -> None:
        self.next_timer_ns = min(self._beat_ns, self._host_limit_ns, self._tick_ns)

    def _compile(self) -> None:
        """Read the PDO settings: which identifiers, which entries."""
        self._rpdos = {pdo.identifier: pdo for pdo in self._used(0x1400)}
        self._tpdos = self._used(0x1800)

    def _used(self, first: int) -> list[_Pdo]:
        pdos = []
        for index in range(first, first + 4):
            identifier = self._values[key(index, 1)]
            if identifier >> 31 or self._values[key(index, 2)] != 1:
                continue
            entries = self.dictionary.mapped(index + 0x200)
            layout = struct.Struct("<" + "".join(letter for _, letter in entries))
            pdos.append(_Pdo(identifier & 0x7FF, layout, tuple(address for address, _ in entries)))
        return pdos
