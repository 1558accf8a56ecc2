"""Why an excitation cannot be designed.

IdentifyError
└── DesignError      limits, constraints or options leave no trajectory (wrong use)
"""

from __future__ import annotations

from identify.errors import IdentifyError


class DesignError(IdentifyError):
    """No trajectory can meet what was asked; the text holds the number that binds."""

    exit_code = 2
