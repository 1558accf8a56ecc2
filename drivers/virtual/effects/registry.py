"""All effects by name: every module of this folder that defines one."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from drivers.virtual.effects.effect import Effect, EffectSpec, Range
from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import PlantSpec


@cache
def effect_classes() -> dict[str, type[Effect]]:
    """Every effect class by its name."""
    found: dict[str, type[Effect]] = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        loaded = importlib.import_module(f"{__package__}.{module.name}")
        for thing in vars(loaded).values():
            if (
                isinstance(thing, type)
                and issubclass(thing, Effect)
                and thing.__module__ == loaded.__name__
                and "name" in vars(thing)
            ):
                found[thing.name] = thing
    return dict(sorted(found.items()))


def effect_class(name: str) -> type[Effect]:
    """Return the effect of that name.

    Raises:
        PlantError: There is none.
    """
    classes = effect_classes()
    if name not in classes:
        raise PlantError(f"There is no effect {name}; known are {', '.join(classes)}.")
    return classes[name]


def make_effects(specs: Iterable[EffectSpec], plant: PlantSpec) -> tuple[Effect, ...]:
    """Build the effects for one plant, in the order given."""
    return tuple(effect_class(spec.name)(spec, plant) for spec in specs)


def default_sizes(plant: PlantSpec, name: str, joint: str | None = None) -> dict[str, Range]:
    """Parameters of an effect with their default ranges on this robot; joint None is the first."""
    chosen = effect_class(name)
    index = 0 if joint is None else plant.joint_names.index(joint)
    return chosen.ranges(plant, index)


def catalogued() -> tuple[str, ...]:
    """Names of the effects of the catalogue."""
    return tuple(name for name, kind in effect_classes().items() if kind.catalogued)


def uncatalogued() -> tuple[str, ...]:
    """Names of the effects outside the catalogue, which a diagnosis must leave unexplained."""
    return tuple(name for name, kind in effect_classes().items() if not kind.catalogued)
