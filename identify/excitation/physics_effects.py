"""The catalogue's effects as columns that a discriminating design can work with."""

from __future__ import annotations

import difflib
from dataclasses import dataclass

import numpy as np

from identify.excitation.errors import DesignError
from identify.excitation.information import NamedEffect
from identify.excitation.reference import ReferenceModel
from identify.model import Model
from identify.physics.catalogue import effect_named
from identify.physics.effect import Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray


@dataclass(frozen=True)
class CatalogueColumns:
    """Columns of one effect at one place, its shape parameters at the middle of their range.

    Attributes:
        model: combined or internal.
        reference: expected parameter values; loads and currents come from it.
        name: of the effect.
        place: where it sits.
        period_s: of the motion [s].
    """

    model: Model
    reference: ReferenceModel
    name: str
    place: Place
    period_s: float

    def __call__(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Give the columns on an even grid of one period, shape (channels, k, N)."""
        effect = effect_named(self.name)
        scene = _scene(self.model, self.reference, self.period_s, q, qd, qdd)
        shape = {s.name: s.grid[len(s.grid) // 2] for s in effect.shapes}
        return effect.columns(scene, self.place, shape)


def _scene(
    model: Model, reference: ReferenceModel, period_s: float, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> Scene:
    t_s = np.arange(q.shape[1]) * (period_s / q.shape[1])
    ones = np.ones(model.robot.n)
    return Scene(model, reference.theta, ones, t_s, q, qd, qdd, True, model.kind == "combined")


def catalogue_effect(model: Model, reference: ReferenceModel, period_s: float, word: str) -> NamedEffect:
    """Find an effect by ``NAME`` or ``NAME:PLACE``, PLACE a joint or a wrench channel.

    Args:
        model: combined or internal.
        reference: expected parameter values.
        period_s: of the motion [s].
        word: what was asked for.

    Returns:
        The effect with its columns.

    Raises:
        ModelError: no such effect.
        DesignError: it cannot sit there.
    """
    name, _, where = word.partition(":")
    effect = effect_named(name)
    rest = np.zeros((model.robot.n, 8))
    places = {
        place_name(model, place): place
        for place in effect.places(_scene(model, reference, period_s, rest, rest, rest))
    }
    if where not in places and not (where == "" and len(places) == 1):
        near = difflib.get_close_matches(where, list(places), n=1)
        hint = (
            f"did you mean '{near[0]}'?"
            if near
            else f"choose {', '.join(p or 'no place' for p in places) or 'another effect'}."
        )
        raise DesignError(f"Effect '{name}' has no place '{where}' on robot '{model.robot.name}'; {hint}")
    place = places[where] if where in places else next(iter(places.values()))
    return NamedEffect(word, CatalogueColumns(model, reference, name, place, period_s))


def place_name(model: Model, place: Place) -> str:
    """Name a place: its joint (``a+b`` for a pair), its channel, or nothing for the whole robot."""
    names = model.robot.joint_names
    if place.joint is None:
        return place.channel or ""
    return names[place.joint] if place.partner is None else f"{names[place.joint]}+{names[place.partner]}"
