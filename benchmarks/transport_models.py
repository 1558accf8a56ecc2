"""How a serial frame's last byte reaches the host: byte by byte, timers, polls and the scheduler."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from daq.timebase import FTDI_1_MS, FTDI_16_MS, USB_CDC, Transport

FRAME_BYTES, BAUD, TICK_S = 37, 460_800, 1e-6
PERIOD_S = 341 * 19.53125e-6  # the reference plate at 150 Hz
FTDI_PAYLOAD = 62  # bytes of a 64-byte packet that carry data (FTDI AN232B-04)


@dataclass(frozen=True)
class Link:
    """A transport: the latency timer (0: none), the USB poll, and what the mapping may know of it."""

    timer_s: float
    poll_s: float
    known: Transport


XHCI_POLL_S = 125e-6  # bulk transfers are retried within the frame; completions once a microframe
UHCI_POLL_S = 1e-3  # old hosts complete once a frame: a second clock of 1 ms that may beat with the chip's

LINKS = {
    "USB-CDC": Link(0.0, XHCI_POLL_S, USB_CDC),
    "FTDI 1 ms": Link(1e-3, XHCI_POLL_S, FTDI_1_MS),
    "FTDI 16 ms": Link(16e-3, XHCI_POLL_S, FTDI_16_MS),
    "FTDI 1 ms, UHCI": Link(1e-3, UHCI_POLL_S, replace(FTDI_1_MS, poll_s=UHCI_POLL_S)),
    "FTDI 16 ms, UHCI": Link(16e-3, UHCI_POLL_S, replace(FTDI_16_MS, poll_s=UHCI_POLL_S)),
}


@dataclass(frozen=True)
class Run:
    """One simulated run with its truth."""

    ticks: np.ndarray
    read_ns: np.ndarray
    true_ns: np.ndarray


def simulate(link: Link, seed: int, duration_s: float = 160.0) -> Run:
    """Return stamps, read instants and true instants of one run."""
    rng = np.random.default_rng(seed)
    count = round(duration_s / PERIOD_S)
    drift = rng.uniform(-80e-6, 80e-6)
    device_s = np.arange(count) * PERIOD_S
    wander = 0.05e-6 * rng.standard_normal() * device_s**2 / duration_s  # 0.05 ppm change of rate in a run
    true_s = 10.0 + rng.uniform(0, 1) + device_s * (1 + drift) + wander
    end_s = true_s + 10 * FRAME_BYTES / BAUD
    if link.timer_s:
        end_s = _through_chip(end_s, link.timer_s * (1 + rng.uniform(-50e-6, 50e-6)), rng)
    ready_s = np.ceil(end_s / link.poll_s + (phase := rng.uniform())) * link.poll_s - phase * link.poll_s
    floor_s = rng.uniform(link.known.floor_min_s, link.known.floor_max_s)
    host_s = ready_s + floor_s + rng.exponential(30e-6, count)
    stalled = rng.random(count) < 2e-3  # the scheduler has better things to do
    host_s[stalled] += rng.exponential(4e-3, int(stalled.sum()))
    host_s = np.maximum.accumulate(host_s)
    ticks = 5_000_000 + np.rint(device_s / TICK_S).astype(np.int64)
    return Run(ticks, np.rint(host_s * 1e9).astype(np.int64), np.rint(true_s * 1e9).astype(np.int64))


def _through_chip(end_s: np.ndarray, timer_s: float, rng: np.random.Generator) -> np.ndarray:
    """Return when the packet with each frame's last byte leaves the chip: full, or its timer expired."""
    byte_s = 10 / BAUD
    leaves = np.empty_like(end_s)
    due = end_s[0] - rng.uniform() * timer_s
    held, waiting = 0, []
    for index, end in enumerate(end_s):
        first_byte = end - (FRAME_BYTES - 1) * byte_s
        sent = 0
        while sent < FRAME_BYTES:
            fill = first_byte + (sent + FTDI_PAYLOAD - held - 1) * byte_s  # when the packet would be full
            last = end
            if due < first_byte + sent * byte_s:  # the timer ends before the next byte
                for frame in waiting:
                    leaves[frame] = due
                waiting, held = [], 0
                missed = max(np.ceil((first_byte + sent * byte_s - due) / timer_s), 1)
                due += missed * timer_s
                continue
            stop = min(fill, due, last)
            arrived = min(int((stop - first_byte) / byte_s + 1 + 1e-6) - sent, FRAME_BYTES - sent)
            held, sent = held + max(arrived, 1), sent + max(arrived, 1)
            if sent >= FRAME_BYTES:
                waiting.append(index)
            if held >= FTDI_PAYLOAD:
                for frame in waiting:
                    leaves[frame] = stop
                waiting, held, due = [], 0, stop + timer_s
    for frame in waiting:
        leaves[frame] = due
    return np.maximum(leaves, end_s)
