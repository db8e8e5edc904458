"""`busplan manual`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from busplan.cli.destinations import require_apart
from busplan.cli.options import form_of_file, output_option
from busplan.cli.output import write_document


def manual_command(
    context: typer.Context,
    format_: Annotated[
        Literal["markdown", "man"] | None,
        typer.Option(
            "--format",
            help="Form of the manual: GitHub's Markdown, or a man page in roff.  "
            "[default: what the name of --output says, else markdown]",
        ),
    ] = None,
    output: Annotated[Path | None, output_option("Write it to FILE: .1 (man) or .md (Markdown)")] = None,
) -> None:
    """Write the whole manual: every command with its arguments, options and example, exit codes, variables and files.

    It is made of what `busplan COMMAND --help` says, and is installed with busplan as a man page, which `man busplan`
    shows, and as Markdown. It exits 0 when the manual is written.

    Example: busplan manual --format man -o busplan.1
    """
    require_apart({"--output": output})
    from busplan.cli.tree import manual_of

    chosen = form_of_file(format_, output, forms={".1": "man", ".md": "markdown"}, default="markdown")
    manual = manual_of(context.find_root().command)
    if chosen == "man":
        from busplan.answers.manual.man import man_page

        text = man_page(manual)
    else:
        from busplan.answers.manual.markdown import markdown_page

        text = markdown_page(manual)
    write_document(text, output)
