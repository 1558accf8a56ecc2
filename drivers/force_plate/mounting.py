"""From the sensor's own axes and sign to the wrench that the plate exerts on the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.force_plate.errors import PlateSettingError


@dataclass(frozen=True)
class Mounting:
    """How a sensor sits under the robot.

    Attributes:
        rotation: 3 x 3, row by row: sensor axes to plate axes (z up).
        is_action: the sensor reports what the robot does to it; the plate's wrench is the opposite.
    """

    rotation: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    is_action: bool = False

    def __post_init__(self) -> None:
        matrix = np.array(self.rotation, dtype=float)
        if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6):
            raise PlateSettingError(
                f"The force plate's mounting rotation {self.rotation} is no rotation; give three "
                "orthogonal rows of length one."
            )

    def apply(self, wrenches: np.ndarray) -> np.ndarray:
        """Return the wrenches in the plate frame.

        Args:
            wrenches: (n, 6) or (6,) in the sensor's axes, N and N.m.

        Returns:
            Same shape; standing still, ``force.z = + m g``.
        """
        matrix = np.array(self.rotation) * (-1.0 if self.is_action else 1.0)
        shaped = np.asarray(wrenches, dtype=float)
        return (shaped.reshape(-1, 3) @ matrix.T).reshape(shaped.shape)
