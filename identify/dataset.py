"""A recording as identification sees it: arrays on one time axis, with what is known of the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identify.filters import AntiAliasFilter
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Signal:
    """Samples of one stream at their own instants.

    Attributes:
        t_s: sampling instants on the common time base [s], increasing, shape (N,).
        values: samples, shape (k, N).
    """

    t_s: FloatArray
    values: FloatArray

    @property
    def rate_hz(self) -> float:
        """Median sampling rate."""
        return float(1.0 / np.median(np.diff(self.t_s)))

    def between(self, start_s: float, stop_s: float) -> Signal:
        """Keep the samples with start <= t < stop."""
        first, last = np.searchsorted(self.t_s, [start_s, stop_s])
        return Signal(self.t_s[first:last], self.values[:, first:last])


@dataclass(frozen=True)
class RunFacts:
    """What the log says of the run; None where it does not say.

    Attributes:
        fundamental_hz: of the excitation.
        harmonics: number of excited harmonics.
        periods: whole steady periods recorded.
        transient_periods: periods to discard first.
    """

    fundamental_hz: float | None = None
    harmonics: int | None = None
    periods: int | None = None
    transient_periods: int | None = None


@dataclass(frozen=True)
class Dataset:
    """One run, ready for identification; joints in the robot's order.

    Attributes:
        position: joint positions [rad or m], values (n, N).
        current: motor currents [A], values (n, N), or None.
        effort: joint efforts [N.m or N], values (n, N), or None.
        wrench: base wrench, forces [N] then torques [N.m] in the plate's frame, values (6, N), or None.
        facts: what the log says of the excitation.
        kind: ``excitation``, ``validation``, ``free`` or empty.
        simulated: whether the log says it is simulated.
        source: where it comes from, for messages.
        filters: anti-alias filters by stream: ``position``, ``current``, ``wrench``.
    """

    position: Signal
    current: Signal | None
    effort: Signal | None
    wrench: Signal | None
    facts: RunFacts = RunFacts()
    kind: str = ""
    simulated: bool = False
    source: str = "the recording"
    filters: Mapping[str, AntiAliasFilter] = field(default_factory=dict)

    @property
    def drive_signal(self) -> Signal | None:
        """Currents where there are any, else efforts."""
        return self.current if self.current is not None else self.effort
