"""From the drive's counts to joint-side SI units and back."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

_POSITION_INVERTED = 1 << 7  # bits of 607Eh
_VELOCITY_INVERTED = 1 << 6


@dataclass(frozen=True)
class DriveScaling:
    """What the drive says about its own numbers, read at boot and kept in the log.

    Args:
        rated_current_ma: 6075h [mA].
        rated_torque_mnm: 6076h [mN.m].
        encoder_counts: 608Fh:1 per `encoder_revolutions` 608Fh:2.
        gear_motor: 6091h:1 motor revolutions per `gear_shaft` 6091h:2.
        feed: 6092h:1 position units per `feed_shaft` 6092h:2; None where the drive has no such object
            (one shaft revolution then counts one encoder revolution).
        polarity: 607Eh.
    """

    rated_current_ma: int
    rated_torque_mnm: int
    encoder_counts: int
    encoder_revolutions: int
    gear_motor: int
    gear_shaft: int
    polarity: int
    feed: int | None = None
    feed_shaft: int | None = None

    @property
    def counts_per_shaft_revolution(self) -> float:
        """Position units in one revolution of the shaft that 6091h speaks of."""
        if self.feed and self.feed_shaft:
            return self.feed / self.feed_shaft
        return self.encoder_counts / self.encoder_revolutions

    def record(self) -> dict[str, int | None]:
        """The raw numbers, for the log."""
        return asdict(self)


@dataclass(frozen=True)
class AxisUnits:
    """Factors between raw numbers and SI units at one joint; one sense of rotation for all three.

    The polarity object turns the sign of positions (bit 7) and velocities (bit 6) but not of the current
    in most drives; it is undone here, so that position, velocity and current share the motor's own sense.
    """

    rad_per_count: float
    rad_s_per_unit: float
    ampere_per_unit: float
    rated_torque_nm: float

    def position_rad(self, counts: int) -> float:
        """Joint angle [rad] of a position in counts."""
        return counts * self.rad_per_count

    def counts(self, position_rad: float) -> int:
        """Nearest position in counts to a joint angle [rad]."""
        return round(position_rad / self.rad_per_count)

    def velocity_rad_s(self, raw: int) -> float:
        """Joint speed [rad/s] of 606Ch."""
        return raw * self.rad_s_per_unit

    def current_a(self, raw: int) -> float:
        """Motor current [A] of 6078h (per mille of the rated current)."""
        return raw * self.ampere_per_unit

    def torque_nm(self, raw: int) -> float:
        """Motor torque [N.m] of 6077h (per mille of the rated torque)."""
        return raw * 1e-3 * self.rated_torque_nm


def axis_units(
    scaling: DriveScaling,
    gear_ratio: float,
    direction: int = 1,
    velocity_in_rpm: bool = False,
    current_follows_polarity: bool = False,
) -> AxisUnits:
    """Factors of one axis.

    Args:
        scaling: the drive's own numbers.
        gear_ratio: motor revolutions per joint revolution.
        direction: +1 when the motor's positive sense is the joint's, else -1.
        velocity_in_rpm: 606Ch in motor revolutions per minute instead of position units per second.
        current_follows_polarity: the drive turns the sign of 6078h with bit 7 of 607Eh as well.

    Source:
        CiA 402-2, position = internal position * feed constant / (encoder resolution * gear ratio).
    """
    drive_gear = scaling.gear_motor / scaling.gear_shaft
    rad = math.tau * drive_gear / (scaling.counts_per_shaft_revolution * gear_ratio)
    position_sign = direction * (-1 if scaling.polarity & _POSITION_INVERTED else 1)
    velocity_sign = direction * (-1 if scaling.polarity & _VELOCITY_INVERTED else 1)
    current_sign = position_sign if current_follows_polarity else direction
    speed = math.tau / 60.0 / gear_ratio if velocity_in_rpm else rad
    return AxisUnits(
        rad_per_count=position_sign * rad,
        rad_s_per_unit=velocity_sign * speed,
        ampere_per_unit=current_sign * scaling.rated_current_ma * 1e-6,
        rated_torque_nm=current_sign * scaling.rated_torque_mnm * 1e-3,
    )
