"""What every effect of the catalogue has in common: a name, a place, a size, and where it acts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from drivers.virtual.errors import PlantError
from drivers.virtual.history import History
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import OutsideForce, RigidLoads, RigidPlant
from drivers.virtual.servo import Moments

HOOKS = ("tick", "deviation", "outside", "torque", "current", "plate", "encoder", "instants")
CHANNELS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


@dataclass(frozen=True)
class EffectSpec:
    """One effect to be simulated: name as in the catalogue, place, and parameters in SI units."""

    name: str
    joint: str | None = None
    channel: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Range:
    """Default range of one parameter; it is drawn log-uniformly where both ends are positive."""

    low: float
    high: float
    unit: str
    signed: bool = False
    """Either sign is drawn."""
    integer: bool = False

    @property
    def middle(self) -> float:
        """Geometric (else arithmetic) middle of the range."""
        if self.integer:
            return float((int(self.low) + int(self.high)) // 2)
        if self.low > 0.0:
            return float(np.sqrt(self.low * self.high))
        return 0.5 * (self.low + self.high)

    def draw(self, random: np.random.Generator) -> float:
        """Draw a value: log-uniform where both ends are positive, else uniform."""
        if self.integer:
            return float(random.integers(int(self.low), int(self.high) + 1))
        sign = random.choice((-1.0, 1.0)) if self.signed else 1.0
        if self.low > 0.0:
            return float(sign * np.exp(random.uniform(np.log(self.low), np.log(self.high))))
        return float(sign * random.uniform(self.low, self.high))


class Effect:
    """Base of all effects: each overrides the one or two hooks through which its physics enters.

    Class attributes: `where` is I (currents), B (both), P (plate) or S (sensing); `place` is joint, channel,
    crosstalk or none; `size` names the parameter whose zero switches the effect off.
    """

    name: ClassVar[str]
    where: ClassVar[str]
    place: ClassVar[str] = "joint"
    size: ClassVar[str]
    catalogued: ClassVar[bool] = True
    needs_loads: ClassVar[bool] = False
    needs_tilting: ClassVar[bool] = False

    def __init__(self, spec: EffectSpec, plant: PlantSpec) -> None:
        self.spec, self.plant_spec = spec, plant
        self.width = len(plant.joints)
        self.key = self.name
        self.j = _joint_index(spec, plant, self.place)
        self.channels = _channel_indices(spec, self.place)
        ranges = self.ranges(plant, self.j)
        unknown = sorted(set(spec.parameters) - set(ranges))
        if unknown:
            raise PlantError(f"{self.name} has no parameter {unknown[0]}; it has {', '.join(ranges)}.")
        self.p = {name: float(spec.parameters.get(name, r.middle)) for name, r in ranges.items()}

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters with their default ranges on this robot (and joint), in SI units."""
        raise NotImplementedError

    def column(self, values: np.ndarray) -> np.ndarray:
        """Put values (n,) into the effect's joint's column of an (n, k) array."""
        out = np.zeros((len(values), self.width))
        out[:, self.j] = values
        return out

    def alter(self, plant: PlantSpec) -> PlantSpec:
        """Return the plant as it truly is with this effect."""
        return plant

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Prepare the state that lives on the ticks."""

    def tick(self, moments: Moments, loads: RigidLoads | None) -> None:
        """Carry the effect's own state through the new ticks."""

    def deviation(self, moments: Moments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Link coordinate minus motor coordinate (n, k), with two derivatives."""
        raise NotImplementedError

    def outside(self, moments: Moments) -> Sequence[OutsideForce]:
        """Forces from the world on the links."""
        raise NotImplementedError

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Torque (n, k) the motors must supply in addition [N.m, joint side]."""
        raise NotImplementedError

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Return the motor currents (n, k) as they become."""
        raise NotImplementedError

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Return the plate's six channels (n, 6) as they become; successive calls continue in time."""
        raise NotImplementedError

    def encoder(self, moments: Moments, reading: np.ndarray) -> np.ndarray:
        """Return the encoder readings (n, k) as they become."""
        raise NotImplementedError

    def instants(self, stream: str, t_s: np.ndarray) -> np.ndarray:
        """Return the true instants (n,) or (n, k) of samples of `stream` that claim `t_s`."""
        raise NotImplementedError

    def has(self, hook: str) -> bool:
        """Whether this effect acts through a hook."""
        return getattr(type(self), hook) is not getattr(Effect, hook)


def _joint_index(spec: EffectSpec, plant: PlantSpec, place: str) -> int:
    if place != "joint":
        return 0
    if spec.joint not in plant.joint_names:
        known = ", ".join(plant.joint_names)
        raise PlantError(f"{spec.name} needs a joint of {plant.name} ({known}), not {spec.joint}.")
    return plant.joint_names.index(spec.joint)


def _channel_indices(spec: EffectSpec, place: str) -> tuple[int, ...]:
    if place not in ("channel", "crosstalk"):
        return ()
    if place == "channel" and spec.channel is None:
        return tuple(range(len(CHANNELS)))
    words = (spec.channel or "").split("->")
    if len(words) != (2 if place == "crosstalk" else 1) or any(word not in CHANNELS for word in words):
        example = "force.x->force.y" if place == "crosstalk" else "force.x"
        raise PlantError(f"{spec.name} needs a channel such as {example}, not {spec.channel}.")
    return tuple(CHANNELS.index(word) for word in words)
