"""Has anything moved? Two estimates compared by their covariances, group by group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from service.nightly.unknowns import Unknowns, unknowns_of

_DEPENDENT = 1e-9  # of the largest eigenvalue of a correlation matrix: below, rounding decides
LEAST_NIGHTS = 8  # fewer say too little about the scatter between nights


@dataclass(frozen=True)
class GroupShift:
    """How far one group of parameters has moved.

    Attributes:
        group: its name.
        chi2: squared distance in the metric of the covariance.
        dof: dimensions.
        p_value: chance of that distance if nothing moved.
        largest: the parameter that moved most, in std.
        largest_z: by how many std.
    """

    group: str
    chi2: float
    dof: int
    p_value: float
    largest: str
    largest_z: float


@dataclass(frozen=True)
class Shift:
    """A comparison of two estimates.

    Attributes:
        groups: one entry a group.
        p_value: of the whole, corrected for looking at several groups (Bonferroni).
        level: below this p the estimates differ.
        has_moved: whether they do.
        compared: parameters in common.
        sentence: the outcome in words.
    """

    groups: tuple[GroupShift, ...]
    p_value: float
    level: float
    has_moved: bool
    compared: int
    sentence: str

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def compare(
    first: Mapping[str, Any],
    second: Mapping[str, Any],
    level: float,
    scatter: Mapping[str, float] | None = None,
) -> Shift:
    """Test whether two estimates differ by more than their uncertainty.

    Args:
        first: the estimate in force.
        second: the new one.
        level: significance level of the whole test.
        scatter: variance between nights by unknown, from ``night_scatter``; beyond both covariances.

    Returns:
        The comparison.
    """
    a, b = unknowns_of(first), unknowns_of(second)
    names = [name for name in a.names if name in b.names]
    if not names:
        return Shift(
            (), 1.0, level, False, 0, "The estimates have no parameter in common; nothing was compared."
        )
    a, b = a.only(names), b.only(names)
    extra = np.diag([(scatter or {}).get(name, 0.0) for name in names])
    difference, covariance = b.values - a.values, a.covariance + b.covariance + extra
    groups = tuple(_group(group, a, difference, covariance) for group in dict.fromkeys(a.groups))
    p_value = min(1.0, len(groups) * min(g.p_value for g in groups))
    return Shift(groups, p_value, level, p_value < level, len(names), _sentence(groups, p_value, level))


def _group(group: str, unknowns: Unknowns, difference: np.ndarray, covariance: np.ndarray) -> GroupShift:
    from scipy import special  # late: the server starts faster without it

    at = [k for k, name in enumerate(unknowns.groups) if name == group]
    std = np.sqrt(np.diag(covariance)[at])
    z = difference[at] / std
    values, vectors = np.linalg.eigh(covariance[np.ix_(at, at)] / np.outer(std, std))
    kept = values > _DEPENDENT * values[-1]
    chi2 = float(np.sum((vectors[:, kept].T @ z) ** 2 / values[kept]))
    dof = int(kept.sum())
    most = int(np.argmax(np.abs(z)))
    return GroupShift(
        group, chi2, dof, float(special.chdtrc(dof, chi2)), unknowns.names[at[most]], float(z[most])
    )


def _sentence(groups: Sequence[GroupShift], p_value: float, level: float) -> str:
    if p_value >= level:
        return f"No difference beyond uncertainty (p = {p_value:.2g}, level {level:.1g})."
    moved = min(groups, key=lambda g: g.p_value)
    return (
        f"The {moved.group.replace('_', ' ')} parameters have moved (p = {p_value:.2g}, level {level:.1g}); "
        f"most of all {moved.largest}, by {moved.largest_z:+.1f} standard deviations."
    )


def night_scatter(contents: Sequence[Mapping[str, Any]], level: float) -> dict[str, float]:
    """Variance between nights beyond what the covariances explain.

    Successive differences are used, so that a slow drift does not hide in the scatter (von Neumann 1941). The
    variance is widened as Student's t asks for, because it comes from so many nights only.

    Args:
        contents: estimates of past nights, oldest first.
        level: significance level of the test that will use it.

    Returns:
        Variance by unknown; empty with fewer than ``LEAST_NIGHTS`` nights.
    """
    from scipy import special  # late: the server starts faster without it

    nights = [unknowns_of(content) for content in contents]
    if len(nights) < LEAST_NIGHTS:
        return {}
    names = [name for name in nights[0].names if all(name in night.names for night in nights)]
    parts = [night.only(names) for night in nights]
    values = np.array([part.values for part in parts])
    within = np.mean([part.std**2 for part in parts], axis=0)
    between = 0.5 * np.mean(np.diff(values, axis=0) ** 2, axis=0)
    widened = (special.stdtrit(len(nights) - 1, level / 2) / special.ndtri(level / 2)) ** 2
    excess = np.maximum(between - within, 0.0) * widened
    return dict(zip(names, excess.tolist(), strict=True))
