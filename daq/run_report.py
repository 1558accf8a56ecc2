"""How a run ended: complete with its proof, or failed with the exact missing cycles, first cause first."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from daq.run_state import RunState

_LISTED = 200
"""Entries of a list that go into the log's record; a run that lost more has stopped long before."""


def spans(cycles: Sequence[int]) -> str:
    """Cycle numbers as spans: ``3, 7-9``."""
    found: list[list[int]] = []
    for cycle in sorted(set(cycles)):
        if found and cycle == found[-1][1] + 1:
            found[-1][1] = cycle
        else:
            found.append([cycle, cycle])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in found)


def _in_brackets(cycles: Sequence[int]) -> str:
    return f" ({spans(cycles)})" if cycles else ""


@dataclass(frozen=True)
class Missing:
    """One axis without its values in one cycle."""

    cycle: int
    axis: str


@dataclass(frozen=True)
class RunReport:
    """The account of a run.

    Attributes:
        state: how it ended.
        log: the log's path, empty where nothing was worth keeping.
        planned: set points of the motion.
        cycles: set points sent.
        written: cycles in the log.
        missing: every axis and cycle without values.
        torn: every axis and cycle whose set point did not arrive.
        irregular: cycles with late or duplicate frames or frames of a wrong length; nothing is missing there.
        late_syncs: cycles whose SYNC left late; the stamps say when.
        overruns: items that found the ring full.
        plate_samples: samples of the plate in the log.
        plate_lost: samples it counted that did not arrive.
        causes: what went wrong, first cause first.
        notes: what is worth knowing and spoils nothing.
        unconfirmed: axes that never confirmed their stop.
        restore_failures: settings that could not be put back.
    """

    state: RunState
    log: str
    planned: int
    cycles: int
    written: int
    missing: tuple[Missing, ...] = ()
    torn: tuple[Missing, ...] = ()
    irregular: tuple[int, ...] = ()
    late_syncs: tuple[int, ...] = ()
    overruns: int = 0
    plate_samples: int = 0
    plate_lost: int = 0
    causes: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    restore_failures: tuple[str, ...] = ()

    @property
    def missing_cycles(self) -> tuple[int, ...]:
        """Numbers of the cycles that lack anything, each once."""
        return tuple(sorted({entry.cycle for entry in self.missing}))

    @property
    def is_whole(self) -> bool:
        """Whether everything planned was sent, answered and written."""
        whole = self.cycles == self.planned == self.written and not (self.missing or self.torn)
        return whole and not (self.overruns or self.plate_lost or self.unconfirmed)

    @property
    def proof(self) -> str:
        """The arithmetic, in one sentence."""
        sent = f"{self.cycles} of {self.planned} cycles, {self.written} written"
        lacking = f"{len(self.missing_cycles)} missing{_in_brackets(self.missing_cycles)}"
        late = [entry.cycle for entry in self.torn]
        torn = f", {len(late)} set points missed{_in_brackets(late)}" if late else ""
        ring = f", {self.overruns} lost before the disk" if self.overruns else ""
        plate = f"; plate: {self.plate_samples} samples, {self.plate_lost} lost" if self.plate_samples else ""
        return f"{sent}, {lacking}{torn}{ring}{plate}"

    @property
    def sentence(self) -> str:
        """The whole outcome."""
        if self.state is RunState.RECORDED:
            return f"The run is complete: {self.proof}."
        what = "was aborted" if self.state is RunState.ABORTED else "failed"
        cause = f" First cause: {self.causes[0]}" if self.causes else ""
        kept = f" What came before is in {self.log}." if self.log else ""
        return f"The run {what}: {self.proof}.{cause}{kept}"

    def metadata(self) -> dict[str, str]:
        """The proof as it stands in the log's record."""
        outcome = {RunState.RECORDED: "complete", RunState.ABORTED: "aborted"}.get(self.state, "failed")
        return {
            "outcome": outcome,
            "proof": self.proof,
            "cycles_planned": str(self.planned),
            "cycles": str(self.cycles),
            "cycles_missing": str(len(self.missing_cycles)),
            "missing_cycles": spans(self.missing_cycles),
            "missing": json.dumps([[entry.cycle, entry.axis] for entry in self.missing[:_LISTED]]),
            "torn": json.dumps([[entry.cycle, entry.axis] for entry in self.torn[:_LISTED]]),
            "irregular_cycles": spans(self.irregular),
            "late_syncs": str(len(self.late_syncs)),
            "overruns": str(self.overruns),
            "plate_samples": str(self.plate_samples),
            "plate_lost": str(self.plate_lost),
            "causes": json.dumps(self.causes[:_LISTED]),
            "notes": json.dumps(self.notes[:_LISTED]),
        }

    def to_json(self) -> dict[str, Any]:
        """The report as plain data."""
        return {
            "schema_version": 1, **asdict(self), "state": self.state.value, "proof": self.proof,
            "sentence": self.sentence, "missing_cycles": list(self.missing_cycles),
        }
