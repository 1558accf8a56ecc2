"""A small lab in a database: robots, recordings, estimates made of plain values."""

import uuid

from service.jobs import queue_job
from service.registry import RobotEntry, register_robot
from service.robots import load_robot
from service.store.assets import Recording
from service.store.results import Estimate, Fit


def add_robot(session, serial="IR-1", simulated=False, unattended=False):
    entry = RobotEntry(serial, simulated, unattended)
    return register_robot(session, entry, load_robot("ir361"), "test")[0]


def add_recording(session, serial="IR-1", simulated=False):
    row = Recording(
        sha256=uuid.uuid4().hex * 2,
        label="run.mcap",
        size_bytes=3_000_000_000,
        robot_serial=serial,
        kind="excitation",
        simulated=simulated,
        facts={},
        created_by="test",
    )
    session.add(row)
    session.flush()
    return row


def add_estimate(session, serial="IR-1", simulated=False, content=None, model_hash=None):
    recording = add_recording(session, serial, simulated)
    job = queue_job(session, "fit", "-", serial, "test")
    fit = Fit(job_id=job.id, robot_serial=serial, recording_id=recording.id, options={})
    session.add(fit)
    session.flush()
    row = Estimate(
        fit_id=fit.id,
        robot_serial=serial,
        recording_id=recording.id,
        model_hash=model_hash or load_robot("ir361").model_hash,
        simulated=simulated,
        intervals_valid=True,
        content=content or {"torque_constants": []},
    )
    session.add(row)
    session.flush()
    return row
