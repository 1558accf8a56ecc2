"""Any error as data: stable code, cause, remedy; what REST, jobs and the page show."""

from __future__ import annotations

import re
from typing import Any

_CAPITALS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def fault_of(error: BaseException) -> dict[str, Any]:
    """Describe an error.

    Args:
        error: of one of the packages' trees, or anything else.

    Returns:
        ``code`` (stable, from the class), ``cause``, ``remedy``, ``sentence``, ``exit_code``.
    """
    exit_code = getattr(error, "exit_code", None)
    if not isinstance(exit_code, int):
        sentence = f"Unexpected {type(error).__name__}: {error}"
        remedy = "this is a fault of residuum; report it with the server's log"
        return {
            "code": "internal_error",
            "cause": sentence,
            "remedy": remedy,
            "sentence": f"{sentence}; {remedy}.",
            "exit_code": 1,
        }
    sentence = " ".join(str(error).split())
    cause, remedy = getattr(error, "cause", None), getattr(error, "remedy", None)
    if cause is None or remedy is None:
        cause, remedy = _parts(sentence)
    code = getattr(error, "code", None) or _code(type(error).__name__)
    return {"code": code, "cause": cause, "remedy": remedy, "sentence": sentence, "exit_code": exit_code}


def _code(name: str) -> str:
    return _CAPITALS.sub("_", name.removesuffix("Error")).lower() or "error"


def _parts(sentence: str) -> tuple[str, str]:
    """The house's sentences say the cause, a semicolon, what to do."""
    cause, found, remedy = sentence.rstrip(".").rpartition("; ")
    return (
        (cause, remedy)
        if found
        else (sentence, "correct what the sentence names, then send the request again")
    )
