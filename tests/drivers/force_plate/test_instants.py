"""From bytes on a bad line to sampling instants."""

from __future__ import annotations

import numpy as np
import pytest

from daq.timebase import FTDI_16_MS, NATIVE_UART
from drivers.force_plate.fake import FakePlate
from drivers.force_plate.faults import Fault
from drivers.force_plate.instants import live_clock, sampling_instants, transport_of
from drivers.force_plate.parser import PlateParser
from tests.drivers.force_plate.streams import NAMES, SINGLE

START_NS = 7_000_000_000


def received(name: str, duration_s: float, faults, seed: int = 1):
    """Run a plate in virtual time behind a host that needs 50 to some hundred microseconds."""
    rng = np.random.default_rng(seed)
    plate = FakePlate(SINGLE[name], faults=faults, drift=60e-6, seed=seed)
    parser = PlateParser(SINGLE[name])
    samples, taken_s, kept_s, read_ns = [], [], [], 0
    for emission in plate.emissions(duration_s):
        read_ns = max(read_ns, START_NS + round((emission.due_s + 50e-6 + rng.exponential(80e-6)) * 1e9))
        samples += parser.feed(emission.data, read_ns)
        taken_s.append(emission.taken_s)
        kept_s += [emission.taken_s] if emission.is_intact else []
    samples += parser.flush(read_ns)
    if SINGLE[name].counter_format is None:
        taken_s = kept_s
    else:
        step = SINGLE[name].counter_format.step
        taken_s = [taken_s[round((sample.ticks - samples[0].ticks) / step)] for sample in samples]
    return samples, START_NS + np.rint(np.array(taken_s) * 1e9).astype(np.int64)


@pytest.mark.parametrize("name", NAMES)
def test_instants_are_right_to_a_tenth_of_a_millisecond(name):
    faults = (Fault("drop", 2.0, 18.0, 0.002), Fault("garbage", probability=0.05))
    samples, truth_ns = received(name, 20.0, faults)
    base = sampling_instants(SINGLE[name], samples, NATIVE_UART)
    error_s = np.abs(base.stamp_ns - truth_ns) * 1e-9
    assert np.quantile(error_s, 0.95) < 1e-4
    if SINGLE[name].counter_format is not None:
        assert np.all(error_s <= base.uncertainty_s)


def test_clumps_of_sixteen_milliseconds_do_not_reach_the_instants():
    samples, truth_ns = received("bota", 60.0, (Fault("clump"),))
    base = sampling_instants(SINGLE["bota"], samples, FTDI_16_MS)
    error_s = np.abs(base.stamp_ns - truth_ns) * 1e-9
    late_s = np.array([s.read_ns for s in samples]) * 1e-9 - truth_ns * 1e-9
    assert np.quantile(late_s, 0.9) > 0.012
    assert error_s.max() < 5e-4
    assert np.all(error_s <= base.uncertainty_s)


def test_the_live_clock_follows():
    samples, truth_ns = received("bota", 20.0, ())
    clock = live_clock(SINGLE["bota"], NATIVE_UART)
    stamps = np.array([clock.update(s.ticks, s.read_ns).stamp_ns for s in samples])
    assert np.abs(stamps - truth_ns)[1000:].max() < 1e5


def test_the_transport_is_read_from_the_system(tmp_path):
    (tmp_path / "ttyUSB3").mkdir()
    (tmp_path / "ttyUSB3" / "latency_timer").write_text("16")
    assert transport_of("/dev/ttyUSB3", tmp_path).period_s == pytest.approx(0.016)
    assert transport_of("/dev/ttyACM0", tmp_path).name == "USB CDC"
