"""A force plate as a run sees it: streaming, resting, polled each cycle, mapped to the host's clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from daq.arrival_count import count_arrivals
from daq.ports import PlateRest, PlateStream
from daq.timebase import Transport
from drivers.force_plate.instants import live_clock, sampling_instants, transport_of
from drivers.force_plate.mounting import Mounting
from drivers.force_plate.plate import ForcePlate
from drivers.force_plate.protocols.protocol import PlateProtocol, sample_period_s
from drivers.force_plate.sample import PlateSample
from drivers.force_plate.tare import Tare, tare_drift

_REST_S = 1.0
"""How long a resting plate is averaged."""


class PlateOnHostClock:
    """Puts samples of a protocol on the host's clock and into the plate's axes."""

    def __init__(
        self, protocol: PlateProtocol, transport: Transport, mounting: Mounting | None = None
    ) -> None:
        self.protocol, self.transport, self.mounting = protocol, transport, mounting or Mounting()
        self._clock = live_clock(protocol, transport)

    def live(self, sample: PlateSample) -> tuple[int, float]:
        """Instant [ns] and uncertainty [s] of a sample as known when it arrived."""
        instant = self._clock.update(sample.ticks, sample.read_ns)
        return instant.stamp_ns, instant.uncertainty_s

    def stream(self, samples: Sequence[PlateSample]) -> PlateStream:
        """All samples at their instants; their wrenches in the plate's axes, not tared."""
        base = sampling_instants(self.protocol, samples, self.transport)
        lost = np.array([sample.lost for sample in samples], dtype=np.int64)
        lost[0] = 0  # what was lost before the first sample of the run is no loss of the run
        sequence = np.arange(len(samples)) + np.cumsum(lost)
        if self.protocol.counter_format is None:
            read_ns = np.array([sample.read_ns for sample in samples], dtype=np.int64)
            sequence = count_arrivals(read_ns, sample_period_s(self.protocol)).ticks
            sequence = sequence - sequence[0]
        wrench = self.mounting.apply(np.array([sample.wrench for sample in samples]))
        missing = int(sequence[-1]) + 1 - len(samples)
        return PlateStream(base.stamp_ns, base.uncertainty_s, sequence, wrench, missing, base.method)

    def drift(self, before: PlateRest, after: PlateRest) -> str:
        """What moved between two rests, in words; empty where nothing did."""
        return tare_drift(_tare(before), _tare(after)).sentence

    def facts(self) -> Mapping[str, str]:
        """What is needed to understand the raw samples later."""
        rows = " ".join(f"{value:g}" for row in self.mounting.rotation for value in row)
        transport = self.transport
        return {
            "protocol": self.protocol.name,
            "rate_hz": f"{self.protocol.rate_hz:.9g}",
            "transport": transport.name,
            "transport_period_s": f"{transport.period_s:g}",
            "transport_poll_s": f"{transport.poll_s:g}",
            "mounting": f"{rows} {'action' if self.mounting.is_action else 'reaction'}",
        }


class SerialPlate(PlateOnHostClock):
    """A plate on a serial port.

    Args:
        protocol: how it speaks.
        port: serial device.
        mounting: how the sensor sits under the robot.
    """

    def __init__(self, protocol: PlateProtocol, port: str, mounting: Mounting | None = None) -> None:
        super().__init__(protocol, transport_of(port), mounting)
        self.plate = ForcePlate(protocol, port)

    def start(self) -> Sequence[str]:
        """Open the port and start the stream; return warnings for the user."""
        warnings = self.plate.open()
        self.transport = transport_of(self.plate.port)  # opening may have shortened the latency timer
        self.plate.start()
        return warnings

    def rest(self) -> PlateRest:
        """Average the plate while nothing moves."""
        found = self.plate.tare(_REST_S)
        return PlateRest(found.mean, found.std, found.count)

    def poll(self) -> Sequence[PlateSample]:
        """The samples that arrived since the last call."""
        return self.plate.read()

    def stop(self) -> None:
        """End the stream and release the port."""
        self.plate.close()


def _tare(rest: PlateRest) -> Tare:
    return Tare(rest.mean, rest.std, rest.count)
