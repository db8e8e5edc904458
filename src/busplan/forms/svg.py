"""Drawings as SVG. Widths are in percent, so that a drawing fills its container and text keeps its size."""

import re
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.resources import as_file, files
from itertools import groupby
from math import ceil, cos, radians, sin
from typing import TYPE_CHECKING, Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan.forms import charts
from busplan.forms.inks import styled
from busplan.forms.lines import Line, wrapped
from busplan.forms.scale import placed

if TYPE_CHECKING:
    from busplan.forms import Picture


WIDTH: Final = 640
"""Width of a PNG of a drawing as wide as its container [px]."""
_ZOOM: Final = 2.0
"""Pixels of the PNG for a px of the SVG [1]."""
_MOST_HEIGHT: Final = 16_000
"""Largest height [pixels]. A drawing that would be higher is enlarged by less than `_ZOOM`."""
_FONT: Final = '* {font-family:"DejaVu Sans Subset" !important}'


def png(svg: str) -> bytes:
    """PNG of a drawing as wide as its container, with its style sheet; the same drawing gives the same bytes.

    Characters that the font lacks come from a font of this computer, or are boxes if none has them.
    """
    import resvg_py

    height = re.search(r'\bheight="(\d+)"', svg)
    zoom = min(_ZOOM, _MOST_HEIGHT / int(height[1])) if height else _ZOOM
    with as_file(files("busplan.forms") / "fonts") as fonts:
        return resvg_py.svg_to_bytes(
            svg_string=svg.replace('width="100%"', f'width="{WIDTH}"', 1),
            background="#ffffff",
            zoom=zoom,
            font_files=[str(fonts / "regular.ttf"), str(fonts / "bold.ttf")],
            style_sheet=_FONT,
        )


_PHONE: Final = 335
"""Width of a phone without margins [px]."""
_MARGIN: Final = 2.5
"""Margin at each side of a file [%]."""
_LINE: Final = 20
"""Height of a line of text [px]."""
_GAP: Final = 12
_LETTER, _SMALL_LETTER = 8, 7
"""Approximate width of a letter [px]."""
_NAMESPACE: Final = "http://www.w3.org/2000/svg"


def inline(drawing: charts.Drawing) -> str:
    """A drawing for a page that has the style sheet."""
    return _drawn(drawing, room=_PHONE)


def content(drawing: charts.Drawing, form: "Picture", *, note: str = "") -> str | bytes:
    """A drawing as a file of its own, with its title and a note after it. A screen of 320 px has room for it.

    A png needs the extra `plot`.
    """
    drawing = drawing._replace(title=f"{drawing.title} {note}".rstrip())
    if form == "svg":
        return styled(_drawn(drawing, room=_PHONE, is_file=True))
    return png(styled(_drawn(drawing, room=WIDTH * (1 - 2 * _MARGIN / 100), is_file=True)))


def _drawn(drawing: charts.Drawing, *, room: float, is_file: bool = False) -> str:
    root = _root(drawing.title)
    if drawing.description:
        SubElement(root, "desc").text = drawing.description
    sheet = _Sheet(root, room)
    if is_file:
        sheet = _Sheet(_inside(root, left=_MARGIN, width=100 - 2 * _MARGIN), room)
        sheet.y = 8
        sheet.words(drawing.title, css="head")
        for words in drawing.words:
            sheet.words(words, css="small")
        sheet.y += _GAP
    for panel in drawing.panels:
        sheet.panel(panel)
    sheet.legend(charts.legend(drawing.panels))
    return _markup(root, height=sheet.y + (_GAP if is_file else 0))


def _root(title: str) -> Element:
    root = Element("svg", {"xmlns": _NAMESPACE, "class": "chart", "width": "100%", "role": "img"})
    SubElement(root, "title").text = title
    return root


