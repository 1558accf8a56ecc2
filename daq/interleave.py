"""Puts the message records of several streams behind one another by log time, in chunks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np


def interleave(
    parts: Sequence[tuple[int, np.ndarray, np.ndarray]], chunk_bytes: int
) -> Iterator[tuple[bytes, np.ndarray, np.ndarray, np.ndarray]]:
    """Merge streams into chunks.

    A stream never changes its own order, even where its log times step back.

    Args:
        parts: channel id, (n, bytes) uint8 records and (n,) log times of each stream.
        chunk_bytes: a chunk ends with the message that reaches this size.

    Yields:
        The chunk's bytes, and each message's offset in it, channel and log time.
    """
    if not parts:
        return
    keys = np.concatenate([np.maximum.accumulate(times) for _, _, times in parts])
    order = np.argsort(keys, kind="stable")
    sizes = np.concatenate([np.full(len(rows), rows.shape[1]) for _, rows, _ in parts])[order]
    ends = np.cumsum(sizes)
    starts = np.empty(len(order), np.int64)
    starts[order] = ends - sizes
    buffer = _scatter(parts, starts, int(ends[-1]))
    channels = np.concatenate([np.full(len(rows), channel) for channel, rows, _ in parts])[order]
    times = np.concatenate([times for _, _, times in parts])[order]
    starts = ends - sizes
    cut = 0
    while cut < len(order):
        stop = min(int(np.searchsorted(ends, starts[cut] + chunk_bytes)) + 1, len(order))
        block = buffer[starts[cut] : ends[stop - 1]].tobytes()
        yield block, starts[cut:stop] - starts[cut], channels[cut:stop], times[cut:stop]
        cut = stop


def _scatter(
    parts: Sequence[tuple[int, np.ndarray, np.ndarray]], starts: np.ndarray, size: int
) -> np.ndarray:
    """Put every record at its place, through a view of every possible place."""
    buffer = np.empty(size, np.uint8)
    done = 0
    for _, rows, _ in parts:
        width = rows.shape[1]
        kind = np.dtype((np.void, width))
        every = np.lib.stride_tricks.as_strided(buffer[:width].view(kind), (size - width + 1,), (1,))
        every[starts[done : done + len(rows)]] = np.ascontiguousarray(rows).view(kind)[:, 0]
        done += len(rows)
    return buffer
