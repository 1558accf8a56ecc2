"""Recordings of the virtual robot (own physics) with one effect, and what the columns say of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.plant_file import load_plant
from drivers.virtual.record import record_virtual
from drivers.virtual.trajectories import random_fourier
from identify.fit import Fit, FitOptions, fit
from identify.model import Model, build_model
from identify.physics.effect import Effect, Place
from identify.physics.scene import Scene
from identify.solve import solve
from service.datasets import dataset_of
from service.robots import load_robot

ROBOT, PLANT = load_robot("ir361"), load_plant("ir361")


@dataclass(frozen=True)
class Estimate:
    """Coefficients of one effect fitted together with the whole model."""

    values: np.ndarray
    std: np.ndarray
    gain: float


@cache
def model(kind: str = "combined") -> Model:
    return build_model(ROBOT.robot, kind)


def recorded(*effects: EffectSpec, periods: int = 4, nominal: bool = False, kind: str = "combined") -> Fit:
    run = record_virtual(PLANT, random_fourier(PLANT, 5), periods, 1, seed=3, effects=effects)
    return fit(ROBOT.robot, dataset_of(run, ROBOT), FitOptions(nominal_constants=nominal), model(kind))


@cache
def null() -> Fit:
    return recorded()


def scene_of(fitted: Fit) -> Scene:
    grid_s = fitted.rows.blocks[0].grid_s
    motion = fitted.trajectory.evaluate(fitted.window.start_s + grid_s)
    theta, plate = np.nan_to_num(fitted.theta), fitted.model.kind != "internal"
    return Scene(fitted.model, theta, fitted.solution.scale, grid_s, *motion, True, plate)


class DirectedTest:
    """Effects one at a time against what the fitted model leaves, the model projected out."""

    def __init__(self, fitted: Fit) -> None:
        self.fitted, self.scene = fitted, scene_of(fitted)
        jacobian = fitted.solution.jacobian
        left, size, _ = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), full_matrices=False)
        self.basis = left[:, size > 1e-9 * size[0]]

    def ratio(self, effect: Effect, place: Place, shape: Mapping[str, float]) -> np.ndarray:
        """Coefficients over their std."""
        columns, parts = effect.columns(self.scene, place, shape), []
        channels = list(self.fitted.model.channels)
        for block, noise in zip(self.fitted.rows.blocks, self.fitted.noises, strict=True):
            rows = columns[[channels.index(c) for c in block.channels]] * block.usable[:, None, :]
            white = np.sqrt(block.repeats) * noise.whiten(rows)
            parts.append(white.transpose(0, 2, 1).reshape(-1, white.shape[1]))
        white = np.vstack(parts)
        white = white - self.basis @ (self.basis.T @ white)
        variance = np.linalg.inv(white.T @ white)
        return variance @ (white.T @ self.fitted.solution.whitened) / np.sqrt(np.diag(variance))


def estimate(fitted: Fit, effect: Effect, place: Place, shape: Mapping[str, float]) -> Estimate:
    """Fit model and effect together, twice: what the columns rest on is renewed from the first fit."""
    scene, count = scene_of(fitted), len(fitted.model.parameters)
    channels = list(fitted.model.channels)
    for _ in range(2):
        columns = effect.columns(scene, place, shape)
        blocks = []
        for block in fitted.rows.blocks:
            own = columns[[channels.index(channel) for channel in block.channels]]
            blocks.append(replace(block, columns=np.concatenate([block.columns, own], axis=1)))
        found = solve(tuple(blocks), fitted.noises, scene.robot.n, fitted.solution.free_scales)
        values = found.theta[count:]
        theta = np.where(found.identifiable[:count], found.theta[:count], 0.0)
        torque = np.tensordot(columns[: scene.robot.n], values, axes=([1], [0]))
        scene = replace(scene, theta=theta, scale=found.scale, found=torque)
    variance = np.diag(found.covariance)[count : count + len(values)]
    return Estimate(values, np.sqrt(variance), fitted.solution.chi2 - found.chi2)
