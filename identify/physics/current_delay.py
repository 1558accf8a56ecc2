"""One drive whose current is sampled late."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive, fitted
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray

# instants of samples are known no better than this; it also lets the estimate move smoothly past a sample
_BLUR_S = 1e-4


def _late(scene: Scene, series: FloatArray, delay_s: float) -> FloatArray:
    """A smooth series as it was a delay earlier, shape (B,)."""
    if not scene.periodic:
        return np.interp(scene.t_s - delay_s, scene.t_s, series)
    count = len(series)
    turn = np.exp(-2j * np.pi * delay_s * np.fft.rfftfreq(count, scene.step_s))
    return np.fft.irfft(np.fft.rfft(series) * turn, count)


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    """Difference to the torque one lag ago; friction's steps move by it and are not smeared over samples."""
    joint, lag = place.joint, shape["lag"]
    coulomb = fitted(scene, joint, "coulomb")
    smooth = scene.torque[joint] - coulomb * scene.direction[joint]
    speed, pull = scene.speed[joint], scene.robot.drive_matrix[joint] @ scene.qdd
    turning = np.abs(_late(scene, pull, lag)) * _BLUR_S + 1e-12
    side = np.clip(_late(scene, speed, lag) / turning, -1.0, 1.0)
    before = _late(scene, smooth, lag) + coulomb * side
    return only_joint(scene, joint, (before - scene.torque[joint]) / lag)


EFFECT = Effect(
    name="current_delay",
    where="I",
    parity="O",
    coefficients=(Coefficient("T", "s", +1),),
    columns=_columns,
    places=every_drive,
    sentence="{place}'s current lags its motion by {T}.",
    reference="i(t - T): pulses at the steps of friction, a phase lag elsewhere; one drive alone",
    shapes=(Shape("lag", "s", (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3, 8e-3, 1.6e-2)),),
    # the size must agree with the shift that shapes the pulses, else it is no delay
    constraint=lambda scene, place, values, shape: bool(0.4 * shape["lag"] < values[0] < 2.5 * shape["lag"]),
)
