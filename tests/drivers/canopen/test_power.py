"""The table of the power stage against a behaving drive, and its deadlines."""

import pytest

from drivers.canopen.fake.power import FAULT, SWITCH_ON_DISABLED, PowerSection
from drivers.canopen.power import TABLE, Goal, PowerStage, State, state_of
from drivers.errors import StateTimeoutError

MS = 1_000_000


def lead(stage, section, cycles=20, start_ns=0):
    """Let stage and drive talk to each other; returns the control words."""
    words = []
    for cycle in range(cycles):
        words.append(stage.advance(section.bits, start_ns + cycle * 7 * MS))
        section.take(words[-1])
    return words


def test_the_table_has_a_row_for_every_goal_and_state():
    assert set(TABLE) == {(goal, state) for goal in Goal for state in State}


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0250, State.SWITCH_ON_DISABLED),
        (0x0231, State.READY),
        (0x0233, State.SWITCHED_ON),
        (0x1237, State.ENABLED),
        (0x0217, State.QUICK_STOP),
        (0x0218, State.FAULT),
        (0x021F, State.FAULT_REACTION),
        (0x0200, State.NOT_READY),
    ],
)
def test_states_are_read_from_the_status_word(word, state):
    assert state_of(word) is state


@pytest.mark.parametrize("bits", [SWITCH_ON_DISABLED, FAULT])
def test_enable_then_disable_reaches_both_goals(bits):
    stage, section = PowerStage("joint_1"), PowerSection()
    section.bits = bits
    stage.aim(Goal.ENABLE, 0)
    words = lead(stage, section)
    assert stage.reached
    assert stage.state is State.ENABLED
    assert words.count(0x80) == (1 if bits == FAULT else 0)
    stage.aim(Goal.DISABLE, 200 * MS)
    lead(stage, section, start_ns=200 * MS)
    assert stage.reached
    assert stage.state is State.SWITCH_ON_DISABLED


def test_interpolation_bit_is_set_only_once_enabled():
    stage, section = PowerStage("joint_1", enable_bits=0x10), PowerSection()
    stage.aim(Goal.ENABLE, 0)
    words = lead(stage, section)
    assert words[:4] == [0x06, 0x07, 0x0F, 0x1F]


def test_a_fault_that_stays_misses_its_deadline_and_is_reset_once():
    stage = PowerStage("joint_4")
    stage.aim(Goal.ENABLE, 0)
    words = [stage.advance(FAULT, k * 100 * MS) for k in range(10)]
    assert words.count(0x80) == 1
    with pytest.raises(StateTimeoutError, match=r"joint_4 stayed in 'fault' for 1\.10 s"):
        stage.advance(FAULT, 1100 * MS)


def test_a_silent_drive_misses_its_deadline():
    stage = PowerStage("joint_1")
    stage.aim(Goal.ENABLE, 0)
    stage.advance(None, 0)
    with pytest.raises(StateTimeoutError, match="unknown"):
        stage.advance(None, 1001 * MS)
