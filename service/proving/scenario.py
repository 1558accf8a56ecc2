"""What is concealed in a trial."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.virtual.effects.draw import draw_effect
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.effects.registry import catalogued, uncatalogued
from drivers.virtual.plant_file import PlantSpec

# shares of the campaign; the rest are single effects of the catalogue
_NULL, _PAIR, _OUTSIDE = 0.25, 0.15, 0.12
_COLOURED = 0.4  # share of trials with coloured noise
# without a reference a payload is part of the last link: such a recording cannot show it
_NOT_SHOWN = ("payload",)


@dataclass(frozen=True)
class Scenario:
    """The answer of one trial.

    Attributes:
        number: of the trial.
        seed: of everything random in it.
        kind: ``null``, ``single``, ``pair`` or ``outside``.
        effects: what is concealed.
        colour: AR(1) coefficient of the noise.
    """

    number: int
    seed: int
    kind: str
    effects: tuple[EffectSpec, ...]
    colour: float


def draw_scenario(plant: PlantSpec, number: int, campaign_seed: int) -> Scenario:
    """Draw a trial's answer.

    Args:
        plant: the virtual robot.
        number: of the trial.
        campaign_seed: of the campaign.

    Returns:
        The scenario, a function of the two numbers alone.
    """
    rng = np.random.default_rng([campaign_seed, number])
    seed = int(rng.integers(2**31))
    colour = float(rng.uniform(0.3, 0.8)) if rng.random() < _COLOURED else 0.0
    draw = rng.random()
    names = [name for name in catalogued() if name not in _NOT_SHOWN]
    if draw < _NULL:
        return Scenario(number, seed, "null", (), colour)
    if draw < _NULL + _OUTSIDE:
        return Scenario(number, seed, "outside", (_draw(plant, str(rng.choice(uncatalogued())), rng),), colour)
    if draw < _NULL + _OUTSIDE + _PAIR:
        chosen = rng.choice(names, size=2, replace=False)
        return Scenario(number, seed, "pair", tuple(_draw(plant, str(name), rng) for name in chosen), colour)
    return Scenario(number, seed, "single", (_draw(plant, str(rng.choice(names)), rng),), colour)


def _draw(plant: PlantSpec, name: str, rng: np.random.Generator) -> EffectSpec:
    if name == "bearing_moment_friction":  # only the plate knows a tilting moment, and only at the first joint
        return replace(draw_effect(plant, name, rng), joint=plant.joint_names[0])
    return draw_effect(plant, name, rng)
