"""A CAN frame, the CANopen identifiers, and the time a frame occupies the wire."""

from __future__ import annotations

from typing import NamedTuple

NMT = 0x000
SYNC = 0x080
EMERGENCY = 0x080
TPDO1 = 0x180
RPDO1 = 0x200
TPDO2 = 0x280
SDO_ANSWER = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700

#: Bits of SocketCAN's error frame identifier (linux/can/error.h).
ERROR_CONTROLLER = 0x004
ERROR_NO_ACKNOWLEDGE = 0x020
ERROR_BUS_OFF = 0x040
ERROR_RESTARTED = 0x100

_ERROR_TEXTS = {
    0x001: "transmit timeout",
    0x002: "arbitration lost",
    ERROR_CONTROLLER: "controller problem",
    0x008: "protocol violation",
    0x010: "transceiver problem",
    ERROR_NO_ACKNOWLEDGE: "no acknowledgement",
    ERROR_BUS_OFF: "bus-off",
    0x080: "bus error",
    ERROR_RESTARTED: "controller restarted",
}


class Frame(NamedTuple):
    """One frame as the host saw it; a plain tuple because thousands pass each second."""

    stamp_ns: int  # end of the frame on the wire, on the link's clock
    identifier: int
    data: bytes
    own: bool = False  # the echo of a frame this host sent
    error: bool = False  # an error frame: `identifier` holds the error class bits


def worst_case_bits(length_bytes: int) -> int:
    """Bits a standard frame occupies with the most stuff bits possible, interframe space included.

    Args:
        length_bytes: number of data bytes, 0 to 8.

    Returns:
        Bits on the wire.

    Source:
        Davis, Burns, Bril, Lukkien (2007), "Controller Area Network schedulability analysis", equation (1).
    """
    return 47 + 8 * length_bytes + (33 + 8 * length_bytes) // 4


def bus_load(axes: int, rate_hz: float, bitrate_hz: float = 1e6) -> float:
    """Worst-case share of the wire that the cyclic traffic of `axes` drives takes (0 to 1)."""
    bits = worst_case_bits(0) + axes * (worst_case_bits(6) + 2 * worst_case_bits(8))
    return bits * rate_hz / bitrate_hz


def error_text(identifier: int) -> str:
    """The classes of an error frame in words."""
    texts = [text for bit, text in _ERROR_TEXTS.items() if identifier & bit]
    return ", ".join(texts) or f"error class {identifier:#x}"
