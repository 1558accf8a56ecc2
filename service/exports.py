"""Export an estimate for simulators: refused unless physically possible, kept only where proven."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.consistency_entry import consistency_entry
from service.errors import EstimateError, UsageError
from service.estimate_reading import read_estimate
from service.export_check import MOTIONS, check_mjcf, check_urdf
from service.export_mjcf import held_springs, mjcf_text
from service.export_model import ExportModel, export_model
from service.export_sidecar import sidecar_content
from service.export_urdf import urdf_text
from service.files import check_writable, to_json, write_text

SCHEMA_VERSION = 1
SIDECAR_SUFFIX = ".residuum.json"


@dataclass(frozen=True)
class ExportReport:
    """What was written and how well it agrees.

    Attributes:
        robot: its name.
        simulated: whether the estimate comes from simulated data.
        projected: whether parameters were moved to be physically possible.
        consistency: the verdict, as in ``estimate.json``.
        files: written files by kind: ``urdf``, ``mjcf``, ``sidecar``.
        errors: largest relative errors of the files read back, by what was compared.
        motions: number of random states compared.
        beyond_mjcf: per joint, the largest torque that only the sidecar holds [N.m or N].
        notes: what a reader of the files must know.
    """

    robot: str
    simulated: bool
    projected: bool
    consistency: dict[str, Any]
    files: dict[str, str]
    errors: dict[str, float]
    motions: int
    beyond_mjcf: dict[str, float]
    notes: tuple[str, ...]

    def content(self) -> dict[str, Any]:
        """Arrange the report for ``--json``."""
        return {
            "schema_version": SCHEMA_VERSION,
            "robot": self.robot,
            "simulated": self.simulated,
            "projected": self.projected,
            "consistency": self.consistency,
            "files": self.files,
            "agreement": {"largest_relative_error": self.errors, "motions": self.motions},
            "beyond_mjcf": self.beyond_mjcf,
            "notes": list(self.notes),
        }


def export_estimate(
    path: Path | str, urdf: Path | None = None, mjcf: Path | None = None, *, project: bool = False
) -> ExportReport:
    """Write an estimate as URDF and MJCF, read the files back and prove them in MuJoCo.

    Args:
        path: ``estimate.json``.
        urdf: where to write the URDF, or None.
        mjcf: where to write the MJCF, or None; what it cannot hold goes beside it.
        project: whether to write the nearest possible parameters where the estimate is not possible.

    Returns:
        What was written.

    Raises:
        UsageError: no or the same output, unwritable paths, no estimate.
        EstimateError: the estimate is not possible, or a file does not say what the estimate says.
    """
    sidecar = None if mjcf is None else mjcf.with_name(mjcf.name + SIDECAR_SUFFIX)
    _check_outputs(urdf, mjcf, sidecar)
    estimate = read_estimate(path)
    found = estimate.consistency()
    if not found.consistent and not project:
        raise EstimateError(
            f"Estimate {path} is not physically possible: it lies {found.distance:.3g} std from the nearest "
            f"possible parameters ({'inside' if found.within_uncertainty else 'outside'} its 95% region of "
            f"{found.limit:.3g} std); "
            "add --project to export those instead, and the files will say so."
        )
    export = export_model(estimate, found)
    texts: dict[Path, tuple[str, str]] = {}
    springs = held_springs(export)
    if urdf is not None:
        texts[urdf] = ("urdf", urdf_text(export))
    if mjcf is not None and sidecar is not None:
        texts[mjcf] = ("mjcf", mjcf_text(export, springs, sidecar.name))
        texts[sidecar] = ("sidecar", to_json(sidecar_content(export, springs)))
    errors, beyond = _write_proven(export, texts)
    return ExportReport(
        estimate.loaded.name,
        estimate.simulated,
        export.projected,
        consistency_entry(found),
        {kind: str(place) for place, (kind, _) in texts.items()},
        errors,
        MOTIONS,
        beyond,
        export.notes,
    )


def _check_outputs(urdf: Path | None, mjcf: Path | None, sidecar: Path | None) -> None:
    if urdf is None and mjcf is None:
        raise UsageError("Nothing to export to: give --urdf FILE, --mjcf FILE or both.")
    if urdf is not None and mjcf is not None and urdf.absolute() == mjcf.absolute():
        raise UsageError(f"URDF and MJCF cannot both be written to {urdf}; give two names.")
    check_writable(urdf, "the URDF")
    check_writable(mjcf, "the MJCF")
    check_writable(sidecar, "the MJCF's sidecar")


def _write_proven(
    export: ExportModel, texts: dict[Path, tuple[str, str]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Write beside the final names, read back, compare, and only then move into place."""
    staged: dict[str, Path] = {}
    errors: dict[str, float] = {}
    beyond: dict[str, float] = {}
    try:
        for place, (kind, text) in texts.items():
            staged[kind] = _stage(place, text)
        if "urdf" in staged:
            errors |= check_urdf(export, staged["urdf"])
        if "mjcf" in staged:
            more, beyond = check_mjcf(export, staged["mjcf"], staged["sidecar"])
            errors |= more
        for place, (kind, _) in texts.items():
            os.replace(staged[kind], place)
    finally:
        for left in staged.values():
            left.unlink(missing_ok=True)
    return errors, beyond


def _stage(place: Path, text: str) -> Path:
    handle, name = tempfile.mkstemp(dir=place.parent, prefix=f".{place.name}.", suffix=".unproven")
    os.close(handle)
    write_text(name, text, f"{place.name}")
    return Path(name)
