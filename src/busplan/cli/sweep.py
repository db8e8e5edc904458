"""`busplan sweep`."""

from collections.abc import Mapping
from contextlib import ExitStack, nullcontext
from functools import partial
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from busplan.cli.answering import profile_files, require_apart, write_report
from busplan.cli.options import (
    VALUES_HELP,
    AllOption,
    JobsOption,
    ProfileArgument,
    TimingModelOption,
    chosen_model,
    form_of_file,
    load_changed,
    option,
    output_option,
    parse_axes,
    plot_form,
    require_company,
    takes_changes,
)
from busplan.cli.output import progress_bar, refuse_terminal, say, write_document
from busplan.errors import BusplanError
from busplan.extras import require_pyarrow
from busplan.files import NewFile, document_bytes, new_file
from busplan.forms import ENDINGS, ROWS_ENDINGS, Form, RowsForm
from busplan.profile.changes import NO_CHANGES, KeyChanges, require_separate

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Executor
    from contextlib import AbstractContextManager

    from busplan.forms.blocks import Report
    from busplan.questions.sweep import SweepAnswer
    from busplan.questions.sweep.table import Sweep

SweepForm = Literal[Form, RowsForm]
_ENDINGS: Final[Mapping[str, SweepForm]] = MappingProxyType({**ENDINGS, **ROWS_ENDINGS})
_DEFAULT_TOP: Final = 20


