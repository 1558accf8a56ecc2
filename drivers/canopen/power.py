"""The power stage of CiA 402 as one table: for each goal and state the control word and its deadline."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drivers.errors import StateTimeoutError


class State(Enum):
    """States of a drive's power stage (CiA 402-2, figure of the finite state automaton)."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "unknown"


class Goal(Enum):
    """What the host wants of a power stage."""

    ENABLE = "enable operation"
    DISABLE = "disable operation"
    QUICK_STOP = "quick stop"


#: Status word bits (CiA 402-2, object 6041h).
BIT_FAULT = 1 << 3
BIT_FOLLOWS = 1 << 12
BIT_FOLLOWING_ERROR = 1 << 13

_PATTERNS = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.ENABLED),
    (0x6F, 0x07, State.QUICK_STOP),
    (0x4F, 0x0F, State.FAULT_REACTION),
    (0x4F, 0x08, State.FAULT),
)


def _decode(status_word: int) -> State:
    for mask, value, state in _PATTERNS:
        if status_word & mask == value:
            return state
    return State.UNKNOWN


_STATE_OF = tuple(_decode(low) for low in range(0x80))


def state_of(status_word: int) -> State:
    """The power stage state that a status word reports."""
    return _STATE_OF[status_word & 0x7F]


@dataclass(frozen=True)
class Step:
    """One row: what to command in a state, how long the state may last, whether the goal is met."""

    control_word: int
    deadline_s: float
    reached: bool = False


SHUTDOWN, SWITCH_ON, ENABLE_OPERATION = 0x06, 0x07, 0x0F
DISABLE_VOLTAGE, QUICK_STOP, FAULT_RESET = 0x00, 0x02, 0x80

_FOREVER_S = float("inf")

#: Deadlines: enabling may release a brake; a quick stop has the ramp ahead of it; the rest is firmware.
TABLE: dict[tuple[Goal, State], Step] = {
    (Goal.ENABLE, State.NOT_READY): Step(DISABLE_VOLTAGE, 5.0),
    (Goal.ENABLE, State.SWITCH_ON_DISABLED): Step(SHUTDOWN, 1.0),
    (Goal.ENABLE, State.READY): Step(SWITCH_ON, 1.0),
    (Goal.ENABLE, State.SWITCHED_ON): Step(ENABLE_OPERATION, 2.0),
    (Goal.ENABLE, State.ENABLED): Step(ENABLE_OPERATION, _FOREVER_S, reached=True),
    (Goal.ENABLE, State.QUICK_STOP): Step(DISABLE_VOLTAGE, 2.0),
    (Goal.ENABLE, State.FAULT_REACTION): Step(DISABLE_VOLTAGE, 2.0),
    (Goal.ENABLE, State.FAULT): Step(FAULT_RESET, 1.0),
    (Goal.ENABLE, State.UNKNOWN): Step(DISABLE_VOLTAGE, 1.0),
    (Goal.DISABLE, State.NOT_READY): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.DISABLE, State.SWITCH_ON_DISABLED): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.DISABLE, State.READY): Step(DISABLE_VOLTAGE, 1.0),
    (Goal.DISABLE, State.SWITCHED_ON): Step(SHUTDOWN, 1.0),
    (Goal.DISABLE, State.ENABLED): Step(SWITCH_ON, 2.0),
    (Goal.DISABLE, State.QUICK_STOP): Step(DISABLE_VOLTAGE, 2.0),
    (Goal.DISABLE, State.FAULT_REACTION): Step(DISABLE_VOLTAGE, 2.0),
    (Goal.DISABLE, State.FAULT): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.DISABLE, State.UNKNOWN): Step(DISABLE_VOLTAGE, 1.0),
    (Goal.QUICK_STOP, State.NOT_READY): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.QUICK_STOP, State.SWITCH_ON_DISABLED): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.QUICK_STOP, State.READY): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.QUICK_STOP, State.SWITCHED_ON): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.QUICK_STOP, State.ENABLED): Step(QUICK_STOP, 0.5),
    (Goal.QUICK_STOP, State.QUICK_STOP): Step(QUICK_STOP, 2.0),
    (Goal.QUICK_STOP, State.FAULT_REACTION): Step(DISABLE_VOLTAGE, 2.0),
    (Goal.QUICK_STOP, State.FAULT): Step(DISABLE_VOLTAGE, _FOREVER_S, reached=True),
    (Goal.QUICK_STOP, State.UNKNOWN): Step(QUICK_STOP, 0.5),
}


class PowerStage:
    """Leads one drive to a goal, one cycle at a time.

    Args:
        axis: the joint's name, for sentences.
        enable_bits: further control word bits while enabled (bit 4 in interpolated position mode).
    """

    def __init__(self, axis: str, enable_bits: int = 0) -> None:
        self.axis = axis
        self.goal = Goal.DISABLE
        self.state = State.UNKNOWN
        self._enable_bits = enable_bits
        self._since_ns: int | None = None
        self._resets = 0
        self._last_word = 0

    def aim(self, goal: Goal, now_ns: int) -> None:
        """Set a new goal; the deadline of the present state starts anew."""
        self.goal = goal
        self._since_ns = now_ns
        self._resets = 0

    @property
    def reached(self) -> bool:
        """Whether the drive last reported the goal as met."""
        return TABLE[self.goal, self.state].reached

    def advance(self, status_word: int | None, now_ns: int) -> int:
        """Take the latest status word and return the control word to send.

        Args:
            status_word: 6041h of this cycle, None when its frame is missing (the state is then kept).
            now_ns: present time [ns].

        Raises:
            StateTimeoutError: a state outlasted its deadline, or a fault did not clear.
        """
        if status_word is not None:
            self._enter(state_of(status_word), now_ns)
        step = TABLE[self.goal, self.state]
        self._check_deadline(step, now_ns)
        self._last_word = self._word(step)
        return self._last_word

    def _enter(self, state: State, now_ns: int) -> None:
        if state is not self.state or self._since_ns is None:
            self.state = state
            self._since_ns = now_ns

    def _word(self, step: Step) -> int:
        if step.control_word == ENABLE_OPERATION:
            return step.control_word | (self._enable_bits if step.reached else 0)
        if step.control_word == FAULT_RESET and (self._last_word & FAULT_RESET or self._resets):
            return DISABLE_VOLTAGE  # bit 7 acts on its rising edge: once is enough
        if step.control_word == FAULT_RESET:
            self._resets += 1
        return step.control_word

    def _check_deadline(self, step: Step, now_ns: int) -> None:
        elapsed_s = 0.0 if self._since_ns is None else (now_ns - self._since_ns) * 1e-9
        if elapsed_s > step.deadline_s:
            raise StateTimeoutError(
                f"The drive of {self.axis} stayed in '{self.state.value}' for {elapsed_s:.2f} s on its way "
                f"to '{self.goal.value}' (deadline {step.deadline_s:g} s); read its error code and supply."
            )
