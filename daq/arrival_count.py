"""Sample numbers for devices that send none: losses found by the arrivals that stay late for good."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_REACH = 40
"""Samples on either side of a suspected hole whose least delays are compared."""

_SHARE = 0.6
"""Part of a period by which the least delay must rise for a sample to be missing."""


@dataclass(frozen=True)
class ArrivalCount:
    """Reconstructed sample numbers.

    Attributes:
        ticks: (n,) int64 sample number of each arrival, holes left out.
        lost: samples that are missing between the first and the last.
    """

    ticks: np.ndarray
    lost: int


def count_arrivals(read_ns: np.ndarray, period_s: float) -> ArrivalCount:
    """Number the samples of a device without a counter.

    A late read is made up for by the next ones; a lost sample makes all later ones late by a period. A loss
    is placed within one transport clump of where it was; losses nearer than 40 samples to either end of the
    stream are found only if they stand alone, and a stream on a link that clumps by more than half a period
    shows a single loss only if some arrival within the reach came through without waiting.

    Args:
        read_ns: (n,) int64 host monotonic read instants.
        period_s: nominal sample period, true to 0.5 %.
    """
    ticks = np.arange(len(read_ns), dtype=np.int64)
    host_s = (np.asarray(read_ns) - read_ns[0]) * 1e-9 if len(ticks) else np.empty(0)
    for _ in range(len(ticks)):
        delay_s = host_s - ticks * period_s
        rise_s = _least_ahead(delay_s) - _least_behind(delay_s)
        at = _first_rise(rise_s, _SHARE * period_s)
        missing = int(rise_s[at] / period_s + 1 - _SHARE) if at else 0
        if missing < 1:
            break
        ticks[at:] += missing
    return ArrivalCount(ticks, int(ticks[-1] - ticks[0]) + 1 - len(ticks) if len(ticks) else 0)


def _least_ahead(delay_s: np.ndarray) -> np.ndarray:
    """Return the least delay of each sample and those that follow it, within the reach."""
    padded = np.concatenate((delay_s, np.full(_REACH - 1, np.inf)))
    return np.lib.stride_tricks.sliding_window_view(padded, _REACH).min(axis=1)


def _least_behind(delay_s: np.ndarray) -> np.ndarray:
    """Return the least delay of those before each sample, within the reach."""
    least = _least_ahead(delay_s[::-1])[::-1]
    return np.concatenate((least[:1], least[:-1]))


def _first_rise(rise_s: np.ndarray, least_s: float) -> int:
    """Return where the delays begin to stay late: the start of the highest stretch of ``rise_s``; else 0."""
    if len(rise_s) < 2 or rise_s[1:].max() < least_s:
        return 0
    best = 1 + int(np.argmax(rise_s[1:]))
    low_before = np.flatnonzero(rise_s[:best] < least_s)
    return int(low_before[-1]) + 1 if len(low_before) else 1
