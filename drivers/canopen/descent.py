"""Walking down the stop ladder on the real bus."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.canopen.config import Deadlines
from drivers.canopen.exchange import Exchange
from drivers.canopen.heartbeat import STOPPED
from drivers.canopen.ladder import Event, Rung, StopLadder
from drivers.canopen.power import Goal, PowerStage
from drivers.canopen.sample import CycleSample
from drivers.canopen.traffic import STOP, Traffic
from drivers.errors import LinkError, StateTimeoutError

_LOOK_NS = 10_000_000  # how often the last rung looks at the heartbeats [ns]
_GOALS = {Rung.DISABLING: Goal.DISABLE, Rung.QUICK_STOP: Goal.QUICK_STOP}


class Descent:
    """Stops all drives, rung by rung, whatever fails on the way."""

    def __init__(
        self,
        deadlines: Deadlines,
        traffic: Traffic,
        exchange: Exchange,
        stages: Sequence[PowerStage],
        names: Sequence[str],
    ) -> None:
        self.ladder = StopLadder(round(deadlines.quick_stop_s * 1e9), round(deadlines.nmt_stop_s * 1e9))
        self.tail: list[CycleSample] = []
        self.unconfirmed: tuple[str, ...] = ()
        self._traffic = traffic
        self._exchange = exchange
        self._stages = stages
        self._names = names

    def run(self, event: Event, targets: Sequence[int], last: CycleSample | None) -> None:
        """Go down until the drives have stopped or the last deadline passed; never raises for a dead bus.

        Args:
            event: what started it.
            targets: the last set points [counts], held meanwhile.
            last: the latest sample, for the drives' states.
        """
        ladder, link = self.ladder, self._traffic.link
        causes = len(self._traffic.ledger.causes)
        rung = ladder.take(event, link.now_ns())
        entered: Rung | None = None
        while not ladder.ended:
            try:
                if rung is not entered:
                    self._enter(rung)
                    entered = rung
                confirmed = self._work(rung, targets, last)
                last = self.tail[-1] if self.tail else last
                rung = ladder.advance(confirmed, link.now_ns())
            except LinkError:
                rung = ladder.take(Event.NO_LINK, link.now_ns())
            if rung is Rung.DISABLING and len(self._traffic.ledger.causes) > causes:
                rung = ladder.take(Event.TRIP, link.now_ns())
        if ladder.rung is Rung.UNCONFIRMED:
            self.unconfirmed = self._not_stopped()

    def _enter(self, rung: Rung) -> None:
        goal = _GOALS.get(rung)
        if goal is not None:
            for stage in self._stages:
                stage.aim(goal, self._traffic.link.now_ns())
        elif rung is Rung.NMT_STOP:
            self._traffic.command(STOP)

    def _work(self, rung: Rung, targets: Sequence[int], last: CycleSample | None) -> bool:
        if rung is Rung.NMT_STOP:
            self._traffic.run_until(self._traffic.link.now_ns() + _LOOK_NS)
            return not self._not_stopped()
        status = last.status_word if last else (None,) * len(self._stages)
        words = [self._word(stage, word) for stage, word in zip(self._stages, status, strict=True)]
        sample = self._exchange.step(-1, words, targets)
        self.tail.append(sample)
        for stage, word in zip(self._stages, sample.status_word, strict=True):
            self._word(stage, word)
        return all(stage.reached for stage in self._stages) and None not in sample.status_word

    def _word(self, stage: PowerStage, status_word: int | None) -> int:
        try:
            return stage.advance(status_word, self._traffic.link.now_ns())
        except StateTimeoutError:
            return 0  # the ladder keeps its own deadline, and disable voltage is the next lower word

    def _not_stopped(self) -> tuple[str, ...]:
        states = self._traffic.heartbeats.state.values()
        return tuple(name for name, state in zip(self._names, states, strict=True) if state != STOPPED)
