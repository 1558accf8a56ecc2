"""A force plate on a serial port: start, read in bulk, tare, watch for stalls, stop."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import serial

from drivers.errors import HardwareError
from drivers.force_plate.errors import (
    PlateNotFoundError,
    PlateNotStillError,
    PlateRefusedError,
    PlateStalledError,
    PlateUnpluggedError,
)
from drivers.force_plate.latency_timer import SYSFS_ROOT, latency_timer
from drivers.force_plate.parser import PlateParser
from drivers.force_plate.protocols.protocol import Exchange, PlateProtocol, sample_period_s
from drivers.force_plate.sample import PlateSample
from drivers.force_plate.tare import Tare, tare_of

_READ_TIMEOUT_S = 0.05
"""Longest time that the reader thread sleeps in a read, and thus that stopping takes."""

_RESEND_NS = 500_000_000
"""A device that is still starting up misses its first command."""

_STALL_PERIODS = 20
_LEAST_STALL_S = 0.25
"""Default deadline: twenty samples, and never less than what a busy host may take to look."""


@dataclass(frozen=True)
class PlateHealth:
    """The plate's account since the start.

    Attributes:
        samples: intact samples.
        lost: samples lost by the device's own count; 0 for devices that keep none.
        skipped_bytes: bytes that belonged to no intact frame.
        overloaded: samples with a channel at or beyond its range.
        invalid: samples that the device itself does not trust.
    """

    samples: int
    lost: int
    skipped_bytes: int
    overloaded: int
    invalid: int


class ForcePlate:
    """One plate; use as a context manager, which opens the port and always stops the stream.

    Args of the constructor:
        protocol: how the plate speaks, see `protocols.protocol_named`.
        port: serial device, such as ``/dev/serial/by-id/...``.
        stall_s: deadline without an intact sample, default twenty samples and at least 0.25 s.
        sysfs_root: where converters keep their latency timers.
        now_ns: host monotonic clock.
    """

    def __init__(
        self,
        protocol: PlateProtocol,
        port: str,
        *,
        stall_s: float | None = None,
        sysfs_root: Path = SYSFS_ROOT,
        now_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.protocol, self.port = protocol, port
        self.stall_s = stall_s or max(_STALL_PERIODS * sample_period_s(protocol), _LEAST_STALL_S)
        self._sysfs_root, self._now_ns = sysfs_root, now_ns
        self._serial: serial.Serial | None = None
        self._parser = PlateParser(protocol)
        self._samples: deque[PlateSample] = deque()
        self._arrived = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_stopping = False
        self._failure: HardwareError | None = None
        self._last_ns = 0
        self._total = self._overloaded = self._invalid = 0

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self) -> tuple[str, ...]:
        """Open the port and shorten its latency; return warnings for the user.

        Raises:
            PlateNotFoundError: no such port, or no right to open it.
        """
        try:
            self._serial = serial.Serial(self.port, self.protocol.baud, timeout=_READ_TIMEOUT_S)
        except (serial.SerialException, OSError, ValueError) as error:
            raise PlateNotFoundError(self.port, _reason(error)) from error
        with contextlib.suppress(OSError, ValueError, AttributeError, NotImplementedError):
            self._serial.set_low_latency_mode(True)  # Linux drivers that know it; others keep their timer
        timer = latency_timer(self.port, self._sysfs_root)
        return () if timer is None or timer.is_good else (timer.remedy,)

    def start(self) -> None:
        """Bring the plate to streaming and begin to read in a thread.

        Raises:
            PlateRefusedError: a command was not acknowledged.
            PlateUnpluggedError: the port vanished.
        """
        self._parser = PlateParser(self.protocol)
        self._samples.clear()
        self._total = self._overloaded = self._invalid = 0
        rest = b""
        with self._translated():
            self._port().reset_input_buffer()
            for exchange in self.protocol.startup:
                rest = self._exchange(exchange)
        self._is_stopping, self._failure, self._last_ns = False, None, self._now_ns()
        self._take(self._parser.feed(rest, self._last_ns))
        self._thread = threading.Thread(target=self._read_loop, name="force-plate", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the reading and ask the plate to be silent; a plate that is gone is no error here."""
        self._is_stopping = True
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._serial is not None and self._failure is None:
            with contextlib.suppress(HardwareError), self._translated():
                for exchange in self.protocol.shutdown:
                    self._exchange(exchange)

    def close(self) -> None:
        """Stop and give the port back."""
        self.stop()
        if self._serial is not None:
            with contextlib.suppress(OSError, serial.SerialException):
                self._serial.close()
            self._serial = None

    def read(self, timeout_s: float = 0.0) -> list[PlateSample]:
        """Return the samples that arrived since the last call, waiting up to ``timeout_s`` for the first.

        Samples read before a failure are returned first; the failure is raised by the next call.

        Raises:
            PlateStalledError: no intact sample within the deadline.
            PlateUnpluggedError: the port vanished.
        """
        with self._arrived:
            if not self._samples and self._failure is None and timeout_s > 0:
                wait_s = min(timeout_s, max(self.stall_s - self._silent_s(), 0.0) + _READ_TIMEOUT_S)
                self._arrived.wait_for(lambda: self._samples or self._failure is not None, wait_s)
            samples = list(self._samples)
            self._samples.clear()
        if not samples:
            self._raise_trouble()
        return samples

    def tare(self, duration_s: float = 1.0) -> Tare:
        """Average the unloaded or standing plate.

        Raises:
            PlateNotStillError: too few samples, or an overloaded or invalid one.
        """
        wanted = max(round(duration_s / sample_period_s(self.protocol)), 2)
        self.read()  # what is older than the request does not count
        samples: list[PlateSample] = []
        while len(samples) < wanted:
            samples += self.read(timeout_s=self.stall_s)
        bad = sum(sample.is_overloaded or not sample.is_valid for sample in samples)
        if bad:
            raise PlateNotStillError(
                self.port, f"{bad} of {len(samples)} samples were overloaded or invalid"
            )
        return tare_of(samples)

    @property
    def health(self) -> PlateHealth:
        """The account since the start."""
        counts = self._parser.counts
        return PlateHealth(
            self._total, self._parser.lost, counts.skipped_bytes, self._overloaded, self._invalid
        )

    def _silent_s(self) -> float:
        return (self._now_ns() - self._last_ns) * 1e-9

    def _raise_trouble(self) -> None:
        if self._failure is not None:
            raise self._failure
        silent_s = self._silent_s()
        if self._thread is not None and silent_s > self.stall_s:
            raise PlateStalledError(self.port, silent_s, self.stall_s)

    def _read_loop(self) -> None:
        port = self._port()
        while not self._is_stopping:
            try:
                # All that is there at once; when nothing is, sleep until the first byte.
                data = port.read(max(port.in_waiting, 1))
            except (serial.SerialException, OSError, TypeError) as error:
                self._fail(PlateUnpluggedError(self.port, _reason(error)))
                return
            read_ns = self._now_ns()
            self._take(self._parser.feed(data, read_ns) if data else self._parser.flush(read_ns))

    def _take(self, samples: list[PlateSample]) -> None:
        if not samples:
            return
        with self._arrived:
            self._samples.extend(samples)
            self._last_ns = samples[-1].read_ns
            self._total += len(samples)
            self._overloaded += sum(sample.is_overloaded for sample in samples)
            self._invalid += sum(not sample.is_valid for sample in samples)
            self._arrived.notify_all()

    def _fail(self, failure: HardwareError) -> None:
        with self._arrived:
            self._failure = failure
            self._arrived.notify_all()

    def _exchange(self, exchange: Exchange) -> bytes:
        """Send a command, again every half second, until it is acknowledged; return what came after."""
        port = self._port()
        port.write(exchange.send)
        if not exchange.expect:
            return b""
        answer = bytearray()
        begun_ns = sent_ns = self._now_ns()
        while exchange.expect not in answer:
            now_ns = self._now_ns()
            if now_ns > begun_ns + round(exchange.timeout_s * 1e9):
                raise PlateRefusedError(self.port, exchange.send, exchange.expect, bytes(answer))
            if now_ns > sent_ns + _RESEND_NS:
                port.write(exchange.send)
                sent_ns = now_ns
            answer += port.read(max(port.in_waiting, 1))
        return bytes(answer[answer.index(exchange.expect) + len(exchange.expect) :])

    def _port(self) -> serial.Serial:
        if self._serial is None:
            raise PlateNotFoundError(self.port, "it was not opened")
        return self._serial

    @contextlib.contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except (serial.SerialException, OSError) as error:
            raise PlateUnpluggedError(self.port, _reason(error)) from error


def _reason(error: BaseException) -> str:
    """Return the system's own words for an error, on one line."""
    number = getattr(error, "errno", None)
    if number:
        return os.strerror(number).lower()
    return " ".join(str(error).split()) or type(error).__name__
