"""Torque constants over the nights: magnets that age lose a little every month."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

_DAYS_PER_YEAR = 365.25
_MOST_SIMILAR = 0.9  # beyond it a slope could never be told from slow wandering
_LEAST_NIGHTS = 8  # below this the scatter of the nights is not known well enough to test a slope


@dataclass(frozen=True)
class Trend:
    """A straight line through a torque constant's nights.

    Attributes:
        joint: its name.
        nights: used.
        percent_per_year: slope.
        std_percent_per_year: of the slope.
        p_value: chance of that slope if the constant stays.
        scatter: scatter of the nights over what their std explain; the std is widened by it above 1.
        is_alarm: significant at the level and large enough to matter.
        sentence: in words.
    """

    joint: str
    nights: int
    percent_per_year: float | None
    std_percent_per_year: float | None
    p_value: float | None
    scatter: float | None
    is_alarm: bool
    sentence: str

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True)
class TrendRule:
    """What counts as an alarm.

    Attributes:
        level: significance level of one test.
        least_percent_per_year: smaller slopes never alarm.
        nights: how many of the last nights are used.
    """

    level: float
    least_percent_per_year: float
    nights: int


def fit_trend(
    joint: str, days: Sequence[float], values: Sequence[float], std: Sequence[float], rule: TrendRule
) -> Trend:
    """Fit and test the slope of a torque constant by weighted least squares.

    Args:
        joint: its name.
        days: instants of the nights [d] (n,).
        values: torque constants [N.m/A] (n,).
        std: their standard deviations [N.m/A] (n,).
        rule: level and size of an alarm.

    Returns:
        The trend; without numbers when there are too few nights.
    """
    from scipy import special  # late: the server starts faster without it

    keep = slice(-rule.nights, None)
    t, y, s = (np.asarray(column, dtype=float)[keep] for column in (days, values, std))
    if len(t) < _LEAST_NIGHTS or np.ptp(t) == 0 or not np.all(s > 0):
        return Trend(
            joint, len(t), None, None, None, None, False, f"{joint}: too few nights for a trend ({len(t)})."
        )
    weight = 1.0 / s**2
    centre = np.average(t, weights=weight)
    spread = float(np.sum(weight * (t - centre) ** 2))
    mean = float(np.average(y, weights=weight))
    slope = float(np.sum(weight * (t - centre) * y)) / spread
    residual = (y - mean - slope * (t - centre)) / s
    scatter = float(np.sqrt(np.sum(residual**2) / (len(t) - 2)))
    slope_std = max(1.0, scatter) * _memory(residual) / np.sqrt(spread)
    p_value = float(2 * special.stdtr(len(t) - 2, -abs(slope) / slope_std))
    percent, percent_std = (100 * _DAYS_PER_YEAR * v / abs(mean) for v in (slope * np.sign(mean), slope_std))
    alarm = p_value < rule.level and abs(percent) >= rule.least_percent_per_year
    return Trend(
        joint, len(t), float(percent), float(percent_std), p_value, scatter, bool(alarm),
        _sentence(joint, float(percent), float(percent_std), len(t), bool(alarm)),
    )  # fmt: skip


def _memory(residual: np.ndarray) -> float:
    """How much nights that resemble their neighbours widen a slope's std (first-order autoregression)."""
    total = float(residual @ residual)
    similarity = float(residual[1:] @ residual[:-1]) / total if total else 0.0
    similarity = min(max(similarity, 0.0), _MOST_SIMILAR)
    return float(np.sqrt((1 + similarity) / (1 - similarity)))


def _sentence(joint: str, percent: float, percent_std: float, nights: int, alarm: bool) -> str:
    what = f"{percent:+.1f} ± {percent_std:.1f} % a year over {nights} nights"
    if not alarm:
        return f"{joint}: torque constant steady within {what}."
    cause = (
        "losing magnetisation (or its current sensor is drifting)"
        if percent < 0
        else "gaining: suspect the current sensor"
    )
    return f"{joint}: torque constant {what}: the motor is {cause}."


def torque_constant_trends(
    nights: Sequence[tuple[float, list[dict[str, Any]]]], rule: TrendRule
) -> list[Trend]:
    """Trends of every joint.

    Args:
        nights: instant [d] and ``torque_constants`` of an estimate, oldest first.
        rule: level and size of an alarm.

    Returns:
        One trend a joint that has a constant with a std.
    """
    series: dict[str, list[tuple[float, float, float]]] = {}
    for day, constants in nights:
        for constant in constants:
            if constant["value"] is not None and constant["std"]:
                series.setdefault(constant["joint"], []).append((day, constant["value"], constant["std"]))
    return [fit_trend(joint, *zip(*points, strict=True), rule) for joint, points in series.items()]
