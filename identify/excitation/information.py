"""What a motion tells: the information matrix of parameters, torque constants and effects; its derivative."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from identify.base_parameters import independent_columns
from identify.excitation.errors import DesignError
from identify.excitation.limits import MotionLimits
from identify.excitation.reference import ReferenceModel
from identify.excitation.stacked_rows import stacked_rows
from identify.friction import drive_velocity
from identify.model import Model
from identify.rotations import FloatArray

# Verdonck, Swevers, Samin 2001: std per sample of the wrench; the joints' are relative to the effort
WRENCH_NOISE = {
    "force.x": 10.54, "force.y": 10.88, "force.z": 4.81,
    "torque.x": 11.61, "torque.y": 11.33, "torque.z": 3.15,
}  # fmt: skip
_JOINT_NOISE_SHARE = (
    0.005  # of the effort limit: 3.55 of 600, 4.03 of 900, 1.26 of 300 N.m on the published arm
)
_STEP = 1e-6  # of the forward differences: rounding and curvature both cost about 1e-8 of a column
_RICH, _SEED = 200, 7
# speed below which the search smooths Coulomb's sign, as a share of a typical speed
_SMOOTH_SHARE = 0.03

EffectColumns = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class NamedEffect:
    """Physics a design shall reveal.

    Attributes:
        name: as in the catalogue, with its place, such as ``stribeck_friction:joint_2``.
        columns: (q, qd, qdd) on an even grid of one period, each (n, N), to its columns (channels, k, N) in
            the channels' units.
    """

    name: str
    columns: EffectColumns


@dataclass(frozen=True)
class NoiseLevels:
    """Std per sample of every channel.

    Attributes:
        std: shape (channels,).
        sentence: where they come from.
    """

    std: FloatArray
    sentence: str


def noise_levels(model: Model, given: Mapping[str, float], where: str = "the robot file") -> NoiseLevels:
    """Collect noise levels; others are published ones (plate) or a share of the effort limit (joints).

    Args:
        model: the model, for its channels.
        given: std by channel name [N.m or N].
        where: the source of ``given``, for the statement.

    Returns:
        The levels.

    Raises:
        DesignError: a level is not positive.
    """
    guessed = {}
    for joint in model.robot.joints:
        effort = joint.limits.effort
        guessed[joint.name] = _JOINT_NOISE_SHARE * effort if np.isfinite(effort) and effort > 0 else 1.0
    std = np.array(
        [given.get(channel, (guessed | WRENCH_NOISE).get(channel, 1.0)) for channel in model.channels]
    )
    for channel, level in zip(model.channels, std, strict=True):
        if not (np.isfinite(level) and level > 0.0):
            raise DesignError(
                f"The noise of channel '{channel}' in {where} is {level:g}; give a positive std per sample."
            )
    count = sum(channel in given for channel in model.channels)
    if count == len(std):
        return NoiseLevels(std, f"All {count} levels from {where}.")
    assumed = f"{_JOINT_NOISE_SHARE:.1%} of the effort limits, published plate noise"
    rest = f"{len(std) - count} of {len(std)} levels assumed: {assumed}"
    return NoiseLevels(std, f"{rest}; the others from {where}." if count else f"{rest}.")


@dataclass(frozen=True)
class Sampled:
    """Whitened columns of a motion and the reference torques.

    Attributes:
        columns: shape (channels, columns, N).
        torque: drive torques of the reference model, shape (n, N).
    """

    columns: FloatArray
    torque: FloatArray

    def information(self, samples: float) -> FloatArray:
        """Information matrix of ``samples`` samples spread like the grid's."""
        flat = self.columns.transpose(1, 0, 2).reshape(self.columns.shape[1], -1)
        return flat @ flat.T * (samples / self.columns.shape[2])


