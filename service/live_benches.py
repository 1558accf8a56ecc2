"""The virtual robot in real time, as a bench for a run."""

from __future__ import annotations

from collections.abc import Sequence

from daq.host_clock import HostClock
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.live import LiveLab, LiveSettings
from service.benches import Bench, plant_for
from service.robots import LoadedRobot


def live_bench(
    loaded: LoadedRobot, rate_hz: float, seed: int, effects: Sequence[EffectSpec] = ()
) -> Bench:
    """Start the laboratory's process; it ends with the run."""
    lab = LiveLab(LiveSettings(plant_for(loaded), rate_hz, seed, tuple(effects)))
    return Bench(lab.drives, lab.plate, HostClock(), is_virtual=True, close=lab.close)
