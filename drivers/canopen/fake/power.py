"""The power stage inside a fake drive: what control words do to its state."""

from __future__ import annotations

SWITCH_ON_DISABLED, READY, SWITCHED_ON = 0x40, 0x31, 0x33
ENABLED, QUICK_STOP, FAULT = 0x37, 0x17, 0x08

_MOVES: dict[tuple[int, str], int] = {
    (SWITCH_ON_DISABLED, "shutdown"): READY,
    (READY, "switch on"): SWITCHED_ON,
    (READY, "enable"): SWITCHED_ON,  # the next control word enables
    (READY, "voltage off"): SWITCH_ON_DISABLED,
    (READY, "quick stop"): SWITCH_ON_DISABLED,
    (SWITCHED_ON, "enable"): ENABLED,
    (SWITCHED_ON, "shutdown"): READY,
    (SWITCHED_ON, "voltage off"): SWITCH_ON_DISABLED,
    (SWITCHED_ON, "quick stop"): SWITCH_ON_DISABLED,
    (ENABLED, "switch on"): SWITCHED_ON,
    (ENABLED, "shutdown"): READY,
    (ENABLED, "voltage off"): SWITCH_ON_DISABLED,
    (ENABLED, "quick stop"): QUICK_STOP,
    (QUICK_STOP, "voltage off"): SWITCH_ON_DISABLED,
    (FAULT, "fault reset"): SWITCH_ON_DISABLED,
}


def command_of(word: int, previous: int) -> str:
    """The command that a control word means (bit pattern of 6040h), '' for none."""
    if word & 0x80:
        return "" if previous & 0x80 else "fault reset"
    if not word & 0x02:
        return "voltage off"
    if not word & 0x04:
        return "quick stop"
    if not word & 0x01:
        return "shutdown"
    return "enable" if word & 0x08 else "switch on"


class PowerSection:
    """State of the power stage; `bits` are the low status word bits of the present state."""

    def __init__(self) -> None:
        self.bits = SWITCH_ON_DISABLED
        self.deaf_to_quick_stop = False
        self._previous = 0

    def take(self, word: int) -> bool:
        """Let a control word act; True when the state changed."""
        if word == self._previous and self.bits in (ENABLED, QUICK_STOP, FAULT):
            return False
        command = command_of(word, self._previous)
        self._previous = word
        if command in ("quick stop", "voltage off") and self.deaf_to_quick_stop:
            return False
        target = _MOVES.get((self.bits, command))
        if target is None:
            return False
        self.bits = target
        return True
