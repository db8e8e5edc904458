"""What a notebook and a file get: tables and charts of the HTML form, pictures, pages."""

import re

import pytest

import busplan
from busplan.profile.changes import KeyChanges, parse_set


def test_a_notebook_shows_tables_and_charts_and_no_name_is_markup() -> None:
    found = busplan.capacity(busplan.load_profile("paper-4ms", changes={"name": "<b>&x"}), sensitivity=True)
    shown = found._repr_html_()
    assert "<b>" not in shown
    assert "&lt;b&gt;&amp;x</bdi>  IEEE 1394, " in shown
    assert shown.count("<table") == 2  # what moves the margin, and how far each quantity may grow
    assert shown.count('role="img"') == 2  # the bar of the card, and what moves the margin
    assert f'<data value="{found.results[0].margin_corrected_us!r}"' in shown


def test_the_styles_of_a_notebook_reach_nothing_outside() -> None:
    shown = busplan.timeline("paper-4ms")._repr_html_()
    (style,) = re.findall(r"<style>\n\.busplan\.busplan \{\n(.*?)\n\}\n</style>", shown, re.DOTALL)
    # All rules are nested: outside the two braces stands none, and none is of the root of the page.
    assert style.count("{") == style.count("}")
    assert ":root" not in style
    assert "<html" not in shown
    assert "<script" not in shown


def test_a_sweep_shows_its_table_and_a_map_of_one_quantity_its_curve() -> None:
    swept = busplan.sweep("paper-4ms", vary={"bus.nodes": [1, 2]})
    assert swept._repr_html_().count("<table") == 1
    assert swept._repr_svg_() is None
    drawn = busplan.map_("paper-4ms", x={"bus.nodes": [1, 2]})
    assert drawn._repr_html_().count('<svg xmlns="http://www.w3.org/2000/svg" class="chart"') == 1
    assert (drawn._repr_svg_() or "").startswith("<svg ")


def test_a_notebooks_own_styles_of_lists_and_tables_are_undone() -> None:
    # JupyterLab floats each dt at a fifth of the width and fixes the columns of tables, which breaks words.
    shown = busplan.capacity("paper-4ms")._repr_html_()
    for rule in (
        "tbody tr { background: none; }",
        "dt { float: none; width: auto; font-weight: inherit; }",
        "table-layout: auto;",
    ):
        assert rule in shown


def test_a_light_notebook_stays_light_on_a_dark_desktop() -> None:
    shown = busplan.compare("paper-4ms")._repr_html_()
    light, dark = '&:not([data-jp-theme-light="true"] *) {\n@media', "@media screen and (prefers-color-scheme"
    assert shown.count(dark) == shown.count(f"{light}{dark.removeprefix('@media')}") >= 3


def test_the_name_of_a_question_that_python_has_taken_is_said() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'map'; did you mean map_\?$"):
        busplan.map  # type: ignore[attr-defined]  # noqa: B018
    assert not hasattr(busplan, "qqq")


def test_an_answer_without_a_picture_gives_none() -> None:
    assert busplan.capacity("paper-4ms")._repr_svg_() is None
    assert busplan.diff("paper-4ms", "paper-1ms")._repr_svg_() is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "busplan latency sercos2-servo-8"),
        ({"bus.nodes": 3}, "busplan latency sercos2-servo-8 --set bus.nodes=3"),
        ({"name": "mine"}, "busplan latency mine.toml"),
    ],
)
def test_the_commands_of_a_page_give_its_profile(changes: dict[str, object], words: str) -> None:
    page = busplan.report(busplan.load_profile("sercos2-servo-8", changes=changes), circle=False)
    assert f"$ {words}\n" in str(page)


def test_the_commands_of_a_page_give_the_origin_that_is_said() -> None:
    profile = busplan.load_profile("sercos2-servo-8", changes={"bus.nodes": 3})
    changes = KeyChanges(parse_set(["bus.nodes=3"]))
    page = str(busplan.report(profile, circle=False, origins=[("line 1.toml", changes)]))
    assert page.startswith("sercos2-servo-8\nWith --set bus.nodes=3.\n")
    assert "$ busplan latency 'line 1.toml' --set bus.nodes=3\n" in page
