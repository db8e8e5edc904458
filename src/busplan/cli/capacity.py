"""`busplan capacity`."""

from busplan.cli.options import (
    NO_CHANGES,
    Changes,
    FormatOption,
    PeriodsOption,
    ProfileArgument,
    TimingOption,
    load_changed,
    periods_us,
    takes_bus_options,
    timing_models,
)
from busplan.cli.output import emit, emit_document


@takes_bus_options
def capacity_command(
    profile: ProfileArgument,
    period: PeriodsOption = None,
    changes: Changes = NO_CHANGES,
    timing: TimingOption = "both",
    format_: FormatOption = "table",
) -> None:
    """Tell whether the cycle fits its period, by what margin, and how many axes the bus carries.

    The verdict comes first: it is that of the profile's bus.timing_model, with the largest term and the cheapest
    change. Times are in us. A report: it exits 0 whatever the verdict is.

    Example: busplan capacity paper-4ms --period 4ms --period 500us
    """
    from busplan.analysis.capacity.figures import capacity
    from busplan.analysis.capacity.verdict import verdicts

    plan = load_changed(profile, changes)
    result = capacity(
        plan,
        periods_us=periods_us(period, plan),
        timing_models=timing_models(timing, plan),
    )
    if format_ == "table":
        from busplan.answers.capacity import capacity_lines

        emit(capacity_lines(result, verdicts(result)))
        return
    from busplan.answers import documents
    from busplan.forms import json_and_csv

    emit_document(
        json_and_csv.to_json(documents.capacity_document(result, verdicts(result)))
        if format_ == "json"
        else json_and_csv.to_csv(documents.with_profile(plan.name, documents.capacity_rows(result)))
    )
