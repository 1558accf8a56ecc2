"""A robot becomes an excitation file: search spread over processes, content hashed, written whole."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from identify.excitation.companions import Moves
from identify.excitation.design import Design, DesignOptions, design
from identify.excitation.expected import Expected
from identify.excitation.search import Progress
from identify.excitation.series import FourierSeries
from service.errors import UsageError
from service.files import read_json, to_json, write_text
from service.robots import LoadedRobot

SCHEMA_VERSION = 1
_DIGITS = 6  # significant digits of stated qualities: the last ones depend on the processor


@contextmanager
def worker_processes(jobs: int) -> Iterator[Executor]:
    """Start worker processes that compute on one thread each and leave Ctrl-C to the parent.

    Args:
        jobs: number of processes.

    Yields:
        The executor.
    """
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # read by the workers at their start: same sums, same bytes
    context = multiprocessing.get_context("spawn")  # no half-copied threads or locks
    executor = ProcessPoolExecutor(jobs, mp_context=context, initializer=_leave_interrupts_to_parent)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _leave_interrupts_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def design_excitation(
    loaded: LoadedRobot,
    options: DesignOptions,
    jobs: int = 2,
    progress: Callable[[Progress], None] | None = None,
) -> Design:
    """Design an excitation for a robot.

    Args:
        loaded: the robot with its file.
        options: what is wanted; noise levels of the robot file fill in what it leaves open.
        jobs: number of worker processes; the result does not depend on it. 0 computes here.
        progress: told the best value so far.

    Returns:
        The design.
    """
    if jobs == 0:
        return design(loaded.robot, options, None, progress)
    with worker_processes(jobs) as executor:
        return design(loaded.robot, options, executor, progress)


def content_hash(content: dict[str, Any]) -> str:
    """Digest of a file's content: sha256 over JSON with sorted keys and no spaces, without the hash."""
    rest = {key: value for key, value in content.items() if key != "hash"}
    canonical = json.dumps(rest, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def _number(value: float) -> float | None:
    """Finite numbers to the digits that mean something; None for infinity."""
    return float(f"{float(value):.{_DIGITS}g}") if np.isfinite(value) else None


def _quality(expected: Expected) -> dict[str, Any]:
    return {
        "std": {name: _number(std) for name, std in expected.std.items()},
        "log_det_covariance": _number(expected.log_det_covariance),
        "condition_number": _number(expected.condition_number),
        "smallest_detectable": {name: _number(size) for name, size in expected.smallest_detectable.items()},
    }


def _limits(result: Design) -> dict[str, Any]:
    limits, peaks = result.limits, result.peaks
    joints = {
        name: {
            "position": [_number(limits.lower[k]), _number(limits.upper[k])],
            "velocity": _number(limits.velocity[k]),
            "acceleration": _number(limits.acceleration[k]),
            "effort": _number(limits.effort[k]),
            "reached": {
                "position": [_number(peaks.lower[k]), _number(peaks.upper[k])],
                "velocity": _number(peaks.velocity[k]),
                "acceleration": _number(peaks.acceleration[k]),
                "effort": _number(peaks.effort[k]),
            },
        }
        for k, name in enumerate(result.joints)
    }
    ramp = {"kind": "phase", "blend": "quintic", "duration_s": result.ramp.duration_s}
    clearance = {"least_m": _number(peaks.clearance_m), "margin_m": result.options.workspace.margin_m}
    return {"share": result.options.share, "joints": joints, "ramp": ramp, "clearance": clearance}


def excitation_content(result: Design, series: FourierSeries | None = None) -> dict[str, Any]:
    """Give the content of ``excitation.json``.

    Args:
        result: the design.
        series: another motion to write in its place, such as the reversed twin.

    Returns:
        A self-contained JSON object with its hash.
    """
    motion = series or result.series
    options = result.options
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "robot": result.robot,
        "joints": list(result.joints),
        "fundamental_hz": motion.fundamental_hz,
        "harmonics": motion.harmonics,
        "sample_rate_hz": options.rate_hz,
        "offset": motion.offset.tolist(),
        "cosine": motion.cosine.tolist(),
        "sine": motion.sine.tolist(),
        "criterion": options.criterion,
        "limits": _limits(result),
        "expected": {
            "model": result.model,
            "periods": options.periods,
            "seed": options.seed,
            **_quality(result.expected),
            "reference": {"source": result.reference.source, "sentence": result.reference.sentence},
            "noise": result.noise.sentence,
            "search": "interrupted" if result.interrupted else "finished",
        },
    }
    return content | {"hash": content_hash(content)}


def moves_content(result: Design, moves: Moves, kind: str) -> dict[str, Any]:
    """Give the content of a file of moves from rest to rest (validation, static poses, sweeps)."""
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "kind": kind,
        "robot": result.robot,
        "joints": list(result.joints),
        "sample_rate_hz": result.options.rate_hz,
        "points": moves.points.tolist(),
        "duration_s": moves.duration_s.tolist(),
        "blend_s": moves.blend_s.tolist(),
        "pause_s": moves.pause_s,
    }
    return content | {"hash": content_hash(content)}


def write_content(path: Path | str, content: dict[str, Any], what: str) -> None:
    """Write a JSON file whole or not at all."""
    write_text(path, to_json(content), what)


def read_series(path: Path | str) -> FourierSeries:
    """Read the motion of an excitation file.

    Args:
        path: the file.

    Returns:
        The motion.

    Raises:
        UsageError: not an excitation file, or its content does not match its hash.
    """
    content = read_json(path, "the excitation")
    try:
        series = FourierSeries(
            float(content["fundamental_hz"]),
            np.array(content["offset"], dtype=float),
            np.array(content["cosine"], dtype=float),
            np.array(content["sine"], dtype=float),
        )
        shapes_agree = (
            series.cosine.shape == series.sine.shape == (len(series.offset), int(content["harmonics"]))
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"The excitation {path} lacks or garbles {error}; write it anew with residuum design."
        ) from error
    if not shapes_agree:
        raise UsageError(
            f"The excitation {path} has coefficients of differing shapes; write it anew with residuum design."
        )
    if "hash" in content and content["hash"] != content_hash(content):
        raise UsageError(
            f"The excitation {path} was changed after it was checked (its hash does not match); "
            "restore it, or write it anew with residuum design."
        )
    return series
