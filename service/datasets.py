"""A recording becomes a data set: streams in the robot's joint order, on one time axis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq.checks import check_recording
from daq.log_reader import read_recording
from daq.recording import Recording, Stream
from identify.dataset import Dataset, RunFacts, Signal
from identify.filters import AntiAliasFilter
from service.errors import LogError
from service.robot_file import StreamFilter
from service.robots import LoadedRobot


def open_recording(path: str | Path) -> Recording:
    """Read a log and refuse one whose values or stamps cannot be trusted.

    Args:
        path: the log.

    Returns:
        The recording.

    Raises:
        daq.errors.DataError: not readable.
        LogError: readable, but with faults; names the first and counts the rest.
    """
    recording = read_recording(path)
    problems = check_recording(recording)
    if problems:
        more = f" ({len(problems) - 1} more such faults; see residuum inspect.)" if len(problems) > 1 else ""
        raise LogError(f"{path}: {problems[0]}{more}")
    return recording


def dataset_of(recording: Recording, loaded: LoadedRobot) -> Dataset:
    """Bring a recording into the form identification takes.

    Args:
        recording: the log.
        loaded: the robot it is to be understood with.

    Returns:
        The data set; time zero is the first joint sample.

    Raises:
        LogError: joints missing, metadata that make no sense.
    """
    states = recording.joint_states
    if len(states) < 2:
        raise LogError(f"{recording.source} holds {len(states)} joint samples; nothing can be identified from that.")
    start_ns = int(states.stamp_ns[0])
    names = loaded.robot.joint_names
    where = recording.source
    effort = _signal(states, "effort", names, start_ns, where) if "effort" in states.data else None
    currents = recording.motor_currents
    wrench = recording.wrench
    return Dataset(
        position=_signal(states, "position", names, start_ns, where),
        current=_signal(currents, "current", names, start_ns, where) if currents is not None and len(currents) else None,
        effort=effort,
        wrench=_wrench(wrench, start_ns) if wrench is not None and len(wrench) else None,
        facts=run_facts(recording.metadata, where),
        kind=recording.metadata.get("kind", ""),
        simulated=recording.metadata.get("simulated", "false").lower() == "true",
        source=where,
        filters=_filters(loaded),
    )


def _columns(stream: Stream, names: tuple[str, ...], where: str) -> list[int]:
    missing = [name for name in names if name not in stream.names]
    if missing:
        raise LogError(
            f"{where}: {stream.topic} lacks joint '{missing[0]}' of the robot file; it holds {', '.join(stream.names) or 'no names'}. "
            "Correct the names in the robot file, or import the log with a map."
        )
    return [stream.names.index(name) for name in names]


def _seconds(stream: Stream, start_ns: int) -> np.ndarray:
    return (stream.stamp_ns - start_ns) * 1e-9


def _signal(stream: Stream, key: str, names: tuple[str, ...], start_ns: int, where: str) -> Signal:
    values = stream.data[key][:, _columns(stream, names, where)]
    return Signal(_seconds(stream, start_ns), np.ascontiguousarray(values.T))


def _wrench(stream: Stream, start_ns: int) -> Signal:
    values = np.hstack([stream.data["force"], stream.data["torque"]])
    return Signal(_seconds(stream, start_ns), np.ascontiguousarray(values.T))


def run_facts(metadata: Mapping[str, str], where: str) -> RunFacts:
    """Read what the log says of its excitation.

    Args:
        metadata: the ``residuum.run`` record.
        where: for messages.

    Returns:
        The facts; None where the log says nothing.

    Raises:
        LogError: a value that is no number, or not positive.
    """
    return RunFacts(
        fundamental_hz=_number(metadata, "fundamental_hz", where, float),
        harmonics=_number(metadata, "harmonics", where, int),
        periods=_number(metadata, "periods", where, int),
        transient_periods=_number(metadata, "transient_periods", where, int, lowest=0),
    )


def _number(metadata: Mapping[str, str], key: str, where: str, kind: type, lowest: float | None = None):  # noqa: ANN202
    text = metadata.get(key, "")
    if not text:
        return None
    try:
        value = kind(float(text)) if kind is int else kind(text)
    except (ValueError, OverflowError):
        value = None
    if value is None or not np.isfinite(value) or (value <= 0 if lowest is None else value < lowest):
        raise LogError(f"{where}: its metadata say {key} = '{text}', which is no sensible number; correct the log or leave the key out.")
    return value


def _anti_alias(section: StreamFilter | None) -> AntiAliasFilter | None:
    if section is None:
        return None
    if section.kind == "delay":
        return AntiAliasFilter(delay_s=section.delay_s)
    return AntiAliasFilter(section.order, section.cutoff_hz or 1.0, section.delay_s)


def _filters(loaded: LoadedRobot) -> dict[str, AntiAliasFilter]:
    stated = loaded.file.filter
    pairs = (("position", stated.position), ("current", stated.current), ("wrench", stated.wrench))
    return {key: made for key, section in pairs if (made := _anti_alias(section)) is not None}
