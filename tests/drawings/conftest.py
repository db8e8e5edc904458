"""Plots of a picture, read by their labels as a reader does."""

from collections.abc import Callable
from dataclasses import dataclass, field
from re import findall
from xml.etree.ElementTree import Element

import pytest

SVG = "{http://www.w3.org/2000/svg}"
Points = list[tuple[float, float]]


@dataclass
class Plot:
    """A plot between two scales, of which two labels at least are numbers."""

    area: Element
    path: Element
    up: dict[str, float]
    """Height of each label, from the top of the plot, as a share of its height."""
    across: dict[str, float]
    """Place of each label, as a share of the width."""
    paths: dict[str, list[Points]] = field(default_factory=dict)
    """Points of each path as shares, by its class."""

    def x(self, share: float) -> float:
        """Value of a place across."""
        return self._value(self.across, share)

    def y(self, share: float) -> float:
        """Value of a place up."""
        return self._value(self.up, share)

    def values(self, css: str) -> Points:
        """Points of all paths of a class, in the numbers of the scales."""
        return [(self.x(x), self.y(y)) for one in self.paths.get(css, ()) for x, y in one]

    @staticmethod
    def _value(labels: dict[str, float], share: float) -> float:
        (first, at), *_, (last, end) = labels.items()
        return float(first) + (share - at) / (end - at) * (float(last) - float(first))


def read(root: Element) -> list[Plot]:
    """All plots of a picture, from top to bottom."""
    (body,) = root.findall(f"{SVG}svg")
    plots = []
    for area in body.findall(f"{SVG}svg"):
        path = area.find(f"{SVG}svg[@preserveAspectRatio]")
        if path is None:
            continue
        top, height = float(path.get("y", "")), float(path.get("height", ""))
        width = float(path.get("viewBox", "").split()[2])
        up = {
            text.text or "": (float(text.get("y", "")) - 4 - top) / height
            for text in body.findall(f"{SVG}text[@class='small'][@text-anchor='end']")
            if -5 <= float(text.get("y", "")) - 4 - top <= height + 5
        }
        across = {
            text.text or "": float(text.get("x", "").rstrip("%")) / 100
            for text in area.findall(f"{SVG}text[@class='small']")
            if float(text.get("y", "")) == top + height + 19
        }
        plot = Plot(area, path, up, across)
        for each in path.iter(f"{SVG}path"):
            numbers = [tuple(map(float, pair)) for pair in findall(r"(-?[\d.]+) (-?[\d.]+)", each.get("d", ""))]
            points = [(x / width, y / height) for x, y in numbers]
            plot.paths.setdefault(each.get("class", ""), []).append(points)
        plots.append(plot)
    return plots


@pytest.fixture(scope="session")
def plots() -> Callable[[Element], list[Plot]]:
    return read
