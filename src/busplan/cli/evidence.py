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
    """Compare published and measured figures of a kind of bus with the computed ones.

    Each figure has its grade, the way it is computed, and the residual, computed less published, also in percent. A
    kind without such a figure says so, here and in its verdicts. `busplan paper` shows the part of the paper. Exits 0
    with any residuals.

    Example: busplan evidence ieee1394
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.questions.evidence import evidence

        with progress_bar("circle tests") as progress:
            known = evidence(kind, progress=progress)
        give(known.report())
