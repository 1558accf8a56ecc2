"""How the false alarms of a year are shared out among nights and tests."""

from __future__ import annotations

_NIGHTS_PER_YEAR = 365.25


def shift_level(false_alarms_per_year: float) -> float:
    """Significance level of one night's comparison: half of the year's budget, shared by its nights.

    Expected false alarms add up whatever their dependence, so that the year keeps its budget.
    """
    return 0.5 * false_alarms_per_year / _NIGHTS_PER_YEAR


def trend_level(false_alarms_per_year: float, joints: int) -> float:
    """Significance level of one joint's trend on one night: the other half, shared by nights and joints."""
    return 0.5 * false_alarms_per_year / _NIGHTS_PER_YEAR / max(joints, 1)
