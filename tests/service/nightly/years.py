"""Years of nights of synthetic estimates: known truth and covariance, friction that follows the weather."""

from dataclasses import dataclass

import numpy as np

from service.config import NightlySection
from service.nightly.levels import shift_level, trend_level
from service.nightly.policy import Evidence, decide
from service.nightly.shift import compare, night_scatter
from service.nightly.trend import TrendRule, torque_constant_trends
from service.nightly.unknowns import TORQUE_CONSTANTS, Unknowns

JOINTS = ("joint_1", "joint_2", "joint_3")
CONSTANTS = np.array([0.215, 0.215, 0.155])
RELATIVE_STD = np.array([0.0016, 0.0032, 0.0035])  # what a 16-period run of the reference robot gives
NAMES = tuple(f"inertia_{k}" for k in range(10)) + tuple(f"{j}.coulomb" for j in JOINTS)
NAMES += tuple(f"{j}.torque_constant" for j in JOINTS)
GROUPS = ("inertial",) * 10 + ("friction",) * 3 + (TORQUE_CONSTANTS,) * 3
TRUTH = np.concatenate([np.linspace(1.0, 20.0, 10), [12.0, 15.0, 6.0], CONSTANTS])
STD = np.concatenate([0.01 * TRUTH[:10], 0.01 * TRUTH[10:13], RELATIVE_STD * CONSTANTS])


@dataclass
class Year:
    """What a year's nights led to: the alarms by night, each kind and subject once while it lasts."""

    alarms: list


def covariance(rng):
    mix = rng.normal(size=(len(TRUTH), len(TRUTH))) * 0.3 + np.eye(len(TRUTH))
    full = mix @ mix.T
    scale = STD / np.sqrt(np.diag(full))
    return full * np.outer(scale, scale)


def nights(seed, loss_percent=0.0, begin=90, days=182, count=365, friction_scatter=0.04):
    """Estimates of a year; joint 2 loses `loss_percent` from night `begin` within `days`."""
    rng = np.random.default_rng(seed)
    shape = covariance(rng)
    root = np.linalg.cholesky(shape)
    for night in range(count):
        truth = TRUTH.copy()
        truth[10:13] *= 1 + friction_scatter * rng.normal()  # cold and warm nights
        truth[14] *= 1 - loss_percent / 100 * np.clip((night - begin) / days, 0, 1)
        yield Unknowns(NAMES, GROUPS, truth + root @ rng.normal(size=len(truth)), shape)


def live_through(estimates, settings=None, accept_at=30):
    """Run the nightly tests over a year: night `accept_at` is accepted, everything later compared with it."""
    settings = settings or NightlySection()
    level = shift_level(settings.false_alarms_per_year)
    rule = TrendRule(
        trend_level(settings.false_alarms_per_year, len(JOINTS)),
        settings.least_trend_percent_per_year,
        settings.trend_nights,
    )
    past, series, reference, found, lasting = [], [], None, [], set()
    for night, estimate in enumerate(estimates):
        shift = None
        if reference is not None:
            shift = compare(reference, estimate, level, night_scatter(past[-60:], level))
        past.append(estimate)
        constants = [
            {"joint": j, "value": v, "std": s}
            for j, v, s in zip(JOINTS, estimate.values[13:], estimate.std[13:], strict=True)
        ]
        series = [*series, (float(night), constants)]
        trends = tuple(torque_constant_trends(series, rule))
        decision = decide(Evidence(True, 1.0, "consistent", {}, shift, trends), settings)
        now = {(alarm.kind, alarm.subject) for alarm in decision.alarms}
        found += [(night, *alarm) for alarm in sorted(now - lasting)]
        lasting = now
        if night == accept_at:
            reference = estimate
    return Year(found)
