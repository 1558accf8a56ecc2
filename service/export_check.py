"""Proof of exported files: read back and moved in MuJoCo, compared with the estimate's own regressors."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.inertia import PARAMETERS
from identify.parameters import unknown_rotors
from identify.urdf import read_urdf
from service.errors import EstimateError
from service.export_model import ExportModel, FloatArray
from service.export_sidecar import drive_rest, rotor_rest
from service.files import read_json

MOTIONS = 200
TOLERANCE = 1e-8  # two independent recursions in double precision, numbers written in full
_SEED = 4711  # any fixed seed


@dataclass(frozen=True)
class Motions:
    """Random states of the arm, each (n, N)."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray


def random_motions(export: ExportModel) -> Motions:
    """Draw states within the joint limits; no joint stands still, where friction is not defined."""
    rng = np.random.default_rng(_SEED)
    rows = []
    for joint in export.robot.joints:
        low, high = max(joint.limits.lower, -np.pi), min(joint.limits.upper, np.pi)
        rows.append(rng.uniform(low, high, MOTIONS))
    q = np.array(rows)
    speed = rng.uniform(0.1, 1.5, q.shape) * rng.choice([-1.0, 1.0], q.shape)
    return Motions(q, speed, rng.normal(0.0, 3.0, q.shape))


def _relative(found: FloatArray, expected: FloatArray) -> float:
    """Largest deviation over the largest expected value of the same kind."""
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-300))


def _expected(export: ExportModel, motions: Motions) -> tuple[FloatArray | None, FloatArray | None]:
    """Joint torques (n, N) and base wrench (6, N) of the estimate's own rows, None where it has none."""
    model, theta = export.estimate.model, export.theta
    torque = wrench = None
    if model.kind != "external":
        rows = model.drive_rows(motions.q, motions.qd, motions.qdd)
        drive = np.tensordot(rows.columns, theta, axes=([1], [0])) + rows.known
        torque = export.robot.drive_matrix.T @ drive
    if model.kind != "internal":
        rows = model.wrench_rows(motions.q, motions.qd, motions.qdd)
        wrench = np.tensordot(rows.columns, theta, axes=([1], [0])) + rows.known
    return torque, wrench


def _plate_offsets(export: ExportModel) -> FloatArray:
    """Offsets of the plate without the weight they had absorbed, shape (6, 1)."""
    model = export.estimate.model
    links = dict(
        zip(
            (f"{link}.{p}" for link in model.robot.link_names for p in PARAMETERS),
            export.links.ravel(),
            strict=True,
        )
    )
    plate = [
        export.theta[k] - sum(c * links.get(name, 0.0) for name, c in parameter.definition.items())
        for k, parameter in enumerate(model.parameters)
        if parameter.group == "plate"
    ]
    return np.array(plate or [0.0] * 6)[:, None]


