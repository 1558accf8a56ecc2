"""From serial bytes to plate samples: frames, decoding, unwrapped counters."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.force_plate.counter import CounterUnwrapper, Tick
from drivers.force_plate.framing import Framer, FramingCounts
from drivers.force_plate.protocols.protocol import PlateProtocol
from drivers.force_plate.sample import PlateSample, Reading


class PlateParser:
    """Turns any split of a plate's byte stream into the same samples."""

    def __init__(self, protocol: PlateProtocol) -> None:
        self.protocol = protocol
        self._framer = Framer(protocol.frame_format)
        counter = protocol.counter_format
        self._unwrapper = None
        if counter is not None:
            self._unwrapper = CounterUnwrapper(counter.modulus, counter.step, counter.tick_s)
        self._count = 0
        self._lost = 0

    @property
    def counts(self) -> FramingCounts:
        """What became of the bytes so far."""
        return self._framer.counts

    @property
    def lost(self) -> int:
        """Samples lost so far by the device's own count (0 where it keeps none)."""
        return self._lost

    def feed(self, data: bytes, read_ns: int = 0) -> list[PlateSample]:
        """Take bytes read at ``read_ns`` (host monotonic) and return the samples they complete."""
        return self._samples(self._framer.feed(data), read_ns)

    def flush(self, read_ns: int = 0) -> list[PlateSample]:
        """Return samples that were held back for a second opinion, when no more bytes will come."""
        return self._samples(self._framer.flush(), read_ns)

    def _samples(self, frames: Sequence[bytes], read_ns: int) -> list[PlateSample]:
        readings = [self.protocol.decode(frame) for frame in frames]
        ticks = self._ticks(readings, read_ns)
        self._lost += sum(tick.lost for tick in ticks)
        return [_join(reading, tick, read_ns) for reading, tick in zip(readings, ticks, strict=True)]

    def _ticks(self, readings: Sequence[Reading], read_ns: int) -> list[Tick]:
        first, self._count = self._count, self._count + len(readings)
        if self._unwrapper is None:
            return [Tick(index, 0, 0) for index in range(first, self._count)]
        counters = [reading.counter for reading in readings if reading.counter is not None]
        return self._unwrapper.advance(counters, read_ns)


def _join(reading: Reading, tick: Tick, read_ns: int) -> PlateSample:
    return PlateSample(
        raw=reading.raw,
        wrench=reading.wrench,
        counter=reading.counter,
        ticks=tick.ticks,
        segment=tick.segment,
        lost=tick.lost,
        status=reading.status,
        is_overloaded=reading.is_overloaded,
        is_valid=reading.is_valid,
        temperature_c=reading.temperature_c,
        read_ns=read_ns,
    )