@takes_changes("A key that varies takes none.")
def sweep_command(
    profile: ProfileArgument,
    vary: Annotated[
        list[str] | None,
        option(
            "--vary KEY=VALUES",
            f"A numeric key of the profile, and its values in its unit: {VALUES_HELP} Given several times, every "
            "combination is computed; the last key changes fastest.  [required]",
        ),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: TimingModelOption = "both",
    format_: SweepForm | None = None,
    output: Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(_ENDINGS)}")] = None,
    columns: str | None = None,
    sort: str | None = None,
    top: Annotated[int | None, typer.Option(min=1)] = None,
    plot: Path | None = None,
    figure: str | None = None,
    group: str | None = None,
    all_: AllOption = False,
    circle: bool = False,
    summary: bool = False,
    jobs: JobsOption = None,
    cluster: str | None = None,
    unlimited: bool = False,
) -> None:
    """Compute capacity over a grid: every combination of values of any keys, under each timing model.

    Each row has the figures of `busplan capacity` for one point, of a million at most. Ctrl-C, SIGTERM and SIGHUP leave
    FILE as it was. Exits 0 with any verdict.

    Example: busplan sweep paper-1ms --vary bus.nodes=1:16 --sort margin_us

    Parameters
    ----------
    --format
        Form of the answer: the top rows as a table (text in lines), markdown or html, or every row as csv, json (one
        document) or parquet (typed columns; needs the extra table, pyarrow). [default: by the ending of --output, else
        table]
    --columns NAMES
        Figures to write, with commas, as margin_us,safe_axes: the names in `busplan capacity --format json`. [default:
        all; for the top rows the main ones]
    --sort COLUMN[:asc]
        Top rows: largest first by this column, or smallest first with :asc. [default: order of the grid]
    --top N
        Number of top rows. [default: 20]
    --plot FILE
        Draw --figure into FILE.svg or FILE.png: curves where one key varies, heat maps where two do; an old file is
        replaced. PNG needs the extra plot (resvg-py). [default: no figure]
    --figure COLUMN
        Figure that --plot draws, by its name in --columns. [default: safe_axes; margin_corrected_us where safe_axes
        does not vary]
    --group NAME
        In a profile with groups: the one whose nodes vary for max_axes, safe_axes and so on; the others stay as they
        are. [default: the one with the most axes]
    --circle
        Also run the circle test of every point, and add its columns (errors in mm, margins).
    --summary
        With --circle and --vary delivery.seed=1:1000: one row for all seeds, with mean, standard deviation, 95th
        percentile and worst of each figure of the circle, and the share of seeds that fail.
    --cluster ADDRESS
        Run the tests of --circle on the workers of a Dask scheduler, as tcp://HOST:8786. They must have the same
        versions of Python, busplan and numpy. Needs the extra cluster (distributed). [default: here]
    --unlimited
        Run more than 1,000 circle tests, which --circle alone refuses.
    """
    form = form_of_file(format_, output, forms=_ENDINGS, default="table")
    has_top = form not in ROWS_ENDINGS.values()
    of_top = {"--sort": sort, "--top": top}
    require_company(f"--format table, markdown or html; {form} has every row", of_top, is_given=has_top)
    require_company("--plot FILE", {"--figure": figure}, is_given=plot)
    of_circle = {"--jobs": jobs, "--cluster": cluster, "--unlimited": unlimited, "--summary": summary}
    require_company("--circle", of_circle, is_given=circle)
    if cluster is not None and jobs is not None:
        raise BusplanError(
            "--jobs: is the number of processes here, and --cluster runs the tests elsewhere; leave one out"
        )
    if form == "parquet":
        if output is None:
            refuse_terminal("parquet")
        require_pyarrow("--format parquet" if format_ else f"--output {output}")
    require_apart({"--output": output, "--plot": plot}, inputs=profile_files(profile))
    picture_form = None if plot is None else plot_form(plot)
    sort_by, _, order = (sort or "").partition(":")
    if order not in {"", "asc"}:
        raise BusplanError(f"--sort {sort}: expected a column, or a column and :asc for the smallest first")
    from busplan.questions.base.inputs import load_network
    from busplan.questions.sweep import checked_sweep, computed, require_drawable

    loaded, varied = load_changed(profile, changes), parse_axes(vary or [])
    for change, key in product(changes.entries, varied):
        require_separate(change, key, typed=f"--vary {key}")
    model = chosen_model(timing_model)
    sweep = checked_sweep(
        load_network(loaded),
        varied,
        timing_models=None if model is None else [model],
        group=group,
        circle=circle,
        summary=summary,
        unlimited=unlimited,
        changes=changes,
    )
    sweep.require_number(sort_by or None, name="--sort")
    sweep.require_number(figure, name="--figure")
    names = [name.strip() for name in columns.split(",")] if columns is not None else []
    sweep.require_columns(names, name="--columns")
    if plot is not None:
        require_drawable(sweep.grid, option="--plot")
    with ExitStack() as run:
        # Opened before the work, so that a path that cannot be written fails at once.
        picture_file = run.enter_context(new_file(plot, overwrite=True)) if plot else None
        file = run.enter_context(new_file(output, overwrite=True)) if output else None
        with progress_bar("sweep") as progress, _crew(sweep, jobs=jobs, cluster=cluster) as crew:
            answer = computed(sweep, executor=crew, progress=progress)
        top_rows = partial(
            answer.report, columns=names, top=top or _DEFAULT_TOP, sort_by=sort_by or None, ascending=bool(order)
        )
        _write(answer, form, names, top_rows, file, is_whole=all_)
        if picture_file is not None and picture_form is not None:
            from busplan.forms.svg import content

            picture_file.write(document_bytes(content(answer.drawing(figure=figure), picture_form)))
    say(*(f"wrote {path}" for path in (output, plot) if path is not None))


def _crew(sweep: "Sweep", *, jobs: int | None, cluster: str | None) -> "AbstractContextManager[Executor | None]":
    """Where circle tests run: in worker processes or on a cluster; None for this process."""
    if not sweep.circle:
        return nullcontext()
    from busplan.cli.workers import available_processors, dask_executor, executor

    if cluster is not None:
        return dask_executor(cluster)
    return executor(min(jobs or available_processors(), sweep.tests.points))


def _write(
    answer: "SweepAnswer",
    form: SweepForm,
    columns: list[str],
    top_rows: "Callable[[], Report]",
    file: NewFile | None,
    *,
    is_whole: bool,
) -> None:
    """Write all rows, or a report with the top rows; and say how much fits, unless the report has it."""
    from busplan.forms.numbers import sentence_text
    from busplan.questions.base.sentences import changes_sentences

    changes = changes_sentences(answer.sweep.changes)
    match form:
        case "csv" | "json" | "parquet":
            for piece in answer.rows_in(form, columns):
                write_document(piece, file)
        case _:
            report = top_rows()
            write_report(report._replace(blocks=(*changes, *report.blocks), is_whole=is_whole), form, file)
            if file is None:
                return
    say(*map(sentence_text, (*changes, *answer.sentences())))
