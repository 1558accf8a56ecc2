"""When the next SYNC is due: on the grid, catching up after a hiccup but never in a burst."""

from __future__ import annotations

#: Least distance of two SYNCs in periods: closer ones overtake the answers to the former.
_LEAST_SPACING = 0.8

#: A SYNC further off its place than this share of the period counts as late.
_LATE_SHARE = 0.2


class SyncSchedule:
    """The grid of SYNC instants.

    Args:
        period_ns: SYNC period [ns].
        start_ns: first due time [ns].
    """

    def __init__(self, period_ns: int, start_ns: int) -> None:
        self.period_ns = period_ns
        self._grid_ns = start_ns
        self._due_ns = start_ns
        self.slips = 0  # times the grid was moved because a whole period was lost

    @property
    def due_ns(self) -> int:
        """When the next SYNC is to leave [ns]."""
        return self._due_ns

    def hold_until(self, time_ns: int) -> None:
        """Put the next SYNC off until `time_ns` [ns] or later: set points that left late arrive first."""
        self._due_ns = max(self._due_ns, time_ns)

    def sent(self, at_ns: int) -> bool:
        """Note that the SYNC left at `at_ns` and plan the next.

        Returns:
            True when it left late.
        """
        late_ns = at_ns - self._grid_ns
        if late_ns > self.period_ns:
            self.slips += 1
            self._grid_ns = at_ns  # the lost time stays lost: the motion is stretched, not jumped
        self._grid_ns += self.period_ns
        self._due_ns = max(self._grid_ns, at_ns + round(_LEAST_SPACING * self.period_ns))
        return late_ns > _LATE_SHARE * self.period_ns
