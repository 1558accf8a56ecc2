"""What a diagnosis says: findings, the unexplained, verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from identify.diagnosis.adequacy import Structure
from identify.diagnosis.blind_spots import BlindSpot
from identify.diagnosis.held_out import HeldOut
from identify.diagnosis.locate import Location

VERDICTS = ("consistent", "explained", "partly_explained", "unexplained")


@dataclass(frozen=True)
class FoundParameter:
    """One number of a finding; std is None where the data do not bound it."""

    name: str
    value: float
    std: float | None
    unit: str


@dataclass(frozen=True)
class Where:
    """Where a finding shows.

    Attributes:
        channels: channels that carry it, strongest first.
        region: part of the motion it sits in, in words.
        lines_hz: strongest lines of its contribution.
    """

    channels: tuple[str, ...]
    region: str
    lines_hz: tuple[float, ...]


@dataclass(frozen=True)
class Finding:
    """One named effect.

    Attributes:
        effect: its name.
        joint: joint name, None for plate and whole-robot effects.
        channel: wrench channel, or ``from->to``, None elsewhere.
        parameters: its numbers.
        p_value: chance that noise alone would make the best of all candidates stand out as much.
        delta_chi2: what the fit loses without it.
        alternatives: effects that these data cannot tell from it, at most four.
        where: where it shows.
        sentence: for people.
    """

    effect: str
    joint: str | None
    channel: str | None
    parameters: tuple[FoundParameter, ...]
    p_value: float
    delta_chi2: float
    alternatives: tuple[str, ...]
    where: Where
    sentence: str


@dataclass(frozen=True)
class Unexplained:
    """A misfit without a name."""

    channels: tuple[str, ...]
    depends_on: tuple[str, ...]
    p_value: float
    sentence: str


@dataclass(frozen=True)
class ChannelFit:
    """RMS of the averaged residual of every channel before and after, and what noise alone would leave."""

    before: Mapping[str, float]
    after: Mapping[str, float]
    noise: Mapping[str, float]


@dataclass(frozen=True)
class Diagnosis:
    """Everything a diagnosis found.

    Attributes:
        verdict: one of :data:`VERDICTS`.
        findings: named effects.
        unexplained: what is left without a name, or None.
        blind_spots: one entry an effect.
        training: RMS on the run itself.
        held_out: RMS on another recording, or None.
        location: internal against external.
        next_experiment: what to record next, or None.
        structures: curves of the baseline residual against states, for plots.
        warnings: what the reader must know.
        model: what ``simulate`` and ``export`` need of the augmented model.
    """

    verdict: str
    findings: tuple[Finding, ...]
    unexplained: Unexplained | None
    blind_spots: tuple[BlindSpot, ...]
    training: ChannelFit
    held_out: HeldOut | None
    location: Location
    next_experiment: Mapping[str, object] | None
    structures: tuple[Structure, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())
    model: Mapping[str, object] = field(default_factory=dict)


def rounded(value: float, std: float | None) -> str:
    """Write a number to the digit its std supports, with its std."""
    if std is None or not np.isfinite(std) or std <= 0.0:
        return f"{value:.3g}"
    digits = int(np.clip(1 - np.floor(np.log10(std)), 0, 12))
    return f"{value:.{digits}f} ± {std:.{digits}f}"