@dataclass(frozen=True)
class InformationModel:
    """Columns of parameters, torque constants and effects, under the noise.

    Attributes:
        model: combined or internal.
        noise: std per channel.
        reference: values to expect.
        free_scales: joints whose torque constant is an unknown, shape (k,).
    X        smooth_speed: speed at which the search smooths Coulomb's sign, shape (n,).
        effects: physics a discriminating design shall reveal.
        effect_columns: for every effect, its positions behind the kept columns.
    """

    model: Model
    noise: NoiseLevels
    reference: ReferenceModel
    free_scales: FloatArray
    kept: FloatArray
    smooth_speed: FloatArray
    effects: tuple[NamedEffect, ...] = ()
    effect_columns: tuple[FloatArray, ...] = field(default=())

    @property
    def names(self) -> list[str]:
        """Names of the kept columns that are parameters or torque constants."""
        names = self.all_names
        return [names[k] for k in self.kept]

    @property
    def all_names(self) -> list[str]:
        """Names of the parameters, then of the unknown torque constants."""
        joints = self.model.robot.joint_names
        return [p.name for p in self.model.parameters] + [
            f"{joints[k]}.torque_constant" for k in self.free_scales
        ]

    @property
    def baseline(self) -> int:
        """Number of columns that belong to parameters and torque constants."""
        return len(self.kept)

    def sample(self, q: FloatArray, qd: FloatArray, qdd: FloatArray, smooth: bool = False) -> Sampled:
        """Evaluate whitened columns and torques.

        Args:
            q: positions on an even grid of one period, shape (n, N).
            qd: velocities, shape (n, N).
            qdd: accelerations, shape (n, N).
            smooth: take tanh for Coulomb's sign, as the search does.

        Returns:
            The kept columns, those of the effects behind them, and the torques.
        """
        columns, torque = self.baseline_columns(q, qd, qdd, smooth)
        return Sampled(
            np.concatenate([columns[:, self.kept], self.whitened_effects(q, qd, qdd)], axis=1), torque
        )

    def whitened_effects(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Evaluate the effects' columns over one period, shape (channels, k, N)."""
        none = np.zeros((len(self.noise.std), 0, q.shape[1]))
        parts = [effect.columns(q, qd, qdd) for effect in self.effects]
        return np.concatenate([none, *parts], axis=1) / self.noise.std[:, None, None]

    def baseline_columns(
        self, q: FloatArray, qd: FloatArray, qdd: FloatArray, smooth: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Evaluate whitened columns of parameters and constants, each instant by itself, and the torques."""
        model, theta = self.model, self.reference.theta
        sign = np.tanh(drive_velocity(model.robot, qd) / self.smooth_speed[:, None]) if smooth else None
        columns, known = stacked_rows(model, q, qd, qdd, sign)
        torque = np.einsum("cpn,p->cn", columns[: model.robot.n], theta) + known[: model.robot.n]
        scales = np.zeros((len(columns), len(self.free_scales), q.shape[1]))
        scales[self.free_scales, np.arange(len(self.free_scales))] = torque[self.free_scales]
        together = np.concatenate([columns, scales], axis=1)
        together /= self.noise.std[:, None, None]
        return together, torque

    def differentiate(
        self, q: FloatArray, qd: FloatArray, qdd: FloatArray
    ) -> tuple[Sampled, Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]]:
        """Evaluate smooth baseline columns and the way back from their derivatives to the motion's.

        Args:
            q: positions, shape (n, N).
            qd: velocities, shape (n, N).
            qdd: accelerations, shape (n, N).

        Returns:
            The sample, and a function of (derivative by columns, derivative by torque) that gives the
            derivatives by q, qd and qdd, each (n, N). A column at one instant depends on the motion at
            that instant only, so 3 n forward differences serve any number of coefficients.
        """
        n, count = q.shape
        state = np.concatenate([q, qd, qdd])
        moved = np.repeat(state[:, None], 3 * n + 1, axis=1)
        moved[np.arange(3 * n), np.arange(1, 3 * n + 1)] += _STEP
        flat = moved.reshape(3 * n, -1)
        columns, torque = self.baseline_columns(flat[:n], flat[n : 2 * n], flat[2 * n :], smooth=True)
        if len(self.kept) < columns.shape[1]:
            columns = columns[:, self.kept]
        columns = columns.reshape(len(columns), len(self.kept), 3 * n + 1, count)
        torque = torque.reshape(n, 3 * n + 1, count)
        here = Sampled(
            np.concatenate([columns[:, :, 0], self.whitened_effects(q, qd, qdd)], axis=1), torque[:, 0]
        )

        def pull_back(
            columns_bar: FloatArray, torque_bar: FloatArray
        ) -> tuple[FloatArray, FloatArray, FloatArray]:
            with_columns = np.einsum("cpn,cpkn->kn", columns_bar[:, : len(self.kept)], columns)
            with_torque = np.einsum("jn,jkn->kn", torque_bar, torque)
            both = with_columns + with_torque
            slope = (both[1:] - both[0]) / _STEP
            return slope[:n], slope[n : 2 * n], slope[2 * n :]

        return here, pull_back


def information_model(
    model: Model,
    noise: NoiseLevels,
    reference: ReferenceModel,
    limits: MotionLimits,
    effects: tuple[NamedEffect, ...] = (),
) -> InformationModel:
    """Find which columns motions inside the limits can tell apart, and keep those.

    Args:
        model: combined or internal; without a plate torque constants are not unknowns.
        noise: levels per channel.
        reference: values to expect.
        limits: what motions keep.
        effects: physics a discriminating design shall reveal.

    Returns:
        The information model.

    """
    speed = np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)
    has_constant = [
        k for k, joint in enumerate(model.robot.joints) if joint.drive.torque_constant is not None
    ]
    free = np.array(has_constant if model.kind == "combined" else [], dtype=int)
    everything = InformationModel(model, noise, reference, free, np.arange(0), _SMOOTH_SHARE * speed)
    rng = np.random.default_rng(_SEED)
    q = rng.uniform(limits.lower[:, None], limits.upper[:, None], (model.robot.n, _RICH))
    hard = np.where(np.isfinite(limits.acceleration), limits.acceleration, 5.0 * speed)
    qd, qdd = (rng.uniform(-1.0, 1.0, q.shape) * size[:, None] for size in (speed, hard))
    columns, _ = everything.baseline_columns(q, qd, qdd, False)
    flat = columns.transpose(0, 2, 1).reshape(-1, columns.shape[1])
    kept = np.sort(independent_columns(flat, np.arange(columns.shape[1])))
    return replace(
        everything, kept=kept, effects=effects, effect_columns=_effect_places(effects, q, len(kept))
    )


def _effect_places(effects: tuple[NamedEffect, ...], q: FloatArray, first: int) -> tuple[FloatArray, ...]:
    still, places = np.zeros_like(q), []
    for effect in effects:
        width = effect.columns(q, still, still).shape[1]
        places.append(np.arange(first, first + width))
        first += width
    return tuple(places)
