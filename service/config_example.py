"""The example configuration, made from the schema so that it cannot fall behind it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from service.config import Config


def example_config() -> str:
    """Write every field with its meaning, unit, default and consequence.

    Returns:
        TOML that reads back as the defaults; fields without a default are commented out.
    """
    head = ["# Configuration of residuum serve. Every value shown is the default.", ""]
    return "\n".join([*head, *_section(Config, "")]).rstrip() + "\n"


def _section(model: type[BaseModel], prefix: str) -> Iterator[str]:
    for name, field in model.model_fields.items():
        kind = type(field.default)
        path = f"{prefix}{name}"
        if isinstance(field.default, BaseModel):
            yield f"# {kind.__doc__}"
            yield f"[{path}]"
            yield from _section(kind, f"{path}.")
            yield ""
        else:
            yield from _entry(name, field)


def _entry(name: str, field: FieldInfo) -> Iterator[str]:
    facts: dict[str, Any] = dict(field.json_schema_extra or {})  # type: ignore[arg-type]
    unit = "" if facts["unit"] == "-" else f" [{facts['unit']}]"
    yield f"# {field.description}{unit}: {facts['consequence']}"
    if field.default is None:
        yield f'# {name} = "/path/to/file"'
    else:
        yield f"{name} = {_toml(field.default)}"


def _toml(value: Any) -> str:
    if isinstance(value, Path):
        return json.dumps(str(value))
    return json.dumps(list(value) if isinstance(value, tuple) else value)
