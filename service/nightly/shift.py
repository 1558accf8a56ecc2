"""Has anything moved? Two estimates compared by their covariances, group by group."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from service.nightly.unknowns import Unknowns

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

    @property
    def moved(self) -> str:
        """The group that differs most."""
        return min(self.groups, key=lambda group: group.p_value).group if self.groups else ""

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def compare(
    first: Unknowns,
    second: Unknowns,
    level: float,
    scatter: Scatter | None = None,
) -> Shift:
    """Test whether two estimates differ by more than their uncertainty.

    Args:
        first: the estimate in force.
        second: the new one.
        level: significance level of the whole test.
        scatter: between nights, from ``night_scatter``; beyond both covariances.

    Returns:
        The comparison.
    """
    a, b = first, second
    names = [name for name in a.names if name in b.names]
    if not names:
        return Shift(
            (), 1.0, level, False, 0, "The estimates have no parameter in common; nothing was compared."
        )
    a, b = a.only(names), b.only(names)
    # both estimates are of one night each, with its own weather
    extra = 2.0 * scatter.of(names) if scatter is not None else 0.0
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


@dataclass(frozen=True)
class Scatter:
    """Covariance between nights beyond what the estimates' own covariances explain.

    Attributes:
        names: unknowns.
        covariance: (n, n); zero between groups.
    """

    names: tuple[str, ...]
    covariance: np.ndarray

    def of(self, names: Sequence[str]) -> np.ndarray:
        """The part of these unknowns; zero for those that are not known."""
        at = {name: k for k, name in enumerate(self.names)}
        result = np.zeros((len(names), len(names)))
        known = [k for k, name in enumerate(names) if name in at]
        places = [at[names[k]] for k in known]
        result[np.ix_(known, known)] = self.covariance[np.ix_(places, places)]
        return result


def night_scatter(nights: Sequence[Unknowns], level: float) -> Scatter | None:
    """Measure how much more the nights differ than their covariances say: weather, grease, load.

    Successive differences are used: a slow drift does not hide in the scatter (von Neumann 1941). What
    moves together is seen together: one cold night stiffens all joints. The covariance is widened, for it
    comes from so many nights only.

    Args:
        nights: estimates of past nights, oldest first.
        level: significance level of the test that will use it.

    Returns:
        The scatter; None with fewer than ``LEAST_NIGHTS`` nights.
    """
    if len(nights) < LEAST_NIGHTS:
        return None
    names = [name for name in nights[0].names if all(name in night.names for night in nights)]
    parts = [night if list(night.names) == names else night.only(names) for night in nights]
    steps = np.diff(np.array([part.values for part in parts]), axis=0)
    within = np.mean([part.covariance for part in parts], axis=0)
    groups = parts[0].groups
    covariance = np.zeros_like(within)
    for group in set(groups):
        block = np.ix_(*[[k for k, name in enumerate(groups) if name == group]] * 2)
        factor = _widening(groups.count(group), len(nights), level / len(set(groups)))
        covariance[block] = factor * _excess(steps[:, block[1][0]], within[block])
    return Scatter(tuple(names), covariance)


def _excess(steps: np.ndarray, within: np.ndarray) -> np.ndarray:
    """What the steps (n, k) vary beyond `within` (k, k), direction by direction."""
    std = np.sqrt(np.diag(within))
    values, vectors = np.linalg.eigh(within / np.outer(std, std))
    kept = values > _DEPENDENT * values[-1]
    root = std[:, None] * vectors[:, kept] * np.sqrt(values[kept])
    white = (steps / std) @ vectors[:, kept] / np.sqrt(values[kept])
    ratios, directions = np.linalg.eigh(0.5 * white.T @ white / len(white))
    axes = root @ directions
    return (axes * np.maximum(ratios - 1.0, 0.0)) @ axes.T


def _widening(dimensions: int, nights: int, level: float) -> float:
    """Factor on a variance from so many nights that lets chi-square quantiles keep their level."""
    from scipy import special

    freedom = 2.0 * (nights - 1) / 3.0  # of a variance from successive differences
    exact = dimensions * special.fdtri(dimensions, freedom, 1.0 - level)
    return float(exact / special.chdtri(dimensions, level))
