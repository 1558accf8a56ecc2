"""What can go wrong with a force plate.

    drivers.errors.HardwareError   exit 3
        ├── PlateNotFoundError              there is no such port, or it may not be opened
        ├── PlateRefusedError               the plate did not answer a command
        ├── PlateStalledError               no sample arrived within the deadline
        ├── PlateUnpluggedError             the port vanished while reading
        └── PlateNotStillError              the plate was loaded or shaken while it was tared
    drivers.errors.ConfigError     exit 2
        └── PlateSettingError              a protocol name or setting that does not exist
"""

from __future__ import annotations

from drivers.errors import ConfigError, HardwareError


class PlateNotFoundError(HardwareError):
    """The serial port does not exist or may not be opened."""

    def __init__(self, port: str, reason: str) -> None:
        self.port, self.reason = port, reason
        super().__init__(
            f"The force plate's port {port} cannot be opened ({reason}); check the cable, the name "
            "(ls /dev/serial/by-id) and that your user is in the group dialout."
        )


class PlateRefusedError(HardwareError):
    """The plate did not acknowledge a command."""

    def __init__(self, port: str, command: bytes, expected: bytes, answer: bytes) -> None:
        self.port, self.command, self.expected, self.answer = port, command, expected, answer
        got = f"{answer[-24:]!r}" if answer else "nothing"
        super().__init__(
            f"The force plate on {port} did not acknowledge {command[:24]!r}: "
            f"expected {expected!r}, got {got}; "
            "check that the protocol and the baud rate are those of this device, then power it off and on."
        )


class PlateStalledError(HardwareError):
    """The plate fell silent."""

    def __init__(self, port: str, silent_s: float, deadline_s: float) -> None:
        self.port, self.silent_s, self.deadline_s = port, silent_s, deadline_s
        super().__init__(
            f"The force plate on {port} has sent no intact sample for {silent_s:.2f} s "
            f"(deadline {deadline_s:.2f} s); check its power and its cable, then start the run again."
        )


class PlateUnpluggedError(HardwareError):
    """The port disappeared."""

    def __init__(self, port: str, reason: str) -> None:
        self.port, self.reason = port, reason
        super().__init__(
            f"The force plate on {port} was unplugged while it was read ({reason}); "
            "plug it in again and repeat the run."
        )


class PlateNotStillError(HardwareError):
    """Too little, or overloaded, data to tare from."""

    def __init__(self, port: str, reason: str) -> None:
        self.port, self.reason = port, reason
        super().__init__(
            f"The force plate on {port} cannot be tared: {reason}; keep the robot still and repeat the tare."
        )


class PlateSettingError(ConfigError):
    """A protocol name or a setting that does not exist."""
