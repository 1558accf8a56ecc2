"""Small parts: schedule, ladder, heartbeats, units, emergencies, frames, profiles, configuration."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from drivers.canopen.config import AxisConfig, BusConfig, CanConfig, load_bus
from drivers.canopen.emergency import decode_emergency, emergency_text
from drivers.canopen.frame import bus_load, error_text, worst_case_bits
from drivers.canopen.heartbeat import HeartbeatProducer, HeartbeatWatch
from drivers.canopen.ladder import TABLE, Event, Rung, StopLadder
from drivers.canopen.profile import common_period_us, interpolation_time, load_profile
from drivers.canopen.schedule import SyncSchedule
from drivers.canopen.units import DriveScaling, axis_units
from drivers.clock import ManualClock, MonotonicClock
from drivers.errors import ConfigError, RateRefusedError

PERIOD_NS = 1_000_000


@given(st.lists(st.integers(0, 5 * PERIOD_NS), max_size=40))
def test_syncs_keep_their_distance_whatever_the_delays(delays_ns):
    schedule = SyncSchedule(PERIOD_NS, 0)
    sent_ns = []
    for delay_ns in delays_ns:
        sent_ns.append(schedule.due_ns + delay_ns)
        late = schedule.sent(sent_ns[-1])
        assert late or delay_ns <= 0.2 * PERIOD_NS
    assert all(b - a >= 0.8 * PERIOD_NS for a, b in pairwise(sent_ns))


def test_a_short_delay_is_caught_up_and_a_long_one_moves_the_grid():
    schedule = SyncSchedule(PERIOD_NS, 0)
    schedule.sent(600_000)
    assert schedule.due_ns == 1_400_000
    schedule.sent(1_400_000)
    schedule.sent(schedule.due_ns)
    assert schedule.due_ns == 3_000_000
    assert schedule.slips == 0
    schedule.sent(9_000_000)
    assert schedule.slips == 1
    assert schedule.due_ns == 10_000_000


def test_the_ladder_only_goes_down():
    order = [*Rung]
    for (rung, _), target in TABLE.items():
        assert order.index(target) > order.index(rung)


def test_the_ladder_keeps_its_deadlines():
    ladder = StopLadder(quick_stop_ns=100, nmt_stop_ns=50)
    ladder.take(Event.TRIP, 1000)
    assert ladder.advance(False, 1099) is Rung.QUICK_STOP
    assert ladder.advance(False, 1100) is Rung.NMT_STOP
    assert ladder.advance(False, 1149) is Rung.NMT_STOP
    assert ladder.advance(False, 1150) is Rung.UNCONFIRMED
    assert ladder.ended
    assert ladder.history == [(Rung.QUICK_STOP, 1000), (Rung.NMT_STOP, 1100), (Rung.UNCONFIRMED, 1150)]


def test_the_ladder_ends_when_the_drives_confirm():
    ladder = StopLadder(100, 50)
    ladder.take(Event.FINISH, 0)
    assert ladder.take(Event.TRIP, 10) is Rung.QUICK_STOP
    assert ladder.advance(True, 20) is Rung.STOPPED
    assert ladder.take(Event.TRIP, 30) is Rung.STOPPED


def test_an_overdue_heartbeat_is_seen_even_of_a_drive_that_never_beat():
    watch = HeartbeatWatch([1, 2], lost_ns=100)
    assert watch.overdue(10_000) == []
    watch.watch(1000)
    watch.heard(1, b"\x05", 1080)
    watch.heard(77, b"\x05", 1080)
    assert watch.overdue(1100) == []
    assert watch.overdue(1101) == [2]
    assert watch.overdue(1181) == [1, 2]


def test_the_own_heartbeat_keeps_its_period():
    producer = HeartbeatProducer(100)
    assert [time for time in range(0, 500, 10) if producer.due(time)] == [0, 100, 200, 300, 400]


SCALING = DriveScaling(
    rated_current_ma=4000,
    rated_torque_mnm=1500,
    encoder_counts=65536,
    encoder_revolutions=1,
    gear_motor=1,
    gear_shaft=1,
    polarity=0,
)


def test_one_motor_revolution_is_a_joint_revolution_by_the_gear():
    units = axis_units(SCALING, gear_ratio=94.0)
    assert units.position_rad(65536) == pytest.approx(math.tau / 94.0)
    assert units.current_a(1000) == pytest.approx(4.0)
    assert units.torque_nm(500) == pytest.approx(0.75)


def test_a_drive_that_counts_behind_its_gear_counts_joint_revolutions():
    scaling = DriveScaling(**{**SCALING.record(), "gear_motor": 94, "feed": 36000, "feed_shaft": 1})
    assert axis_units(scaling, gear_ratio=94.0).position_rad(36000) == pytest.approx(math.tau)


@given(
    polarity=st.sampled_from([0x00, 0x80, 0x40, 0xC0]),
    direction=st.sampled_from([1, -1]),
    counts=st.integers(-(2**31), 2**31 - 1),
)
def test_counts_and_radians_are_inverse_and_signs_agree(polarity, direction, counts):
    scaling = DriveScaling(**{**SCALING.record(), "polarity": polarity})
    units = axis_units(scaling, 120.0, direction)
    assert units.counts(units.position_rad(counts)) == counts
    assert math.copysign(1, units.rad_per_count) == direction * (-1 if polarity & 0x80 else 1)
    assert math.copysign(1, units.rad_s_per_unit) == direction * (-1 if polarity & 0x40 else 1)
    assert math.copysign(1, units.ampere_per_unit) == direction


def test_velocity_in_rpm_is_motor_side():
    units = axis_units(SCALING, gear_ratio=100.0, velocity_in_rpm=True)
    assert units.velocity_rad_s(3000) == pytest.approx(3000 / 60 * math.tau / 100)


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8110, "overrun"),
        (0x8120, "passive"),
        (0x8130, "heartbeat"),
        (0x8140, "bus-off"),
        (0x8210, "length"),
        (0x8250, "RPDO timeout"),
        (0x2399, "output side"),
        (0x5599, "hardware"),
        (0xFF07, "specific to the device"),
        (0xB000, "unknown"),
    ],
)
def test_emergency_codes_have_words(code, text):
    assert text in emergency_text(code)


@given(st.binary(max_size=8))
def test_an_emergency_of_any_length_is_read(data):
    emergency = decode_emergency(3, data, 17)
    assert emergency.node == 3
    assert len(emergency.detail) == 5
    if len(data) >= 2:
        assert emergency.code == data[0] | data[1] << 8
    else:
        assert not emergency.clears


def test_frame_times_and_load_are_those_of_the_standard():
    assert worst_case_bits(8) == 135
    assert worst_case_bits(0) == 55
    assert bus_load(7, 150.0) == pytest.approx(0.41, abs=0.01)
    assert bus_load(11, 150.0) < 0.70


def test_error_frames_have_words():
    assert error_text(0x40) == "bus-off"
    assert error_text(0x24) == "controller problem, no acknowledgement"


@given(st.integers(1, 1_000_000))
def test_the_interpolation_time_is_exact_or_refused(period_us):
    time = interpolation_time(period_us)
    if time is None:
        assert period_us > 255
    else:
        value, exponent = time
        assert 1 <= value <= 255
        assert value * 10 ** (exponent + 6) == period_us


def test_profiles_offer_their_rates():
    assert load_profile("generic").period_us(150.0) == 6667
    assert load_profile("generic").period_us(166.667) == 6000
    assert interpolation_time(6667) is None
    both = [load_profile("generic"), load_profile("whole_milliseconds")]
    assert common_period_us(both, 250.0) == 4000
    with pytest.raises(RateRefusedError, match="use one of") as caught:
        common_period_us(both, 150.0)
    assert caught.value.profile == "whole_milliseconds"
    assert all(common_period_us(both, rate_hz) for rate_hz in caught.value.allowed_hz)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('name = "a"', "sync_periods_us"),
        ('name = "a"\nsync_periods_us = [10]', "between 500 and"),
        ('name = "a"\nsync_periods_us = [5000]\nrate = 3', "rate"),
        ("name =", "Invalid value"),
    ],
)
def test_a_bad_profile_is_one_sentence(tmp_path, text, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as caught:
        load_profile(path)
    assert "\n" not in str(caught.value)


def test_an_unknown_profile_lists_the_known():
    with pytest.raises(ConfigError, match="generic, interpolated, whole_milliseconds"):
        load_profile("fancy")


def test_a_bus_is_read_from_toml(tmp_path):
    path = tmp_path / "bus.toml"
    path.write_text(
        'rate_hz = 200\n[can]\ninterface = "slcan"\nchannel = "/dev/ttyACM0"\nown_echo = false\n'
        '[[axes]]\nname = "joint_1"\nnode = 3\ngear_ratio = 94.1\ndirection = -1\n'
    )
    config = load_bus(path)
    assert (config.rate_hz, config.can.interface, config.axes[0].direction) == (200.0, "slcan", -1)
    path.write_text(path.read_text() + "wheel = 3\n")
    with pytest.raises(ConfigError, match=r"bus\.toml cannot be used: axes\.0\.wheel: Extra inputs"):
        load_bus(path)
    with pytest.raises(ConfigError, match="could not be read"):
        load_bus(tmp_path / "none.toml")


def test_node_numbers_and_names_are_distinct():
    one = AxisConfig(name="a", node=1, gear_ratio=1.0)
    for other in (one.model_copy(update={"name": "b"}), one.model_copy(update={"node": 2})):
        with pytest.raises(ValidationError):
            BusConfig(axes=(one, other))
    with pytest.raises(ValidationError):
        BusConfig(axes=(one,), host_node=1)
    with pytest.raises(ValidationError):
        CanConfig(speed=3)


def test_clocks_do_not_go_back():
    clock = ManualClock(5)
    clock.advance_to(9)
    clock.advance_to(7)
    assert clock.now_ns() == 9
    assert MonotonicClock().now_ns() <= MonotonicClock().now_ns()
