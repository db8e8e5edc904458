"""`busplan.explore`: what does a change do? Every setting of a grid, computed before the reader asks."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from math import ceil, prod
from typing import Final

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.errors import BusplanError
from busplan.forms import blocks
from busplan.progress import Progress, ignored, part_of
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import ProfileLike, load_network, require_cycle, with_its_constants
from busplan.questions.base.sentences import document, with_profile
from busplan.questions.capacity.verdict import Verdict, verdicts_of
from busplan.questions.fit.grid import capacities, require_few_tables
from busplan.questions.fit.network import changed
from busplan.questions.map import (
    Along,
    Cell,
    Direction,
    MapAnswer,
    NotDrawn,
    design_value,
    direction,
    directions,
    in_rows,
    map_of,
    possible_points,
)
from busplan.questions.map.report import circle_words, map_document, map_drawing, title_of, value_text
from busplan.sections.base import TRANSACTION_KINDS, value_at
from busplan.sections.profile import Profile, varied_nodes

MOST_VALUES: Final = 32
"""Most values of a slider: their cells are large enough to be chosen."""
MOST_SETTINGS: Final = 5000
"""Most settings of a page, so that it opens at once."""
_MOST_TABLES: Final = 20_000
"""Most groups and messages of all settings together: each setting has its card."""
_TIMES: Final = (0.5, 1, 2, 3, 4)
"""Payloads by default, as multiples of the profile's own."""


@dataclass(frozen=True, slots=True, repr=False)
class ExploreAnswer(Answer):
    """Answer of `explore`: the verdict at every setting of a grid.

    Parameters
    ----------
    profile
        The profile itself: this design.
    over
        The third direction; None where two keys alone vary.
    maps
        The map of the other two directions at each value of the third.
    cards
        For each map, row by row, the card of each cell; None where a setting cannot exist.
    """

    profile: Profile
    over: Direction | None
    maps: tuple[MapAnswer, ...]
    cards: tuple[tuple[blocks.Card | None, ...], ...]

    def report(self) -> blocks.Report:
        """The answer in blocks: sliders on a page of HTML, the map of this design in every other form."""
        number = 0 if self.over is None else _own_place(self.over, self.profile)
        here = self.maps[number]
        up, across = here.directions
        row, column = _own_place(up, self.profile), _own_place(across, self.profile)
        cards, columns = self.cards[number], len(across.values)
        # The profile's own values, unless these are no setting here.
        place, first = min(
            ((place, made) for place, made in enumerate(cards) if made is not None),
            key=lambda choice: choice[0] != row * columns + column,
        )
        row, column = divmod(place, columns)
        # The first slider is the vertical direction, as in the title of a map.
        places = [(up, row), (across, column), *([] if self.over is None else [(self.over, number)])]
        sliders = tuple(
            blocks.Slider(
                title_of(along, here.profile), tuple(value_text(along, value) for value in along.values), place
            )
            for along, place in places
        )
        drawings = tuple(map_drawing(answer, frame=(row, column)) for answer in self.maps)
        explorer = blocks.Explorer(sliders, self.cards, first, drawings, number, tuple(here.report().blocks))
        name = self.profile.name
        return blocks.Report(
            blocks.Sentence(("What a change does to ", blocks.Code(name))),
            (explorer,),
            self._document(),
            with_profile(name, [record for _, whole in self._documents() for record in whole["cells"]]),
            is_page=True,
        )

    def _document(self) -> blocks.JsonDocument:
        return document(
            "explore",
            profile=self.profile.name,
            timing_model=self.maps[0].timing_model,
            over=None if self.over is None else {"key": self.over.key, "values": list(self.over.values)},
            maps=[{"over": value, **whole} for value, whole in self._documents()],
        )

    def _documents(self) -> Iterator[tuple[Value | None, blocks.Record]]:
        """The document of each map, and the value of the third direction, which its cells have, too."""
        for value, answer in zip((None,) if self.over is None else self.over.values, self.maps, strict=True):
            whole = map_document(answer)
            further = {} if self.over is None else {self.over.key: value}
            yield value, {**whole, "cells": [{**further, **cell} for cell in whole["cells"]]}


def _own_place(along: Direction, profile: Profile) -> int:
    """Index of the profile's own value; 0 if it is not among the values."""
    own = design_value(along.key, profile)
    return along.values.index(own) if own in along.values else 0


