"""The latency timer of FTDI converters: 16 ms by default, which clumps a 150 Hz stream."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SYSFS_ROOT = Path("/sys/bus/usb-serial/devices")

UDEV_RULE = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
"""Line for /etc/udev/rules.d/99-residuum-ftdi.rules."""

_GOOD_MS = 1


@dataclass(frozen=True)
class LatencyTimer:
    """The timer of one port.

    Attributes:
        path: its sysfs file.
        value_ms: how long the converter may hold bytes back.
    """

    path: Path
    value_ms: int

    @property
    def is_good(self) -> bool:
        """Whether the timer is as short as it can be."""
        return self.value_ms <= _GOOD_MS

    @property
    def remedy(self) -> str:
        """One sentence: what it does, and what to do."""
        return (
            f"The serial converter holds bytes back for up to {self.value_ms} ms ({self.path}); write 1 "
            f"there, or for good put the line {UDEV_RULE} into /etc/udev/rules.d/99-residuum-ftdi.rules "
            "and plug the converter in again."
        )


def latency_timer(port: str, root: Path = SYSFS_ROOT) -> LatencyTimer | None:
    """Return the latency timer behind ``port`` (symbolic links followed), None where there is none."""
    path = root / Path(port).resolve().name / "latency_timer"
    try:
        return LatencyTimer(path, int(path.read_text().strip()))
    except (OSError, ValueError):
        return None
