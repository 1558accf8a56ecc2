"""The torque of a gravity spring."""

from __future__ import annotations

import numpy as np

from drivers.virtual.plant_file import GravitySpring


def spring_torque(spring: GravitySpring, angle: np.ndarray) -> np.ndarray:
    """Torque (n,) the motor brings against a gravity spring at joint angles (n,)."""
    turn = angle - spring.phase_rad
    a, b = spring.radius_a_m, spring.radius_b_m
    length = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(turn))
    torque = np.zeros_like(angle)
    if spring.stiffness_n_m > 0.0:
        torque += spring.stiffness_n_m * a * b * np.sin(turn) * (1.0 - spring.rest_length_m / length)
    for order, amplitude in enumerate(spring.cosine_nm, start=1):
        torque += amplitude * np.cos(order * angle)
    for order, amplitude in enumerate(spring.sine_nm, start=1):
        torque += amplitude * np.sin(order * angle)
    return torque
