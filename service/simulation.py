"""A model's own version of a recording: the same topics at the same instants, to be laid side by side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from daq.recording import Recording, Stream
from identify.robot import WRENCH_CHANNELS
from identify.simulation import FullModel, Simulated, simulate
from service.datasets import dataset_of, open_recording
from service.errors import EstimateError, LogError
from service.estimate_reading import Estimate, read_estimate
from service.full_model import full_model
from service.robots import load_robot


@dataclass(frozen=True)
class Simulation:
    """A simulated recording.

    Attributes:
        recording: what the model says the sensors would have shown.
        like: the recording it follows.
        difference: RMS of recording less simulation, by channel [N.m or N].
        level: RMS of the recording about its mean, likewise.
        effects: names of the effects that went in.
        notes: what the reader must know.
    """

    recording: Recording
    like: Recording
    difference: dict[str, float]
    level: dict[str, float]
    effects: tuple[str, ...]
    notes: tuple[str, ...]


def simulate_log(robot: str, model_path: str | Path, like_path: str | Path) -> Simulation:
    """Run a model along a recording.

    Args:
        robot: preset name or path of the robot file the model must belong to.
        model_path: ``estimate.json`` or ``diagnosis.json``.
        like_path: the recording.

    Returns:
        The simulated recording.

    Raises:
        EstimateError: the model belongs to another robot.
        LogError: the recording has nothing that the model predicts.
    """
    estimate = read_estimate(model_path)
    notes = _same_robot(estimate, robot)
    like = open_recording(like_path)
    full = full_model(estimate)
    data = dataset_of(like, estimate.loaded)
    found = simulate(full, data)
    if found.torque is None and found.wrench is None:
        raise LogError(
            f"{like.source} has no channel that the {estimate.model.kind} model of {model_path} predicts; "
            "take a recording with currents, efforts or a wrench, or a model of another kind."
        )
    notes += _left_out(like, found, estimate)
    made = _recording(like, estimate, full, found)
    difference, level = _differences(like, made, found, full, estimate)
    return Simulation(
        made, like, difference, level, tuple(item.effect.name for item in full.effects), tuple(notes)
    )


def _same_robot(estimate: Estimate, robot: str) -> list[str]:
    loaded = load_robot(robot)
    if loaded.robot.joint_names != estimate.loaded.robot.joint_names or loaded.name != estimate.loaded.name:
        raise EstimateError(
            f"{estimate.source} is a model of robot '{estimate.loaded.name}' with joints {', '.join(estimate.loaded.robot.joint_names)}, "
            f"but {robot} is robot '{loaded.name}'; name the robot that was identified."
        )
    if loaded.model_hash != estimate.loaded.model_hash:
        return [
            f"The description of '{loaded.name}' has changed since {estimate.source} was made; the description inside the model is used."
        ]
    return []


def _left_out(like: Recording, found: Simulated, estimate: Estimate) -> list[str]:
    notes = []
    if found.torque is None and (like.motor_currents is not None or "effort" in like.joint_states.data):
        notes.append(
            f"The {estimate.model.kind} model says nothing of the drives: their currents and efforts are left out."
        )
    if found.wrench is None and like.wrench is not None:
        notes.append(f"The {estimate.model.kind} model says nothing of the plate: its wrench is left out.")
    return notes


def _joint_states(like: Recording, estimate: Estimate, found: Simulated, full: FullModel) -> Stream:
    states, names = like.joint_states, estimate.loaded.robot.joint_names
    t_s = (states.stamp_ns - states.stamp_ns[0]) * 1e-9
    q, qd, _ = found.motion.at(np.clip(t_s, found.motion.t_s[0], found.motion.t_s[-1]))
    data = {"position": q.T}
    if "velocity" in states.data:
        data["velocity"] = qd.T
    if "effort" in states.data and found.torque is not None:
        torque = found.torque
        if torque.shape[1] != len(t_s):  # predicted at the instants of the currents
            source = (
                (like.motor_currents.stamp_ns - states.stamp_ns[0]) * 1e-9
                if like.motor_currents is not None
                else t_s
            )
            torque = np.stack([np.interp(t_s, source, row) for row in torque])
        data["effort"] = torque.T
    return replace(states, names=names, data=data)


def _currents(stream: Stream, estimate: Estimate, torque: np.ndarray, full: FullModel) -> Stream:
    joints = estimate.loaded.robot.joints
    per_amp = np.array([(j.drive.torque_constant or 1.0) * j.drive.gear_ratio for j in joints]) / full.scale
    return replace(
        stream, names=estimate.loaded.robot.joint_names, data={"current": (torque / per_amp[:, None]).T}
    )


def _recording(like: Recording, estimate: Estimate, full: FullModel, found: Simulated) -> Recording:
    currents = None
    if found.torque is not None and like.motor_currents is not None:
        currents = _currents(like.motor_currents, estimate, found.torque, full)
    wrench = None
    if found.wrench is not None and like.wrench is not None:
        wrench = replace(like.wrench, data={"force": found.wrench[:3].T, "torque": found.wrench[3:].T})
    run = like.metadata.get("run_id", "run")
    metadata = {
        **like.metadata,
        "schema_version": like.metadata.get("schema_version", "1"),
        "robot": estimate.loaded.name,
        "run_id": f"{run}-simulated",
        "simulated": "true",
        "simulated_like": run,
        "simulated_like_sha256": like.sha256,
        "simulated_with": Path(estimate.source).name,
    }
    return Recording(
        f"simulation of {like.source} with {estimate.source}",
        _joint_states(like, estimate, found, full),
        currents,
        wrench,
        like.setpoints,
        metadata,
        _attachments(like, estimate),
        "",
        (),
    )


def _attachments(like: Recording, estimate: Estimate) -> dict[str, bytes]:
    files = {name: data for name, data in like.attachments.items() if name == "excitation.json"}
    files["robot.toml"] = estimate.loaded.toml_text.encode()
    files[Path(estimate.loaded.file.urdf).name] = estimate.loaded.urdf_text.encode()
    return files


def _differences(
    like: Recording, made: Recording, found: Simulated, full: FullModel, estimate: Estimate
) -> tuple[dict[str, float], dict[str, float]]:
    """RMS of recording less simulation and of the recording itself, by channel, away from gaps and ends."""
    difference, level = {}, {}
    for name, stream, recorded, simulated in _pairs(like, made, full, estimate):
        t_s = (stream.stamp_ns - like.joint_states.stamp_ns[0]) * 1e-9
        sure = found.motion.valid_at(t_s)
        if not sure.any():
            continue
        difference[name] = float(np.sqrt(np.mean((recorded - simulated)[sure] ** 2)))
        level[name] = float(np.std(recorded[sure]))
    return difference, level


def _pairs(
    like: Recording, made: Recording, full: FullModel, estimate: Estimate
) -> Iterator[tuple[str, Stream, np.ndarray, np.ndarray]]:
    """Channels of both recordings in N.m and N."""
    for k, joint in enumerate(estimate.loaded.robot.joints):
        for stream, other, key in (
            (like.motor_currents, made.motor_currents, "current"),
            (like.joint_states, made.joint_states, "effort"),
        ):
            if stream is None or other is None or key not in other.data:
                continue
            factor = (joint.drive.torque_constant or 1.0) * joint.drive.gear_ratio / full.scale[k]
            factor = factor if key == "current" else 1.0
            recorded = stream.data[key][:, stream.names.index(joint.name)]
            yield joint.name, stream, recorded * factor, other.data[key][:, k] * factor
            break
    if made.wrench is not None and like.wrench is not None:
        for k, channel in enumerate(WRENCH_CHANNELS):
            key = "force" if k < 3 else "torque"
            yield channel, like.wrench, like.wrench.data[key][:, k % 3], made.wrench.data[key][:, k % 3]
