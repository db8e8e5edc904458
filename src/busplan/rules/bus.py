"""Rules for every kind of bus: does the cycle fit, is there room, is the execution time known?"""

from collections.abc import Iterator
from math import ceil
from typing import Final

from busplan.analysis.capacity.cycle import TIME
from busplan.analysis.network import bus_of
from busplan.buses.rule import Rule, RuleFigures, RuleProblem, RuleSubject, overrun


def slice_overrun(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The cycle does not fit under the timing model that decides."""
    if TIME in subject.deciding.exceeded:
        cure = subject.cure(subject.deciding.timing_model)
        yield RuleProblem("cycle.period_us", f"{overrun(subject.deciding)}; {cure}")


def over_utilisation(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The slice is fuller than [limits] allows."""
    limit, one = subject.profile.limits.max_utilisation, subject.deciding
    if limit is not None and one.utilisation > limit:
        cure = subject.room(one.nodes, utilisation=limit)
        yield RuleProblem(
            "limits.max_utilisation",
            f"{one.utilisation:.1%} of the slice is used under the {one.timing_model} timing, "
            f"{limit:.1%} allowed; {cure}",
        )


def too_few_spare_nodes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The bus carries fewer further nodes than [limits] requires."""
    limit, one = subject.profile.limits.min_spare_nodes, subject.deciding
    spare = one.max_nodes - one.nodes
    if limit is not None and spare < limit:
        yield RuleProblem("limits.min_spare_nodes", f"{_spare(spare, limit, one)}; {_room(subject, one.nodes + limit)}")


def too_few_spare_axes(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The bus carries fewer further axes than [limits] requires."""
    limit, one = subject.profile.limits.min_spare_axes, subject.deciding
    spare = one.max_axes - one.axes
    if limit is not None and spare < limit:
        nodes = ceil((one.axes + limit) / subject.profile.node.axes)
        yield RuleProblem("limits.min_spare_axes", f"{_spare(spare, limit, one)}; {_room(subject, nodes)}")


def _spare(spare: int, limit: int, one: RuleFigures) -> str:
    return f"{max(spare, 0)} to spare under the {one.timing_model} timing, {limit} asked for"


def _room(subject: RuleSubject, nodes: int) -> str:
    """What limits the nodes, and how to make room for a number of them."""
    one = subject.deciding
    limit = bus_of(subject.profile).limit(one.limited_by)
    cure = subject.room(nodes) if limit is None else limit.way_out
    return f"limited by {one.limited_by}; {cure}"


def execution_unmeasured(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The execution time is an assumption."""
    if subject.profile.node.execution.grade == "assumed":
        yield RuleProblem(
            "node.execution.grade",
            "the execution time is an assumption, and the largest terms rest on it; measure it on the node",
        )


RULES: Final = (
    Rule(
        "BP101",
        "slice-overrun",
        "error",
        "the cycle does not fit its time slice",
        "Under the timing model that decides (bus.timing_model), all terms of one cycle together (equation 2) take "
        "longer than slice_ratio * period_us (equation 1). The message names the cheapest cure: a setting of the bus "
        "costs nothing, the slice ratio costs computing time of the host, the period costs machine performance.",
        slice_overrun,
    ),
    Rule(
        "BP103",
        "over-utilisation",
        "error",
        "the slice is fuller than limits.max_utilisation",
        "[limits] max_utilisation keeps a share of the slice free, for retries, growth and what the model does "
        "not cover.",
        over_utilisation,
    ),
    Rule(
        "BP104",
        "too-few-spare-nodes",
        "error",
        "fewer nodes to spare than limits.min_spare_nodes",
        "[limits] min_spare_nodes is the number of further nodes that the bus must carry at the same period.",
        too_few_spare_nodes,
    ),
    Rule(
        "BP105",
        "too-few-spare-axes",
        "error",
        "fewer axes to spare than limits.min_spare_axes",
        "[limits] min_spare_axes is the number of further axes that the bus must carry at the same period.",
        too_few_spare_axes,
    ),
    Rule(
        "BP112",
        "execution-unmeasured",
        "warning",
        "the execution time is an assumption",
        'node.execution has grade = "assumed". The execution time is the largest term of most cycles, and no '
        "equation gives it: measure it.",
        execution_unmeasured,
    ),
)
