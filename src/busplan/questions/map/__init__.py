"""`busplan.map_`."""

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.progress import Progress, ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import ProfileLike, load_network, with_cycle
from busplan.questions.map import trade_off as analysis
from busplan.questions.map.direction import Direction, checked_direction
from busplan.questions.map.trade_off import TradeOff
from busplan.questions.sweep import axis_values
from busplan.questions.sweep.circles import mapper_of
from busplan.sections.profile import Profile

Along = Mapping[str, str | Iterable[object]]


class MapAnswer(Answer, TradeOff):
    """Answer of `map_`: where a design fits, which a notebook draws. Its `rows` have cells, or reasons for none."""

    __slots__ = ()

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.map.report import map_report

        return map_report(self)


def map_(
    profile: ProfileLike,
    *,
    x: Along | None = None,
    y: Along | None = None,
    circle: bool = False,
    progress: Progress = ignored,
    executor: Executor | None = None,
) -> MapAnswer:
    """Tell where over two keys a design fits, and what limits it elsewhere: `busplan map`.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    x, y
        Quantities on the x and the y axis: one dotted key, or "axes" for the axes of all nodes, with up to 64 values in
        its unit, as `sweep` takes them: {"bus.gap_count": [7, 63, "optimal"]}. By default the axes, and the period
        [us].
    circle
        Also run the circle test of every setting that fits, up to 1,000.
    progress
        With `circle`: called now and then with the circle tests that are done, and all of them [1].
    executor
        With `circle`: where the tests run; by default in this thread. Any `concurrent.futures.Executor` gives the same
        answer, and is not shut down. Worker processes must have this version of busplan.

    Returns
    -------
    MapAnswer
        Its `rows` have the shape (values of y, values of x). In a notebook it is a picture.

    Raises
    ------
    BusplanError
        Not a profile, an invalid key or values, no setting that can exist, or too many circle tests.
    Exception
        Anything that `executor` raises.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.map_("paper-4ms", x={"axes": range(4, 13, 4)}, y={"cycle.period_us": [500, 1000]})
    >>> [[cell.state for cell in row] for row in answer.rows]
    [['fits', 'does not fit', 'does not fit'], ['fits', 'fits', 'fits']]
    """
    mapper = mapper_of(executor, circle=circle)
    network = load_network(profile)
    if x is None or y is None:
        with_cycle(network.profile, question="a map of period and axes", instead="give x and y, each a key with values")
    return MapAnswer(
        *analysis.trade_off(
            network,
            x=_direction(network.profile, x, name="x", with_circle=circle),
            y=_direction(network.profile, y, name="y", with_circle=circle),
            with_circle=circle,
            mapper=mapper,
            progress=progress,
        )
    )


def _direction(profile: Profile, along: Along | None, *, name: str, with_circle: bool) -> Direction | None:
    if along is None:
        return None
    if not isinstance(along, Mapping) or len(along) != 1 or not all(isinstance(key, str) for key in along):
        raise BusplanError(f'{name} {along!r}: expected one key and its values, as {{"bus.nodes": range(1, 17)}}')
    ((key, values),) = along.items()
    return checked_direction(
        profile,
        key,
        axis_values(profile, key, values, name=name),
        option=name,
        circle_option=None if with_circle else "circle",
    )
