"""Structure of the internal, external and combined models: which base parameters each can see.

Found numerically on random motions of the robot, never on recorded data: what a trajectory fails to excite
must appear as an unidentifiable parameter, not silently vanish from the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.base_parameters import Reduction, prefer, reduce_columns
from identify.friction import internal_columns
from identify.inertia import PARAMETERS
from identify.parameters import (
    internal_parameters,
    plate_parameters,
    raw_rigid_parameters,
    unknown_rotors,
)
from identify.regressor import rigid_columns
from identify.robot import Robot
from identify.rotations import FloatArray

MODELS = ("combined", "internal", "external")
# first choice first: regroups masses and Ixx onto the others, as the literature's tables do
_PREFERENCE = ("Izz", "Ixy", "Ixz", "Iyz", "Iyy", "Ixx", "mx", "my", "mz", "m")
_SAMPLES = 150
_SEED = 20011201  # any fixed seed: the structure must not change from run to run


@dataclass(frozen=True)
class GravityReplacement:
    """Gravity torques that a joint's Fourier compensation takes over (Eq. 15).

    Attributes:
        joint: index of the joint.
        columns: raw link parameters whose gravity torque on this drive leaves its row, shape (k,).
        coefficients: their share in each Fourier coefficient (and the offset), shape (terms, k).
        terms: names of those internal parameters.
    """

    joint: int
    columns: FloatArray
    coefficients: FloatArray
    terms: tuple[str, ...]


@dataclass(frozen=True)
class RigidBasis:
    """Base parameters of one model.

    Attributes:
        columns: raw rigid columns that span the rows, shape (r,).
        mixing: regressor of the base parameters = raw[:, columns] @ mixing, shape (r, r).
        definitions: functionals over the raw rigid parameters, shape (r, P).
        names: one a base parameter.
        nuisance: coefficients with which dropped rigid columns enter the nuisance parameters,
            shape (nuisance parameters, P).
    """

    columns: FloatArray
    mixing: FloatArray
    definitions: FloatArray
    names: tuple[str, ...]
    nuisance: FloatArray


@dataclass(frozen=True)
class Structure:
    """Structural facts of a robot, for all three models.

    Attributes:
        bases: rigid basis of each model.
        replaced: gravity columns taken over by gravity compensation.
        counts: number of identifiable parameters: internal, external, combined.
    """

    bases: dict[str, RigidBasis]
    replaced: tuple[GravityReplacement, ...]
    counts: dict[str, int]


def _random_motions(robot: Robot, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    spans = [
        (max(j.limits.lower, -1.5), min(j.limits.upper, 1.5)) if j.limits.lower < j.limits.upper else (-1.5, 1.5)
        for j in robot.joints
    ]
    q = np.array([rng.uniform(low, high, _SAMPLES) for low, high in spans])
    return q, rng.normal(size=q.shape), 3.0 * rng.normal(size=q.shape)


def _rigid(robot: Robot, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Raw rigid columns (links, unknown rotors): drive rows (n, P, N) and wrench rows (6, P, N)."""
    columns = rigid_columns(robot, q, qd, qdd)
    rotors = unknown_rotors(robot)
    internal = np.concatenate([columns.internal, columns.rotor_internal[:, rotors]], axis=1)
    external = np.concatenate([columns.external, columns.rotor_external[:, rotors]], axis=1)
    return to_drives(robot, internal), external


def to_drives(robot: Robot, rows: FloatArray) -> FloatArray:
    """Turn joint torque rows (n, ..., N) into drive torque rows, u = D^-T tau (power balance)."""
    if robot.coupling is None:
        return rows
    return np.tensordot(np.linalg.inv(robot.drive_matrix).T, rows, axes=1)


def _flat(rows: FloatArray) -> FloatArray:
    """Stack rows (c, P, N) to a matrix (c N, P)."""
    return rows.transpose(0, 2, 1).reshape(rows.shape[0] * rows.shape[2], rows.shape[1])  # P may be 0


def _gravity_replacements(robot: Robot, names: list[str]) -> tuple[GravityReplacement, ...]:
    result = []
    rng = np.random.default_rng(_SEED)
    q = rng.uniform(-2.0, 2.0, (robot.n, _SAMPLES))
    still = np.zeros_like(q)
    links = to_drives(robot, rigid_columns(robot, q, still, still, external=False).internal)
    nuisance = internal_columns(robot, q, still)
    for index, joint in enumerate(robot.joints):
        if joint.drive.gravity_harmonics == 0:
            continue
        terms = [k for k, name in enumerate(names) if name.startswith((f"{joint.name}.gravity_", f"{joint.name}.offset"))]
        basis, torque = nuisance[index, terms].T, links[index].T
        share = np.linalg.lstsq(basis, torque, rcond=None)[0]
        rest = np.linalg.norm(torque - basis @ share, axis=0)
        size = np.linalg.norm(torque, axis=0)
        columns = np.flatnonzero((size > 1e-9 * size.max(initial=0.0)) & (rest < 1e-8 * size))
        share[np.abs(share) < 1e-9] = 0.0
        result.append(GravityReplacement(index, columns, share[:, columns], tuple(names[k] for k in terms)))
    return tuple(result)


