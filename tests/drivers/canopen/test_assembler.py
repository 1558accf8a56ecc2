"""Cycles from frames: exactly one of each between two SYNCs, for any disorder."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.assembler import CycleAssembler
from drivers.canopen.frame import Frame
from drivers.canopen.sample import Flag

NODES = (5, 9)


def status(node, position, length=8):
    return Frame(0, 0x180 + node, struct.pack("<Hih", 0x1237, position, -3)[:length])


def motion(node, demand):
    return Frame(0, 0x280 + node, struct.pack("<ii", demand, 11))


def fill(assembler, value):
    for node in NODES:
        assembler.add(status(node, value))
        assembler.add(motion(node, value))


def test_a_full_interval_is_decoded():
    assembler = CycleAssembler(NODES)
    fill(assembler, -70000)
    harvest = assembler.close()
    assert harvest.status == ((0x1237, -70000, -3),) * 2
    assert harvest.motion == ((-70000, 11),) * 2
    assert harvest.flags == [0, 0]


def test_nothing_is_carried_over():
    assembler = CycleAssembler(NODES)
    fill(assembler, 1)
    assembler.close()
    harvest = assembler.close()
    assert harvest.status == (None, None)
    assert harvest.flags == [Flag.MISSING_STATUS | Flag.MISSING_MOTION] * 2


def test_the_second_of_two_frames_is_the_interval_s_own():
    assembler = CycleAssembler(NODES)
    assembler.close()
    assembler.add(status(5, 1))
    assembler.add(status(5, 2))
    harvest = assembler.close()
    assert harvest.status[0][1] == 2
    assert harvest.flags[0] & Flag.LATE


FRAMES = st.lists(st.tuples(st.sampled_from(NODES), st.booleans(), st.integers(0, 8)), max_size=8)


@given(st.lists(FRAMES, max_size=6))
def test_a_value_is_there_if_and_only_if_it_is_not_flagged_missing(intervals):
    assembler = CycleAssembler(NODES)
    for frames in intervals:
        good = set()
        for node, is_status, length in frames:
            frame = status(node, 1) if is_status else motion(node, 1)
            assembler.add(frame._replace(data=frame.data[:length]))
            if length == 8:
                good.add((node, is_status))
        harvest = assembler.close()
        for axis, node in enumerate(NODES):
            flags = harvest.flags[axis]
            assert (harvest.status[axis] is None) == bool(flags & Flag.MISSING_STATUS)
            assert (harvest.motion[axis] is None) == bool(flags & Flag.MISSING_MOTION)
            assert (harvest.status[axis] is not None) == ((node, True) in good)
            assert bool(flags & Flag.WRONG_LENGTH) == any(n == node and size != 8 for n, _, size in frames)
