"""The quick stop ramp: constant deceleration to rest."""

from __future__ import annotations


class StopRamp:
    """A set point that slows down by itself.

    Args:
        position_rad: where it starts [rad].
        velocity_rad_s: how fast [rad/s].
        deceleration_rad_s2: 6085h in joint units [rad/s2].
    """

    def __init__(self, position_rad: float, velocity_rad_s: float, deceleration_rad_s2: float) -> None:
        self._position_rad = position_rad
        self._velocity_rad_s = velocity_rad_s
        self._deceleration = deceleration_rad_s2

    @property
    def at_rest(self) -> bool:
        """Whether the ramp has ended."""
        return self._velocity_rad_s == 0.0

    def advance(self, step_s: float) -> float:
        """The set point [rad] after `step_s` more seconds."""
        change = self._deceleration * step_s
        before = self._velocity_rad_s
        if abs(before) <= change:
            self._velocity_rad_s = 0.0
        else:
            self._velocity_rad_s = before - change if before > 0 else before + change
        self._position_rad += 0.5 * (before + self._velocity_rad_s) * step_s
        return self._position_rad
