"""No intact frame is lost and nothing raises, whatever lies between the frames."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.force_plate.framing import FrameFormat, Framer
from drivers.force_plate.parser import PlateParser
from tests.drivers.force_plate.streams import NAMES, SINGLE, chunks_of, frames_of


def cut(name: str, chunks: list[bytes]) -> list[bytes]:
    framer = Framer(SINGLE[name].frame_format)
    frames = [frame for chunk in chunks for frame in framer.feed(chunk)]
    return frames + framer.flush()


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_frames_between_garbage_all_come_out_in_order(name, data):
    frames = frames_of(name, 8, seed=data.draw(st.integers(0, 1000)))
    pieces = []
    for frame in frames:
        pieces.append(data.draw(st.binary(max_size=50)))
        pieces.append(frame)
    stream = b"".join(pieces)
    splits = sorted(data.draw(st.sets(st.integers(1, len(stream) - 1), max_size=20)))
    chunks = [stream[a:b] for a, b in zip([0, *splits], [*splits, len(stream)], strict=True)]
    assert [frame for frame in cut(name, chunks) if frame in frames] == frames


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_a_frame_cut_anywhere_does_not_hide_the_next(name, data):
    frames = frames_of(name, 5, seed=data.draw(st.integers(0, 1000)))
    keep = data.draw(st.integers(0, len(frames[0]) - 1))
    assert cut(name, [frames[0], frames[1][:keep], *frames[2:]]) == [frames[0], *frames[2:]]


@pytest.mark.parametrize("name", NAMES)
def test_every_cut_of_every_length(name):
    for seed in range(12):
        frames = frames_of(name, 4, seed=seed)
        for keep in range(len(frames[1])):
            stream = frames[0] + frames[1][:keep] + frames[2] + frames[3]
            assert cut(name, [stream]) == [frames[0], frames[2], frames[3]], (seed, keep)


@pytest.mark.parametrize("name", NAMES)
def test_header_bytes_inside_the_payload(name):
    """Frames whose payloads are full of the header, after a false header and a lone one."""
    header = SINGLE[name].frame_format.anchor
    protocol = SINGLE[name]
    raw = bytearray(protocol.encode((1, 2, 3, 0.1, 0.2, 0.3), 3))
    if name == "bota":
        payload = b"\xaa" * 34
        from drivers.force_plate.checksums import crc16_x25

        raw = bytearray(b"\xaa" + payload + crc16_x25(payload).to_bytes(2, "little"))
    elif name == "robotiq_ft300":
        from drivers.force_plate.checksums import crc16_modbus

        body = header * 7
        raw = bytearray(body + crc16_modbus(body).to_bytes(2, "little"))
    elif name == "optoforce":
        body = header * 5
        raw = bytearray(body + sum(body).to_bytes(2, "big"))
    elif name == "gsv8":
        value = b"\x41" + header + b"\x85"  # 9.45..., a possible channel value that holds the header
        raw = bytearray(header + b"\x00" + value * 8 + b"\x85")
    frame = bytes(raw)
    stream = [header, frame, frame, header * 3, frame[:-1], frame, frame, frame]
    assert cut(name, stream) == [frame] * 5


@pytest.mark.parametrize("name", NAMES)
def test_chunking_never_changes_the_result(name):
    rng = np.random.default_rng(11)
    stream = b"".join(
        frame + (rng.bytes(int(rng.integers(0, 60))) if rng.random() < 0.3 else b"")
        for frame in frames_of(name, 300)
    )
    whole = cut(name, [stream])
    assert cut(name, [stream[i : i + 1] for i in range(len(stream))]) == whole
    assert cut(name, chunks_of(stream, seed=5)) == whole


@pytest.mark.parametrize("name", NAMES)
def test_a_million_bytes_of_noise_and_frames(name):
    """Random bytes, cut, flipped and intact frames: nothing raises and every intact frame arrives."""
    rng = np.random.default_rng(2024)
    length = SINGLE[name].frame_format.length
    frames = frames_of(name, 500_000 // length, seed=9)
    stream, intact, size = [], [], 0
    for frame in frames:
        fate = rng.random()
        if fate < 0.5:
            piece = frame
            intact.append(frame)
        elif fate < 0.65:
            piece = frame[: rng.integers(0, length)]
        elif fate < 0.8:
            damaged = bytearray(frame)
            damaged[rng.integers(0, length)] ^= int(1 << rng.integers(0, 8))
            piece = bytes(damaged)
        else:
            piece = rng.bytes(int(rng.integers(1, 9 * length)))
        stream.append(piece)
        size += len(piece)
    assert size > 750_000
    parser = PlateParser(SINGLE[name])
    framer = Framer(SINGLE[name].frame_format)
    found = []
    for chunk in chunks_of(b"".join(stream), seed=1, largest=4096):
        found += framer.feed(chunk)
        parser.feed(chunk)
    found += framer.flush()
    wanted = iter(intact)
    following = next(wanted)
    matched = 0
    for frame in found:
        if frame == following:
            matched += 1
            following = next(wanted, None)
    assert matched == len(intact)
    if name in ("bota", "robotiq_ft300"):  # the others cannot see every flipped bit: no CRC
        assert len(found) == len(intact)


@pytest.mark.parametrize("name", NAMES)
def test_a_million_random_bytes(name):
    parser = PlateParser(SINGLE[name])
    rng = np.random.default_rng(77)
    for _ in range(250):
        parser.feed(rng.bytes(4000))
    assert parser.counts.frames <= 2  # 1e6 bytes / 256 headers / 65536 checks = 0.06 expected for Bota


def test_overlapping_candidates_are_settled_by_what_follows():
    """A phantom that starts in a cut frame and passes a weak check loses to the real chain."""
    weak = FrameFormat(4, b"H", 0, lambda frame: frame[-1:] == b"T", is_strong=False)
    framer = Framer(weak)
    stream = b"HabT" + b"Ha" + b"HTcT" + b"HdeT" + b"HfgT"  # "HaHT" would pass, and hide "HTcT"
    assert framer.feed(stream) + framer.flush() == [b"HabT", b"HTcT", b"HdeT", b"HfgT"]
    assert framer.counts.overlaps == 1


def test_counts_add_up():
    frames = frames_of("bota", 10)
    framer = Framer(SINGLE["bota"].frame_format)
    framer.feed(b"xyz" + frames[0] + frames[1][:20] + b"".join(frames[2:]))
    assert (framer.counts.frames, framer.counts.skipped_bytes) == (9, 23)


@pytest.mark.parametrize("size", [1, 3, 100])
def test_a_frame_hidden_in_a_phantom_that_passed_a_strong_check_is_still_found(size):
    """A cut frame in step whose checksum happens to fit is taken at once; the frame inside it comes too."""
    lucky = FrameFormat(4, b"H", 0, lambda frame: frame[-1:] == b"T", is_strong=True)
    framer = Framer(lucky)
    stream = b"HabT" + b"Ha" + b"HTcT" + b"HdeT" + b"HfgT"
    found = [f for at in range(0, len(stream), size) for f in framer.feed(stream[at : at + size])]
    assert found + framer.flush() == [b"HabT", b"HaHT", b"HTcT", b"HdeT", b"HfgT"]
