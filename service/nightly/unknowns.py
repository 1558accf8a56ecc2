"""The unknowns of an estimate, as arrays: values, covariance, groups, in one order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

TORQUE_CONSTANTS = "torque_constants"


@dataclass(frozen=True)
class Unknowns:
    """What an estimate says of what it could identify.

    Attributes:
        names: parameter names, then ``joint.torque_constant``; a base parameter's includes its definition.
        groups: of each.
        values: (n,).
        covariance: (n, n).
    """

    names: tuple[str, ...]
    groups: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray

    @property
    def std(self) -> np.ndarray:
        """Standard deviations (n,)."""
        return np.sqrt(np.diag(self.covariance))

    def only(self, names: list[str]) -> Unknowns:
        """The part with these names, in their order."""
        at = [self.names.index(name) for name in names]
        return Unknowns(
            tuple(names), tuple(self.groups[k] for k in at), self.values[at], self.covariance[np.ix_(at, at)]
        )


def unknowns_of(content: Mapping[str, Any]) -> Unknowns:
    """Read ``estimate.json``.

    Args:
        content: the estimate.

    Returns:
        What has a value and a finite covariance; the rest is left out.
    """
    entries = [(_name(p), p["group"], p["value"]) for p in content["parameters"]]
    entries += [
        (f"{k['joint']}.torque_constant", TORQUE_CONSTANTS, k["value"]) for k in content["torque_constants"]
    ]
    full = np.array([[np.nan if v is None else v for v in row] for row in content["covariance"]], dtype=float)
    entries = entries[: len(full)]  # constants that were not estimated have no covariance
    at = [
        k
        for k, (_, _, value) in enumerate(entries)
        if value is not None and np.isfinite(full[k, k]) and full[k, k] > 0
    ]
    values = np.array([entries[k][2] for k in at], dtype=float)
    part = np.nan_to_num(full[np.ix_(at, at)])
    return Unknowns(tuple(entries[k][0] for k in at), tuple(entries[k][1] for k in at), values, part)


def _name(parameter: Mapping[str, Any]) -> str:
    """A base parameter is the same quantity only where its definition is the same."""
    definition = parameter.get("definition") or {}
    terms = "+".join(f"{factor:.6g}*{name}" for name, factor in sorted(definition.items()))
    return f"{parameter['name']} ({terms})" if len(definition) > 1 else str(parameter["name"])
