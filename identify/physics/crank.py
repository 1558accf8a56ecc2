"""A spring or cylinder between two pivots, one of which turns with the joint."""

from __future__ import annotations

import numpy as np

from identify.rotations import FloatArray

# 2 A B / (A^2 + B^2) of the pivots' radii: a rod five times its crank; what another ratio changes in the
# rod's length is taken up by the second coefficient
_ECCENTRICITY = 0.385
_SHORTEST = np.sqrt(1.0 - _ECCENTRICITY)


def rod(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Length of the rod and its change with the angle, in units of the root of A^2 + B^2.

    Args:
        angle: from where the rod is shortest [rad], shape (B,).

    Returns:
        Length beyond the shortest, and lever (its derivative), each shape (B,).
    """
    length = np.sqrt(1.0 - _ECCENTRICITY * np.cos(angle))
    return length - _SHORTEST, 0.5 * _ECCENTRICITY * np.sin(angle) / length
