"""`busplan sweep`: its options and their checks."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, BinaryIO, Final, Literal, NamedTuple, get_args

import typer

from busplan.cli.answering import give, profile_files, require_apart
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
    takes_changes,
)
from busplan.cli.output import emit_document, refuse_terminal, say
from busplan.cli.pictures import plot_form
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.extras import require_extra, require_pyarrow
from busplan.files import document_bytes, new_file
from busplan.forms import ENDINGS, ROWS_ENDINGS, Form, RowsForm, render
from busplan.profile.changes import NO_CHANGES, KeyChanges, require_separate

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from busplan.questions.sweep import SweepAnswer
    from busplan.questions.sweep.table import Sweep

SweepForm = Literal[Form, RowsForm]
_TOP_FORMS: Final = tuple(form for form in get_args(Form) if form not in get_args(RowsForm))
"""Forms with the top rows, for people."""
_ENDINGS: Final[Mapping[str, SweepForm]] = MappingProxyType({**ENDINGS, **ROWS_ENDINGS})
_DEFAULT_TOP: Final = 20


@takes_changes(words="Not of a key that varies.")
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
    format_: Annotated[
        SweepForm | None,
        typer.Option(
            "--format",
            help="Form of the answer: the top rows as a table (text in lines), markdown or html, or every row as csv, "
            "json (one document) or parquet (typed columns; needs the extra table, pyarrow).  [default: by the ending "
            "of --output, else table]",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(_ENDINGS)}")] = None,
    columns: Annotated[
        str | None,
        option(
            "--columns NAMES",
            "Figures to write, with commas, as margin_us,safe_axes: the names in `busplan capacity --format json`.  "
            "[default: all; for the top rows the main ones]",
        ),
    ] = None,
    sort: Annotated[
        str | None,
        option(
            "--sort COLUMN[:asc]",
            "Top rows: largest first by this column, or smallest first with :asc.  [default: order of the grid]",
        ),
    ] = None,
    top: Annotated[int | None, option("--top N", "Number of top rows.  [default: 20]")] = None,
    plot: Annotated[
        Path | None,
        option(
            "--plot FILE",
            "Draw --figure into FILE.svg or FILE.png: curves where one key varies, heat maps where two do; an old "
            "file is replaced. PNG needs the extra plot (resvg-py).  [default: no figure]",
        ),
    ] = None,
    figure: Annotated[
        str | None,
        option(
            "--figure COLUMN",
            "Figure that --plot draws, by its name in --columns.  [default: safe_axes; margin_corrected_us where "
            "safe_axes does not vary]",
        ),
    ] = None,
    group: Annotated[
        str | None,
        option(
            "--group NAME",
            "Of a profile with groups: the one whose nodes vary for max_axes, safe_axes and so on; the others are as "
            "they are.  [default: the one with the most axes]",
        ),
    ] = None,
    all_: AllOption = False,
    circle: Annotated[
        bool,
        typer.Option(
            "--circle", help="Also run the circle test of every point, and add its columns (errors in mm, margins)."
        ),
    ] = False,
    summary: Annotated[
        bool,
        typer.Option(
            "--summary",
            help="With --circle and --vary delivery.seed=1:1000: one row for all seeds, with mean, standard "
            "deviation, 95th percentile and worst of each figure of the circle, and the share of seeds that fail.",
        ),
    ] = False,
    jobs: JobsOption = None,
    cluster: Annotated[
        str | None,
        option(
            "--cluster ADDRESS",
            "Run the tests of --circle on the workers of a Dask scheduler, as tcp://HOST:8786. They must have the "
            "same versions of Python, busplan and numpy. Needs the extra cluster (distributed).  [default: here]",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Run more than 1,000 circle tests, which --circle alone refuses.")
    ] = False,
) -> None:
    """Compute capacity over a grid: every combination of values of any keys, under each timing model.

    Each row has the figures of `busplan capacity` for one point, of a million at most. Ctrl-C, SIGTERM and SIGHUP leave
    FILE as it was. Exits 0 with any verdict.

    Example: busplan sweep paper-1ms --vary bus.nodes=1:16 --sort margin_us
    """
    form = format_ or _form_of(output)
    if form == "parquet":
        _require_parquet(output, typed=format_)
    _require_sense(form, {"--sort": sort, "--top": top})
    _require_needed("--plot FILE", {"--figure": figure} if plot is None else {})
    of_circle = {"--jobs": jobs, "--cluster": cluster, "--force": force or None, "--summary": summary or None}
    _require_needed("--circle", {} if circle else of_circle)
    _require_numbers({"--top": top, "--jobs": jobs})
    _require_cluster(cluster, jobs)
    require_apart({"--output": output, "--plot": plot}, inputs=profile_files(profile))
    picture_form = None if plot is None else plot_form(plot)
    sort_by, _, order = (sort or "").partition(":")
    if order not in {"", "asc"}:
        raise BusplanError(f"--sort {sort}: expected a column, or a column and :asc for the smallest first")
    from busplan.questions.base.inputs import load_network
    from busplan.questions.sweep import checked_sweep, computed, require_drawable

    loaded, varied = load_changed(profile, changes), parse_axes(vary or [])
    for change, key in product(changes.each, varied):
        require_separate(change, key, typed=f"--vary {key}")
    model = chosen_model(timing_model)
    checked = checked_sweep(
        load_network(loaded),
        varied,
        timing_models=None if model is None else [model],
        group=group,
        circle=circle,
        summary=summary,
        force=force,
        changes=changes,
    )
    checked.require_number(sort_by or None, name="--sort")
    checked.require_number(figure, name="--figure")
    chosen = [name.strip() for name in columns.split(",")] if columns is not None else []
    checked.require_columns(chosen, name="--columns")
    if plot is not None:
        require_drawable(checked.grid, option="--plot")
    rows = _Rows(chosen, top or _DEFAULT_TOP, sort_by or None, ascending=bool(order), is_whole=all_)
    with ExitStack() as run:
        # Opened before the work, so that a path that cannot be written fails at once.
        picture_file = run.enter_context(new_file(plot, overwrite=True)) if plot else None
        file = run.enter_context(new_file(output, overwrite=True)) if output else None
        with progress_bar("sweep") as progress, _crew(checked, jobs=jobs, cluster=cluster) as crew:
            answer = computed(checked, executor=crew, progress=progress)
        _write(answer, form, rows, file)
        if picture_file is not None and picture_form is not None:
            from busplan.forms.svg import content

            picture_file.write(document_bytes(content(answer.drawing(figure=figure), picture_form)))
    for path in (output, plot):
        if path is not None:
            say(f"wrote {path}")


class _Rows(NamedTuple):
    """Which rows and columns are written."""

    columns: list[str]
    """Those asked for; none without --columns."""
    top: int
    sort_by: str | None
    ascending: bool
    is_whole: bool
    """If True, a narrow terminal leaves out no column of the top rows."""


def _write(answer: "SweepAnswer", form: SweepForm, rows: _Rows, file: BinaryIO | None) -> None:
    """Write a sweep to a file, and say how much fits; or to standard output."""
    from busplan.forms.numbers import sentence_text
    from busplan.questions.base.sentences import changes_sentences

    changes = answer.sweep.changes
    match form:
        case "csv" | "json" | "parquet":
            for piece in answer.rows_in(form, rows.columns):
                (emit_document if file is None else file.write)(piece)
        case _:
            top = answer.report(columns=rows.columns, top=rows.top, sort_by=rows.sort_by, ascending=rows.ascending)
            report = top._replace(blocks=(*changes_sentences(changes), *top.blocks), is_whole=rows.is_whole)
            if file is None:
                give(report, form)
                return
            file.write(document_bytes(render(report, form)))
    say(*map(sentence_text, (*changes_sentences(changes), *answer.sentences())))


@contextmanager
def _crew(sweep: "Sweep", *, jobs: int | None, cluster: str | None) -> Iterator["Executor | None"]:
    """Where circle tests run: in worker processes or on a cluster; None for this thread."""
    if cluster is not None:
        from busplan.cli.workers import dask_executor

        with dask_executor(cluster) as there:
            yield there
    elif sweep.circle:
        from busplan.cli.workers import available_processors, executor

        with executor(min(jobs or available_processors(), sweep.tests.points)) as here:
            yield here
    else:
        yield None


def _form_of(output: Path | None) -> SweepForm:
    """Choose the form by the ending of the file."""
    ending = "" if output is None else output.suffix.lower()
    if ending == ".npz":
        raise BusplanError(
            f"--output {output}: a sweep writes no NumPy file; in Python, busplan.sweep(...) gives arrays, "
            "and FILE.csv, FILE.json or FILE.parquet holds every row"
        )
    return form_of_file(None, output, forms=_ENDINGS, default="table")


def _require_parquet(output: Path | None, *, typed: str | None) -> None:
    """Refuse a table that cannot be written, or that nobody can read."""
    if output is None:
        refuse_terminal("parquet")
    require_pyarrow("--format parquet" if typed else f"--output {output}")


def _require_cluster(cluster: str | None, jobs: int | None) -> None:
    """Refuse a cluster without its library, or beside processes of our own."""
    if cluster is not None and jobs is not None:
        raise BusplanError(
            "--jobs: is the number of processes here, and --cluster runs the tests elsewhere; leave one out"
        )
    if cluster is not None:
        require_extra("distributed", extra="cluster", option="--cluster", module="distributed")


def _require_numbers(options: Mapping[str, int | None]) -> None:
    """Refuse numbers below 1."""
    for name, number in options.items():
        if number is not None and number < 1:
            raise BusplanError(f"{name} {number}: must be 1 or more")


def _require_sense(form: SweepForm, options: Mapping[str, object]) -> None:
    """Refuse options of the top rows where every row is written."""
    for name, value in options.items():
        if value is not None and form not in _TOP_FORMS:
            forms = f"{', '.join(_TOP_FORMS[:-1])} or {_TOP_FORMS[-1]}"
            raise BusplanError(f"{name}: goes with --format {forms}; {form} has every row in the order of the grid")


def _require_needed(needed: str, options: Mapping[str, object]) -> None:
    """Refuse options that need another, which is not there."""
    for name, value in options.items():
        if value is not None:
            raise BusplanError(f"{name}: goes with {needed}")
