"""The rule of the gate that only SERCOS III has: a period that it does not know."""

from typing import Final

from busplan.buses.known_period import period_rule
from busplan.buses.sercos3.constants import PERIODS, PERIODS_SOURCE

RULES: Final = (period_rule("BP141", PERIODS, kind="sercos3", source=PERIODS_SOURCE),)
