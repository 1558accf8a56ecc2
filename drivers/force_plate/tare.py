"""Tare: the unloaded reading before and after a run, and whether it moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.force_plate.sample import PlateSample

CHANNELS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")

ALLOWED_DRIFT = (2.0, 2.0, 2.0, 0.5, 0.5, 0.5)
"""Shift of the mean that is let pass [N, N.m]: a charge amplifier drifts some 0.01 N/s."""

_SIGNIFICANT = 5.0
"""Standard errors that a shift must exceed to count; one in a million by chance."""


@dataclass(frozen=True)
class Tare:
    """Mean and standard deviation of a still plate.

    Attributes:
        mean: (6,) N and N.m.
        std: (6,) of one sample.
        count: samples averaged.
    """

    mean: tuple[float, ...]
    std: tuple[float, ...]
    count: int


@dataclass(frozen=True)
class TareDrift:
    """What the tare did between two moments.

    Attributes:
        shift: (6,) after minus before, N and N.m.
        drifted: names of the channels that moved beyond their noise and beyond what is allowed.
        sentence: the same for the user, empty when nothing drifted.
    """

    shift: tuple[float, ...]
    drifted: tuple[str, ...]
    sentence: str


def tare_of(samples: Sequence[PlateSample]) -> Tare:
    """Return mean and standard deviation of samples of a still plate (two at least)."""
    wrenches = np.array([sample.wrench for sample in samples])
    mean, std = wrenches.mean(axis=0), wrenches.std(axis=0, ddof=1)
    return Tare(tuple(mean.tolist()), tuple(std.tolist()), len(samples))


def tare_drift(before: Tare, after: Tare, allowed: Sequence[float] = ALLOWED_DRIFT) -> TareDrift:
    """Compare two tares channel by channel.

    Args:
        before: tare before the run.
        after: tare after it, with the robot as it stood before.
        allowed: (6,) shift that is let pass, N and N.m.
    """
    shift = np.subtract(after.mean, before.mean)
    error = np.sqrt(np.square(before.std) / before.count + np.square(after.std) / after.count)
    is_moved = (np.abs(shift) > allowed) & (np.abs(shift) > _SIGNIFICANT * error)
    drifted = tuple(name for name, moved in zip(CHANNELS, is_moved, strict=True) if moved)
    moves = ", ".join(f"{name} by {shift[CHANNELS.index(name)]:+.2f}" for name in drifted)
    sentence = f"The force plate drifted during the run ({moves}); warm it up, tare it and repeat the run."
    return TareDrift(tuple(shift.tolist()), drifted, sentence if drifted else "")
