"""Frame layouts, checks and scales of every protocol."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from drivers.force_plate.checksums import crc16_modbus, crc16_x25
from drivers.force_plate.errors import PlateSettingError
from drivers.force_plate.kistler import KistlerGeometry
from drivers.force_plate.parser import PlateParser
from drivers.force_plate.protocols import protocol_named
from drivers.force_plate.protocols.protocol import sample_period_s, wire_time_s
from tests.drivers.force_plate.streams import NAMES, SINGLE, frames_of


def test_published_check_values():
    assert crc16_x25(b"123456789") == 0x906E
    assert crc16_modbus(b"123456789") == 0x4B37


@pytest.mark.parametrize(
    ("name", "length", "baud"),
    [
        ("bota", 37, 460800),
        ("robotiq_ft300", 16, 19200),
        ("dynpick", 27, 921600),
        ("gsv8", 36, 230400),
        ("optoforce", 22, 1_000_000),
    ],
)
def test_frame_length_and_line_speed(name, length, baud):
    protocol = SINGLE[name]
    frame = protocol.encode((1, 2, 3, 0.1, 0.2, 0.3), 7)
    assert len(frame) == protocol.frame_format.length == length
    assert protocol.baud == baud
    assert wire_time_s(protocol) == pytest.approx(10 * length / baud)
    assert wire_time_s(protocol) < sample_period_s(protocol)  # the line can carry the rate


def test_bota_frame_byte_for_byte():
    body = struct.pack("<H6fIf", 2, 1.0, -2.0, 3.5, 0.25, 0.5, -0.75, 13320, 31.5)
    expected = b"\xaa" + body + struct.pack("<H", crc16_x25(body))
    frame = SINGLE["bota"].encode((1.0, -2.0, 3.5, 0.25, 0.5, -0.75), 2, is_overloaded=True)
    assert frame == expected
    reading = SINGLE["bota"].decode(frame)
    assert reading.wrench == (1.0, -2.0, 3.5, 0.25, 0.5, -0.75)
    assert (reading.counter, reading.is_overloaded, reading.temperature_c) == (13320, True, 31.5)
    assert SINGLE["bota"].rate_hz == pytest.approx(150.15, abs=0.01)


def test_robotiq_frame_byte_for_byte():
    frame = SINGLE["robotiq_ft300"].encode((1.0, -1.0, 0.01, 0.001, -0.001, 1.0), 0)
    assert frame[:14].hex() == "204e" "6400" "9cff" "0100" "0100" "ffff" "e803"
    assert SINGLE["robotiq_ft300"].decode(frame).raw == (100, -100, 1, 1, -1, 1000)
    start = SINGLE["robotiq_ft300"].startup[-1].send
    assert crc16_modbus(start) == 0  # a Modbus message with its own check leaves nothing


def test_dynpick_frame_byte_for_byte():
    protocol = protocol_named("dynpick", sensitivity=(10.0,) * 6)
    frame = protocol.encode((0, 1, -1, 0, 0, 819.1), 13)
    assert frame == b"32000200A1FF6200020003FFF\r\n"
    reading = protocol.decode(frame)
    assert (reading.counter, reading.raw[5], reading.is_overloaded) == (3, 16383, True)


def test_optoforce_frame_byte_for_byte():
    protocol = protocol_named("optoforce", sensitivity=(1.0,) * 6)
    frame = protocol.encode((1, -1, 256, 0, 0, 0), 65537)
    assert frame[:20].hex() == "aa070810" "0001" "0000" "0001ffff0100000000000000"
    assert int.from_bytes(frame[20:], "big") == sum(frame[:20])
    assert protocol.decode(protocol.encode((0, 0, 40000, 0, 0, 0), 0)).is_overloaded


def test_gsv_frame_byte_for_byte():
    frame = SINGLE["gsv8"].encode((0, 0, 400, 0, 0, 0), 0)
    assert frame == b"\xaa\x17\x00" + struct.pack(">8f", 0, 0, 0, 0, 100, 100, 100, 100) + b"\x85"


def test_kistler_formulas_by_hand():
    geometry = KistlerGeometry(a_m=0.12, b_m=0.2, az0_m=-0.048)
    assert geometry.wrench((0, 0, 0, 0, 10, 0, 0, 0)) == pytest.approx((0, 0, 10, 2.0, -1.2, 0))
    assert geometry.wrench((5, 5, 0, 0, 0, 0, 0, 0)) == pytest.approx((10, 0, 0, 0, 0.48, 0))
    assert geometry.wrench((0, 0, 3, 7, 0, 0, 0, 0)) == pytest.approx((0, 10, 0, -0.48, 0, -0.48))
    assert geometry.wrench((-1, 1, 0, 0, 0, 0, 0, 0)) == pytest.approx((0, 0, 0, 0, 0, 0.4))


def test_kistler_inverse():
    rng = np.random.default_rng(3)
    geometry = KistlerGeometry()
    for wrench in rng.normal(size=(50, 6)) * 100:
        np.testing.assert_allclose(geometry.wrench(geometry.channels(wrench)), wrench, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_wrench_survives_encoding(name):
    tolerance = 0.06  # half a count of the coarsest channel (OptoForce Fz, 9 counts/N)
    rng = np.random.default_rng(1)
    protocol = SINGLE[name]
    for wrench in rng.uniform(-1, 1, (100, 6)) * (100, 100, 100, 4, 4, 4):
        decoded = protocol.decode(protocol.encode(wrench, 0)).wrench
        np.testing.assert_allclose(decoded, wrench, atol=tolerance)


@pytest.mark.parametrize("name", NAMES)
def test_overload_is_reported(name):
    protocol = SINGLE[name]
    calm = protocol.decode(protocol.encode((1, 1, 1, 0, 0, 0), 0))
    loud = protocol.decode(protocol.encode((1, 1, 1, 0, 0, 0), 0, is_overloaded=True))
    assert not calm.is_overloaded and loud.is_overloaded


@pytest.mark.parametrize("name", ["bota", "robotiq_ft300"])
def test_every_single_bit_flip_is_caught_by_a_crc(name):
    frame = frames_of(name, 1)[0]
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        parser = PlateParser(SINGLE[name])
        assert parser.feed(bytes(damaged)) + parser.flush() == []


def test_unknown_names_and_settings_are_refused():
    with pytest.raises(PlateSettingError, match="choose one of bota"):
        protocol_named("acme")
    with pytest.raises(PlateSettingError, match="sinc_lenght"):
        protocol_named("bota", sinc_lenght=341)
    with pytest.raises(PlateSettingError, match="1000, 333, 100"):
        protocol_named("optoforce", rate_hz=150.0)
    assert PlateSettingError.exit_code == 2
