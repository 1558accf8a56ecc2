"""The catalogue: every module of this package that defines an ``EFFECT``."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from functools import cache

import identify.physics as package
from identify.errors import ModelError
from identify.physics.effect import Effect


@cache
def catalogue() -> dict[str, Effect]:
    """Collect all effects by name; a new file in this package is all that a new effect needs."""
    effects = {}
    for module in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
        effect = getattr(importlib.import_module(f"{package.__name__}.{module}"), "EFFECT", None)
        if isinstance(effect, Effect):
            effects[effect.name] = effect
    return effects


def effect_named(name: str) -> Effect:
    """Find an effect.

    Args:
        name: as in the catalogue.

    Returns:
        The effect.

    Raises:
        ModelError: there is none of that name; suggests the nearest.
    """
    effects = catalogue()
    if name not in effects:
        near = difflib.get_close_matches(name, effects, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"choose one of {', '.join(effects)}."
        raise ModelError(f"Effect '{name}' is not in the catalogue; {hint}")
    return effects[name]
