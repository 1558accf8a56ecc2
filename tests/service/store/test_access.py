"""Tokens, leases, jobs."""

import pytest
from sqlalchemy import select

from service import jobs, leases
from service.refusals import (
    Conflict,
    Forbidden,
    LeaseHeld,
    LeaseNeeded,
    TooManyFailures,
    Unauthenticated,
    Unusable,
    WrongState,
)
from service.store.access import Token
from service.tokens import FailureBrake, caller_of, digest_of, first_token, make_token, revoke_token
from tests.service.store import lab


def test_the_first_token_is_made_once_and_is_nowhere_in_the_database(database):
    with database.write() as session:
        secret = first_token(session)
        assert first_token(session) is None
    with database.read() as session:
        row = session.scalars(select(Token)).one()
        assert row.digest == digest_of(secret)
        assert secret not in str(vars(row))
        assert caller_of(session, secret).scopes == {"read", "run", "accept", "admin"}


def test_scopes_expiry_and_revocation(database):
    with database.write() as session:
        row, secret = make_token(session, "timer", ["run"], "test")
        _, late = make_token(session, "late", ["read"], "test", days=-1.0)
        caller = caller_of(session, secret)
        assert caller.scopes == {"run", "read"}
        with pytest.raises(Forbidden, match="lacks the scope 'accept'"):
            caller.require("accept")
        revoke_token(session, row.id, "test")
        for wrong in (secret, late, "residuum_x", "", None):
            with pytest.raises(Unauthenticated):
                caller_of(session, wrong)
        with pytest.raises(Conflict):
            make_token(session, "timer", ["read"], "test")
        with pytest.raises(Unusable):
            make_token(session, "other", ["write"], "test")


def test_the_brake_holds_one_address_and_not_the_others():
    brake = FailureBrake(3, 60.0)
    for _ in range(3):
        brake.check("10.0.0.1")
        brake.fail("10.0.0.1")
    with pytest.raises(TooManyFailures) as caught:
        brake.check("10.0.0.1")
    assert 50 < caught.value.wait_s <= 60
    brake.check("10.0.0.2")


def test_a_lease_has_one_owner_until_it_expires(database):
    with database.write() as session:
        lab.add_robot(session)
        with pytest.raises(LeaseNeeded):
            leases.require_lease(session, "IR-1", "anna")
        lease = leases.take_lease(session, "IR-1", "anna", 10, "excitation", 240)
        leases.take_lease(session, "IR-1", "anna", 20, "excitation", 240)
        leases.require_lease(session, "IR-1", "anna")
        with pytest.raises(LeaseHeld, match="leased to 'anna' for excitation until"):
            leases.take_lease(session, "IR-1", "ben", 10, "", 240)
        with pytest.raises(LeaseHeld):
            leases.end_lease(session, "IR-1", "ben")
        lease.expires_at = lease.created_at
        session.flush()
        leases.take_lease(session, "IR-1", "ben", 10, "", 240)
        leases.end_lease(session, "IR-1", "root", is_admin=True)
        assert leases.current_lease(session, "IR-1") is None
        with pytest.raises(Unusable):
            leases.take_lease(session, "IR-1", "ben", 1000, "", 240)


def test_jobs_are_claimed_in_order_and_found_after_a_stop(database):
    with database.write() as session:
        lab.add_robot(session)
        first, second = (jobs.queue_job(session, "fit", key, "IR-1", "test") for key in "ab")
    with database.write() as session:
        assert jobs.claim_job(session).id == first.id
    with database.write() as session:
        assert jobs.claim_job(session).id == second.id
        assert jobs.claim_job(session) is None
    with database.write() as session:
        assert [job.state for job in jobs.resume_jobs(session, attempts=2)] == ["queued", "queued"]
    with database.write() as session:
        job = jobs.claim_job(session)
        assert (job.id, job.attempts) == (first.id, 2)
    with database.write() as session:
        (job,) = jobs.resume_jobs(session, attempts=2)
        assert (job.state, job.error["code"]) == ("interrupted", "interrupted")
        with pytest.raises(WrongState):
            jobs.cancel_job(session, first.id)
        assert jobs.cancel_job(session, second.id).state == "cancelled"
