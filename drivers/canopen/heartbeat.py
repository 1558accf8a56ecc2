"""Heartbeats both ways: our own at its period, and a deadline for every drive's."""

from __future__ import annotations

from collections.abc import Iterable

BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127


class HeartbeatWatch:
    """The last heartbeat of every node, and which are overdue.

    Watching starts with the call of `watch`: a drive that never beats is overdue as well.
    """

    def __init__(self, nodes: Iterable[int], lost_ns: int) -> None:
        self._lost_ns = lost_ns
        self._seen_ns: dict[int, int] = {}
        self._watched = False
        self.state: dict[int, int | None] = dict.fromkeys(nodes)

    def forget(self) -> None:
        """Take every node as unknown again (before a reset)."""
        self.state = dict.fromkeys(self.state)

    def heard(self, node: int, data: bytes, stamp_ns: int) -> None:
        """Take one heartbeat."""
        if node in self.state and data:
            self.state[node] = data[0] & 0x7F
            self._seen_ns[node] = stamp_ns

    def watch(self, now_ns: int) -> None:
        """From now on every node has a deadline."""
        self._watched = True
        self._seen_ns = dict.fromkeys(self.state, now_ns)

    def rest(self) -> None:
        """Stop watching."""
        self._watched = False

    def overdue(self, now_ns: int) -> list[int]:
        """Nodes whose heartbeat is past its deadline."""
        if not self._watched:
            return []
        limit_ns = now_ns - self._lost_ns
        return [node for node, seen_ns in self._seen_ns.items() if seen_ns < limit_ns]


class HeartbeatProducer:
    """Tells when our own heartbeat is due; only a running cycle beats, so a hung host is silent."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self.next_ns = 0

    def due(self, now_ns: int) -> bool:
        """Whether to beat now; the next beat is then one period away."""
        if now_ns < self.next_ns:
            return False
        self.next_ns = now_ns + self._period_ns
        return True
