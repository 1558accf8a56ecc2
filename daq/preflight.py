"""Named checks before anything moves, each with its remedy; and the dry run: peaks, duration, size."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from daq.errors import HardwareError, UsageError
from daq.limits import Limits, Peak, peaks
from daq.mcap_writer import PARTIAL_SUFFIX
from daq.trajectory import Plan

_BYTES_FIXED, _BYTES_AXIS, _BYTES_PLATE = 260, 42, 60
"""Compressed bytes a cycle in a log: headers, an axis in four streams, a plate sample; rounded up."""

_SPARE = 2.0
"""Free space demanded per byte expected."""


@dataclass(frozen=True)
class Check:
    """One named check.

    Attributes:
        name: stable, for programs.
        is_passed: whether it holds.
        sentence: what was found.
        remedy: what to do where it does not hold.
        kind: error class raised for it: ``use`` or ``hardware``.
    """

    name: str
    is_passed: bool
    sentence: str
    remedy: str = ""
    kind: str = "use"

    @property
    def complaint(self) -> str:
        """Finding and remedy in one sentence."""
        return f"{self.sentence.rstrip('.')}; {self.remedy}".rstrip("; ") + "."


def require(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return the checks if all hold.

    Raises:
        UsageError, HardwareError: the first that does not, with its remedy.
    """
    found = tuple(checks)
    for check in found:
        if not check.is_passed:
            raise (HardwareError if check.kind == "hardware" else UsageError)(check.complaint)
    return found


@dataclass(frozen=True)
class DryRun:
    """What a run would do.

    Attributes:
        peaks: the largest use of every limit.
        duration_s: of the motion.
        cycles: bus cycles.
        size_bytes: of the log, roughly.
    """

    peaks: tuple[Peak, ...]
    duration_s: float
    cycles: int
    size_bytes: int


def dry_run(plan: Plan, limits: Limits, has_plate: bool) -> DryRun:
    """Work out a run without moving anything."""
    size = expected_bytes(plan, has_plate)
    return DryRun(peaks(limits, plan.q, plan.qd, plan.qdd), plan.duration_s, plan.cycles, size)


def expected_bytes(plan: Plan, has_plate: bool) -> int:
    """Size of the log, to be reckoned with."""
    return plan.cycles * (_BYTES_FIXED + _BYTES_AXIS * len(plan.joints) + _BYTES_PLATE * has_plate)


def motion_checks(plan: Plan, limits: Limits) -> tuple[Check, ...]:
    """Every limit of every joint against the commanded motion."""
    return tuple(
        Check(
            f"{peak.quantity}:{peak.joint}", peak.is_kept, f"The motion is refused: {peak.sentence}",
            "design the excitation within the limits of the robot file and the URDF",
        )
        for peak in peaks(limits, plan.q, plan.qd, plan.qdd)
    )


def output_checks(path: Path, size_bytes: int) -> tuple[Check, ...]:
    """Whether the log can be written where it is wanted."""
    folder = path.parent if str(path.parent) else Path(".")
    if not folder.is_dir():
        return (Check("folder", False, f"The folder {folder} of the log does not exist", "create it"),)
    partial = path.with_name(path.name + PARTIAL_SUFFIX)
    free = shutil.disk_usage(folder).free
    return (
        Check("folder", os.access(folder, os.W_OK), f"The folder {folder} may not be written to",
              "choose another or change its permissions"),
        Check("path", not path.is_dir(), f"{path} is a folder", "give a file name inside it"),
        Check("unfinished", not partial.exists(), f"{partial} is an unfinished log of an earlier run",
              f"save it with residuum recover {partial} -o whole.mcap and delete it"),
        Check("disk", free >= _SPARE * size_bytes,
              f"{folder} has {free / 1e6:.0f} MB free and the log may take {size_bytes / 1e6:.0f} MB",
              "free some space", "hardware"),
    )
