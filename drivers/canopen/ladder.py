"""The stop ladder: quick stop on all axes, a deadline, NMT stop, a deadline; one table, one `advance`."""

from __future__ import annotations

from enum import Enum


class Rung(Enum):
    """Where the ladder stands."""

    RUNNING = "running"
    DISABLING = "disabling"
    QUICK_STOP = "quick stop"
    NMT_STOP = "NMT stop"
    STOPPED = "stopped"
    UNCONFIRMED = "stop not confirmed"


class Event(Enum):
    """What moves the ladder."""

    FINISH = "finished as planned"
    TRIP = "a cause to stop"
    CONFIRMED = "every drive reports that it stopped"
    DEADLINE = "deadline passed"
    NO_LINK = "nothing can be sent"


TABLE: dict[tuple[Rung, Event], Rung] = {
    (Rung.RUNNING, Event.FINISH): Rung.DISABLING,
    (Rung.RUNNING, Event.TRIP): Rung.QUICK_STOP,
    (Rung.RUNNING, Event.NO_LINK): Rung.NMT_STOP,
    (Rung.DISABLING, Event.CONFIRMED): Rung.STOPPED,
    (Rung.DISABLING, Event.TRIP): Rung.QUICK_STOP,
    (Rung.DISABLING, Event.DEADLINE): Rung.QUICK_STOP,
    (Rung.DISABLING, Event.NO_LINK): Rung.NMT_STOP,
    (Rung.QUICK_STOP, Event.CONFIRMED): Rung.STOPPED,
    (Rung.QUICK_STOP, Event.DEADLINE): Rung.NMT_STOP,
    (Rung.QUICK_STOP, Event.NO_LINK): Rung.NMT_STOP,
    (Rung.NMT_STOP, Event.CONFIRMED): Rung.STOPPED,
    (Rung.NMT_STOP, Event.DEADLINE): Rung.UNCONFIRMED,
    (Rung.NMT_STOP, Event.NO_LINK): Rung.UNCONFIRMED,
}


class StopLadder:
    """Steps down rung by rung; never up.

    Args:
        quick_stop_ns: how long disabling and the quick stop may each take [ns].
        nmt_stop_ns: how long the drives have to report NMT state 'stopped' [ns].
    """

    def __init__(self, quick_stop_ns: int, nmt_stop_ns: int) -> None:
        self.rung = Rung.RUNNING
        self.history: list[tuple[Rung, int]] = []
        self._deadline_ns = {
            Rung.DISABLING: quick_stop_ns,
            Rung.QUICK_STOP: quick_stop_ns,
            Rung.NMT_STOP: nmt_stop_ns,
        }
        self._since_ns = 0

    @property
    def ended(self) -> bool:
        """Whether the last rung is reached."""
        return self.rung in (Rung.STOPPED, Rung.UNCONFIRMED)

    def take(self, event: Event, now_ns: int) -> Rung:
        """Let one event act; one that means nothing on this rung is passed over."""
        target = TABLE.get((self.rung, event))
        if target is not None:
            self.rung = target
            self._since_ns = now_ns
            self.history.append((target, now_ns))
        return self.rung

    def advance(self, confirmed: bool, now_ns: int) -> Rung:
        """One look at the drives: down when they stopped, down when the deadline passed."""
        if confirmed:
            return self.take(Event.CONFIRMED, now_ns)
        limit_ns = self._deadline_ns.get(self.rung)
        if limit_ns is not None and now_ns - self._since_ns >= limit_ns:
            return self.take(Event.DEADLINE, now_ns)
        return self.rung
