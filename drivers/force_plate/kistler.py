"""A Kistler four-pillar plate: eight piezo channels to one wrench, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

CHANNELS = ("fx12", "fx34", "fy14", "fy23", "fz1", "fz2", "fz3", "fz4")


@dataclass(frozen=True)
class KistlerGeometry:
    """Where the pillars stand (Kistler 9281 by default).

    Attributes:
        a_m: half the distance between the pillars along x.
        b_m: half the distance between the pillars along y.
        az0_m: height of the top plate above the sensors' origin, negative for z pointing down.

    Source: Kistler, multicomponent force plate manuals, table of calculated parameters.
    """

    a_m: float = 0.120
    b_m: float = 0.200
    az0_m: float = -0.048

    def wrench(self, channels: Sequence[float]) -> tuple[float, ...]:
        """Return force and torque about the top plate's centre.

        Args:
            channels: fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4 [N].

        Returns:
            Fx, Fy, Fz [N], Mx, My, Mz [N.m] in the plate's own axes.
        """
        fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4 = channels
        force_x, force_y = fx12 + fx34, fy14 + fy23
        moment_x = self.b_m * (fz1 + fz2 - fz3 - fz4)
        moment_y = self.a_m * (-fz1 + fz2 + fz3 - fz4)
        moment_z = self.b_m * (-fx12 + fx34) + self.a_m * (fy14 - fy23)
        return (
            force_x,
            force_y,
            fz1 + fz2 + fz3 + fz4,
            moment_x + force_y * self.az0_m,
            moment_y - force_x * self.az0_m,
            moment_z,
        )

    def channels(self, wrench: Sequence[float]) -> tuple[float, ...]:
        """Return the smallest eight channel forces that make up ``wrench`` (the inverse of ``wrench``)."""
        force_x, force_y, force_z, top_x, top_y, moment_z = wrench
        along_y = (top_x - force_y * self.az0_m) / self.b_m
        along_x = (top_y + force_x * self.az0_m) / self.a_m
        # Mz is shared so that the squares of the four horizontal differences are least.
        twist = moment_z / (self.a_m**2 + self.b_m**2)
        return (
            (force_x - self.b_m * twist) / 2,
            (force_x + self.b_m * twist) / 2,
            (force_y + self.a_m * twist) / 2,
            (force_y - self.a_m * twist) / 2,
            (force_z + along_y - along_x) / 4,
            (force_z + along_y + along_x) / 4,
            (force_z - along_y + along_x) / 4,
            (force_z - along_y - along_x) / 4,
        )
