"""`busplan evidence`."""

from typing import Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.options import AllOption, FormatOption, OutputOption
from busplan.cli.progress import progress_bar


def complete_kind(incomplete: str) -> list[str]:
    """Complete the name of a kind of bus for the shell."""
    from busplan.buses import kind_names

    return [name for name in kind_names() if name.startswith(incomplete)]


def evidence_command(
    kind: Annotated[
        str | None,
        typer.Argument(help="Kind of bus, as ieee1394.  [default: all of them]", autocompletion=complete_kind),
    ] = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show every figure of a kind of bus that others have published or measured, beside the computed one.

    Each with its grade, the way it is computed, and the residual, computed less published; the last column is its
    share in percent. A kind without such a figure says so, here and in its verdicts. `busplan paper` is the part of
    the paper. A report: it exits 0 whatever the residuals are.

    Example: busplan evidence ieee1394
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.questions.evidence import evidence

        with progress_bar("circle tests") as progress:
            known = evidence(kind, progress=progress)
        give(known.report())
