"""Only a recording of the same robot, load and plate may prove a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from identify.dataset import Dataset
from identify.diagnosis.findings import Diagnosis
from identify.diagnosis.mismatch import Mismatch, mismatches
from identify.fit import Fit
from identify.robot import WRENCH_CHANNELS


def proven_only(found: Diagnosis, fit: Fit, other: Dataset | None) -> tuple[Diagnosis, tuple[Mismatch, ...]]:
    """Take out of a diagnosis what its held-out recording cannot prove.

    Args:
        found: the diagnosis.
        fit: its baseline.
        other: the held-out recording, or None.

    Returns:
        The diagnosis, and what is wrong with the recording.
    """
    if other is None or found.held_out is None:
        return found, ()
    strange = mismatches(fit, found.held_out, other)
    if not strange:
        return found, ()
    if strange[0].kind == "plate_moved":
        kept = {c: gain for c, gain in found.held_out.channels.items() if c not in WRENCH_CHANNELS}
        return replace(found, held_out=replace(found.held_out, channels=kept) if kept else None), strange
    return replace(found, held_out=None), strange
