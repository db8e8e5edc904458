"""What an answer leaves out unless it is asked for as a whole."""

from collections.abc import Iterator, Sequence

from busplan.forms.blocks import Block, Chapter, Detail, Report, Sentence, Table
from busplan.forms.numbers import nouns


def shown_blocks(report: Report) -> Sequence[Block]:
    """Content of an answer for a page or a comment, without rows of detail unless it is whole.

    Parameters
    ----------
    report
        The answer.
    """
    return list(_with_details(report.blocks()) if report.is_whole else _without_details(report.blocks()))


def _with_details(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Detail):
            yield from _with_details(block.blocks)
        elif isinstance(block, Chapter):
            yield block._replace(blocks=tuple(_with_details(block.blocks)))
        else:
            yield block


def _without_details(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Detail):
            continue
        if isinstance(block, Chapter):
            yield block._replace(blocks=tuple(_without_details(block.blocks)))
        elif isinstance(block, Table):
            numbers = [number for number, column in enumerate(block.columns) if not column.is_detail]
            rows = tuple(
                row._replace(cells=tuple(row.cells[number] for number in numbers))
                for row in block.rows
                if not row.is_detail
            )
            heads = sum(number < block.heads for number in numbers)
            yield block._replace(columns=tuple(block.columns[number] for number in numbers), rows=rows, heads=heads)
            left_out = left_out_sentence(len(block.rows) - len(rows))
            yield from [Sentence((left_out,))] if left_out else []
        else:
            yield block


def left_out_sentence(rows: int, columns: Sequence[str] = ()) -> str:
    """Say what a table leaves out, and how to see it; empty if that is nothing.

    Parameters
    ----------
    rows
        How many rows.
    columns
        Names of the columns.

    Examples
    --------
    >>> left_out_sentence(2, ["eq", "paper"]), left_out_sentence(1), left_out_sentence(0)
    ('Not shown: 2 rows; columns eq, paper. --all shows all.', 'Not shown: 1 row. --all shows all.', '')
    """
    names = list(dict.fromkeys(columns))
    parts = [f"{rows} {nouns(rows, 'row')}"] if rows else []
    parts += [f"{nouns(len(names), 'column')} {', '.join(names)}"] if names else []
    return f"Not shown: {'; '.join(parts)}. --all shows all." if parts else ""
