"""Report of `import`: the verdict, what the files leave open, and every value with its grade and place."""

from typing import TYPE_CHECKING, Any

from busplan.forms.blocks import (
    Code,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    sentence,
)
from busplan.profile.edit import short_text
from busplan.questions.base.sentences import document
from busplan.questions.import_.reading import assumed

if TYPE_CHECKING:
    from busplan.questions.import_ import ImportAnswer

_COLUMNS = (
    TableColumn("key", kind="words"),
    TableColumn("value", kind="words"),
    TableColumn("grade", kind="words"),
    TableColumn("file and line", kind="words"),
    TableColumn("note", kind="words", rank=1, wraps=True),
)


def sentences(answer: "ImportAnswer") -> list[str]:
    """What a user must know of the profile: what files say, the card of `capacity`, and what stays unknown."""
    return [*answer.remarks, *_card(answer), *_unknown(answer)]


def _card(answer: "ImportAnswer") -> list[str]:
    from busplan.questions.capacity import capacity

    return str(capacity(answer.profile)).partition("\n\n")[0].splitlines()


def _unknown(answer: "ImportAnswer") -> list[str]:
    unknown: dict[str, list[str]] = {}
    for row in assumed(answer.rows):
        section = (
            f"{row.section.partition('.')[0]}.*" if row.section.startswith(("group.", "message.")) else row.section
        )
        inner = ".execution" if row.section.endswith(".execution") else ""
        values = unknown.setdefault(f"{section}{inner}.{row.key}", [])
        values += [value for value in [short_text(row.fact.value)] if value not in values]
    listed = ", ".join(f"{key} = {' or '.join(values)}" for key, values in unknown.items())
    return [f"Not known, so assumed: {listed}."] if listed else []


def import_report(answer: "ImportAnswer") -> Report:
    """Report of `import_profile`."""
    records = [_record(row) for row in answer.rows]
    return Report(
        sentence("{}, from files of the machine", Code(answer.profile.name)),
        [
            Sentence((" ".join(_card(answer)[0].split()),)),
            *(Sentence((text,)) for text in (*answer.remarks, *_unknown(answer))),
            _table(records),
        ],
        document("import", name=answer.profile.name, values=records, remarks=list(answer.remarks)),
        records,
    )


def _record(row: Any) -> Record:
    fact = row.fact
    return {"key": row.dotted, "value": row.plain, "grade": fact.grade, "place": fact.place, "note": fact.note}


def _table(records: list[Record]) -> Table:
    return Table(
        _COLUMNS,
        tuple(
            TableRow(
                (
                    Code(record["key"]),
                    ShownValue(record["value"])
                    if isinstance(record["value"], int | float)
                    else short_text(record["value"]),
                    record["grade"],
                    record["place"],
                    record["note"],
                )
            )
            for record in records
        ),
    )
