"""`busplan capacity`."""

from busplan.cli.options import (
    BUS_OPTIONS,
    FormatOption,
    GapCountOption,
    NodesOption,
    PeriodsOption,
    ProfileArgument,
    TimingOption,
    bus_changes,
    periods_us,
    timing_models,
)
from busplan.cli.output import emit, emit_document


def capacity_command(
    profile: ProfileArgument,
    period: PeriodsOption = None,
    nodes: NodesOption = None,
    gap_count: GapCountOption = None,
    timing: TimingOption = "both",
    format_: FormatOption = "table",
) -> None:
    """Tell whether the cycle fits its period, by what margin, and how many axes the bus carries.

    The verdict comes first: it is that of the profile's bus.timing_model, with the largest term and the cheapest
    change. Times are in us. A report: it exits 0 whatever the verdict is.

    Example: busplan capacity paper-4ms --period 4ms --period 500us
    """
    from busplan.analysis.capacity import capacity
    from busplan.analysis.verdict import verdicts
    from busplan.profile.shipped import load
    from busplan.profile.toml import override

    plan = override(load(profile).profile, bus_changes(nodes=nodes, gap_count=gap_count), origin=BUS_OPTIONS)
    result = capacity(
        plan,
        periods_us=periods_us(period, plan),
        timing_models=timing_models(timing),
    )
    if format_ == "table":
        from busplan.report.capacity import capacity_lines

        emit(capacity_lines(result, verdicts(result)))
        return
    from busplan.report import documents, text

    emit_document(
        text.to_json(documents.capacity_document(result, verdicts(result)))
        if format_ == "json"
        else text.to_csv(documents.with_profile(plan.name, documents.capacity_rows(result)))
    )