@with_its_constants
def explore(
    profile: ProfileLike,
    *,
    x: Along | None = None,
    y: Along | None = None,
    over: Along | None = None,
    circle: bool = False,
    progress: Progress = ignored,
    executor: Executor | None = None,
) -> ExploreAnswer:
    """Show what a change does: `busplan explore`. Its HTML is a page with a slider for each key.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    x, y
        As for `map_`, with up to 32 values each.
    over
        A third key with up to 32 values; by default the largest payload of a node, where the bus has one.
    circle
        Also run the circle test of every setting that fits.
    progress
        Called now and then with the part that is done, and the whole.
    executor
        With `circle`: where the tests run, as for `map_`.

    Raises
    ------
    BusplanError
        As `map_`; or more than 5,000 settings.

    Examples
    --------
    >>> import busplan
    >>> over = {"payload.write_bytes": [16, 512]}
    >>> answer = busplan.explore("paper-4ms", x={"axes": [4, 8]}, y={"cycle.period_us": [500, 4000]}, over=over)
    >>> [cards[0].verdict.text for cards in answer.cards]
    ['FITS', 'DOES NOT FIT']
    """
    network = load_network(profile)
    third = _third(network, over, with_circle=circle)
    values = (None,) if third is None else third.values
    networks = [network if value is None or third is None else changed(network, {third.key: value}) for value in values]
    if x is None or y is None:
        require_cycle(
            network.profile, question="an explorer of period and axes", instead="give x and y, each a key with values"
        )
    chosen = directions(network, x, y, with_circle=circle)
    _require_few(network, *chosen, third)
    maps, cards = [], []
    for number, variant in enumerate(networks):
        part = part_of(progress, number=number, of=len(networks))
        points = possible_points(variant, *chosen)
        possible = [*points.possible.values()]
        judging = part_of(part, number=0, of=2) if circle else part
        verdicts = verdicts_of(possible, capacities(variant, possible), progress=judging)
        answer = map_of(
            variant,
            *chosen,
            points,
            [verdict.figures for verdict in verdicts],
            circle=circle,
            executor=executor,
            progress=part_of(part, number=1, of=2) if circle else ignored,
        )
        maps.append(answer)
        judged = dict(zip(points.possible, verdicts, strict=True))
        numbers = range(len(points.possible) + len(points.refused))
        verdict_rows = in_rows([judged.get(number) for number in numbers], columns=len(answer.x.values))
        pairs = zip(chain(*verdict_rows), chain(*answer.rows), strict=True)
        cards.append(tuple(_card(answer, verdict, cell) for verdict, cell in pairs))
    return ExploreAnswer(network.profile, third, tuple(maps), tuple(cards))


def _third(network: Network, over: Along | None, *, with_circle: bool) -> Direction | None:
    """The third direction; by default the larger payload of a node of the group that varies."""
    profile = network.profile
    if over is not None:
        return direction(profile, over, name="over", with_circle=with_circle)
    if not network.groups:
        return None
    varied = varied_nodes(profile)
    kind = max(TRANSACTION_KINDS, key=lambda kind: float(varied.bytes_of(kind)))
    key = varied.payload_key(kind)
    own = value_at(profile, key) or 0
    values = [size for size in sorted({ceil(own * times) for times in _TIMES}) if _is_possible(network, key, size)]
    return Direction(key, tuple(values)) if len(values) > 1 else None


def _is_possible(network: Network, key: str, value: Value) -> bool:
    with suppress(BusplanError):
        changed(network, {key: value})
        return True
    return False


def _require_few(network: Network, x: Direction, y: Direction, third: Direction | None) -> None:
    """Refuse a grid that is too large for a page."""
    sizes = {along.key: len(along.values) for along in (x, y, third) if along is not None}
    for key, size in sizes.items():
        if size > MOST_VALUES:
            raise BusplanError(f"{key}: {size} values; a slider has up to {MOST_VALUES}. A map or a sweep takes more")
    if (settings := prod(sizes.values())) > MOST_SETTINGS:
        raise BusplanError(f"{settings:,} settings; an explorer has up to {MOST_SETTINGS:,}: give fewer values")
    require_few_tables(network, settings=settings, most=_MOST_TABLES)


def _card(answer: MapAnswer, verdict: Verdict | None, cell: Cell | NotDrawn) -> blocks.Card | None:
    if verdict is None or isinstance(cell, NotDrawn):
        return None
    made, circle = verdict.card, circle_words(answer, cell)
    return made._replace(lines=(*made.lines, *([("circle", circle)] if circle else [])))
