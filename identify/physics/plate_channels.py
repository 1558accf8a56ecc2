"""The plate's six channels as places."""

from __future__ import annotations

from identify.physics.effect import Place
from identify.physics.scene import Scene
from identify.robot import WRENCH_CHANNELS


def every_channel(scene: Scene) -> list[Place]:
    """The six channels, where there is a plate."""
    return [Place(channel=channel) for channel in WRENCH_CHANNELS] if scene.has_wrench else []


def every_pair(scene: Scene) -> list[Place]:
    """All ordered pairs of two channels, ``from->to``, where there is a plate."""
    if not scene.has_wrench:
        return []
    return [Place(channel=f"{a}->{b}") for a in WRENCH_CHANNELS for b in WRENCH_CHANNELS if a != b]


def row_of(channel: str | None) -> int:
    """Row of a channel among the six."""
    return WRENCH_CHANNELS.index(channel or "")
