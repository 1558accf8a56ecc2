"""A plate that behaves: it samples a load by its own clock and sends frames, faults included.

`FakePlate` works in virtual time; `drivers.force_plate.fake_port` puts it on a serial port in real time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.force_plate.faults import Fault
from drivers.force_plate.protocols.protocol import PlateProtocol, sample_period_s, wire_time_s
from drivers.force_plate.wrench_source import ConstantLoad, WrenchSource

_CLUMP_S = 0.016
"""Default latency timer of FTDI converters."""
_SPLIT_DELAY_S = 0.002
_LONGEST_GARBAGE = 64


@dataclass(frozen=True)
class Emission:
    """Bytes that are complete at the host's end of the line.

    Attributes:
        due_s: when, in seconds of true time since the stream began.
        data: the bytes, one piece of the stream; none for a sample that was lost in the device.
        index: device's sample number they belong to.
        taken_s: true instant of that sample.
        is_intact: whether the frame is whole and unchanged.
        is_end: the line vanished; no bytes follow.
    """

    due_s: float
    data: bytes
    index: int
    taken_s: float
    is_intact: bool = True
    is_end: bool = False


class FakePlate:
    """A simulated plate: protocol, load, clock error and faults, reproducible by its seed.

    Attributes:
        protocol: how it speaks.
        drift: relative error of its clock; positive is slow (its period is longer than nominal).
    """

    def __init__(
        self,
        protocol: PlateProtocol,
        source: WrenchSource | None = None,
        *,
        faults: Sequence[Fault] = (),
        drift: float = 0.0,
        first_index: int = 0,
        noise: Sequence[float] = (0.0,) * 6,
        seed: int = 0,
    ) -> None:
        self.protocol, self.drift = protocol, drift
        self._source = source or ConstantLoad()
        self._faults, self._first_index, self._seed = tuple(faults), first_index, seed
        self._noise = np.asarray(noise, dtype=float)

    def emissions(self, duration_s: float = math.inf) -> Iterator[Emission]:
        """Yield what arrives in order of time; the same every time it is called."""
        rng = np.random.default_rng(self._seed)
        period_s = sample_period_s(self.protocol) * (1.0 + self.drift)
        wire_s = wire_time_s(self.protocol)
        free_s, number = 0.0, 0
        while (taken_s := number * period_s) < duration_s:
            index = self._first_index + number
            number += 1
            active = {fault.kind for fault in self._faults if _hits(fault, taken_s, rng)}
            if "unplug" in active:
                yield Emission(max(taken_s, free_s), b"", index, taken_s, is_intact=False, is_end=True)
                return
            wrench = self._wrench(taken_s, rng)
            if active & {"drop", "stall"}:
                yield Emission(max(taken_s, free_s), b"", index, taken_s, is_intact=False)
                continue
            frame = self.protocol.encode(wrench, index, is_overloaded="overload" in active)
            data, is_intact = _damaged(frame, active, rng)
            free_s = max(taken_s + wire_s, free_s)  # bytes overtake nothing
            if "clump" in active:
                free_s = math.ceil(free_s / _CLUMP_S) * _CLUMP_S
            if "split" in active:
                half = len(data) // 2
                yield Emission(free_s, data[:half], index, taken_s, is_intact)
                data, free_s = data[half:], free_s + _SPLIT_DELAY_S
            yield Emission(free_s, data, index, taken_s, is_intact)

    def _wrench(self, taken_s: float, rng: np.random.Generator) -> Sequence[float]:
        wrench = self._source.sample(taken_s)
        if not self._noise.any():
            return wrench
        return tuple(np.asarray(wrench) + self._noise * rng.standard_normal(6))


def _hits(fault: Fault, t_s: float, rng: np.random.Generator) -> bool:
    if not fault.start_s <= t_s <= fault.stop_s:
        return False
    return fault.probability >= 1.0 or rng.random() < fault.probability


def _damaged(frame: bytes, active: set[str], rng: np.random.Generator) -> tuple[bytes, bool]:
    data, is_intact = bytearray(frame), True
    if "bit_flip" in active:
        data[rng.integers(0, len(data))] ^= 1 << int(rng.integers(0, 8))
        is_intact = False
    if "garbage" in active:
        data[:0] = rng.bytes(int(rng.integers(1, _LONGEST_GARBAGE + 1)))
    return bytes(data), is_intact
