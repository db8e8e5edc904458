"""Rules of the file format. They have no check of their own: reading the profile finds the problems."""

from collections.abc import Mapping
from typing import Final

from busplan.buses.rule import Rule
from busplan.errors import ProblemKind

BY_KIND: Final[Mapping[ProblemKind, Rule]] = {
    "syntax": Rule(
        "BP001",
        "syntax",
        "error",
        "the file is no TOML",
        "A profile is TOML 1.0 in UTF-8, at most 100,000 bytes long. Nothing else of the file can be checked "
        "before it is.",
    ),
    "unknown-key": Rule(
        "BP002",
        "unknown-key",
        "error",
        "the profile has no such key",
        "A key that busplan does not know is most often a typing error, and the value it should have set "
        "is then missing or a default. `busplan schema` lists all keys for editors that complete and check while "
        "you type.",
    ),
    "missing-key": Rule(
        "BP003",
        "missing-key",
        "error",
        "a key without a default is not there",
        "The bus, its speed and nodes, the period, the payloads, the axes and the execution time have no default: "
        "no plan can be made without them. `busplan init` writes a profile that has them all.",
    ),
    "wrong-type": Rule(
        "BP004",
        "wrong-type",
        "error",
        "the value is of the wrong type",
        "Types are strict: no text stands for a number, no fraction for a count, no true for 1. Times and lengths "
        "may be whole numbers or fractions.",
    ),
    "out-of-range": Rule(
        "BP005",
        "out-of-range",
        "error",
        "the value is outside its range",
        "Every quantity has a range in which it means something; `busplan manual profile` and `busplan schema` list "
        "them. What only the bus standard forbids has rules of its own.",
    ),
    "inconsistent": Rule(
        "BP006",
        "inconsistent",
        "error",
        "two values do not go together",
        "The lists of an execution table must be of one length and its payloads must ascend; a value "
        "that busplan finds for you needs a bus that it can be found for.",
    ),
    "execution-unknown": Rule(
        "BP007",
        "execution-extrapolated",
        "error",
        "the execution time of the payload is not known",
        "The payload lies outside the measured table, and busplan extrapolates nothing in silence. Measure the "
        'payload and add it to node.execution, or state an assumption with kind = "linear" and grade = "assumed".',
    ),
}
