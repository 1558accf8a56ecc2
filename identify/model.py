"""The linear model of one kind: parameters, and the rows they span at given motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.errors import ModelError
from identify.friction import drive_velocity, internal_columns
from identify.parameters import (
    Parameter,
    internal_parameters,
    plate_parameters,
    raw_rigid_parameters,
    unknown_rotors,
)
from identify.regressor import rigid_columns
from identify.robot import WRENCH_CHANNELS, Robot
from identify.rotations import FloatArray
from identify.structure import (
    MODELS,
    GravityReplacement,
    RigidBasis,
    Structure,
    find_structure,
    remove_replaced_gravity,
    to_drives,
)

_DIRECTION_SHARE = 1e-3
_CHUNK = 2048  # samples a pass: the working set stays in the cache


@dataclass(frozen=True)
class Rows:
    """Regressor rows of one stream: per channel, parameter and sample.

    Attributes:
        columns: shape (channels, P, N).
        known: part of the prediction that needs no parameter (known rotor inertias), shape (channels, N).
    """

    columns: FloatArray
    known: FloatArray


@dataclass(frozen=True)
class Model:
    """A model of one kind (``combined``, ``internal``, ``external``) of one robot.

    Attributes:
        robot: the chain.
        kind: which rows it explains.
        structure: structural facts shared by the three kinds.
        parameters: the unknowns, in the order of the columns.
    """

    robot: Robot
    kind: str
    structure: Structure
    parameters: tuple[Parameter, ...]

    @property
    def basis(self) -> RigidBasis:
        """Rigid base parameters of this kind."""
        return self.structure.bases[self.kind]

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels this model explains."""
        joints = self.robot.joint_names if self.kind != "external" else ()
        return joints + (WRENCH_CHANNELS if self.kind != "internal" else ())

    def index(self, name: str) -> int:
        """Position of a parameter by name."""
        return [parameter.name for parameter in self.parameters].index(name)

    def drive_rows(self, q: FloatArray, qd: FloatArray, qdd: FloatArray, sign: FloatArray | None = None) -> Rows:
        """Rows of the drive torques.

        Args:
            q: joint positions, shape (n, N).
            qd: joint velocities, shape (n, N).
            qdd: joint accelerations, shape (n, N).
            sign: sign of the drive velocities, where it is known better than from ``qd``.

        Returns:
            Rows of n channels [N.m or N].
        """
        return self._chunked(self.robot.n, q, qd, qdd, sign, self._drive_chunk)

    def wrench_rows(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> Rows:
        """Rows of the base wrench, six channels [N, N.m], in the plate's frame."""
        return self._chunked(6, q, qd, qdd, None, self._wrench_chunk)

    def _chunked(self, channels: int, q, qd, qdd, sign, chunk) -> Rows:  # noqa: ANN001
        count = q.shape[1]
        columns, known = np.zeros((channels, len(self.parameters), count)), np.zeros((channels, count))
        for first in range(0, count, _CHUNK):
            part = slice(first, min(first + _CHUNK, count))
            direction = None if sign is None else sign[:, part]
            chunk(q[:, part], qd[:, part], qdd[:, part], direction, columns[:, :, part], known[:, part])
        return Rows(columns, known)

    def _rigid(self, raw: FloatArray, rotor: FloatArray, out: FloatArray, known: FloatArray) -> None:
        basis = self.basis
        picked = raw[:, basis.columns]
        if np.array_equal(basis.mixing, np.eye(len(basis.columns))):
            out[:, : len(basis.columns)] = picked
        else:
            np.matmul(basis.mixing.T, picked, out=out[:, : len(basis.columns)])
        for k, joint in enumerate(self.robot.joints):
            if joint.drive.has_rotor and joint.drive.rotor_inertia is not None:
                known += rotor[:, k] * joint.drive.rotor_inertia

    def _drive_chunk(self, q, qd, qdd, sign, out, known) -> None:  # noqa: ANN001
        robot = self.robot
        rigid = rigid_columns(robot, q, qd, qdd, external=False)
        rotor = to_drives(robot, rigid.rotor_internal)
        raw = np.concatenate([to_drives(robot, rigid.internal), rotor[:, unknown_rotors(robot)]], axis=1)
        nuisance = internal_columns(robot, q, qd, sign)
        names = [parameter.name for parameter in internal_parameters(robot)]
        remove_replaced_gravity(robot, self.structure.replaced, raw, nuisance, names)
        self._rigid(raw, rotor, out, known)
        first = len(self.basis.columns)
        out[:, first : first + nuisance.shape[1]] = nuisance

    def _wrench_chunk(self, q, qd, qdd, sign, out, known) -> None:  # noqa: ANN001
        rigid = rigid_columns(self.robot, q, qd, qdd, internal=False)
        raw = np.concatenate([rigid.external, rigid.rotor_external[:, unknown_rotors(self.robot)]], axis=1)
        self._rigid(raw, rigid.rotor_external, out, known)
        offsets = len(plate_parameters(self.robot))
        if offsets:
            out[:, -offsets:] = np.eye(6)[:, :, None]

    def sign_unknown(self, qd: FloatArray, speed_std: FloatArray) -> FloatArray:
        """Tell where a drive's direction is not known for sure.

        Args:
            qd: joint velocities, shape (n, N).
            speed_std: std of the drive speeds by encoder noise, shape (n,).

        Returns:
            True within three std of zero, widened by a thousandth of the usual speed: lines too small to be
            kept move the instant of a reversal, and one wrong sign is twice the Coulomb friction; shape (n, N).
        """
        speed = drive_velocity(self.robot, qd)
        usual = np.sqrt(np.mean(speed**2, axis=1))
        slow = np.abs(speed) < (3.0 * speed_std + _DIRECTION_SHARE * usual)[:, None]
        rubs = np.array(["coulomb" in joint.drive.friction for joint in self.robot.joints])
        return (slow & rubs[:, None]) | self._joint_sign_unknown(qd)

    def _joint_sign_unknown(self, qd: FloatArray) -> FloatArray:
        """The same for friction on the joints' own side, on every drive that it reaches, shape (n, N)."""
        rubs = np.array(["joint_coulomb" in joint.drive.friction for joint in self.robot.joints])
        usual = np.sqrt(np.mean(qd**2, axis=1, keepdims=True))
        slow = (np.abs(qd) < _DIRECTION_SHARE * usual) & rubs[:, None]
        reaches = np.abs(np.linalg.inv(self.robot.drive_matrix).T) > 1e-12
        return (reaches.astype(int) @ slow.astype(int)) > 0


def _named(row: FloatArray, names: list[str]) -> dict[str, float]:
    return {names[k]: float(row[k]) for k in np.flatnonzero(row)}


def _nuisance_definitions(
    parameters: list[Parameter], basis: RigidBasis, replaced: tuple[GravityReplacement, ...], raw: list[str]
) -> list[Parameter]:
    """Add to each non-rigid parameter what it has absorbed of the rigid ones."""
    names = [parameter.name for parameter in parameters]
    shares = basis.nuisance.copy()
    if shares.size == 0:
        return parameters
    for item in replaced:
        for row, term in enumerate(item.terms):
            if term in names:
                shares[names.index(term), item.columns] += item.coefficients[row]
    return [
        Parameter(p.name, p.group, p.unit, {p.name: 1.0, **_named(shares[k], raw)}, p.joint)
        for k, p in enumerate(parameters)
    ]


def build_model(robot: Robot, kind: str = "combined", structure: Structure | None = None) -> Model:
    """Build the model of one kind.

    Args:
        robot: the chain with drives and plate.
        kind: ``combined``, ``internal`` or ``external``.
        structure: structural facts, found here when not given.

    Returns:
        The model.

    Raises:
        ModelError: unknown kind, or rows asked for that the robot does not have.
    """
    if kind not in MODELS:
        raise ModelError(f"Model '{kind}' is unknown; choose combined, internal or external.")
    if kind != "internal" and robot.plate is None:
        raise ModelError(
            f"The {kind} model needs a force plate, but robot '{robot.name}' has none; "
            "add a [force_plate] section to its file, or choose --model internal."
        )
    structure = structure or find_structure(robot)
    basis = structure.bases[kind]
    raw = raw_rigid_parameters(robot)
    names = [name for name, _ in raw]
    rigid = [
        Parameter(name, *_group_and_unit(name, dict(raw)), definition=_named(row, names))
        for name, row in zip(basis.names, basis.definitions, strict=True)
    ]
    inside = internal_parameters(robot) if kind != "external" else []
    plate = plate_parameters(robot) if kind != "internal" else []
    others = _nuisance_definitions(inside + plate, basis, structure.replaced, names)
    return Model(robot, kind, structure, tuple(rigid + others))


def _group_and_unit(name: str, units: dict[str, str]) -> tuple[str, str]:
    representative = name.split("+...")[0]
    return ("rotor" if representative.endswith(".rotor_inertia") else "inertial"), units[representative]
