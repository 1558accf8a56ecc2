"""Make the recordings of a trial and seal its answer: the hash is public at once, the text only later."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from daq.log_writer import write_recording
from daq.recording import Recording
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.effects.registry import effect_class
from drivers.virtual.plant_file import PlantSpec, load_plant
from drivers.virtual.record import record_virtual
from drivers.virtual.robot_description import robot_attachments
from drivers.virtual.trajectories import FourierMotion, random_fourier, random_points
from identify.fit import fit
from service.datasets import dataset_of
from service.errors import ServiceError
from service.files import write_text
from service.proving.scenario import draw_scenario
from service.robots import build_robot

_STRENGTHS = (np.log(0.04), np.log(0.4))  # drawn evenly between these, in noise std left after the refit
_STRENGTH_PERIODS = 3
_QUIET = 0.05  # of the noise: the recording that measures how much of an effect the model cannot absorb


def _coloured(plant: PlantSpec, colour: float) -> PlantSpec:
    noise = plant.noise.model_copy(update={"colour": colour})
    return plant.model_copy(update={"noise": noise})


def _quieter(plant: PlantSpec) -> PlantSpec:
    noise = plant.noise
    scaled = {
        key: tuple(_QUIET * value for value in getattr(noise, key))
        for key in ("joint_torque_nm", "force_n", "torque_nm")
        if hasattr(noise, key)
    }
    return plant.model_copy(update={"noise": noise.model_copy(update=scaled)})


def strength(plant: PlantSpec, trajectory: FourierMotion, effect: EffectSpec, seed: int) -> float:
    """Measure what an effect leaves after the refit of the plain model, in units of the noise std.

    A recording with a twentieth of the noise is fitted by the plain model; its averaged residual, less what
    that noise leaves, is the effect's.

    Args:
        plant: the virtual robot.
        trajectory: its motion.
        effect: the effect.
        seed: of the noise.

    Returns:
        The largest over the channels.
    """
    quiet = record_virtual(_quieter(plant), trajectory, _STRENGTH_PERIODS, 1, seed, (effect,))
    files = robot_attachments(plant)
    urdf = next(text for name, text in files.items() if name.endswith(".urdf"))
    loaded = build_robot(files["robot.toml"].decode(), urdf.decode(), plant.name)
    result = fit(loaded.robot, dataset_of(quiet, loaded))
    noise = result.noise_std
    left = 0.0
    for channel, rms in result.residual_rms.items():
        excess = max(rms**2 - noise[channel] ** 2 / _STRENGTH_PERIODS, 0.0)
        left = max(left, float(np.sqrt(excess) * _QUIET / max(noise[channel], 1e-300)))
    return left


def scaled(
    plant: PlantSpec, trajectory: FourierMotion, effect: EffectSpec, seed: int, target: float
) -> tuple[EffectSpec, float]:
    """Scale an effect so that it leaves about the wanted strength, within sixfold of its usual size.

    Effects that the model swallows stay at sixfold and weak; the strength returned is measured, not wanted.
    """
    size = effect_class(effect.name).size
    first = strength(plant, trajectory, effect, seed)
    factor = float(np.clip(target / max(first, 1e-6), 1.0 / 12.0, 6.0))
    changed = replace(effect, parameters=dict(effect.parameters) | {size: effect.parameters[size] * factor})
    return changed, strength(plant, trajectory, changed, seed)


def conceal(folder: Path, robot: str, number: int, campaign_seed: int, periods: int) -> None:
    """Record one trial and seal its answer.

    Args:
        folder: of the campaign; gets ``trials/N/`` (what the diagnosis may see) and ``sealed/N.json``.
        robot: preset of the virtual robot.
        number: of the trial.
        campaign_seed: of the campaign.
        periods: of the run.
    """
    plant = load_plant(robot)
    scenario = draw_scenario(plant, number, campaign_seed)
    plant = _coloured(plant, scenario.colour)
    trial = folder / "trials" / f"{number:04d}"
    trial.mkdir(parents=True, exist_ok=True)
    trajectory = random_fourier(plant, scenario.seed)
    rng = np.random.default_rng([scenario.seed, 1])
    pairs = [
        scaled(plant, trajectory, effect, scenario.seed + 1, float(np.exp(rng.uniform(*_STRENGTHS)))) for effect in scenario.effects
    ]
    scenario = replace(scenario, effects=tuple(effect for effect, _ in pairs))
    answer = {"scenario": asdict(scenario), "strength": [left for _, left in pairs]}
    text = json.dumps(answer, sort_keys=True)
    (folder / "sealed").mkdir(exist_ok=True)
    write_text(folder / "sealed" / f"{number:04d}.json", text, "the sealed answer")
    write_text(trial / "seal.sha256", hashlib.sha256(text.encode()).hexdigest() + "\n", "the seal")
    attachments = robot_attachments(plant)
    run = record_virtual(plant, trajectory, periods, 1, scenario.seed, scenario.effects, attachments=attachments)
    points = random_points(plant, scenario.seed + 7)
    other = record_virtual(plant, points, seed=scenario.seed + 7, effects=scenario.effects, attachments=attachments)
    _write(run, trial / "run.mcap")
    _write(other, trial / "validation.mcap")


def _write(recording: Recording, path: Path) -> None:
    for leftover in (path, path.with_name(path.name + ".partial")):
        leftover.unlink(missing_ok=True)
    write_recording(recording, path)


def open_seal(folder: Path, number: int) -> dict:
    """Open a trial's answer.

    Args:
        folder: of the campaign.
        number: of the trial.

    Returns:
        The answer.

    Raises:
        ServiceError: the answer is not the one that was sealed.
    """
    text = (folder / "sealed" / f"{number:04d}.json").read_text()
    seal = (folder / "trials" / f"{number:04d}" / "seal.sha256").read_text().strip()
    if hashlib.sha256(text.encode()).hexdigest() != seal:
        raise ServiceError(f"The answer of trial {number} in {folder} is not the one that was sealed; the campaign is void, run it again.")
    return json.loads(text)
