"""Named faults of a plate and its line, for the fakes."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.force_plate.errors import PlateSettingError

KINDS = {
    "drop": "the frame never leaves, the device counts on",
    "bit_flip": "one bit of the frame is inverted",
    "split": "the frame's second half comes 2 ms later",
    "garbage": "up to 64 random bytes precede the frame",
    "stall": "the device falls silent and counts on",
    "clump": "bytes are held back to the next multiple of 16 ms",
    "unplug": "the line vanishes for good",
    "overload": "the device reports a channel beyond its range",
}
"""Every fault by name."""


@dataclass(frozen=True)
class Fault:
    """One fault in a stretch of time.

    Attributes:
        kind: one of `KINDS`.
        start_s: first instant, since the stream began.
        stop_s: last instant.
        probability: chance of each frame to be hit while it lasts.
    """

    kind: str
    start_s: float = 0.0
    stop_s: float = float("inf")
    probability: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise PlateSettingError(f"There is no fault '{self.kind}'; choose one of {', '.join(KINDS)}.")
