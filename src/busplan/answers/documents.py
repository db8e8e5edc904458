"""Common parts of the JSON documents and CSV rows of all answers.

Keys carry their units and are stable between releases; new ones may be added.
"""

from collections.abc import Sequence
from typing import Final

from busplan.forms.blocks import JsonDocument, Record

JSON_SCHEMA: Final = 1


def document(command: str, **content: object) -> JsonDocument:
    """JSON document of a command: schema version, command name and content."""
    return {"schema": JSON_SCHEMA, "command": command, **content}


def with_profile(name: str, records: Sequence[Record]) -> list[Record]:
    """Rows for CSV with the profile's name in front, so that tables of several runs can be joined."""
    return [{"profile": name, **record} for record in records]
