"""Metrics in the text format of Prometheus, written by hand."""

from __future__ import annotations

import shutil
import threading
import time
from collections import Counter
from collections.abc import Iterator

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.calibrations import accepted
from service.leases import current_lease
from service.rest.lab import Lab
from service.store.assets import Recording, Robot
from service.store.base import now
from service.store.results import Estimate, Night
from service.store.work import Job


class Traffic:
    """Requests answered since the start."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.counts: Counter[tuple[str, int]] = Counter()
        self.seconds = 0.0

    def add(self, method: str, status: int, seconds: float) -> None:
        """Count a request."""
        with self._lock:
            self.counts[(method, status)] += 1
            self.seconds += seconds


def metrics_text(lab: Lab, traffic: Traffic) -> str:
    """Write every metric.

    Args:
        lab: the server's belongings.
        traffic: requests so far.

    Returns:
        The text.
    """
    with lab.database.read() as session:
        lines = [*_process(lab, traffic), *_work(session), *_robots(session)]
    return "\n".join(lines) + "\n"


def _head(name: str, kind: str, meaning: str) -> Iterator[str]:
    yield f"# HELP residuum_{name} {meaning}"
    yield f"# TYPE residuum_{name} {kind}"


def _process(lab: Lab, traffic: Traffic) -> Iterator[str]:
    yield from _head("up_seconds", "gauge", "Time since the start.")
    yield f"residuum_up_seconds {time.monotonic() - lab.started_s:.3f}"
    yield from _head("disk_free_bytes", "gauge", "Free space of the storage folder.")
    yield f"residuum_disk_free_bytes {shutil.disk_usage(lab.config.storage.folder).free}"
    yield from _head("requests_total", "counter", "Requests answered.")
    for (method, status), count in sorted(traffic.counts.items()):
        yield f'residuum_requests_total{{method="{method}",status="{status}"}} {count}'
    yield from _head("request_seconds_total", "counter", "Time spent on them.")
    yield f"residuum_request_seconds_total {traffic.seconds:.6f}"


def _work(session: Session) -> Iterator[str]:
    yield from _head("jobs", "gauge", "Jobs by kind and state.")
    for kind, state, count in session.execute(
        select(Job.kind, Job.state, func.count()).group_by(Job.kind, Job.state)
    ):
        yield f'residuum_jobs{{kind="{kind}",state="{state}"}} {count}'
    count, size = session.execute(
        select(func.count(), func.coalesce(func.sum(Recording.size_bytes), 0)).select_from(Recording)
    ).one()
    yield from _head("recordings", "gauge", "Stored recordings.")
    yield f"residuum_recordings {count}"
    yield from _head("recordings_bytes", "gauge", "Their size.")
    yield f"residuum_recordings_bytes {size}"


def _robots(session: Session) -> Iterator[str]:
    robots = session.scalars(select(Robot).order_by(Robot.serial)).all()
    yield from _head("robot_leased", "gauge", "1 while somebody has the robot.")
    for robot in robots:
        held = int(current_lease(session, robot.serial) is not None)
        yield f'residuum_robot_leased{{robot="{robot.serial}"}} {held}'
    yield from _head("torque_constant", "gauge", "Torque constant in force [N.m/A].")
    for robot in robots:
        yield from _constants(session, robot)
    yield from _head("night_age_seconds", "gauge", "Time since the last nightly recalibration, by outcome.")
    for robot in robots:
        last = session.scalars(
            select(Night).where(Night.robot_serial == robot.serial).order_by(Night.id.desc()).limit(1)
        ).first()
        if last is not None:
            age_s = (now() - last.created_at).total_seconds()
            yield f'residuum_night_age_seconds{{robot="{robot.serial}",outcome="{last.outcome}"}} {age_s:.0f}'


def _constants(session: Session, robot: Robot) -> Iterator[str]:
    calibration = accepted(session, robot.serial)
    if calibration is None:
        return
    for constant in session.get_one(Estimate, calibration.estimate_id).content["torque_constants"]:
        if constant["value"] is not None:
            joint = "".join(c for c in constant["joint"] if c not in '"\\\n')
            yield f'residuum_torque_constant{{robot="{robot.serial}",joint="{joint}"}} {constant["value"]!r}'
