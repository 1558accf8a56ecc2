"""A charge amplifier that forgets: w - (1/T) integral w since its zero at the start, 1/T the corner."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.history import History
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidPlant


class PlateHighPass(Effect):
    """A charge amplifier that forgets: w - (1/T) integral w since its zero at the start, 1/T the corner."""

    name = "plate_high_pass"
    where = "P"
    place = "none"
    size = "corner_rad_s"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"corner_rad_s": Range(1.0 / 500.0, 1.0 / 15.0, "rad/s")}

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Set the amplifier to its reset state."""
        self._start: np.ndarray | None = None
        self._input: np.ndarray | None = None
        self._output = np.zeros(6)
        self._last_s = 0.0

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        start = wrench[0] if self._start is None else self._start
        before = start if self._input is None else self._input
        rise = np.diff(np.vstack([before, wrench]), axis=0)
        step_s = float(np.mean(np.diff(t_s))) if len(t_s) > 1 else t_s[0] - self._last_s
        decay = np.exp(-self.p["corner_rad_s"] * step_s)
        mean_decay = 0.5 * (1.0 + decay)
        output, _ = lfilter([mean_decay], [1.0, -decay], rise, axis=0, zi=decay * self._output[None])
        self._start, self._input, self._last_s = start, wrench[-1].copy(), float(t_s[-1])
        self._output = output[-1]
        return output + start
