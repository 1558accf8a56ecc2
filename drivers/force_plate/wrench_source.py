"""What stands on a fake plate: anything that knows the wrench at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


class WrenchSource(Protocol):
    """A load on the plate; the virtual robot is one."""

    def sample(self, t_s: float) -> Sequence[float]:
        """Return force [N] and torque [N.m], six values, at ``t_s`` seconds after the start."""


@dataclass(frozen=True)
class ConstantLoad:
    """A dead weight."""

    wrench: tuple[float, ...] = (0.0,) * 6

    def sample(self, t_s: float) -> Sequence[float]:
        """Return the same wrench at all times."""
        return self.wrench


@dataclass(frozen=True)
class SwingingLoad:
    """A weight that swings with one frequency in all six channels, each with its own phase."""

    mean: tuple[float, ...] = (0.0, 0.0, 80.0, 0.0, 0.0, 0.0)
    amplitude: tuple[float, ...] = (20.0, 20.0, 30.0, 1.0, 1.0, 1.0)
    frequency_hz: float = 0.7

    def sample(self, t_s: float) -> Sequence[float]:
        """Return the wrench at ``t_s``."""
        angle = 2 * math.pi * self.frequency_hz * t_s
        return tuple(
            mean + amplitude * math.sin(angle + channel)
            for channel, (mean, amplitude) in enumerate(zip(self.mean, self.amplitude, strict=True))
        )
