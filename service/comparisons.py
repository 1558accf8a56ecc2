"""Estimates of a robot against each other: two at a time, and over all its nights."""

from __future__ import annotations

from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.config import NightlySection
from service.nightly.levels import shift_level, trend_level
from service.nightly.shift import Shift, compare, night_scatter
from service.nightly.trend import Trend, TrendRule, torque_constant_trends
from service.nightly.unknowns import unknowns_of
from service.refusals import NotFound, Unusable
from service.store.results import Estimate, Night

_SCATTER_NIGHTS = 60  # recent enough to speak of the robot as it is
_DAY_S = 86_400.0


def find_estimate(session: Session, estimate_id: str) -> Estimate:
    """Find an estimate.

    Raises:
        NotFound: no such identifier.
    """
    row = session.get(Estimate, estimate_id)
    if row is None:
        raise NotFound(f"There is no estimate {estimate_id}", "list the estimates for their identifiers")
    return row


def compare_estimates(
    session: Session, first: str, second: str, level: float | None, settings: NightlySection
) -> Shift:
    """Compare two estimates of one robot, with the scatter of its nights.

    Raises:
        NotFound: no such estimate.
        Unusable: they are of different robots.
    """
    a, b = find_estimate(session, first), find_estimate(session, second)
    if a.robot_serial != b.robot_serial:
        raise Unusable("The estimates are of different robots", "compare two of the same robot")
    used = shift_level(settings.false_alarms_per_year) if level is None else level
    nights = [
        unknowns_of(row.content)
        for row in _night_estimates(session, a.robot_serial, _SCATTER_NIGHTS)
        if row.id != second
    ]
    return compare(unknowns_of(a.content), unknowns_of(b.content), used, night_scatter(nights, used))


def torque_constant_history(session: Session, serial: str, settings: NightlySection) -> dict[str, Any]:
    """Torque constants of a robot's estimates, oldest first, and their trends.

    Args:
        session: a transaction.
        serial: the robot.
        settings: level, size and window of an alarm.

    Returns:
        ``points`` of every estimate, ``trends`` over the nights (without nights, over all estimates).
    """
    newest = (
        select(Estimate)
        .where(Estimate.robot_serial == serial)
        .order_by(Estimate.id.desc())
        .limit(settings.trend_nights)
    )
    everything = list(reversed(session.scalars(newest).all()))
    nights = _night_estimates(session, serial, settings.trend_nights) or everything
    points = [
        {
            "estimate_id": row.id,
            "at": row.created_at.isoformat(),
            "torque_constants": row.content["torque_constants"],
        }
        for row in everything
    ]
    return {"points": points, "trends": [trend.to_json() for trend in trends_of(nights, settings)]}


def trends_of(estimates: list[Estimate], settings: NightlySection) -> list[Trend]:
    """Trends of the torque constants of estimates, oldest first."""
    series = [(row.created_at.timestamp() / _DAY_S, row.content["torque_constants"]) for row in estimates]
    joints = max((len(constants) for _, constants in series), default=1)
    level = trend_level(settings.false_alarms_per_year, joints)
    return torque_constant_trends(
        series, TrendRule(level, settings.least_trend_percent_per_year, settings.trend_nights)
    )


def _night_estimates(session: Session, serial: str, most: int) -> list[Estimate]:
    wanted = (
        select(Estimate).join(Night, Night.estimate_id == Estimate.id).where(Night.robot_serial == serial)
    )
    return list(reversed(session.scalars(wanted.order_by(Night.id.desc()).limit(most)).all()))
