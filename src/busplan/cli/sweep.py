"""`busplan sweep`: its options and their checks."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final

import typer

from busplan.cli.answering import naming_option
from busplan.cli.changes import load_changed, takes_changes
from busplan.cli.destinations import profile_files, require_apart
from busplan.cli.options import (
    ALL_MODELS,
    VALUES_HELP,
    AllOption,
    JobsOption,
    ProfileArgument,
    TimingOption,
    form_of_file,
    option,
    output_option,
    parse_axes,
)
from busplan.cli.output import refuse_terminal
from busplan.cli.pictures import plot_form
from busplan.cli.sweep_run import TOP_FORMS, SweepForm, SweepJob, run_sweep
from busplan.errors import BusplanError
from busplan.extras import require_extra, require_pyarrow
from busplan.files import partial_path
from busplan.forms import ENDINGS, ROWS_ENDINGS
from busplan.profile.changes import NO_CHANGES, KeyChanges, require_separate

if TYPE_CHECKING:
    from busplan.questions.sweep.asked import Sweep

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
    timing: TimingOption = "both",
    format_: Annotated[
        SweepForm | None,
        typer.Option(
            "--format",
            help="Form of the answer: the top rows as a table (text in lines), markdown or html, or every row as csv, "
            "json (one document), jsonl (a JSON object a line, the first describes the sweep) or parquet (typed "
            "columns; needs the extra table, pyarrow).  [default: by the ending of --output, else table]",
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
            "Figure that --plot draws, by its name in --columns.  [default: safe_axes; margin_corrected_us of groups "
            "and where safe_axes does not vary]",
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
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="With --circle and -o FILE: continue a sweep that was interrupted or killed, after the finished "
            "tests in FILE.parts.",
        ),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Run more than 1,000 circle tests, which --circle alone refuses.")
    ] = False,
) -> None:
    """Compute capacity over a grid: every combination of values of any keys, under each timing model.

    Each row has the figures of `busplan capacity` for one point. Memory does not grow with the grid; millions of points
    take seconds, and writing them as text some minutes. Ctrl-C, SIGTERM and SIGHUP keep the rows so far in
    FILE.partial.csv (or .json, .jsonl, .parquet) and leave FILE as it was. With --circle and -o FILE, finished tests
    are kept in the folder FILE.parts until FILE is complete, and --resume continues from there, even after SIGKILL.
    Exits 0 with any verdict.

    Example: busplan sweep paper-1ms --vary bus.nodes=1:16 --sort margin_us
    """
    form = format_ or _form_of(output)
    if form == "parquet":
        _require_parquet(output, typed=format_)
    _require_sense(form, sort=sort, top=top)
    _require_needed("--plot FILE", plot is not None, {"--figure": figure})
    own = {"--cluster": cluster, "--resume": resume or None, "--force": force or None, "--summary": summary or None}
    _require_needed("--circle", circle, {"--jobs": jobs, **own})
    _require_needed("--output FILE, beside which the parts stand", output is not None, {"--resume": resume or None})
    if cluster is not None:
        _require_cluster(jobs)
    for name, number in (("--top", top), ("--jobs", jobs)):
        if number is not None and number < 1:
            raise BusplanError(f"{name} {number}: must be 1 or more")
    kept = None if output is None else partial_path(output)
    outputs = {"--output": output, "--output's partial file": kept, "--plot": plot}
    require_apart(outputs, inputs=profile_files(profile))
    plot_form_ = None if plot is None else plot_form(plot)
    from busplan.cli.workers import available_processors
    from busplan.questions.sweep import checked_sweep

    loaded = load_changed(profile, changes)
    varied = parse_axes(vary or [])
    for change in changes.each:
        for key in varied:
            require_separate(change, key, typed=f"--vary {key}")
    sort_by, _, order = (sort or "").partition(":")
    if order not in {"", "asc"}:
        raise BusplanError(f"--sort {sort}: expected a column, or a column and :asc for the smallest first")
    with naming_option("vary", "timing_model", "circle", "summary", "force"):
        asked = checked_sweep(
            loaded,
            varied,
            timing_models=None if timing == ALL_MODELS else [timing],
            circle=circle,
            summary=summary,
            force=force,
            changes=changes,
        )
    _require_number(asked, {"--sort": sort_by or None, "--figure": figure})
    chosen = _columns(asked, columns, short=form in TOP_FORMS, sort_by=sort_by)
    run_sweep(
        SweepJob(
            asked._replace(columns=chosen),
            form=form,
            output=output,
            top=top or _DEFAULT_TOP,
            is_whole=all_,
            sort_by=sort_by or None,
            ascending=order == "asc",
            plot=plot,
            plot_form=plot_form_,
            figure=figure,
            jobs=jobs or available_processors(),
            cluster=cluster,
            resume=resume,
        )
    )


def _form_of(output: Path | None) -> SweepForm:
    """Choose the form by the ending of the file."""
    ending = "" if output is None else output.suffix.lower()
    if ending == ".npz":
        raise BusplanError(
            f"--output {output}: a sweep writes no NumPy file; in Python, busplan.sweep(...) gives arrays, "
            "and FILE.csv, FILE.jsonl or FILE.parquet holds every row"
        )
    return form_of_file(None, output, forms=_ENDINGS, default="table")


def _require_parquet(output: Path | None, *, typed: str | None) -> None:
    """Refuse a table that cannot be written, or that nobody can read."""
    if output is None:
        refuse_terminal("parquet")
    require_pyarrow("--format parquet" if typed else f"--output {output}")


def _require_cluster(jobs: int | None) -> None:
    """Refuse a cluster without its library, or beside processes of our own."""
    if jobs is not None:
        raise BusplanError(
            "--jobs: is the number of processes here, and --cluster runs the tests elsewhere; leave one out"
        )
    require_extra("distributed", extra="cluster", option="--cluster", module="distributed")


def _require_sense(form: SweepForm, *, sort: str | None, top: int | None) -> None:
    """Refuse options that do not apply to the form."""
    for name, value in (("--sort", sort), ("--top", top)):
        if value is not None and form not in TOP_FORMS:
            forms = f"{', '.join(TOP_FORMS[:-1])} or {TOP_FORMS[-1]}"
            raise BusplanError(f"{name}: goes with --format {forms}; {form} has every row in the order of the grid")


def _require_needed(needed: str, is_there: bool, options: dict[str, object]) -> None:
    """Refuse options that need another name."""
    for name, value in options.items():
        if value is not None and not is_there:
            raise BusplanError(f"{name}: goes with {needed}")


def _require_number(sweep: "Sweep", asked: dict[str, str | None]) -> None:
    """Refuse a column that does not exist or is not numeric."""
    for name, column in asked.items():
        if column is not None and column not in sweep.numbers:
            raise BusplanError(f"{name} {column}: expected a column in numbers: {', '.join(sweep.numbers)}")


def _columns(sweep: "Sweep", asked: str | None, *, short: bool, sort_by: str) -> tuple[str, ...]:
    """Columns to write: the varied keys and timing_model, then those asked for, or all, or the main ones."""
    if asked is not None:
        chosen = tuple(name.strip() for name in asked.split(","))
        for name in chosen:
            if name not in sweep.columns:
                raise BusplanError(f"--columns {name}: no such column; there are {', '.join(sweep.columns)}")
    elif short:
        from busplan.questions.sweep import default_columns

        chosen = default_columns(sweep)
    else:
        chosen = sweep.columns
    return tuple(dict.fromkeys((*sweep.grid.axes, "timing_model", *chosen, *([sort_by] if sort_by else []))))
