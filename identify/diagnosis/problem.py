"""The whitened problem that every directed test runs on: baseline columns, residual, and how columns enter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identify.blocks import Block
from identify.fit import Fit
from identify.physics.effect import Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray


@dataclass(frozen=True)
class Problem:
    """A fit prepared for diagnosis.

    Attributes:
        fit: the fit.
        scenes: one a block, on the block's grid (on the motion's grid for a non-periodic run).
        extra: whitened columns that join the baseline, such as what changes over the run leaves in the mean
            over the periods, shape (rows, e).
        without: a column of the fit's Jacobian that leaves the baseline, to test what else could stand for it.
    """

    fit: Fit
    scenes: tuple[Scene, ...]
    extra: FloatArray | None = None
    without: int | None = None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Averaged rows."""
        return self.fit.rows.blocks

    @property
    def scene(self) -> Scene:
        """The first block's scene: for places and names."""
        return self.scenes[0]

    @cached_property
    def residual(self) -> FloatArray:
        """Whitened residual of the baseline, shape (rows,)."""
        solution = self.fit.solution
        rest = solution.whitened
        if self.without is not None:  # back to the value the robot file states
            column = self.without - len(self.fit.model.parameters)
            rest = rest + solution.jacobian[:, self.without] * (solution.scale[solution.free_scales[column]] - 1.0)
        return rest if self.extra is None and self.without is None else rest - self.basis @ (self.basis.T @ rest)

    @cached_property
    def jacobian(self) -> FloatArray:
        """Whitened columns of the baseline, shape (rows, P + k + e)."""
        jacobian = self.fit.solution.jacobian
        if self.without is not None:
            jacobian = np.delete(jacobian, self.without, axis=1)
        return jacobian if self.extra is None else np.hstack([jacobian, self.extra])

    @cached_property
    def basis(self) -> FloatArray:
        """Orthonormal basis of the baseline's whitened columns, shape (rows, rank)."""
        jacobian = self.jacobian
        norms = np.linalg.norm(jacobian, axis=0)
        left, values, _ = np.linalg.svd(jacobian[:, norms > 0] / norms[norms > 0], full_matrices=False)
        return left[:, values > 1e-9 * values[0]]

    @cached_property
    def channel_slices(self) -> dict[str, slice]:
        """Rows of every channel in the whitened vectors (whitening mixes channels a little)."""
        result, first = {}, 0
        for block in self.blocks:
            for channel in block.channels:
                result[channel] = slice(first, first + block.target.shape[1])
                first += block.target.shape[1]
        return result

    def raw_columns(self, effect: Effect, place: Place, shape: Mapping[str, float]) -> list[FloatArray]:
        """Columns of an effect on every block, measurement units, before whitening, each (c, k, B)."""
        return [
            self.enter(index, effect.columns(scene, place, shape)) for index, scene in enumerate(self.scenes)
        ]

    def enter(self, index: int, columns: FloatArray) -> FloatArray:
        """Bring columns of all rows (rows, k, B) to one block: its channels, filters, scales, thinning."""
        block, fit, n = self.blocks[index], self.fit, self.scene.robot.n
        rows = np.where(block.joint >= 0, block.joint, 0)
        wrench = np.cumsum(block.joint < 0) - 1
        rows = np.where(block.joint < 0, n + wrench, rows)
        picked = columns[rows]
        factors = np.where(block.joint >= 0, fit.solution.scale[np.maximum(block.joint, 0)], 1.0)
        picked = picked * factors[:, None, None]
        for stream, members in (("current", block.joint >= 0), ("wrench", block.joint < 0)):
            anti_alias = fit.data.filters.get(stream)
            if anti_alias is not None and members.any():
                picked[members] = self._filtered(anti_alias, picked[members])
        if fit.thinning is not None:
            picked = fit.thinning.apply(picked)
        return picked

    def _filtered(self, anti_alias, series: FloatArray) -> FloatArray:  # noqa: ANN001
        if self.fit.window is not None:
            return anti_alias.apply_periodic(series, self.fit.window.period_s)
        assert self.fit.motion is not None
        return anti_alias.apply(series, self.fit.motion.rate_hz)

    def whiten(self, raw: list[FloatArray]) -> FloatArray:
        """Whiten columns of all blocks in the order of the residual, shape (rows, k)."""
        parts = []
        for block, noise, columns in zip(self.blocks, self.fit.noises, raw, strict=True):
            weighted = np.sqrt(block.repeats) * noise.whiten(columns * block.usable[:, None, :])
            parts.append(weighted.transpose(0, 2, 1).reshape(-1, columns.shape[1]))
        return np.vstack(parts)

    def columns(self, effect: Effect, place: Place, shape: Mapping[str, float]) -> FloatArray:
        """Whitened columns of an effect, shape (rows, k)."""
        return self.whiten(self.raw_columns(effect, place, shape))


def build_problem(fit: Fit) -> Problem:
    """Prepare a fit for diagnosis.

    Args:
        fit: the fit.

    Returns:
        The problem.
    """
    scenes = []
    theta = np.where(fit.solution.identifiable[: len(fit.model.parameters)], fit.solution.theta, 0.0)
    has_wrench = fit.model.kind != "internal"
    for block in fit.rows.blocks:
        if fit.window is not None and fit.trajectory is not None:
            t = block.grid_s
            q, qd, qdd = fit.trajectory.evaluate(fit.window.start_s + t)
        else:
            assert fit.motion is not None
            t, q, qd, qdd = fit.motion.t_s - fit.motion.t_s[0], fit.motion.q, fit.motion.qd, fit.motion.qdd
        scenes.append(Scene(fit.model, theta, fit.solution.scale, t, q, qd, qdd, fit.window is not None, has_wrench))
    return Problem(fit, tuple(scenes))
