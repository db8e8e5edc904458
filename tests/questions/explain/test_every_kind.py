"""Every figure of every kind of bus is explained as it is computed, and what does not exist is null."""

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named, kind_names

if TYPE_CHECKING:
    from subprocess import CompletedProcess

Run = Callable[..., "CompletedProcess[str]"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", kind_names())
@given(data=st.data())
def test_a_figure_is_explained_as_capacity_has_it(
    kind: str, data: st.DataObject, profiles_by_kind: Mapping[str, st.SearchStrategy[busplan.Profile]]
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    bus = kind_named(kind)
    (found,) = busplan.capacity(profile, timing_model=bus.deciding_model).results
    command, figure = data.draw(st.sampled_from(busplan.explain(profile).figures))
    (one, *_) = busplan.explain(profile, f"{command}.{figure.key}", timing_model=bus.deciding_model).derivations
    known = found.values()
    if command == "latency":
        rows = busplan.latency(profile, timing_model=bus.deciding_model).to_dict()["transactions"]
        known = next(
            row for row in rows if one.transaction in (row["transaction"], f"{row.get('group')} {row['transaction']}")
        )
    assert one.value == pytest.approx(known[one.figure.key], rel=1e-12)


def test_an_unknown_uncertainty_is_null_and_no_zero(run: Run) -> None:
    measured = busplan.load_profile("sercos3-servo-8", changes={"bus.ring_grade": "measured"})
    deciding = busplan.capacity(measured).verdicts[0].deciding
    assert (deciding.bias_us, deciding.uncertainty_us) == (None, None)
    assert busplan.capacity("sercos3-servo-8").verdicts[0].deciding.uncertainty_us is not None
    words = ("sercos3-servo-8", "--set", "bus.ring_grade=measured")
    shown = run("capacity", *words, "--all").stdout
    assert re.search(r"^uncertainty U +JCGM 100 +us +- +-$", shown, re.MULTILINE)
    assert "+/-" not in shown.partition("\n8 nodes")[0]
    (derivation,) = busplan.explain(measured, "uncertainty_us").to_dict()["derivations"]
    assert (derivation["value"], derivation["steps"][-1]["value"]) == (None, None)
    explained = run("explain", *words[:1], "uncertainty_us", *words[1:])
    assert (explained.returncode, "inf" in explained.stdout) == (0, False)
