"""The synthetic logs with something changed: added physics, another load, a moved plate, clipped channels."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from identify.inertia import PARAMETERS
from tests.service import synthetic_logs as logs

DRIVE = np.array([94.147 * 0.215, 103.235 * 0.215, 51.441 * 0.155])  # joint torque per ampere [N.m/A]


def _seconds(stream):
    return (stream.stamp_ns - logs.START_NS) * 1e-9


def motion(which=None):
    """Position, speed, acceleration of a log's truth as functions of time."""
    return logs.clean(**(which or {})).motion


def with_torque(recording, torque_of, **which):
    """Add torques (n, N), a function of q, qd, qdd, to the drives."""
    t = _seconds(recording.motor_currents)
    extra = torque_of(*motion(which)(t)) / DRIVE[:, None]
    current = recording.motor_currents.data["current"] + extra.T
    return replace(recording, motor_currents=logs.changed(recording.motor_currents, current=current))


def sticking(size_nm=8.0, speed=0.06):
    """Stribeck friction in joint 2."""

    def torque(q, qd, qdd):
        extra = np.zeros_like(q)
        extra[1] = size_nm * np.exp(-((qd[1] / speed) ** 2)) * np.sign(qd[1])
        return extra

    return torque


def with_scaled_current(recording, factors):
    """Currents times one factor a joint: a torque constant over the true one."""
    current = recording.motor_currents.data["current"] * np.asarray(factors)
    return replace(recording, motor_currents=logs.changed(recording.motor_currents, current=current))


def with_payload(recording, mass_kg=3.0, place_m=(0.05, 0.0, 0.3), **which):
    """A point mass at the last link, felt by drives and plate."""
    truth = logs.clean(**which)
    x, y, z = place_m
    second = np.array([y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y])
    body = mass_kg * np.concatenate([[1.0, x, y, z], second])
    link = truth.model.robot.link_names[-1]
    names = [f"{link}.{name}" for name in PARAMETERS]
    change = np.array([[p.definition.get(n, 0.0) for n in names] for p in truth.model.parameters]) @ body
    t, tp = _seconds(recording.motor_currents), _seconds(recording.wrench)
    torque = np.tensordot(truth.model.drive_rows(*truth.motion(t)).columns, change, axes=([1], [0]))
    wrench = np.tensordot(truth.model.wrench_rows(*truth.motion(tp)).columns, change, axes=([1], [0])).T
    current = recording.motor_currents.data["current"] + (torque / DRIVE[:, None]).T
    force, moment = (recording.wrench.data[key] for key in ("force", "torque"))
    return replace(
        recording,
        motor_currents=logs.changed(recording.motor_currents, current=current),
        wrench=logs.changed(recording.wrench, force=force + wrench[:, :3], torque=moment + wrench[:, 3:]),
    )


def with_moved_plate(recording, yaw_deg=10.0, shift_m=(0.03, -0.02, 0.0)):
    """The same wrench as a plate turned and shifted under the robot would report it."""
    turn = Rotation.from_euler("z", yaw_deg, degrees=True)
    force = turn.apply(recording.wrench.data["force"])
    torque = turn.apply(recording.wrench.data["torque"]) - np.cross(np.array(shift_m), force)
    return replace(recording, wrench=logs.changed(recording.wrench, force=force, torque=torque))


def with_clipped_current(recording, joint=1, share=0.04):
    """One drive's current clipped at the end of its range for a share of the run."""
    current = recording.motor_currents.data["current"].copy()
    limit = np.quantile(np.abs(current[:, joint]), 1.0 - share)
    current[:, joint] = np.clip(current[:, joint], -limit, limit)
    return replace(recording, motor_currents=logs.changed(recording.motor_currents, current=current)), limit


def as_effort(recording):
    """The same log with joint efforts in the joint states instead of currents, and no plate."""
    states, currents = recording.joint_states, recording.motor_currents
    effort = currents.data["current"] * DRIVE
    states = replace(states, data={**states.data, "effort": effort})
    return replace(recording, joint_states=states, motor_currents=None, wrench=None)


VALIDATION = {"kind": "validation", "fundamental_hz": None, "periods": None, "harmonics": None}
OTHER_MOTION = {"motion_seed": 7}
