"""What the search minimises: a criterion, plus penalties where torques and distances pass their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.criteria import Criterion
from identify.excitation.information import InformationModel
from identify.excitation.mapping import ShapeMapping, smooth_motion
from identify.excitation.series import FourierSeries
from identify.excitation.workspace import Workspace, clearances
from identify.rotations import FloatArray

_STEP = 1e-6
_TORQUE_MARGIN, _DISTANCE_SCALE_M = 0.01, 0.05
CHECK_POINTS = 400  # grid of a period on which finished motions are compared


@dataclass(frozen=True)
class Problem:
    """Everything the search needs; plain data, so that it can be sent to another process.

    Attributes:
        information: columns under noise.
        criterion: to be minimised.
        mapping: free numbers to motions inside the joints' limits.
        workspace: obstacles.
        samples: number of samples of the whole run.
    """

    information: InformationModel
    criterion: Criterion
    mapping: ShapeMapping
    workspace: Workspace
    samples: float

    def value_of(self, series: FourierSeries) -> float:
        """Criterion of a finished motion, with Coulomb's own sign, on a fine grid."""
        return self.criterion(self.matrix_of(series))[0]

    def matrix_of(self, series: FourierSeries) -> FloatArray:
        """Information matrix of a finished motion."""
        return self.information.sample(*series.evaluate(series.grid_s(CHECK_POINTS))).information(
            self.samples
        )

    def quick_value(self, x: FloatArray, sharpness: float) -> float:
        """Criterion of a start, without gradient or penalties."""
        motion = smooth_motion(self.mapping, x, sharpness)
        sample = self.information.sample(motion.q, motion.qd, motion.qdd, smooth=True)
        return self.criterion(sample.information(self.samples))[0]

    def value_and_gradient(
        self, x: FloatArray, sharpness: float, stiffness: float
    ) -> tuple[float, FloatArray]:
        """Evaluate the objective.

        Args:
            x: free numbers of the mapping.
            sharpness: of the smooth maxima.
            stiffness: weight of the penalties.

        Returns:
            Value and gradient, shape of x.
        """
        motion = smooth_motion(self.mapping, x, sharpness)
        sample, pull_back = self.information.differentiate(motion.q, motion.qd, motion.qdd)
        factor = self.samples / motion.q.shape[1]
        value, matrix_bar = self.criterion(sample.information(self.samples))
        columns_bar = (
            2.0 * factor * np.tensordot(matrix_bar, sample.columns, axes=([0], [1])).transpose(1, 0, 2)
        )
        torque_value, torque_bar = self._torque_penalty(sample.torque, stiffness)
        q_bar, qd_bar, qdd_bar = pull_back(columns_bar, torque_bar)
        distance_value, distance_bar = self._distance_penalty(motion.q, stiffness)
        gradient = motion.pull_back(q_bar + distance_bar, qd_bar, qdd_bar)
        if self.information.effects:
            gradient += self._through_effects(x, sharpness, columns_bar[:, self.information.baseline :])
        return value + torque_value + distance_value, gradient

    def _through_effects(self, x: FloatArray, sharpness: float, effects_bar: FloatArray) -> FloatArray:
        """Gradient through the effects' columns, which may look along time (delays, derivatives)."""

        def weighted(z: FloatArray) -> float:
            motion = smooth_motion(self.mapping, z, sharpness)
            return float(
                np.sum(effects_bar * self.information.whitened_effects(motion.q, motion.qd, motion.qdd))
            )

        here = weighted(x)
        return np.array([(weighted(x + step) - here) / _STEP for step in _STEP * np.eye(len(x))])

    def _torque_penalty(self, torque: FloatArray, stiffness: float) -> tuple[float, FloatArray]:
        limit = (self.mapping.limits.effort * (1.0 - _TORQUE_MARGIN))[:, None]
        excess = np.maximum(np.abs(torque) / limit - 1.0, 0.0)
        return stiffness * float(np.sum(excess**2)), 2.0 * stiffness * excess * np.sign(torque) / limit

    def _distance_penalty(self, q: FloatArray, stiffness: float) -> tuple[float, FloatArray]:
        if self.workspace.empty:
            return 0.0, np.zeros_like(q)
        found = clearances(self.information.model.robot, self.workspace, q)
        lack = np.maximum(0.1 - found.distance_m / _DISTANCE_SCALE_M, 0.0)
        slope = -2.0 * stiffness * lack / _DISTANCE_SCALE_M
        return stiffness * float(np.sum(lack**2)), np.einsum("kn,kjn->jn", slope, found.gradient)
