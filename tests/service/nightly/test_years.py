"""Simulated years: a real loss is found soon, a healthy robot raises no alarm."""

from tests.service.nightly.years import live_through, nights


def test_three_percent_in_six_months_is_found_within_two_months_and_named():
    for seed in (1, 2):
        alarms = live_through(nights(seed, loss_percent=3.0)).alarms
        early = [alarm for alarm in alarms if alarm[0] < 90]
        found = [night for night, kind, subject in alarms if (kind, subject) == ("drift", "joint_2")]
        assert early == []
        assert found
        assert found[0] - 90 <= 60
        assert {subject for _, kind, subject in alarms if kind == "drift"} == {"joint_2"}


def test_healthy_years_with_cold_and_warm_nights_stay_quiet():
    alarms = [alarm for seed in range(10, 13) for alarm in live_through(nights(seed)).alarms]
    assert (
        len(alarms) <= 2
    )  # a budget of 0.1 a year: three or more in three years have a chance below 1 in 1000


def test_a_sudden_change_is_found_the_next_night():
    from dataclasses import replace

    estimates = list(nights(5, count=120))
    changed = [
        e if k < 100 else replace(e, values=e.values * ([1.0] * 3 + [1.12] + [1.0] * 12))
        for k, e in enumerate(estimates)
    ]
    alarms = live_through(changed).alarms
    assert alarms[0] == (100, "shift", "inertial")
