"""A fake plate on a real serial port (a pseudo-terminal), in real time, from a thread or a process."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import select
import threading
import time
import tty
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Self

from drivers.force_plate.fake import Emission, FakePlate
from drivers.force_plate.protocols.protocol import Exchange, PlateProtocol

_LISTEN_S = 0.002
"""Longest wait between two looks at the commands."""

_LONGEST_COMMAND = 64


class FakePort:
    """A plate behind a pseudo-terminal, served by a thread; use as a context manager.

    It answers the protocol's commands and streams only between its start and its stop command.

    Attributes:
        port: path to open, as `/dev/ttyUSB0` would be.
    """

    def __init__(self, plate: FakePlate) -> None:
        self._plate = plate
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="fake-plate", daemon=True)
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave: int | None = slave

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(timeout=5.0)
        self._close()

    def _close(self) -> None:
        for descriptor in (self._master, self._slave):
            if descriptor is not None:
                with contextlib.suppress(OSError):
                    os.close(descriptor)
        self._slave = None

    def _serve(self) -> None:
        with contextlib.suppress(OSError):  # the reader may have gone
            serve(self._master, self._plate, self._stop)
        if not self._stop.is_set():  # unplugged
            self._stop.set()
            self._close()


class FakePortProcess:
    """The same, served by another process: the reader's own load cannot slow the device down."""

    def __init__(self, plate: FakePlate) -> None:
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._process = context.Process(target=_run_in_process, args=(plate, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self.port: str = self._ours.recv()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self._ours.send("stop")
        self._process.join(timeout=5.0)
        self._ours.close()


def _run_in_process(plate: FakePlate, pipe: Connection) -> None:
    with FakePort(plate) as fake, contextlib.suppress(EOFError):
        pipe.send(fake.port)
        pipe.recv()


def serve(master: int, plate: FakePlate, stop: threading.Event) -> None:
    """Answer commands and stream on an open pseudo-terminal until stopped or unplugged."""
    listener = _CommandListener(plate.protocol)
    emissions: Iterator[Emission] | None = None
    following: Emission | None = None
    started_s = 0.0
    while not stop.is_set():
        wait_s = _LISTEN_S
        if following is not None:
            wait_s = min(max(started_s + following.due_s - time.monotonic(), 0.0), _LISTEN_S)
        if select.select([master], [], [], wait_s)[0]:
            answer = listener.hear(os.read(master, 4096))
            os.write(master, answer)
            if listener.is_streaming and emissions is None:
                emissions, started_s = plate.emissions(), time.monotonic()
                following = next(emissions, None)
            elif not listener.is_streaming:
                emissions = following = None
        now_s = time.monotonic() - started_s
        while emissions is not None and following is not None and following.due_s <= now_s:
            if following.is_end:
                return
            os.write(master, following.data)
            following = next(emissions, None)


class _CommandListener:
    """Recognises the protocol's commands in what the host writes."""

    def __init__(self, protocol: PlateProtocol) -> None:
        self._start = protocol.startup[-1]
        self._known: tuple[Exchange, ...] = (*protocol.startup, *protocol.shutdown)
        self._heard = bytearray()
        self.is_streaming = False

    def hear(self, data: bytes) -> bytes:
        """Take bytes from the host and return the device's answers."""
        self._heard += data
        answers = bytearray()
        while (exchange := self._next_command()) is not None:
            self.is_streaming = exchange.send == self._start.send
            answers += exchange.expect
        del self._heard[:-_LONGEST_COMMAND]
        return bytes(answers)

    def _next_command(self) -> Exchange | None:
        places = [(self._heard.find(exchange.send), exchange) for exchange in self._known]
        found = [(at, exchange) for at, exchange in places if at >= 0]
        if not found:
            return None
        at, exchange = min(found, key=lambda item: item[0])
        del self._heard[: at + len(exchange.send)]
        return exchange