def _markup(root: Element, *, height: float) -> str:
    """SVG of a drawing; its text is escaped."""
    root.set("height", f"{height:.0f}")
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _inside(parent: Element, *, left: float, width: float) -> Element:
    """A nested drawing with its own width [%]; content at its edge may overflow."""
    return SubElement(parent, "svg", {"x": f"{left:.5g}%", "width": f"{width:.5g}%", "overflow": "visible"})


def _text(parent: Element, text: str, *, x: str = "0", y: float, css: str = "", anchor: str = "start") -> None:
    if text:
        SubElement(parent, "text", {"x": x, "y": f"{y:g}", "class": css, "text-anchor": anchor}).text = text


def _rect(parent: Element, *, x: str = "0", y: float, width: str, height: float, css: str, title: str = "") -> None:
    """Draw a box, with its title as a tooltip."""
    box = {"x": x, "y": f"{y:.5g}", "width": width, "height": f"{height:.5g}", "class": css}
    rect = SubElement(parent, "rect", box)
    if title:
        SubElement(rect, "title").text = title


def _frame(parent: Element, *, x: str, y: float, width: str, height: float) -> None:
    """Draw an empty box that is visible on any colour."""
    for css in ("halo", "frame"):
        _rect(parent, x=x, y=y, width=width, height=height, css=css)


def _line(parent: Element, x: tuple[str, str], y: tuple[float, float], *, css: str) -> None:
    ends = {"x1": x[0], "x2": x[1], "y1": f"{y[0]:.5g}", "y2": f"{y[1]:.5g}"}
    SubElement(parent, "line", {**ends, "class": css})


def _dot(parent: Element, entry: charts.Entry, *, x: str, y: float, title: str = "") -> None:
    dot = SubElement(parent, "circle", {"cx": x, "cy": f"{y:.5g}", "r": "7", "class": f"dot {entry.ink}"})
    if title:
        SubElement(dot, "title").text = title
    _text(parent, entry.mark, x=x, y=round(y + 3.6, 1), css="dot-letter", anchor="middle")


def _percent(share: float) -> str:
    return f"{100 * share:.5g}%"


class _Area(NamedTuple):
    """A plot between two scales."""

    area: Element
    """Element with text and marks: x in percent, y in px of the drawing."""
    plot: charts.ChartGrid | charts.Curves
    top: float
    width: float
    height: float

    def x(self, value: float) -> str:
        """The x of a value [%]."""
        return _percent(self.plot.across.share(value))

    def y(self, value: float) -> float:
        """The y of a value [px]."""
        return self.top + self.height * (1 - self.plot.up.share(value))

    def paths(self) -> Element:
        """Element for paths in the coordinates of `point`, clipped to the plot.

        Except in a PNG it stretches with the plot.
        """
        box = {"y": f"{self.top:g}", "width": "100%", "height": f"{self.height:g}", "preserveAspectRatio": "none"}
        return SubElement(self.area, "svg", {**box, "viewBox": f"0 0 {self.width:.1f} {self.height:g}"})

    def point(self, x: float, y: float) -> str:
        """Coordinates of a point in a path, from shares of the plot's width and height."""
        return f"{self.width * x:.1f} {self.height * (1 - y):.1f}"


_GUTTER: Final = 40.0
"""Width of the part left of a plot, at most [%]."""
_ROW: Final = 16
"""Least distance of two labels, up [px]."""
_TALL, _MOST_TALL, _HEIGHT = 20, 32, 520
"""Height of a row of cells, largest number of rows with it, and height of all rows where there are more [px]."""
_FAR: Final = 48
"""Distance of the marks of small cells [px]."""
_CURVES: Final = 240
"""Height of curves [px]."""
_BAR, _THIN_BAR = 18, 8
_BESIDE, _MOST_BESIDE = 22, 24
"""Pitch of lanes with labels beside them [px], and largest number of lanes with it; more have the pitch `_ROW`."""
_LETTER_PERCENT: Final = 4.5
"""Width of the narrowest bar with room for its letter on a phone [%]."""