def remove_replaced_gravity(
    robot: Robot, replaced: tuple[GravityReplacement, ...], internal: FloatArray, nuisance: FloatArray, names: list[str]
) -> None:
    """Take the gravity that a compensation stands for out of its drive's row, in place.

    Args:
        robot: the chain.
        replaced: which gravity columns, and their shares in the Fourier terms.
        internal: raw rigid drive rows, shape (n, P, N).
        nuisance: columns of the internal parameters, shape (n, k, N).
        names: names of the internal parameters.
    """
    for item in replaced:
        terms = [names.index(term) for term in item.terms]
        internal[item.joint, item.columns] -= np.tensordot(
            item.coefficients.T, nuisance[item.joint, terms], axes=1
        )


def _column_order(robot: Robot, raw: list[tuple[str, str]]) -> FloatArray:
    """Unknown rotors first, then link by link in the order of preference."""
    names = [name for name, _ in raw]
    rotors = [k for k, name in enumerate(names) if name.endswith(".rotor_inertia")]
    links = [names.index(f"{link}.{parameter}") for link in robot.link_names for parameter in _PREFERENCE]
    assert len(links) == len(PARAMETERS) * robot.n
    return np.array(rotors + links, dtype=int)


def _reduce(nuisance: FloatArray, rigid: FloatArray, order: FloatArray) -> tuple[Reduction, FloatArray, int]:
    """Reduce rigid columns modulo nuisance columns; also the nuisance rank."""
    k = nuisance.shape[1]
    both = np.hstack([nuisance, rigid])
    full = reduce_columns(both, np.concatenate([np.arange(k), k + order]))
    is_rigid = full.independent >= k
    reduction = Reduction(full.independent[is_rigid] - k, full.definitions[is_rigid][:, k:])
    shares = np.zeros((k, rigid.shape[1]))
    shares[full.independent[~is_rigid]] = full.definitions[~is_rigid][:, k:]
    return reduction, shares, int((~is_rigid).sum())


def _unique_names(definitions: FloatArray, representatives: list[str]) -> tuple[str, ...]:
    names: list[str] = []
    for row, representative in zip(definitions, representatives, strict=True):
        single = np.count_nonzero(row) == 1
        name = representative if single else f"{representative}+..."
        repeat = 2
        while name in names:
            name = f"{representative}+...({repeat})"
            repeat += 1
        names.append(name)
    return tuple(names)


def _basis(
    reduction: Reduction, shares: FloatArray, preferred: FloatArray, preferred_names: list[str], raw: list[str]
) -> RigidBasis:
    chosen, completing = prefer(preferred, reduction.definitions)
    definitions = np.vstack([preferred[chosen], reduction.definitions[completing]])
    mixing = np.linalg.inv(definitions[:, reduction.independent]) if len(definitions) else np.zeros((0, 0))
    mixing[np.abs(mixing) < 1e-12] = 0.0
    representatives = [preferred_names[k] for k in chosen] + [raw[reduction.independent[k]] for k in completing]
    return RigidBasis(
        reduction.independent, mixing, definitions, _unique_names(definitions, representatives), shares
    )


def find_structure(robot: Robot) -> Structure:
    """Find the base parameters of the internal, external and combined models.

    The bases share functionals: those of the internal model come first in all three, so that estimates
    can be compared parameter by parameter (d_i is a subset of d_e).

    Args:
        robot: the chain with its drives and plate.

    Returns:
        Bases, gravity replacements and the counts of identifiable parameters.

    Source:
        Verdonck, Swevers, Samin 2001, Eqs. (1)-(4), Table 1 (28 / 19 / 34 for the IR 361).
    """
    raw = [name for name, _ in raw_rigid_parameters(robot)]
    names = [parameter.name for parameter in internal_parameters(robot)]
    order = _column_order(robot, raw_rigid_parameters(robot))
    q, qd, qdd = _random_motions(robot, np.random.default_rng(_SEED))
    internal, external = _rigid(robot, q, qd, qdd)
    nuisance = internal_columns(robot, q, qd)
    replaced = _gravity_replacements(robot, names)
    remove_replaced_gravity(robot, replaced, internal, nuisance, names)
    rows_i, rows_n = _flat(internal), _flat(nuisance)
    reduction_i, shares_i, rank_n = _reduce(rows_n, rows_i, order)
    own = [raw[k] for k in reduction_i.independent]
    basis_i = _basis(reduction_i, shares_i, reduction_i.definitions, own, raw)
    counts = {"internal": rank_n + len(own)}
    if robot.plate is None:
        return Structure({"internal": basis_i}, replaced, counts)
    rows_e = _flat(external)
    offsets = np.repeat(np.eye(6), _SAMPLES, axis=0)[:, : len(plate_parameters(robot))]
    reduction_c, shares_c, _ = _reduce(
        np.block([[rows_n, np.zeros((len(rows_n), offsets.shape[1]))], [np.zeros((len(rows_e), rows_n.shape[1])), offsets]]),
        np.vstack([rows_i, rows_e]),
        order,
    )
    basis_c = _basis(reduction_c, shares_c, reduction_i.definitions, own, raw)
    reduction_e, shares_e, _ = _reduce(offsets, rows_e, order)
    shared = [name.split("+...")[0] for name in basis_c.names]
    basis_e = _basis(reduction_e, shares_e, basis_c.definitions, shared, raw)
    counts |= {"external": len(basis_e.names), "combined": rank_n + len(basis_c.names)}
    return Structure({"internal": basis_i, "external": basis_e, "combined": basis_c}, replaced, counts)