def _simulate(model: Any, motions: Motions, export: ExportModel) -> tuple[FloatArray, FloatArray]:
    """Inverse dynamics of a compiled model: joint torques with dry friction (n, N), base wrench (6, N)."""
    import mujoco

    data = mujoco.MjData(model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # dry friction is added exactly instead
    order = [model.joint(name).dofadr[0] for name in export.robot.joint_names]
    places = [model.joint(name).qposadr[0] for name in export.robot.joint_names]
    torque, wrench = np.empty_like(motions.q), np.empty((6, motions.q.shape[1]))
    first = model.joint(export.robot.joint_names[0]).bodyid[0]
    for k in range(motions.q.shape[1]):
        data.qpos[places], data.qvel[order], data.qacc[order] = (
            x[:, k] for x in (motions.q, motions.qd, motions.qdd)
        )
        mujoco.mj_inverse(model, data)
        torque[:, k] = (data.qfrc_inverse + _dry_friction(model, data))[order]
        mujoco.mj_rnePostConstraint(model, data)
        moment, force = data.cfrc_int[first][:3], data.cfrc_int[first][3:]
        wrench[:3, k], wrench[3:, k] = force, moment + np.cross(data.subtree_com[first], force)
    return torque, wrench


def _dry_friction(model: Any, data: Any) -> FloatArray:
    """Friction torques of the file's joints and coupled drives at full slip."""
    result = model.dof_frictionloss * np.sign(data.qvel)
    for k in range(model.ntendon):
        parts = slice(model.tendon_adr[k], model.tendon_adr[k] + model.tendon_num[k])
        dofs = model.jnt_dofadr[model.wrap_objid[parts]]
        coefficients = model.wrap_prm[parts]
        slip = np.sign(coefficients @ data.qvel[dofs])
        result[dofs] += coefficients * model.tendon_frictionloss[k] * slip
    return result


def _on_plate(export: ExportModel, wrench: FloatArray) -> FloatArray:
    """Express a wrench about the base origin in the plate's frame about the plate's origin."""
    plate = export.robot.plate
    if plate is None:
        return wrench
    moment = wrench[3:] - np.cross(plate.translation_m, wrench[:3], axisb=0, axisc=0)
    return np.concatenate([plate.rotation.T @ wrench[:3], plate.rotation.T @ moment])


def check_mjcf(export: ExportModel, mjcf: Path, sidecar: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Read an MJCF and its sidecar back and compare them with the estimate.

    Args:
        export: the numbers.
        mjcf: the file.
        sidecar: the file beside it.

    Returns:
        Largest relative errors; joint by joint, the largest torque that only the sidecar holds [N.m or N].

    Raises:
        EstimateError: MuJoCo does not read the file, or they do not agree.
    """
    motions = random_motions(export)
    model = _compile(mjcf.read_text(encoding="utf-8"), "MJCF")
    torque, wrench = _simulate(model, motions, export)
    beside = read_json(sidecar, "the sidecar")
    rotors, rotor_wrench = rotor_rest(export, motions.q, motions.qd, motions.qdd, with_armature=True)
    rest = export.robot.drive_matrix.T @ drive_rest(beside, export, motions.q, motions.qd) + rotors
    expected_torque, expected_wrench = _expected(export, motions)
    errors = {}
    if expected_torque is not None:
        errors["mjcf joint torques"] = _relative(torque + rest, expected_torque)
    if expected_wrench is not None:
        total = _on_plate(export, wrench) + rotor_wrench + _plate_offsets(export)
        errors["mjcf base wrench"] = _relative(total, expected_wrench)
    _demand(errors)
    largest = np.abs(rest).max(axis=1)
    return errors, {name: float(value) for name, value in zip(export.robot.joint_names, largest, strict=True)}


def check_urdf(export: ExportModel, urdf: Path) -> dict[str, float]:
    """Read a URDF back: its base parameters, and its torques in MuJoCo.

    Args:
        export: the numbers.
        urdf: the file.

    Returns:
        Largest relative errors.

    Raises:
        EstimateError: they do not agree.
    """
    text, motions = urdf.read_text(encoding="utf-8"), random_motions(export)
    chain = read_urdf(text, export.robot.joint_names)
    model = export.estimate.model
    rotors = [export.drives[k].rotor_inertia for k in unknown_rotors(model.robot)]
    base = model.basis.definitions @ np.concatenate([chain.parameters.ravel(), rotors])
    errors = {"urdf base parameters": _relative(base, export.theta[: len(base)])}
    expected = _expected(export, motions)[0]
    if expected is not None and export.robot.coupling is None:
        compiled = _compile(_without_shapes(text), "URDF")
        compiled.opt.gravity[:] = export.robot.gravity
        torque = _simulate(compiled, motions, export)[0]
        rest = rotor_rest(export, motions.q, motions.qd, motions.qdd, with_armature=False)[0]
        for k, drive in enumerate(export.drives):
            rest[k] += drive.offset + drive.asymmetric_viscous * np.abs(motions.qd[k])
            rest[k] += drive.compensation_nm(motions.q[k])
        errors["urdf joint torques"] = _relative(torque + rest, expected)
    _demand(errors)
    return errors


def _without_shapes(text: str) -> str:
    """Leave out shapes: they do not move the arm, and their mesh files may lie elsewhere."""
    root = ElementTree.fromstring(text)
    for link in root.findall("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    return ElementTree.tostring(root, encoding="unicode")


def _compile(text: str, what: str) -> Any:
    import mujoco

    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise EstimateError(
            f"MuJoCo does not read the exported {what}: {reason}; nothing was kept."
        ) from error


def _demand(errors: dict[str, float]) -> None:
    for what, error in errors.items():
        if not error <= TOLERANCE:
            raise EstimateError(
                f"The exported {what} differ from the estimate's by {error:.1e} of the largest (allowed "
                f"{TOLERANCE:.0e}); nothing was kept, please report it with the estimate."
            )
