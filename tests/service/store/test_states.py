import pytest

from service.refusals import WrongState
from service.states import CHANGES, advance, is_final


@pytest.mark.parametrize("noun", CHANGES)
def test_every_change_leads_to_a_state_of_the_table(noun):
    for events in CHANGES[noun].values():
        assert set(events.values()) <= set(CHANGES[noun])


@pytest.mark.parametrize("noun", CHANGES)
def test_every_state_can_be_reached(noun):
    reached, pending = set(), [next(iter(CHANGES[noun]))]
    while pending:
        state = pending.pop()
        if state not in reached:
            reached.add(state)
            pending += CHANGES[noun][state].values()
    assert reached == set(CHANGES[noun])


def test_everything_else_is_refused_with_what_is_allowed():
    with pytest.raises(WrongState, match="it allows: start, cancel"):
        advance("job", "queued", "finish")
    with pytest.raises(WrongState, match="nothing can change it"):
        advance("calibration", "rejected", "accept")
    assert is_final("run", "aborted")
    assert not is_final("run", "recording")
