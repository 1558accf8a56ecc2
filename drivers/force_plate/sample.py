"""One measurement of a force plate, as it came and in SI units."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reading:
    """What one frame says, before its counter is unwrapped.

    Attributes:
        raw: counts or floats exactly as in the frame.
        wrench: force x, y, z [N] and torque x, y, z [N.m] in the sensor's own frame.
        counter: the device's own stamp or counter as sent (wrapped), None where it sends none.
        status: status word as sent, 0 where there is none.
        is_overloaded: a channel is at or beyond its range.
        is_valid: the device itself trusts the values.
        temperature_c: degrees Celsius, None where it sends none.
    """

    raw: tuple[float, ...]
    wrench: tuple[float, ...]
    counter: int | None = None
    status: int = 0
    is_overloaded: bool = False
    is_valid: bool = True
    temperature_c: float | None = None


@dataclass(frozen=True, slots=True)
class PlateSample:
    """One sample of a force plate with its place in the device's own count.

    Attributes:
        raw: counts or floats exactly as in the frame.
        wrench: force x, y, z [N] and torque x, y, z [N.m] in the sensor's own frame, not tared.
        counter: the device's stamp or counter as sent, None where it sends none.
        ticks: the same unwrapped, in units of the protocol's ``tick_s``; without a device counter,
            the number of intact frames since the start.
        segment: number of device clock resets seen before this sample.
        lost: samples that the device took and that did not arrive just before this one.
        status: status word as sent.
        is_overloaded: a channel is at or beyond its range.
        is_valid: the device itself trusts the values.
        temperature_c: degrees Celsius, None where it sends none.
        read_ns: host monotonic instant at which the frame's last bytes were read.
    """

    raw: tuple[float, ...]
    wrench: tuple[float, ...]
    counter: int | None
    ticks: int
    segment: int
    lost: int
    status: int
    is_overloaded: bool
    is_valid: bool
    temperature_c: float | None
    read_ns: int
