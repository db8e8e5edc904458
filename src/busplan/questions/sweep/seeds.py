"""What a summary over seeds says of all points, in sentences."""

from collections.abc import Iterator

import numpy as np

from busplan.forms.blocks import Code, Sentence, count_value, sentence
from busplan.forms.numbers import nouns
from busplan.questions.sweep.blocks import SweepBlock


class SeedTally:
    """Counts the points whose circle fails with no, some and every seed.

    Parameters
    ----------
    seeds
        Circle tests of each point.
    """

    def __init__(self, seeds: int) -> None:
        self._seeds = seeds
        self._never = self._sometimes = self._always = self._unjudged = self._unmoved = 0

    def add(self, block: SweepBlock) -> None:
        """Count one more block; a circle is the same under every model."""
        figures = block.models[0]
        failed = figures["failed_share"].values
        self._never += int(np.sum(failed == 0))
        self._always += int(np.sum(failed == 1))
        self._sometimes += int(np.sum((failed > 0) & (failed < 1)))
        self._unjudged += int(np.sum(np.isnan(failed)))
        self._unmoved += int(np.sum(figures["max_contour_error_std_mm"].values == 0))

    def sentences(self) -> Iterator[Sentence]:
        """Summary of the counts."""
        judged = self._never + self._sometimes + self._always
        seeds = count_value(self._seeds, grouped=True)
        if judged:
            counts = (count_value(one, grouped=True) for one in (self._never, self._sometimes, self._always))
            points = f"{judged:,} {nouns(judged, 'point')}"
            words = f"The circle holds every tolerance with each of {{}} seeds at {{}} of {points}, "
            yield sentence(f"{words}fails with some at {{}} and with all at {{}}.", seeds, *counts)
        if self._unjudged:
            words = "The circle is not judged at {}: no contour tolerance is asked for."
            yield sentence(words, count_value(self._unjudged, grouped=True), state="warns")
        if self._unmoved:
            points = nouns(self._unmoved, "point")
            words = f"At {{}} {points} all seeds gave the same circle: a seed draws for {{}} and {{}}."
            drawn = Code("delivery.jitter_us"), Code("delivery.loss_probability")
            yield sentence(words, count_value(self._unmoved, grouped=True), *drawn, state="warns")
