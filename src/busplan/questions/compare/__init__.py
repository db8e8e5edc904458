"""`busplan.compare`."""

from collections.abc import Iterable

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.charts import Drawing
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import ProfileLike, load_profile, one_or_several, with_cycle
from busplan.questions.compare import kinds as analysis
from busplan.questions.compare.kinds import KindComparison, MachineOnKind, NotOnKind
from busplan.questions.fit.network import network_of


class CompareAnswer(Answer, KindComparison):
    """Answer of `compare`: a machine on several kinds of bus, whose most axes a notebook draws.

    Each of its `kinds` has `figures` at the profile's period, its `smallest` period and its most `safe` axes, or the
    reason why it has none.
    """

    __slots__ = ()

    def on(self, kind: str) -> MachineOnKind | NotOnKind:
        """The machine on one kind of bus.

        Raises
        ------
        KeyError
            The kind was not asked for.
        """
        return {
            machine.kind if isinstance(machine, NotOnKind) else machine.figures.kind: machine for machine in self.kinds
        }[kind]

    def drawing(self) -> Drawing:
        """The most axes over the period, a curve for each kind of bus.

        Raises
        ------
        BusplanError
            No kind of bus can have the machine.
        """
        if not self.compared:
            raise BusplanError("there is nothing to draw: no kind of bus that was asked for can have this machine")
        return super().drawing()

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.compare.report import compare_report

        return compare_report(self)


def compare(
    profile: ProfileLike,
    *,
    buses: str | Iterable[str] | None = None,
) -> CompareAnswer:
    """Put the machine of a profile on each kind of bus: `busplan compare`.

    Parameters
    ----------
    profile
        The profile: a `Profile`, a path or a shipped name. On its own kind it stays as it is.
    buses
        Name of a kind of bus, or several; by default all, the profile's own first.

    Returns
    -------
    CompareAnswer
        Periods are in us. In a notebook it is a picture.

    Raises
    ------
    BusplanError
        Not a profile, or an unknown kind of bus.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.compare("paper-4ms", buses=["ieee1394", "can"])
    >>> [(kind.figures.verdict, kind.safe.axes, round(kind.smallest.us)) for kind in answer.kinds]
    [('fits', 52, 552), ('fits', 16, 2126)]
    >>> [term.key for term in answer.on("can").assumed if term.source == "new profile"]
    ['bus.bit_rate_kbit_s', 'bus.pipeline_cycles']
    """
    network = network_of(with_cycle(load_profile(profile), question="compare"))
    kinds = None
    if buses is not None:
        kinds = analysis.checked_kinds([str(kind) for kind in one_or_several(buses, name="buses")], option="buses")
    return CompareAnswer(*analysis.compare(network, kinds=kinds))
