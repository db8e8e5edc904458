"""What an answer leaves out unless it is asked for as a whole."""

from collections.abc import Iterator, Sequence

from busplan.forms.blocks import Block, Chapter, Report, Sentence, Table
from busplan.forms.numbers import nouns


def shown_blocks(report: Report) -> Sequence[Block]:
    """Content of an answer for a page or a comment, without rows of detail unless it is whole.

    Parameters
    ----------
    report
        The answer.
    """
    return report.blocks() if report.is_whole else list(_without_details(report.blocks()))


def _without_details(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        if isinstance(block, Chapter):
            yield block._replace(blocks=tuple(_without_details(block.blocks)))
        elif isinstance(block, Table):
            rows = tuple(row for row in block.rows if not row.is_detail)
            yield block._replace(rows=rows)
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
