"""The two 16-bit cyclic checks that force sensors use on their serial lines."""

from __future__ import annotations


def _reflected_table(polynomial: int) -> tuple[int, ...]:
    table = []
    for byte in range(256):
        register = byte
        for _ in range(8):
            register = (register >> 1) ^ polynomial if register & 1 else register >> 1
        table.append(register)
    return tuple(table)


_X25_TABLE = _reflected_table(0x8408)
_MODBUS_TABLE = _reflected_table(0xA001)


def _crc16(data: bytes, table: tuple[int, ...], register: int) -> int:
    for byte in data:
        register = (register >> 8) ^ table[(register ^ byte) & 0xFF]
    return register


def crc16_x25(data: bytes) -> int:
    """Return CRC-16/X-25 (check value of b"123456789": 0x906E).

    Source: ITU-T X.25, frame check sequence, polynomial x^16 + x^12 + x^5 + 1.
    """
    return _crc16(data, _X25_TABLE, 0xFFFF) ^ 0xFFFF


def crc16_modbus(data: bytes) -> int:
    """Return CRC-16/Modbus (check value of b"123456789": 0x4B37).

    Source: MODBUS over serial line V1.02, appendix B, polynomial x^16 + x^15 + x^2 + 1.
    """
    return _crc16(data, _MODBUS_TABLE, 0xFFFF)


def sum16(data: bytes) -> int:
    """Return the sum of all bytes modulo 2**16."""
    return sum(data) & 0xFFFF
