"""Calibrations: proposed, accepted, rejected, superseded, rolled back; no simulated one on a real robot."""

import threading

import pytest

from service import calibrations
from service.calibrations import Change
from service.refusals import Conflict, NotFound, SimulatedResult, Unusable, WrongState
from tests.service.store import lab

WHY = Change("anna", "looked at it")


@pytest.fixture
def proposed(database):
    """Three proposed calibrations of one robot."""
    with database.write() as session:
        lab.add_robot(session)
        return [calibrations.propose(session, lab.add_estimate(session).id, WHY).id for _ in range(3)]


def states(database):
    with database.read() as session:
        return calibrations.states(session, "IR-1")


def act(database, function, *arguments):
    with database.write() as session:
        return function(session, *arguments, WHY)


def test_accepting_supersedes_the_one_before(database, proposed):
    first, second, third = proposed
    act(database, calibrations.accept, first)
    act(database, calibrations.accept, second)
    act(database, calibrations.reject, third)
    assert states(database) == {first: "superseded", second: "accepted", third: "rejected"}
    with database.read() as session:
        assert calibrations.accepted(session, "IR-1").id == second
        assert [event.event for event in calibrations.history(session, first)] == [
            "propose",
            "accept",
            "supersede",
        ]


def test_rolling_back_walks_back_through_what_was_in_force(database, proposed):
    for key in proposed:
        act(database, calibrations.accept, key)
    assert act(database, calibrations.roll_back, "IR-1").id == proposed[1]
    assert act(database, calibrations.roll_back, "IR-1").id == proposed[0]
    assert states(database) == {proposed[0]: "accepted", proposed[1]: "rejected", proposed[2]: "rejected"}
    with pytest.raises(WrongState, match="no calibration before"):
        act(database, calibrations.roll_back, "IR-1")


def test_rolling_back_nothing(database):
    with database.write() as session:
        lab.add_robot(session)
    with pytest.raises(WrongState, match="no accepted"):
        act(database, calibrations.roll_back, "IR-1")


def test_a_simulated_estimate_is_never_accepted_for_a_real_robot(database):
    with database.write() as session:
        lab.add_robot(session)
        row = calibrations.propose(session, lab.add_estimate(session, simulated=True).id, WHY)
    with pytest.raises(SimulatedResult, match="never be accepted"):
        act(database, calibrations.accept, row.id)
    assert states(database) == {row.id: "proposed"}


def test_but_for_a_simulated_robot(database):
    with database.write() as session:
        lab.add_robot(session, "VIRTUAL", simulated=True)
        row = calibrations.propose(session, lab.add_estimate(session, "VIRTUAL", simulated=True).id, WHY)
        calibrations.accept(session, row.id, WHY)
        assert calibrations.state_of(session, row.id) == "accepted"


def test_what_is_decided_stays_decided(database, proposed):
    act(database, calibrations.reject, proposed[0])
    for function in (calibrations.accept, calibrations.reject):
        with pytest.raises(WrongState, match="rejected calibration"):
            act(database, function, proposed[0])


def test_an_estimate_is_proposed_once_and_for_the_present_description(database):
    with database.write() as session:
        lab.add_robot(session)
        estimate = lab.add_estimate(session)
        other = lab.add_estimate(session, model_hash="0123")
        calibrations.propose(session, estimate.id, WHY)
    with pytest.raises(Conflict, match="proposed before"):
        act(database, calibrations.propose, estimate.id)
    with pytest.raises(Unusable, match="another description"):
        act(database, calibrations.propose, other.id)
    with pytest.raises(NotFound):
        act(database, calibrations.propose, "none")


def test_two_people_who_accept_at_once_leave_one_in_force(database, proposed):
    threads = [threading.Thread(target=act, args=(database, calibrations.accept, key)) for key in proposed]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(states(database).values()) == ["accepted", "superseded", "superseded"]
