"""Commands that teach: manual, profiles, evidence and paper."""

from pathlib import Path
from typing import Annotated

import typer

from busplan.cli.answering import answer, require_apart
from busplan.cli.options import AllOption, FormatOption, OutputOption, output_option
from busplan.cli.output import emit_pages, is_terminal, write_document
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError


def complete_topic(incomplete: str) -> list[str]:
    """Complete the name of a topic for the shell."""
    from busplan.manual import topics

    return [topic for topic in topics() if topic.startswith(incomplete)]


def manual_command(
    topic: Annotated[
        str | None,
        typer.Argument(
            help="Topic of a page, as profile.  [default: a list of all of them]", autocompletion=complete_topic
        ),
    ] = None,
    output: Annotated[Path | None, output_option("Write the page to FILE, always as Markdown")] = None,
) -> None:
    """Show a reference page: profile keys, timing models, the circle test, the plan, the gate, JSON, Python, limits.

    Pages are Markdown, set for reading and paged on a terminal. Without a topic it lists the topics. `busplan COMMAND
    --help` describes a command and its options. Exits 0 when the page is written.

    Example: busplan manual profile
    """
    from busplan.manual import page, topics

    known = topics()
    if topic is not None and topic not in known:
        from busplan.english import did_you_mean

        hints = "; ".join(filter(None, (f"there are {', '.join(known)}", did_you_mean(topic, known))))
        raise BusplanError(f"{topic or repr(topic)}: no such topic; {hints}")
    require_apart({"--output": output})
    if topic is None:
        write_document(_contents(known), output)
    elif output is None and is_terminal():
        from busplan.forms.pages import rendered

        emit_pages(rendered(page(topic)))
    else:
        write_document(page(topic), output)


def _contents(headings: dict[str, str]) -> str:
    """List of topics, one on each line."""
    width = max(map(len, headings))
    lines = (f"{topic:{width}}  {heading}\n" for topic, heading in headings.items())
    return f"Topics of the manual; `busplan manual TOPIC` shows one:\n\n{''.join(lines)}"


def profiles_command(format_: FormatOption = None, output: OutputOption = None) -> None:
    """List the shipped profiles, which every command takes by name.

    Each has its number of nodes, its period, its leading timing model and a description. Exits 0.

    Example: busplan profiles
    """
    with answer(format_, output) as give:
        from busplan.cli.profiles_report import profiles_report
        from busplan.profile.sources import load, shipped_names

        give(profiles_report([load(name).profile for name in shipped_names()]))


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


def paper_command(all_: AllOption = False, format_: FormatOption = None, output: OutputOption = None) -> None:
    """Compare every figure of the paper that the equations give with the computed one.

    The figures are those of Table I and Table II, the comparison with CAN, the constant of equation (15), the gaps of
    equation (10), Figs. 9 and 10 and the comparison with SERCOS, each with its grade and the way it is computed. The
    residual is computed less published, also in percent. The servo values of the circles were calibrated to these very
    figures. This is the paper's part of `busplan evidence ieee1394`. Exits 0 with any residuals.

    Example: busplan paper --format csv
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.questions.evidence import evidence

        with progress_bar("circle tests") as progress:
            known = evidence(paper=True, progress=progress)
        give(known.report())
