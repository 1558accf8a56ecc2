"""Encoders that are all stamped late by the same time."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class EncoderTimeSkew(Effect):
    """Encoders that are all stamped late by the same time."""

    name = "encoder_time_skew"
    where = "S"
    place = "none"
    size = "skew_s"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"skew_s": Range(3e-4, 6e-3, "s")}

    def instants(self, stream: str, t_s: np.ndarray) -> np.ndarray:
        """True instants of the samples of a stream."""
        return t_s - self.p["skew_s"] if stream == "encoder" else t_s
