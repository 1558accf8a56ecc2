"""One tree of errors for everything that touches hardware, real or fake.

    DriverError
      ConfigError             a configuration that cannot be used (wrong use, exit 2)
        RateRefusedError      a SYNC rate the drive profile does not offer
      HardwareError           the device or its wiring (exit 3)
        LinkError             the adapter or the bus itself
          BusOffError         the controller left the bus
        NodeMissingError      drives that did not answer at boot
        SdoFailedError        a confirmed request that was refused or not answered
        IdentityError         another device than the one configured
        ReadBackError         a value written that does not read back
        ModeRefusedError      an operation mode the drive does not take
        StateTimeoutError     a drive that missed the deadline of a state change
        DriveStoppedError     a session ended by the stop ladder; carries its report
"""

from __future__ import annotations

from typing import Any


class DriverError(Exception):
    """Anything that went wrong between this program and a device."""

    exit_code = 3


class ConfigError(DriverError):
    """A configuration that no device could follow."""

    exit_code = 2


class RateRefusedError(ConfigError):
    """A SYNC rate that a drive profile does not offer; carries those it does."""

    def __init__(self, rate_hz: float, profile: str, allowed_hz: tuple[float, ...]) -> None:
        self.rate_hz = rate_hz
        self.profile = profile
        self.allowed_hz = allowed_hz
        choices = ", ".join(f"{rate:.6g}" for rate in allowed_hz)
        super().__init__(
            f"The drive profile '{profile}' cannot run its SYNC at {rate_hz:.6g} Hz, "
            f"because the drive cannot represent that period; use one of {choices} Hz and resample the log."
        )


class HardwareError(DriverError):
    """A device, its wiring or its adapter did not do what was asked."""

    exit_code = 3


class LinkError(HardwareError):
    """The adapter could not be opened, read or written."""


class BusOffError(LinkError):
    """The CAN controller switched itself off the bus after too many errors."""

    def __init__(self, sign: str) -> None:
        super().__init__(
            f"The CAN controller went bus-off ({sign}); check the cable, the termination and the bit rate, "
            "then restart the interface."
        )


class NodeMissingError(HardwareError):
    """Configured drives that did not report at boot; carries their node numbers."""

    def __init__(self, nodes: tuple[int, ...], waited_s: float) -> None:
        self.nodes = nodes
        names = ", ".join(str(node) for node in nodes)
        super().__init__(
            f"No boot-up message came from CANopen node {names} within {waited_s:.3g} s; "
            "check its supply, its node number, the bit rate and the termination."
        )


class SdoFailedError(HardwareError):
    """A confirmed request that the drive refused or left unanswered."""


class IdentityError(HardwareError):
    """The device that answers is not the one that was configured."""


class ReadBackError(HardwareError):
    """A value that was written and reads back differently."""


class ModeRefusedError(HardwareError):
    """The drive did not take the operation mode (6061h says another)."""


class StateTimeoutError(HardwareError):
    """A drive that stayed in a state of its power stage beyond the deadline."""


class DriveStoppedError(HardwareError):
    """The session was ended by the stop ladder; `report` names the cause first and the missing cycles."""

    def __init__(self, sentence: str, report: Any) -> None:
        self.report = report
        super().__init__(sentence)