class _Sheet:
    """A drawing that grows downwards, in the element `body`.

    Its text must fit in a width of `room` px.
    """

    def __init__(self, body: Element, room: float) -> None:
        self._body, self._room, self.y = body, room, 0.0

    def words(self, text: str, *, x: float = 0, css: str = "") -> None:
        """Write a paragraph."""
        characters = int((self._room - x) / _LETTER)
        # Letters of other scripts may be twice as wide.
        for line in wrapped(Line(text), characters if text.isascii() else characters // 2) if text else ():
            self.y += _LINE
            _text(self._body, line.text, x=f"{x:g}", y=self.y - 5, css=css)

    def panel(self, panel: charts.Panel) -> None:
        """Draw a chart below its title."""
        self.words(panel.title, css=f"head {panel.tone}")
        self.words(panel.words, css="small")
        match panel.plot:
            case charts.ChartGrid():
                self._grid(panel.plot)
            case charts.Curves():
                self._curves(panel.plot)
            case charts.Lanes():
                self._lanes(panel.plot)
            case charts.Dial():
                self._dial(panel.plot)
        self.y += _GAP

    def legend(self, entries: Sequence[charts.Entry]) -> None:
        """Draw the entries one after the other, in lines."""
        x = 0.0
        for entry in entries:
            sample = 34 if entry.shape == "line" else 20
            width = sample + _SMALL_LETTER * len(entry.words) + 2 * _GAP
            if x and x + width > self._room:
                x, self.y = 0.0, self.y + _LINE
            above = self.y
            if entry.shape == "line":
                _line(self._body, (f"{x:g}", f"{x + 28:g}"), (above + 11, above + 11), css=f"line {entry.ink}")
                if entry.mark:
                    _dot(self._body, entry, x=f"{x + 14:g}", y=above + 11)
            else:
                box = _frame if entry.ink == "frame" else partial(_rect, css=entry.ink)
                box(self._body, x=f"{x + 1:g}", y=above + 4, width="14", height=14)
                letter = f"letter on-{entry.ink}"
                _text(self._body, entry.mark, x=f"{x + 8:g}", y=above + 15, css=letter, anchor="middle")
            self.words(entry.words, x=x + sample)
            x, self.y = (0.0, self.y) if self.y > above + _LINE else (x + width, above)
        self.y += _LINE if x else 0

    # --- scales

    def _area(self, plot: charts.ChartGrid | charts.Curves, *, height: float) -> _Area:
        """Draw both scales, and return the plot between them."""
        across, up = plot.across, plot.up
        _text(self._body, up.label, y=self.y + 14, css="small")
        top, longest = self.y + _LINE + 8, max((len(tick.label) for tick in up.ticks), default=0)
        gutter = min(_GUTTER, 100 * (_SMALL_LETTER * longest + 12) / self._room)
        area = _inside(self._body, left=gutter, width=99 - gutter)
        width = WIDTH * (1 - 2 * _MARGIN / 100) * (99 - gutter) / 100
        places = [(height * (1 - up.share(tick.at)), _ROW) for tick in up.ticks]
        for number in placed(places, room=height + _ROW, own=up.own_tick):
            y = top + places[number][0]
            if isinstance(plot, charts.Curves):
                _line(area, ("0", "100%"), (y, y), css="rule")
            css = "small here" if number == up.own_tick else "small"
            _text(self._body, up.ticks[number].label, x=f"{gutter - 2:.5g}%", y=round(y) + 4, css=css, anchor="end")
        self.y = top + height
        self._across(area, across, room=self._room * (99 - gutter) / 100)
        _text(area, across.label, x="100%", y=self.y + 14, css="small", anchor="end")
        self.y += _LINE + 2
        return _Area(area, plot, top, width, height)

    def _across(self, area: Element, ruler: charts.Ruler, *, room: float) -> None:
        """Draw the ticks of a scale below a plot at least `room` px wide."""
        labels = [(room * ruler.share(tick.at), _SMALL_LETTER * len(tick.label)) for tick in ruler.ticks]
        for number, start in placed(labels, room=room, gap=_SMALL_LETTER, own=ruler.own_tick).items():
            (at, size), tick = labels[number], ruler.ticks[number]
            x, middle = _percent(ruler.share(tick.at)), at - size / 2
            _line(area, (x, x), (self.y, self.y + 5), css="rule")
            anchor = "middle" if abs(start - middle) < 1 else "start" if start > middle else "end"
            css = "small here" if number == ruler.own_tick else "small"
            _text(area, tick.label, x=x, y=self.y + 19, css=css, anchor=anchor)
        self.y += _LINE + 2

    # --- cells

    def _grid(self, grid: charts.ChartGrid) -> None:
        rows, columns = len(grid.rows), len(grid.rows[0])
        tall = _TALL if rows <= _MOST_TALL else _HEIGHT / rows
        area = self._area(grid, height=tall * rows)
        is_fine = max(rows, columns) > _MOST_TALL
        css, wide = "fine" if is_fine else "cell", 1 / columns
        # Small cells have a mark only now and then.
        every = (_FAR // (self._room * wide) + 1, ceil(_GAP / tall)) if is_fine else (1, 1)
        for number, row in enumerate(grid.rows):
            y, start = area.top + tall * (rows - number - 1), 0
            for cell, run in groupby(row):
                end = start + len(list(run))
                if cell is not None:
                    box = {"x": _percent(start * wide), "width": _percent((end - start) * wide)}
                    _rect(area.area, **box, y=y, height=tall, css=f"{css} {cell.ink}", title=cell.words)
                start = end
            if number % every[1] == every[1] // 2:
                self._marks(area.area, row, y=y + tall / 2 + 4, every=int(every[0]))
        edges = "".join(f"M{area.point(*start)}L{area.point(*end)}" for start, end in _borders(grid))
        if edges:
            SubElement(area.paths(), "path", {"class": "line border", "d": edges})
        if grid.own is not None:
            x, y = grid.own
            place = SubElement(area.area, "svg", {"x": area.x(x), "y": f"{area.y(y):.5g}", "overflow": "visible"})
            if is_fine:
                _frame(place, x="-6", y=-6, width="12", height=12)
            else:
                left = _percent(grid.across.share(x) - wide / 2)
                _frame(area.area, x=left, y=area.y(y) - tall / 2, width=_percent(wide), height=tall)

    @staticmethod
    def _marks(area: Element, row: Sequence[charts.ChartCell | None], *, y: float, every: int) -> None:
        """Write the marks of a row, one for `every` alike cells, as one text, because a page has many maps."""
        marks, places, start = "", [], 0
        for mark, run in groupby("" if cell is None else cell.mark for cell in row):
            size = len(list(run))
            several = max(1, size // every) if mark else 0
            marks += mark * several
            places += [_percent((start + size * (number + 0.5) / several) / len(row)) for number in range(several)]
            start += size
        if marks:
            _text(area, marks, x=" ".join(places), y=y, css="letter", anchor="middle")

    # --- curves

    def _curves(self, curves: charts.Curves) -> None:
        area = self._area(curves, height=_CURVES)
        for shade in curves.shades:
            low, high = (curves.across.share(end) for end in (shade.low, shade.high))
            box = {"x": _percent(low), "width": _percent(high - low)}
            _rect(area.area, **box, y=area.top, height=_CURVES, css=f"shade {shade.entry.ink}")
            middle, foot = _percent((low + high) / 2), area.top + _CURVES - 6
            _text(area.area, shade.entry.mark, x=middle, y=foot, css="head", anchor="middle")
        for guide in curves.guides:
            across = ("0", "100%") if guide.x is None else (area.x(guide.x),) * 2
            up = (area.top, area.top + _CURVES) if guide.y is None else (area.y(guide.y),) * 2
            _line(area.area, across, up, css=f"line {guide.entry.ink}")
        paths = area.paths()
        for curve in curves.curves:
            if curve.has_line:
                SubElement(paths, "path", {"class": f"line {curve.entry.ink}", "d": _path(area, curve)})
        for curve in curves.curves:
            points = [(number, x, y) for number, (x, y) in enumerate(curve.points) if y is not None]
            for number, x, y in (points if curve.has_dots else points[-1:]) if curve.entry.mark else ():
                title = curve.words[number] if curve.words else ""
                _dot(area.area, curve.entry, x=area.x(x), y=area.y(y), title=title)

    # --- bars

    def _lanes(self, lanes: charts.Lanes) -> None:
        gutter = 0.0
        if lanes.is_beside:
            gutter = min(_GUTTER, 100 * _SMALL_LETTER * max(len(lane.label) for lane in lanes.lanes) / self._room)
        area = _inside(self._body, left=gutter, width=100 - gutter)
        pitch = _BESIDE if len(lanes.lanes) <= _MOST_BESIDE else _ROW
        self.y += 4
        for lane in lanes.lanes:
            tall = pitch - 3 if lanes.is_beside else _THIN_BAR if lane.is_thin else _BAR
            if lanes.is_beside:
                _text(self._body, lane.label, y=self.y + tall - 4, css="small")
            elif lane.label or lane.note:
                _text(self._body, lane.label, y=self.y + 14)
                _text(self._body, lane.note, x="100%", y=self.y + 14, css="small", anchor="end")
                self.y += _LINE
            _rect(area, y=self.y, width="100%", height=tall, css="track")
            for span in lane.spans:
                _span(area, span, lanes.across, y=self.y, height=tall)
            for guide in lanes.guides:
                x = _percent(lanes.across.share(guide.x or 0.0))
                _line(area, (x, x), (self.y - 2, self.y + tall + 2), css=f"line {guide.entry.ink}")
            self.y += tall + 3
        self._across(area, lanes.across, room=self._room * (100 - gutter) / 100)

    # --- circles

    def _dial(self, dial: charts.Dial) -> None:
        wide, tall = _DIAL
        sheet = {"y": f"{self.y:g}", "width": "100%", "height": f"{tall}"}
        box = SubElement(self._body, "svg", {**sheet, "viewBox": f"{-wide / 2:g} {-tall / 2:g} {wide} {tall}"})
        far = max((_NOMINAL * radius for radius, _ in dial.rings), default=_NOMINAL) + 8
        for text, x, y, anchor in _ENDS:
            _line(box, (f"{40 * x}", f"{far * x:g}"), (40 * y, far * y), css="rule")
            _text(box, text, x=f"{x * (far + 4):g}", y=round(y * (far + 9)) + 5, css="small", anchor=anchor)
        for radius, entry in dial.rings:
            SubElement(box, "circle", {"r": f"{_NOMINAL * radius:.1f}", "class": f"line {entry.ink}"})
        SubElement(box, "path", {"class": f"band {dial.entry.ink}", "d": "".join(_outlines(dial))})
        SubElement(box, "path", {"class": "line arrow", "d": _arrow(is_clockwise=dial.is_clockwise)})
        SubElement(box, "circle", {"cx": f"{_NOMINAL}", "r": "4", "class": "start"})
        for number, words in enumerate(dial.words):
            _text(box, words, x="0", y=_LINE * number - 4, anchor="middle")
        self.y += tall


def _borders(grid: charts.ChartGrid) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Edges between cells inside and outside, as shares of the plot."""
    wide, tall = 1 / len(grid.rows[0]), 1 / len(grid.rows)
    inside = [[None if cell is None else cell.is_inside for cell in row] for row in grid.rows]
    for y, row in enumerate(inside):
        for x, here in enumerate(row):
            if here is None:
                continue
            if x + 1 < len(row) and row[x + 1] is (not here):
                yield ((x + 1) * wide, y * tall), ((x + 1) * wide, (y + 1) * tall)
            if y + 1 < len(inside) and inside[y + 1][x] is (not here):
                yield (x * wide, (y + 1) * tall), ((x + 1) * wide, (y + 1) * tall)


def _path(area: _Area, curve: charts.Curve) -> str:
    pieces, is_joined = [], False
    for x, y in curve.points:
        if y is not None:
            point = area.point(area.plot.across.share(x), area.plot.up.share(y))
            pieces.append(f"{'L' if is_joined else 'M'}{point}")
        is_joined = y is not None
    return "".join(pieces)


def _span(area: Element, span: charts.Span, ruler: charts.Ruler, *, y: float, height: float) -> None:
    """Draw a bar, with its letter if there is room."""
    start, end = (100 * min(1.0, max(0.0, ruler.share(at))) for at in (span.start, span.end))
    width, ink = f"{end - start:.5g}%", span.entry.ink
    _rect(area, x=f"{start:.5g}%", y=y, width=width, height=height, css=ink, title=span.words)
    if end - start >= _LETTER_PERCENT and height >= _ROW - 3:
        middle = f"{(start + end) / 2:.5g}%"
        _text(area, span.entry.mark, x=middle, y=y + height / 2 + 4, css=f"letter on-{ink}", anchor="middle")


_DIAL: Final = (420, 380)
"""Width and height of a circle with its labels [px]."""
_NOMINAL: Final = 128
"""Radius of the nominal circle [px]."""
_ENDS: Final = (("X 0°", 1, 0, "start"), ("Y 90°", 0, -1, "middle"), ("180°", -1, 0, "end"), ("270°", 0, 1, "middle"))
"""Axes and angles at the ends of the cross, with their places."""
_ARROW, _ARROW_DEG = 0.62, (20, 65)
"""Radius of the arrow as a multiple of the nominal radius, where no error is drawn, and its start and end [deg]."""


def _place(angle_deg: float, radius: float) -> str:
    """Coordinates in the drawing; y points down in SVG."""
    radius *= _NOMINAL
    return f"{radius * cos(radians(angle_deg)):.1f} {-radius * sin(radians(angle_deg)):.1f}"


def _arrow(*, is_clockwise: bool) -> str:
    """An arc inside the circle, with a head at its end."""
    start, end = reversed(_ARROW_DEG) if is_clockwise else _ARROW_DEG
    back, size = end + (start - end) / 5, _ARROW * _NOMINAL
    arc = f"M{_place(start, _ARROW)}A{size:.1f} {size:.1f} 0 0 {int(is_clockwise)} {_place(end, _ARROW)}"
    return f"{arc}M{_place(back, _ARROW - 0.05)}L{_place(end, _ARROW)}L{_place(back, _ARROW + 0.05)}"


def _outlines(dial: charts.Dial) -> Iterator[str]:
    """Outlines of the band, one for each part of the circle without a gap."""
    sectors = len(dial.inner)
    first = next((number for number, radius in enumerate(dial.inner) if radius is None), -1) + 1
    round_from_gap = (number % sectors for number in range(first, first + sectors))
    for is_known, run in groupby(round_from_gap, key=lambda number: dial.inner[number] is not None):
        numbers = list(run)
        if is_known:
            out, back = (
                [_place(360 * (number + 0.5) / sectors, radii[number] or 0.0) for number in numbers]
                for radii in (dial.outer, dial.inner)
            )
            between = "ZM" if len(numbers) == sectors else "L"
            yield f"M{'L'.join(out)}{between}{'L'.join(reversed(back))}Z"


_CELL_BAR: Final = 16
"""Height of a bar in a table [px]."""


def signed_bar(value: float, *, least: float, most: float, title: str) -> str:
    """A value as a bar in a table, on a scale with least <= 0 <= most. The title is for screen readers."""
    root = _root(title)
    zero, end = ((mark - least) / (most - least) for mark in (0.0, value))
    box = {"x": _percent(min(zero, end)), "width": _percent(abs(end - zero))}
    _rect(root, **box, y=2, height=_CELL_BAR - 4, css="takes" if value >= 0 else "hides")
    _line(root, (_percent(zero),) * 2, (0, _CELL_BAR), css="line zero")
    return _markup(root, height=_CELL_BAR)
