"""Device clocks mapped to host time: hull, segments, wraps, uncertainty, live."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.transport_models import BAUD, FRAME_BYTES, LINKS, TICK_S, simulate
from daq.arrival_count import count_arrivals
from daq.causal_clock import CausalClock
from daq.errors import DataError
from daq.lower_hull import lower_hull, supporting_line
from daq.timebase import COUNTER_DRIFT, FTDI_16_MS, NATIVE_UART, USB_CDC, Transport, map_to_host

WIRE_S = 10 * FRAME_BYTES / BAUD
EXACT = Transport("a line without latency", floor_min_s=0.0, floor_max_s=0.0)


def host_of(device_s: np.ndarray, drift: float, delay_s: np.ndarray) -> np.ndarray:
    return np.rint((5.0 + device_s * (1 + drift) + delay_s) * 1e9).astype(np.int64)


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(-50, 50)), min_size=1, max_size=60))
@settings(max_examples=200, deadline=None)
def test_the_hull_lies_below_all_points_and_bends_upwards(points):
    points.sort()
    x, y = np.array(points, dtype=float).T
    corners = lower_hull(x, y)
    assert np.all(np.diff(x[corners]) > 0)
    assert np.all(np.interp(x, x[corners], y[corners]) <= y + 1e-9)
    slopes = np.diff(y[corners]) / np.diff(x[corners])
    assert np.all(np.diff(slopes) > 0)


@given(st.lists(st.integers(0, 1000), min_size=3, max_size=60))
@settings(max_examples=100, deadline=None)
def test_the_supporting_line_is_the_best_of_all_lines_below(heights):
    x, y = np.arange(len(heights), dtype=float), np.array(heights, dtype=float)
    line = supporting_line(x, y, 1e9)
    assert np.all(line.at(x) <= y + 1e-6)
    for slope in np.linspace(-50, 50, 41):  # no other line below the points comes nearer to them
        height = np.min(y - slope * x)
        assert np.sum(y - line.at(x)) <= np.sum(y - height - slope * x) + 1e-6


def test_a_line_without_latency_is_exact():
    rng = np.random.default_rng(0)
    device_s = np.arange(3000) / 150
    delay_s = rng.exponential(1e-3, 3000)
    delay_s[[100, 2800]] = 0.0
    ticks = 77 + np.rint(device_s * 1e6).astype(np.int64)
    read_ns = host_of((ticks - 77) * 1e-6, 40e-6, delay_s + 1e-3)
    base = map_to_host(ticks, read_ns, tick_s=1e-6, wire_s=1e-3, transport=EXACT)
    truth_ns = host_of((ticks - 77) * 1e-6, 40e-6, np.zeros(3000))
    assert np.abs(base.stamp_ns - truth_ns).max() < 2_000  # at the ends the line is extrapolated
    assert base.segments[0].rate == pytest.approx(1 + 40e-6, abs=1e-7)


@pytest.mark.parametrize(("name", "limit_s"), [("USB-CDC", 1e-4), ("FTDI 1 ms", 1e-4), ("FTDI 16 ms", 5e-4)])
def test_transports_meet_their_targets_and_say_how_well(name, limit_s):
    link = LINKS[name]
    for seed in (101, 102, 103):
        run = simulate(link, seed, duration_s=80.0)
        base = map_to_host(run.ticks, run.read_ns, tick_s=TICK_S, wire_s=WIRE_S, transport=link.known)
        error_s = np.abs(base.stamp_ns - run.true_ns) * 1e-9
        assert np.quantile(error_s, 0.99) < limit_s
        assert np.all(error_s <= base.uncertainty_s)
        arrival_s = np.abs(run.read_ns - run.true_ns) * 1e-9 - WIRE_S
        assert np.quantile(error_s, 0.99) < 0.5 * np.quantile(arrival_s, 0.99)


@pytest.mark.parametrize("name", ["USB-CDC", "FTDI 16 ms"])
def test_the_live_clock_settles_and_never_needs_the_future(name):
    link = LINKS[name]
    run = simulate(link, 7, duration_s=60.0)
    clock = CausalClock(TICK_S, WIRE_S, link.known)
    live = [clock.update(int(t), int(r)) for t, r in zip(run.ticks, run.read_ns, strict=True)]
    error_s = np.abs(np.array([i.stamp_ns for i in live]) - run.true_ns) * 1e-9
    stated_s = np.array([i.uncertainty_s for i in live])
    assert np.quantile(error_s[3000:], 0.99) < 5e-4
    assert np.mean(error_s[3000:] <= stated_s[3000:]) > 0.95
    again = CausalClock(TICK_S, WIRE_S, link.known)
    for index in range(1000):
        assert again.update(int(run.ticks[index]), int(run.read_ns[index])) == live[index]


def test_a_reset_of_the_device_clock_starts_a_segment():
    rng = np.random.default_rng(2)
    device_s = np.arange(6000) / 150
    delay_s = 50e-6 + rng.exponential(2e-4, 6000)
    ticks = np.rint(device_s * 1e6).astype(np.int64)
    restarted = np.where(np.arange(6000) < 2500, 10_000_000_000 + ticks, ticks - ticks[2500])
    read_ns = host_of(device_s, 0.0, delay_s)
    base = map_to_host(restarted, read_ns, tick_s=1e-6, wire_s=0.0, transport=NATIVE_UART)
    assert [(s.first, s.stop) for s in base.segments] == [(0, 2500), (2500, 6000)]
    assert np.abs(base.stamp_ns - host_of(device_s, 0.0, np.zeros(6000))).max() < 60_000
    # A restart that looks like a forward jump is named by the driver's segment count, or by the jump.
    forward = np.where(np.arange(6000) < 2500, ticks, ticks + 9_000_000)
    jumped = map_to_host(forward, read_ns, tick_s=1e-6, wire_s=0.0, transport=NATIVE_UART)
    assert [s.first for s in jumped.segments] == [0, 2500]
    small = np.where(np.arange(6000) < 2500, ticks, ticks + 100_000)
    told = map_to_host(
        small,
        read_ns,
        tick_s=1e-6,
        wire_s=0.0,
        transport=NATIVE_UART,
        segment=(np.arange(6000) >= 2500).astype(int),
    )
    assert [s.first for s in told.segments] == [0, 2500]


def test_a_host_that_slept_is_no_reset():
    device_s = np.arange(3000) / 150
    delay_s = 50e-6 + np.random.default_rng(3).exponential(1e-4, 3000)
    late = (device_s > 5.0) & (device_s < 7.0)  # read at once at 7 s
    delay_s[late] = 7.0 - device_s[late]
    ticks = np.rint(device_s * 1e6).astype(np.int64)
    read_ns = host_of(device_s, 0, delay_s)
    base = map_to_host(ticks, read_ns, tick_s=1e-6, wire_s=0.0, transport=NATIVE_UART)
    assert len(base.segments) == 1
    assert np.abs(base.stamp_ns - host_of(device_s, 0, np.zeros(3000))).max() < 60_000


def test_a_sample_counter_is_a_clock_of_nominal_rate():
    """The "150 Hz" device runs at 149.3 Hz: the hull finds its rate from the counts."""
    rng = np.random.default_rng(4)
    counts = np.arange(12_000)[rng.random(12_000) > 0.01]
    taken_s = counts / 149.3
    read_ns = host_of(taken_s, 0.0, 1e-4 + rng.exponential(2e-4, len(counts)))
    base = map_to_host(
        counts, read_ns, tick_s=1 / 150, wire_s=0.0, transport=USB_CDC, largest_drift=COUNTER_DRIFT
    )
    assert base.segments[0].rate == pytest.approx(150 / 149.3, abs=1e-6)
    error_s = np.abs(base.stamp_ns - host_of(taken_s, 0.0, np.zeros(len(counts)))) * 1e-9
    assert np.all(error_s <= base.uncertainty_s)


def test_a_wandering_clock_is_followed_over_half_an_hour():
    """1 ppm of temperature wander over 30 min is 280 us off any one straight line."""
    rng = np.random.default_rng(5)
    device_s = np.arange(0, 1800, 1 / 50)
    wander_s = 0.3e-6 * 1800 / (2 * np.pi) * np.sin(2 * np.pi * device_s / 1800) * 3
    read_ns = host_of(device_s, 0.0, wander_s + 50e-6 + rng.exponential(2e-4, len(device_s)))
    ticks = np.rint(device_s * 1e6).astype(np.int64)
    base = map_to_host(ticks, read_ns, tick_s=1e-6, wire_s=0.0, transport=NATIVE_UART)
    error_s = np.abs(base.stamp_ns - host_of(device_s, 0.0, wander_s)) * 1e-9
    assert error_s.max() < 60e-6
    assert np.all(error_s <= base.uncertainty_s)


def test_samples_locked_to_the_timer_are_owned_up_to():
    """All samples wait the same 9 ms: no data can show it, so the uncertainty must."""
    device_s = np.arange(3000) / 125
    read_ns = host_of(device_s, 0.0, 9e-3 + np.random.default_rng(6).exponential(2e-5, 3000))
    base = map_to_host(
        np.rint(device_s * 1e6).astype(np.int64), read_ns, tick_s=1e-6, wire_s=0.0, transport=FTDI_16_MS
    )
    error_s = np.abs(base.stamp_ns - host_of(device_s, 0.0, np.zeros(3000))) * 1e-9
    assert np.all(error_s <= base.uncertainty_s)


def test_short_runs_state_more_uncertainty():
    link = LINKS["FTDI 16 ms"]
    run = simulate(link, 1, duration_s=60.0)
    stated = []
    for count in (50, 500, 5000):
        base = map_to_host(
            run.ticks[:count], run.read_ns[:count], tick_s=TICK_S, wire_s=WIRE_S, transport=link.known
        )
        stated.append(base.uncertainty_s.max())
    assert stated[0] > stated[1] > stated[2]
    one = map_to_host(run.ticks[:1], run.read_ns[:1], tick_s=TICK_S, wire_s=WIRE_S, transport=link.known)
    assert len(one.stamp_ns) == 1


def test_nothing_to_map_is_refused():
    with pytest.raises(DataError, match="0 stamps against 0"):
        map_to_host(np.array([]), np.array([]), tick_s=1e-6, wire_s=0.0)
    with pytest.raises(DataError, match="3 stamps against 2"):
        map_to_host(np.arange(3), np.arange(2), tick_s=1e-6, wire_s=0.0)


@pytest.mark.parametrize("holes", [(), ((500, 1),), ((300, 1), (900, 3), (1500, 40)), ((40, 2), (1960, 1))])
def test_losses_of_a_device_without_a_counter(holes):
    rng = np.random.default_rng(8)
    true = np.arange(2000)
    for at, missing in holes:
        true = true[(true < at) | (true >= at + missing)]
    taken_s = true * 0.010003
    delay_s = rng.uniform(0, 4e-3, len(true)) + 1e-4
    delay_s[rng.random(len(true)) < 0.01] += 0.03  # late reads are no losses
    read_ns = np.maximum.accumulate(host_of(taken_s, 0.0, delay_s))
    counted = count_arrivals(read_ns, 0.01)
    assert counted.lost == sum(missing for _, missing in holes)
    assert np.mean(counted.ticks == true) > 0.99
    base = map_to_host(
        counted.ticks, read_ns, tick_s=0.01, wire_s=0.0, transport=replace(USB_CDC, period_s=4e-3),
        largest_drift=COUNTER_DRIFT,
    )
    assert np.quantile(np.abs(base.stamp_ns - host_of(taken_s, 0, np.zeros(len(true)))), 0.95) < 3e5
