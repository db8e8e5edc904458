"""Common parts of the JSON documents and CSV rows of all answers.

Keys carry their units and are stable between releases; new ones may be added.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from busplan.forms.blocks import Code, JsonDocument, Record, Report, Sentence, joined
from busplan.profile.changes import KeyChanges

JSON_SCHEMA: Final = 1


def document(command: str, **content: object) -> JsonDocument:
    """JSON document of a command: schema version, command name and content."""
    return {"schema": JSON_SCHEMA, "command": command, **content}


def with_profile(name: str, records: Sequence[Record]) -> list[Record]:
    """Rows for CSV with the profile's name in front, so that tables of several runs can be joined."""
    return [{"profile": name, **record} for record in records]


def parts_by(parts: Mapping[str, str]) -> list[Record]:
    """Each part of a kind that figures of others set or test, with what does."""
    return [{"part": part, "by": words} for part, words in parts.items()]


def changed_document(content: Mapping[str, Any], changes: KeyChanges) -> JsonDocument:
    """Add the new values by --set to a document, as `changes`; `diff` has other `changes` already."""
    if not changes.by_set:
        return dict(content)
    name = "changes" if "changes" not in content else "changes_of_both"
    head = {key: content[key] for key in ("schema", "command")}
    return {**head, name: {one.key: one.value for one in changes.by_set}, **content}


def changed_report(report: Report, changes: KeyChanges) -> Report:
    """Name the --set options in an answer: in a sentence at its top, and in its JSON document."""
    return report._replace(
        blocks=lambda: (*changes_sentences(changes), *report.blocks()),
        document=lambda: changed_document(report.document(), changes),
    )


def changes_sentences(changes: KeyChanges) -> list[Sentence]:
    """Name the --set options in a sentence, because what is computed is not what the file says; empty without them."""
    options = [Sentence((Code(one.typed),)) for one in changes.by_set]
    return [joined(Sentence(("With ",)), joined(*options, by=" and "), Sentence((".",)), by="")] if options else []
