"""Result files: checked before the work, written whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any

from service.errors import UsageError


def check_writable(path: Path | str | None, what: str) -> None:
    """Refuse an output path that cannot be written, before any work is done.

    Args:
        path: the output file; None is fine.
        what: for the message, such as ``the estimate``.

    Raises:
        UsageError: the folder is missing or not writable, or the path is a folder.
    """
    if path is None:
        return
    path = Path(path)
    folder = path.parent if str(path.parent) else Path(".")
    if path.is_dir():
        raise UsageError(f"Cannot write {what} to {path}: it is a folder; give a file name inside it.")
    if not folder.is_dir():
        raise UsageError(f"Cannot write {what} to {path}: the folder {folder} does not exist; create it or choose another.")
    if not os.access(folder, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise UsageError(f"Cannot write {what} to {path}: permission denied; choose another place.")


def write_text(path: Path | str, text: str, what: str) -> None:
    """Write a file whole: into a temporary neighbour first, then renamed.

    Args:
        path: the output file.
        text: its content.
        what: for the message.

    Raises:
        UsageError: it cannot be written; nothing is left behind then.
    """
    path = Path(path)
    check_writable(path, what)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True)
        raise UsageError(f"Cannot write {what} to {path}: {error.strerror}; free space or choose another place.") from error
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def to_json(content: Any) -> str:
    """Strict JSON text: no NaN or Infinity, which other readers refuse."""
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_json(path: Path | str, what: str) -> dict[str, Any]:
    """Read a JSON object.

    Args:
        path: the file.
        what: for the message, such as ``the estimate``.

    Returns:
        The object.

    Raises:
        UsageError: missing, unreadable or not a JSON object.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise UsageError(f"{what.capitalize()} {path} does not exist; check the path.") from error
    except (OSError, ValueError) as error:
        raise UsageError(f"{what.capitalize()} {path} is not readable as JSON: {error}.") from error
    if not isinstance(content, dict):
        raise UsageError(f"{what.capitalize()} {path} holds no JSON object; give a file that residuum wrote.")
    return content
