"""The error tree of the service.

    ServiceError         what the operator asked for cannot be done
    ├── UsageError       wrong use: a path, a name, an option
    ├── LogError         a log that cannot serve the purpose
    └── EstimateError    an estimate that cannot serve the purpose
"""

from __future__ import annotations


class ServiceError(Exception):
    """Root of the package's errors; its text is one sentence: what, where, why, what to do."""

    exit_code = 1


class UsageError(ServiceError):
    """The command or a file it names is wrong."""

    exit_code = 2


class LogError(ServiceError):
    """A recording does not fit the robot or the purpose."""

    exit_code = 4


class EstimateError(ServiceError):
    """An estimate is not physically possible, or its files would not say what it says."""

    exit_code = 4
