"""Unwrapped counters and exact losses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from drivers.force_plate.counter import CounterUnwrapper
from drivers.force_plate.parser import PlateParser
from drivers.force_plate.protocols.protocol import sample_period_s
from tests.drivers.force_plate.streams import SINGLE

CALM = (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)


@pytest.mark.parametrize("name", ["bota", "optoforce", "dynpick"])
def test_losses_are_counted_exactly_across_wraps(name):
    rng = np.random.default_rng(4)
    protocol = SINGLE[name]
    first = {"bota": 2**32 // 6660 - 200, "optoforce": 65000, "dynpick": 3}[name]
    kept = [first + i for i in range(1000) if i in (0, 999) or rng.random() > 0.1]
    parser = PlateParser(protocol)
    samples = [s for index in kept for s in parser.feed(protocol.encode(CALM, index))]
    assert len(samples) == len(kept)
    assert parser.lost == 1000 - len(kept)
    assert [s.lost for s in samples[1:]] == [b - a - 1 for a, b in pairwise(kept)]
    period_ticks = sample_period_s(protocol) / protocol.counter_format.tick_s
    expected = (np.array(kept) - first) * period_ticks
    np.testing.assert_allclose(np.array([s.ticks for s in samples]) - samples[0].ticks, expected, atol=1)
    assert {s.segment for s in samples} == {0}


def test_a_restart_begins_a_segment():
    parser = PlateParser(SINGLE["bota"])
    frames = [SINGLE["bota"].encode(CALM, i) for i in [5000, 5001, 0, 1]]
    samples = parser.feed(b"".join(frames))
    assert [s.segment for s in samples] == [0, 0, 1, 1]
    assert [s.lost for s in samples] == [0, 0, 0, 0]


@pytest.mark.parametrize("gap", [9, 10, 11, 25, 100, 237])
def test_a_decimal_digit_keeps_count_through_long_holes_with_the_hosts_help(gap):
    """1 kHz, read in 16 ms clumps with 50 ppm of drift: whole turns of ten are restored."""
    counter = CounterUnwrapper(10, 1.0, 1e-3)
    start_ns, drift = 10**9, 1 + 50e-6
    lost, ticks = 0, []
    indices = [i for i in range(3000) if not 1000 <= i < 1000 + gap]
    for block in range(0, 3000, 16):
        batch = [i for i in indices if block <= i < block + 16]
        read_ns = start_ns + round((block + 16) * 1e6 * drift)
        for tick in counter.advance([i % 10 for i in batch], read_ns):
            lost += tick.lost
            ticks.append(tick.ticks)
    assert lost == gap
    assert ticks[-1] - ticks[0] == 2999


def test_late_reads_are_no_losses():
    counter = CounterUnwrapper(10, 1.0, 1e-3)
    rng = np.random.default_rng(8)
    index, now_ns, lost = 0, 10**9, 0
    while index < 5000:
        size = int(rng.integers(1, 40))  # the host comes when it comes, and then reads all there is
        now_ns += size * 1_000_000
        lost += sum(t.lost for t in counter.advance([i % 10 for i in range(index, index + size)], now_ns))
        index += size
    assert lost == 0
