"""The error tree of identification.

    IdentifyError            something asked of the mathematics cannot be done
    ├── ModelError           the robot's description is wrong or not supported (wrong use)
    └── UnusableDataError    the data cannot answer the question
        └── NotPeriodicError no common period, or not the one claimed
"""

from __future__ import annotations


class IdentifyError(Exception):
    """Root of the package's errors; its text is one sentence: what, where, why, what to do."""

    exit_code = 1


class ModelError(IdentifyError):
    """The robot description is inconsistent or holds something that is not supported."""

    exit_code = 2


class UnusableDataError(IdentifyError):
    """The data cannot answer what was asked."""

    exit_code = 4


class NotPeriodicError(UnusableDataError):
    """The recording has no period common to all moving joints, or not the one it claims."""
