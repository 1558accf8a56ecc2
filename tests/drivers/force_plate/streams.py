"""Frames and damage for the protocol tests."""

from __future__ import annotations

import numpy as np

from drivers.force_plate.protocols import PROTOCOLS, protocol_named

NAMES = tuple(PROTOCOLS)
SINGLE = {name: protocol_named(name) for name in NAMES}


def frames_of(name: str, count: int, seed: int = 0, first: int = 0) -> list[bytes]:
    """Distinct frames within every protocol's range."""
    rng = np.random.default_rng(seed)
    wrenches = rng.uniform(-1, 1, (count, 6)) * (100, 100, 100, 4, 4, 4)
    return [SINGLE[name].encode(wrench, first + index) for index, wrench in enumerate(wrenches)]


def chunks_of(data: bytes, seed: int = 0, largest: int = 90) -> list[bytes]:
    """Cut at random places, single bytes included."""
    rng = np.random.default_rng(seed)
    pieces, at = [], 0
    while at < len(data):
        size = int(rng.integers(1, largest))
        pieces.append(data[at : at + size])
        at += size
    return pieces
