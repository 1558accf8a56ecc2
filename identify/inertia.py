"""The ten inertial parameters of a rigid body and their pseudo-inertia matrix."""

from __future__ import annotations

import numpy as np

from identify.rotations import FloatArray, skew

PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
UNITS = ("kg", "kg.m", "kg.m", "kg.m") + ("kg.m2",) * 6
# position of the six inertia components in the 3 x 3 matrix
_INERTIA_ROWS, _INERTIA_COLUMNS = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)


def inertia_matrix(parameters: FloatArray) -> FloatArray:
    """Give the inertia about the link frame's origin.

    Args:
        parameters: m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the joint frame, shape (10,).

    Returns:
        Symmetric matrix [kg.m2], shape (3, 3).
    """
    xx, xy, xz, yy, yz, zz = parameters[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def parameters_from_body(
    mass_kg: float, com_m: FloatArray, inertia_com_kgm2: FloatArray, rotation: FloatArray
) -> FloatArray:
    """Shift a body's inertia from its centre of mass to the link frame (Steiner).

    Args:
        mass_kg: mass [kg].
        com_m: centre of mass in the link frame [m], shape (3,).
        inertia_com_kgm2: inertia about the centre of mass in the body's own axes, shape (3, 3).
        rotation: the body's axes in the link frame, shape (3, 3).

    Returns:
        The ten parameters about the link frame's origin, shape (10,).
    """
    s = skew(com_m)
    about_origin = rotation @ inertia_com_kgm2 @ rotation.T - mass_kg * (s @ s)
    return np.concatenate([[mass_kg], mass_kg * com_m, about_origin[_INERTIA_ROWS, _INERTIA_COLUMNS]])


def body_from_parameters(parameters: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Invert :func:`parameters_from_body` for a body with positive mass.

    Args:
        parameters: the ten parameters, shape (10,).

    Returns:
        Mass [kg], centre of mass [m] (3,), inertia about the centre of mass [kg.m2] (3, 3).
    """
    mass = float(parameters[0])
    com = parameters[1:4] / mass
    s = skew(com)
    return mass, com, inertia_matrix(parameters) + mass * (s @ s)


def transform_parameters(parameters: FloatArray, rotation: FloatArray, translation_m: FloatArray) -> FloatArray:
    """Express a body's parameters in another frame.

    Args:
        parameters: the ten parameters in frame B, shape (10,).
        rotation: axes of B in frame A, shape (3, 3).
        translation_m: origin of B in frame A [m], shape (3,).

    Returns:
        The ten parameters in frame A, shape (10,).
    """
    mass, first = parameters[0], rotation @ parameters[1:4]
    st, sf = skew(translation_m), skew(first)
    inertia = rotation @ inertia_matrix(parameters) @ rotation.T
    inertia = inertia - st @ sf - sf @ st - mass * (st @ st)
    return np.concatenate(
        [[mass], first + mass * translation_m, inertia[_INERTIA_ROWS, _INERTIA_COLUMNS]]
    )


def pseudo_inertia(parameters: FloatArray) -> FloatArray:
    """Arrange the ten parameters so that physical consistency is positive semidefiniteness.

    Args:
        parameters: the ten parameters, shape (10,).

    Returns:
        Symmetric matrix, shape (4, 4): [[trace(I)/2 E - I, h], [h', m]].

    Source:
        Wensing, Kim, Slotine, IEEE RA-L 3(1) 2018.
    """
    inertia = inertia_matrix(parameters)
    result = np.empty((4, 4))
    result[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    result[:3, 3] = result[3, :3] = parameters[1:4]
    result[3, 3] = parameters[0]
    return result
