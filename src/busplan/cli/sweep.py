"""`busplan sweep`."""

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from busplan.cli.answering import profile_files, require_apart, write_report
from busplan.cli.command import Call, command
from busplan.cli.options import (
    VALUES_HELP,
    AllOption,
    JobsOption,
    TimingModelOption,
    chosen_model,
    form_of_file,
    form_typed,
    output_option,
    parse_axes,
    require_company,
)
from busplan.cli.output import progress_bar, refuse_terminal, say, write_document
from busplan.errors import BusplanError
from busplan.extras import require_pyarrow
from busplan.files import new_file
from busplan.forms import ENDINGS, ROWS_ENDINGS, Form, RowsForm
from busplan.profile.changes import require_separate

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from contextlib import AbstractContextManager

SweepForm = Literal[Form, RowsForm]
_ENDINGS: Final[Mapping[str, SweepForm]] = MappingProxyType({**ENDINGS, **ROWS_ENDINGS})


@dataclass(frozen=True)
class _Circle:
    """Circle tests."""

    circle: Annotated[
        bool,
        typer.Option(
            "--circle", help="Also run the circle test of every point, and add its columns (errors in mm, margins)."
        ),
    ] = False
    jobs: JobsOption = None
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run the tests of --circle on the workers of a Dask scheduler, as tcp://HOST:8786. They must "
            "have the same versions of Python, busplan and numpy. Needs the extra cluster "
            "(distributed).  [default: here]",
        ),
    ] = None
    unlimited: Annotated[
        bool, typer.Option("--unlimited", help="Run up to 100,000 circle tests; --circle alone runs 1,000.")
    ] = False

    def __post_init__(self) -> None:
        of_circle = {"--jobs": self.jobs, "--cluster": self.cluster, "--unlimited": self.unlimited}
        require_company("--circle", of_circle, is_given=self.circle)
        if self.cluster is not None and self.jobs is not None:
            raise BusplanError(
                "--jobs: is the number of processes here, and --cluster runs the tests elsewhere; leave one out"
            )

    def crew(self, *, points: int) -> "AbstractContextManager[Executor | None]":
        """Executor of the tests: worker processes or a cluster; None for this process."""
        if not self.circle:
            return nullcontext()
        from busplan.cli.workers import available_processors, dask_executor, executor

        if self.cluster is not None:
            return dask_executor(self.cluster)
        return executor(min(self.jobs or available_processors(), points))


@command("Not for a key of --vary.", answers=False)
def sweep_command(
    call: Call,
    circle: _Circle,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=VALUES",
            help=f"A numeric key of the profile, and its values in its unit: {VALUES_HELP} Given several times, every "
            "combination is computed; the last key changes fastest.  [required]",
        ),
    ] = None,
    timing_model: TimingModelOption = "both",
    format_: Annotated[
        SweepForm | None,
        typer.Option(
            "--format",
            help="Form of the answer: the first rows as a table (text in lines), markdown or html, or every row "
            "as csv, json (one document) or parquet (typed columns; needs the extra table, "
            "pyarrow).  [default: by the ending of --output, else table]",
        ),
    ] = None,
    output: Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(_ENDINGS)}")] = None,
    all_: AllOption = False,
) -> None:
    """Compute capacity over a grid: every combination of values of any keys, under each timing model.

    Each row has the figures of `busplan capacity` for one point, of a million at most: a table for pandas, polars or
    duckdb, which sort, group and draw it. A million points of IEEE 1394 take a minute and 1.2 GB of CSV, or 140 MB of
    Parquet. Ctrl-C, SIGTERM and SIGHUP leave FILE as it was. Exits 0 whatever the verdict.

    Example: busplan sweep paper-1ms --vary bus.nodes=1:16 -o nodes.csv
    """
    form = form_of_file(format_, output, forms=_ENDINGS, default="table")
    if form == "parquet":
        if output is None:
            refuse_terminal("parquet")
        require_pyarrow(form_typed(format_, output))
    require_apart({"--output": output}, inputs=profile_files(call.argument))
    from busplan.forms.numbers import sentence_text
    from busplan.questions.base.arguments import load_network
    from busplan.questions.base.sentences import changes_sentences
    from busplan.questions.sweep import SHOWN, Digest, checked_sweep, computed, written_rows

    varied, model = parse_axes(vary or []), chosen_model(timing_model)
    for change, key in product(call.changes.entries, varied):
        require_separate(change, key, typed=f"--vary {key}")
    sweep = checked_sweep(
        load_network(call.profile),
        varied,
        timing_models=None if model is None else [model],
        circle=circle.circle,
        unlimited=circle.unlimited,
        changes=call.changes,
    )
    rows_form = ROWS_ENDINGS.get(f".{form}")
    digest = Digest(sweep, most=0 if rows_form else sweep.rows if all_ else SHOWN)
    changes = changes_sentences(sweep.changes)
    # Opened before the work, so that a path that cannot be written fails at once.
    with new_file(output, overwrite=True) if output else nullcontext() as file:
        with progress_bar("sweep", beside_stdout=bool(rows_form) and file is None) as progress:
            with circle.crew(points=sweep.grid.points) as crew:
                parts = computed(sweep, executor=crew, progress=progress)
            if rows_form:
                for piece in written_rows(rows_form, sweep, digest.counted(parts)):
                    write_document(piece, file)
            else:
                digest.take(parts)
        match form:
            case "table" | "markdown" | "html":
                report = digest.report()
                write_report(report._replace(blocks=(*changes, *report.blocks), is_whole=all_), form, file)
    # The report on standard output has them.
    if rows_form or output is not None:
        say(*map(sentence_text, (*changes, *digest.sentences())))
    if output is not None:
        say(f"wrote {output}")
