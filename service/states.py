"""Every allowed change of state, in one table, and the one function that makes it."""

from __future__ import annotations

from collections.abc import Mapping

from service.refusals import WrongState

# noun -> state -> event -> next state; what is not listed is refused
CHANGES: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "job": {
        "queued": {"start": "running", "cancel": "cancelled"},
        "running": {"finish": "done", "fail": "failed", "cancel": "cancelled", "lose": "interrupted"},
        "interrupted": {"requeue": "queued"},
        "done": {},
        "failed": {},
        "cancelled": {},
    },
    "run": {
        "previewed": {"confirm": "starting", "expire": "expired"},
        "starting": {"begin": "recording", "fail": "failed", "abort": "aborted", "lose": "interrupted"},
        "recording": {"finish": "finished", "fail": "failed", "abort": "aborted", "lose": "interrupted"},
        "finished": {},
        "failed": {},
        "aborted": {},
        "interrupted": {},
        "expired": {},
    },
    "calibration": {
        "proposed": {"accept": "accepted", "reject": "rejected", "supersede": "superseded"},
        "accepted": {"supersede": "superseded", "withdraw": "rejected"},
        "superseded": {"restore": "accepted"},
        "rejected": {},
    },
}


def advance(noun: str, state: str, event: str) -> str:
    """Give the state that follows.

    Args:
        noun: job, run or calibration.
        state: where it is.
        event: what happens to it.

    Returns:
        The next state.

    Raises:
        WrongState: the event is not allowed there.
    """
    allowed = CHANGES[noun][state]
    if event not in allowed:
        choices = f"it allows: {', '.join(allowed)}" if allowed else "nothing can change it any more"
        raise WrongState(f"A {state} {noun} cannot {event}", choices)
    return allowed[event]


def is_final(noun: str, state: str) -> bool:
    """Whether nothing can change this state any more."""
    return not CHANGES[noun][state]
