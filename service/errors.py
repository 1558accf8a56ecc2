"""The error tree of the service.

    ServiceError         what the operator asked for cannot be done
    ├── UsageError       wrong use: a path, a name, an option
    ├── LogError         a log that cannot serve the purpose
    ├── EstimateError    an estimate that cannot serve the purpose
    ├── HardwareMissingError  the robot file names no hardware to use
    ├── RunFailedError   a run that did not complete; carries its report
    └── RunAbortedError  a run that somebody stopped; carries its report
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


class HardwareMissingError(ServiceError):
    """A robot whose file does not say how its drives are reached."""

    exit_code = 3


class RunFailedError(ServiceError):
    """A recording run that did not complete; `report` names the cause first and the missing cycles."""

    exit_code = 3

    def __init__(self, sentence: str, report: object, exit_code: int = 3) -> None:
        self.report, self.exit_code = report, exit_code
        super().__init__(sentence)


class RunAbortedError(RunFailedError):
    """A recording run that somebody stopped; what was recorded until then is kept."""

    exit_code = 130  # what shells report for Ctrl-C

    def __init__(self, sentence: str, report: object) -> None:
        super().__init__(sentence, report, 130)
