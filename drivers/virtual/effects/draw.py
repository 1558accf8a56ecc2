"""Random effects of plausible size, for blind trials."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import CHANNELS, EffectSpec
from drivers.virtual.effects.registry import effect_class
from drivers.virtual.plant_file import PlantSpec


def draw_effect(
    plant: PlantSpec, name: str, random: np.random.Generator, size_factor: float = 1.0
) -> EffectSpec:
    """Draw place and parameters of one effect from its default ranges on this robot.

    Args:
        plant: the robot.
        name: effect, as the catalogue spells it.
        random: where the draw comes from.
        size_factor: multiplies the drawn size, to walk below what can be seen.
    """
    kind = effect_class(name)
    joint, channel, index = None, None, 0
    if kind.place == "joint":
        index = int(random.integers(len(plant.joints)))
        joint = plant.joint_names[index]
    elif kind.place == "channel":
        channel = CHANNELS[int(random.integers(len(CHANNELS)))]
    elif kind.place == "crosstalk":
        source, sink = random.choice(len(CHANNELS), size=2, replace=False)
        channel = f"{CHANNELS[source]}->{CHANNELS[sink]}"
    parameters = {key: span.draw(random) for key, span in kind.ranges(plant, index).items()}
    parameters[kind.size] *= size_factor
    return EffectSpec(name, joint, channel, parameters)
