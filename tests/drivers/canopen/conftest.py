"""Benches: the same fake drives in virtual time and in real time on python-can's virtual bus."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drivers.canopen.bus import DriveBus
from drivers.canopen.can_link import CanLink
from drivers.canopen.config import AxisConfig, BusConfig, CanConfig, Deadlines
from drivers.canopen.fake.axis import InertiaAxis, InertiaPlant
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.faults import Fault, FaultPlan
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.realtime import RealTimeFleet
from drivers.canopen.fake.segment import SimulatedSegment

_channels = itertools.count()


def bus_config(axes: int = 3, rate_hz: float = 150.0, **changes) -> BusConfig:
    entries = tuple(AxisConfig(name=f"joint_{i}", node=i, gear_ratio=100.0) for i in range(1, axes + 1))
    return BusConfig(axes=entries, rate_hz=rate_hz, **changes)


def make_fleet(axes: int = 3, rate_hz: float = 150.0, plan: FaultPlan | None = None, **data) -> Fleet:
    plates = [DriveData(node=i, serial=i, **data) for i in range(1, axes + 1)]
    plant = InertiaPlant([InertiaAxis(period_s=1.0 / rate_hz) for _ in plates])
    return Fleet(plates, plant, plan)


def sway(cycle: int, rate_hz: float, axes: int) -> list[float]:
    """Set points that change in every cycle, starting at rest."""
    return [0.05 * (1.0 - math.cos(2.0 * cycle / rate_hz + 0.001 * axis * cycle)) for axis in range(axes)]


class Bench:
    """One fleet with its host's bus, and how to let time pass."""

    def __init__(self, name, config, fleet, bus, segment=None):
        self.name, self.config, self.fleet, self.bus, self.segment = name, config, fleet, bus, segment

    def run(self, cycles: int) -> list:
        """Boot, enable, arm the faults and move for some cycles."""
        self.bus.boot()
        self.bus.enable()
        self.fleet.plan.arm(self.bus.sync)
        rate_hz, axes = self.config.rate_hz, len(self.config.axes)
        return [self.bus.cycle(sway(k, rate_hz, axes)) for k in range(cycles)]

    def run_on(self, cycles: int) -> list:
        """Some more cycles at rest where the last ones ended."""
        last = self.bus._last.target
        targets = [axis.units.position_rad(t) for axis, t in zip(self.bus._axes, last, strict=True)]
        return [self.bus.cycle(targets) for _ in range(cycles)]

    def pass_time(self, duration_s: float) -> None:
        """Let the drives go on without a host."""
        if self.segment is not None:
            self.segment.run(round(duration_s * 1e9))
        else:
            time.sleep(duration_s)


@contextmanager
def open_virtual(*faults: Fault, axes: int = 3, **changes) -> Iterator[Bench]:
    config = bus_config(axes, **changes)
    fleet = make_fleet(axes, plan=FaultPlan(faults))
    segment = SimulatedSegment(fleet)
    with DriveBus(config, segment) as bus:
        yield Bench("virtual time", config, fleet, bus, segment)


@contextmanager
def open_real(*faults: Fault, axes: int = 3, **changes) -> Iterator[Bench]:
    channel = f"bench-{next(_channels)}"
    deadlines = Deadlines(boot_s=1.0, quick_stop_s=0.6, nmt_stop_s=0.4)
    # Half a second of patience: the machine that tests may be busy with something else.
    settings = {"rate_hz": 50.0, "heartbeat_ms": 100, "heartbeat_patience": 5.0, "deadlines": deadlines}
    config = bus_config(axes, **{**settings, **changes})
    fleet = make_fleet(axes, rate_hz=config.rate_hz, plan=FaultPlan(faults))
    link = CanLink(CanConfig(interface="virtual", channel=channel))
    with RealTimeFleet(fleet, channel), DriveBus(config, link) as bus:
        yield Bench("real time", config, fleet, bus)


@pytest.fixture(params=[open_virtual, open_real], ids=["virtual-time", "real-time"])
def bench(request):
    """Opens a bench on either clock; takes faults."""
    return request.param


@pytest.fixture
def virtual_bench():
    """Opens a bench in virtual time."""
    return open_virtual


@pytest.fixture
def real_bench():
    """Opens a bench in real time."""
    return open_real
