"""Parameters whose sign physics prescribes: friction dissipates, a motor keeps its direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.model import Model
from identify.rotations import FloatArray

_TERMS = ("coulomb", "viscous", "asymmetric_viscous")
_LEAST_CONSTANT = 1e-3  # of the nominal torque constant: a motor without torque is none


@dataclass(frozen=True)
class SignBounds:
    """Linear conditions G s >= g on the signed parameters.

    Attributes:
        indices: positions in (parameters, torque constants), shape (s,).
        matrix: G, shape (c, s).
        bound: g, shape (c,).
        meanings: one condition each, in words.
    """

    indices: FloatArray
    matrix: FloatArray
    bound: FloatArray
    meanings: tuple[str, ...]

    def violations(self, values: FloatArray) -> tuple[str, ...]:
        """Name the conditions that values of the signed parameters break."""
        broken = self.matrix @ values < self.bound
        return tuple(meaning for meaning, fails in zip(self.meanings, broken, strict=True) if fails)


def sign_bounds(model: Model, known: FloatArray) -> SignBounds:
    """Collect the conditions on friction and torque constants.

    Args:
        model: the model.
        known: which of (parameters, torque constants) have a value, shape (P + n,).

    Returns:
        The conditions; what has no value is left out.
    """
    names = [parameter.name for parameter in model.parameters]
    places = {name: k for k, name in enumerate(names) if name.endswith(_TERMS) and known[k]}
    conditions: list[tuple[dict[int, float], float, str]] = []
    for k, joint in enumerate(model.robot.joints):
        coulomb, viscous, skew = (places.get(f"{joint.name}.{term}") for term in _TERMS)
        if coulomb is not None:
            conditions.append(({coulomb: 1.0}, 0.0, f"{joint.name}.coulomb must not be negative"))
        if viscous is not None and skew is None:
            conditions.append(({viscous: 1.0}, 0.0, f"{joint.name}.viscous must not be negative"))
        elif viscous is not None and skew is not None:
            for sign, way in ((1.0, "forward"), (-1.0, "backward")):
                text = f"{joint.name}'s viscous friction must not be negative {way}"
                conditions.append(({viscous: 1.0, skew: sign}, 0.0, text))
        constant, nominal = len(names) + k, joint.drive.torque_constant or 1.0
        if known[constant]:
            least = _LEAST_CONSTANT * abs(nominal)
            text = f"{joint.name}'s torque constant must have the sign of its nominal value"
            conditions.append(({constant: float(np.sign(nominal))}, least, text))
    indices = sorted({index for row, _, _ in conditions for index in row})
    matrix = np.array([[row.get(index, 0.0) for index in indices] for row, _, _ in conditions])
    return SignBounds(
        np.array(indices, dtype=int),
        matrix.reshape(len(conditions), len(indices)),
        np.array([bound for _, bound, _ in conditions]),
        tuple(text for _, _, text in conditions),
    )
