"""Emergency messages: error codes of CiA 301 and CiA 402 in words."""

from __future__ import annotations

from dataclasses import dataclass

_EXACT = {
    0x0000: "error reset, or no error",
    0x2310: "continuous over-current at the output",
    0x2320: "short circuit or earth leakage at the output",
    0x2340: "short circuit at the output",
    0x3130: "supply phase failure",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4210: "device over-temperature",
    0x4310: "drive over-temperature",
    0x5441: "contact monitor: enable input open",
    0x6320: "parameter error",
    0x7121: "motor blocked",
    0x7300: "position sensor fault",
    0x7305: "incremental encoder 1 fault",
    0x8110: "CAN overrun: frames were lost",
    0x8120: "CAN in error passive mode",
    0x8130: "heartbeat or life guarding lost",
    0x8140: "recovered from bus-off",
    0x8150: "identifier collision on transmit",
    0x8210: "PDO not processed because of its length",
    0x8220: "PDO length exceeded",
    0x8240: "unexpected SYNC data length",
    0x8250: "RPDO timeout",
    0x8500: "position controller fault",
    0x8611: "following error",
    0x8612: "reference limit reached",
}
_FAMILY = {
    0x10: "generic error",
    0x20: "current",
    0x21: "current at the input side",
    0x22: "current inside the device",
    0x23: "current at the output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the device",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "device temperature",
    0x50: "device hardware",
    0x60: "device software",
    0x70: "additional modules",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol error",
    0x90: "external error",
    0xFF: "specific to the device",
}


@dataclass(frozen=True)
class Emergency:
    """One emergency message of one node."""

    node: int
    code: int
    register: int  # error register 1001h, 0 where a short frame left it out
    detail: bytes
    stamp_ns: int

    @property
    def clears(self) -> bool:
        """Whether this message takes errors back rather than reporting one."""
        return self.code >> 8 == 0

    @property
    def text(self) -> str:
        """The code in words, by itself or by its family."""
        return emergency_text(self.code)


def emergency_text(code: int) -> str:
    """An error code in words: the exact one, else its family.

    Source:
        CiA 301 emergency error code classes; CiA 402-2 error codes (603Fh).
    """
    exact = _EXACT.get(code)
    if exact is not None:
        return exact
    high = code >> 8
    return _FAMILY.get(high) or _FAMILY.get(high & 0xF0) or "unknown error code"


def decode_emergency(node: int, data: bytes, stamp_ns: int) -> Emergency:
    """Read an emergency of any length: what a short frame leaves out is zero, the message itself counts.

    Args:
        node: CANopen node number of the sender.
        data: 0 to 8 data bytes.
        stamp_ns: when the frame ended on the wire [ns].
    """
    padded = data.ljust(8, b"\0")
    code = int.from_bytes(padded[:2], "little")
    if len(data) < 2:
        code = 0x1000  # a truncated code still reports an error: the generic one
    return Emergency(node, code, padded[2], bytes(padded[3:8]), stamp_ns)
