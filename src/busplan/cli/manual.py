"""`busplan manual`."""

from pathlib import Path
from typing import Annotated

import typer

from busplan.cli.destinations import require_apart
from busplan.cli.options import output_option
from busplan.cli.output import emit_pages, is_terminal, write_document
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
        from busplan.nearest import did_you_mean

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
