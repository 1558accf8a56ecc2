"""From plate samples to sampling instants on the host's clock."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from daq.arrival_count import count_arrivals
from daq.causal_clock import CausalClock
from daq.timebase import COUNTER_DRIFT, STAMP_DRIFT, USB_CDC, TimeBase, Transport, map_to_host
from drivers.force_plate.latency_timer import SYSFS_ROOT, latency_timer
from drivers.force_plate.protocols.protocol import PlateProtocol, sample_period_s, tick_s, wire_time_s
from drivers.force_plate.sample import PlateSample

_XHCI_POLL_S = 125e-6


def transport_of(port: str, sysfs_root: Path = SYSFS_ROOT) -> Transport:
    """Return what is known of the way from a plate on ``port`` to the host: its latency timer, if any."""
    timer = latency_timer(port, sysfs_root)
    if timer is None:
        return USB_CDC
    name = f"FTDI, latency timer {timer.value_ms} ms"
    return Transport(name, period_s=timer.value_ms * 1e-3, poll_s=_XHCI_POLL_S)


def sampling_instants(
    protocol: PlateProtocol, samples: Sequence[PlateSample], transport: Transport = USB_CDC
) -> TimeBase:
    """Return when the plate took its samples, on the host's monotonic clock.

    Devices that stamp or count are mapped by that; for those that do neither, lost samples are first found
    from the arrivals.

    Raises:
        DataError: no samples.
    """
    read_ns = np.array([sample.read_ns for sample in samples], dtype=np.int64)
    if protocol.counter_format is None:
        ticks = count_arrivals(read_ns, sample_period_s(protocol)).ticks
    else:
        ticks = np.array([sample.ticks for sample in samples], dtype=np.int64)
    return map_to_host(
        ticks,
        read_ns,
        tick_s=tick_s(protocol),
        wire_s=wire_time_s(protocol),
        transport=transport,
        segment=np.array([sample.segment for sample in samples]),
        largest_drift=largest_drift(protocol),
    )


def live_clock(protocol: PlateProtocol, transport: Transport = USB_CDC) -> CausalClock:
    """Return a clock to feed with each sample's ``ticks`` and ``read_ns`` as it arrives."""
    return CausalClock(tick_s(protocol), wire_time_s(protocol), transport, largest_drift(protocol))


def largest_drift(protocol: PlateProtocol) -> float:
    """Return how far the device's rate may be off: quartz for stamps, the nominal rate's error for counts."""
    counter = protocol.counter_format
    is_stamp = counter is not None and counter.step > 1
    return STAMP_DRIFT if is_stamp else COUNTER_DRIFT
