"""What the running service refuses: each with a stable code, an HTTP status, the cause and the remedy.

Refusal
├── NotFound            no such thing
├── Unauthenticated     no token, or a wrong one
├── Forbidden           the token lacks the scope
├── TooManyFailures     too many wrong tokens from one address
├── WrongState          the change is not allowed from this state
├── LeaseHeld           somebody else has the robot
├── LeaseNeeded         the robot is not leased by the caller
├── SimulatedResult     a simulated result for a real robot
├── Conflict            it exists already, and differs
├── KeyReused           an idempotency key with another request
├── TooLarge            an upload above the limit
├── NotCleared          unattended motion without clearance
└── Unusable            content that cannot serve
"""

from __future__ import annotations

from service.errors import ServiceError


class Refusal(ServiceError):
    """A request the service will not carry out.

    Args:
        cause: what, where and why, without a final stop.
        remedy: what to do, without a final stop.
    """

    code = "refused"
    status = 409

    def __init__(self, cause: str, remedy: str) -> None:
        super().__init__(f"{cause}; {remedy}.")
        self.cause, self.remedy = cause, remedy


class NotFound(Refusal):
    """There is no such thing."""

    code, status, exit_code = "not_found", 404, 2


class Unauthenticated(Refusal):
    """No token, or a wrong one."""

    code, status = "unauthenticated", 401


class Forbidden(Refusal):
    """The token lacks the scope."""

    code, status = "forbidden", 403


class TooManyFailures(Refusal):
    """Too many wrong tokens from one address."""

    code, status = "too_many_failures", 429

    def __init__(self, cause: str, remedy: str, wait_s: float) -> None:
        super().__init__(cause, remedy)
        self.wait_s = wait_s


class WrongState(Refusal):
    """The change is not allowed from this state."""

    code = "wrong_state"


class LeaseHeld(Refusal):
    """Somebody else has the robot."""

    code = "lease_held"


class LeaseNeeded(Refusal):
    """The caller has no lease of the robot."""

    code = "lease_needed"


class SimulatedResult(Refusal):
    """A simulated result can never be accepted for a real robot."""

    code = "simulated_result"


class Conflict(Refusal):
    """It exists already, and differs."""

    code = "conflict"


class KeyReused(Refusal):
    """An idempotency key came back with another request."""

    code, status = "idempotency_key_reused", 422


class TooLarge(Refusal):
    """An upload above the limit, or more than the disk can take."""

    code, status = "too_large", 413


class NotCleared(Refusal):
    """The robot is not cleared for unattended motion."""

    code = "not_cleared"


class Unusable(Refusal):
    """Content that cannot serve the purpose."""

    code, status, exit_code = "unusable", 422, 4
