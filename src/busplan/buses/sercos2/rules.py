"""The rule of the gate that only SERCOS I and II have: a period that they do not know."""

from typing import Final

from busplan.buses.known_period import period_rule
from busplan.buses.sercos2.constants import PERIODS, PERIODS_SOURCE

RULES: Final = (period_rule("BP151", PERIODS, kind="sercos2", source=PERIODS_SOURCE),)
