"""Put a fitted effect into words: where it shows, its numbers, its sentence."""

from __future__ import annotations

import numpy as np

from identify.diagnosis.augmented import Addition
from identify.diagnosis.blind_spots import place_name
from identify.diagnosis.candidates import Trial
from identify.diagnosis.findings import FoundParameter, Where, rounded
from identify.diagnosis.problem import Problem
from identify.rotations import FloatArray

_CARRIES = 0.1  # share of an effect's energy from which a channel counts as carrying it
_CONCENTRATED = 0.8  # share of the energy that must sit in a region worth naming
_NARROW = 0.45  # share of the samples such a region may have


def contribution(problem: Problem, item: Addition | Trial) -> FloatArray:
    """Whitened contribution of a fitted effect, shape (rows,)."""
    return problem.columns(item.effect, item.place, item.shape) @ item.values


def carrying_channels(problem: Problem, whitened: FloatArray) -> tuple[str, ...]:
    """Channels that hold at least a tenth of the energy, strongest first."""
    energy = {channel: float(np.sum(whitened[rows] ** 2)) for channel, rows in problem.channel_slices.items()}
    total = max(sum(energy.values()), 1e-300)
    return tuple(sorted((c for c, e in energy.items() if e >= _CARRIES * total), key=lambda c: -energy[c]))


def _units(problem: Problem, item: Addition, unit: str) -> str:
    joint = item.place.joint
    if joint is not None and problem.scene.robot.joints[joint].prismatic:
        return unit.replace("N.m", "N").replace("rad", "m")
    return unit


def parameters_of(problem: Problem, item: Addition) -> tuple[FoundParameter, ...]:
    """Numbers of an effect with their std."""
    result = []
    for coefficient, value, std in zip(item.effect.coefficients, item.values, item.value_std, strict=True):
        unit = _units(problem, item, coefficient.unit)
        result.append(FoundParameter(coefficient.name, float(value), float(std) if np.isfinite(std) else None, unit))
    for shape in item.effect.shapes:
        std = item.shape_std[shape.name]
        known = float(std) if np.isfinite(std) else None
        result.append(FoundParameter(shape.name, float(item.shape[shape.name]), known, _units(problem, item, shape.unit)))
    return tuple(result)


def where_of(problem: Problem, item: Addition) -> Where:
    """Channels, region and lines of an effect's contribution."""
    whitened = contribution(problem, item)
    channels = carrying_channels(problem, whitened)
    strongest = whitened[problem.channel_slices[channels[0]]]
    return Where(channels, _region(problem, item, strongest), _lines(problem, strongest))


def _region(problem: Problem, item: Addition, series: FloatArray) -> str:
    joint = item.place.joint
    if joint is None:
        return "the whole motion"
    scene, energy = problem.scene, series**2
    name, unit = scene.robot.joints[joint].name, "m" if scene.robot.joints[joint].prismatic else "rad"
    pick = (lambda x: x) if problem.fit.thinning is None else problem.fit.thinning.pick
    speed, position = np.abs(pick(scene.speed[joint])), pick(scene.q[joint])
    for variable, label, end in ((speed, f"|velocity| of {name}", f"{unit}/s"), (np.abs(pick(scene.load[joint])), f"|load| of {name}", "N.m")):
        order = np.argsort(variable)
        share = np.cumsum(energy[order]) / max(energy.sum(), 1e-300)
        low = int(np.searchsorted(share, _CONCENTRATED))
        if low < _NARROW * len(order):
            return f"{label} < {variable[order[low]]:.2g} {end}"
        high = int(np.searchsorted(share, 1.0 - _CONCENTRATED))
        if high > (1.0 - _NARROW) * len(order):
            return f"{label} > {variable[order[high]]:.2g} {end}"
    bins = np.array_split(np.argsort(position), 10)
    sums = np.array([energy[b].sum() for b in bins]) / max(energy.sum(), 1e-300)
    top = int(np.argmax(sums))
    if sums[top] > 0.5:
        return f"position of {name} between {position[bins[top]].min():.2g} and {position[bins[top]].max():.2g} {unit}"
    return "the whole motion"


def _lines(problem: Problem, series: FloatArray) -> tuple[float, ...]:
    window = problem.fit.window
    if window is None:
        return ()
    power = np.abs(np.fft.rfft(series))
    power[0] = 0.0
    strongest = np.argsort(-power)[:3]
    return tuple(sorted(round(float(line * window.fundamental_hz), 6) for line in strongest if power[line] > 0))


def readable_place(place: str) -> str:
    """A place at the head of a sentence: ``joint_2`` becomes ``Joint 2``."""
    words = place.replace("_", " ").replace("+", " and ")
    return "The robot" if place == "robot" else words[0].upper() + words[1:]


def sentence_of(problem: Problem, item: Addition, parameters: tuple[FoundParameter, ...]) -> str:
    """Fill the effect's sentence with its place and numbers."""
    words = {p.name: f"{rounded(p.value, p.std)} {p.unit}".strip() for p in parameters}
    place = place_name(problem, item.place)
    place = readable_place(place)
    try:
        return item.effect.sentence.format(place=place, **words)
    except (KeyError, IndexError):
        return f"{place}: {item.effect.name.replace('_', ' ')}, " + ", ".join(f"{k} = {v}" for k, v in words.items()) + "."
