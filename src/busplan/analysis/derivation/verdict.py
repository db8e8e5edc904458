"""How the figures of a verdict come about, which compares the timing models and looks for a change."""

from typing import Final

from busplan.analysis.capacity.figures import capacity
from busplan.analysis.capacity.verdict import Verdict, verdicts
from busplan.analysis.derivation.capacity import capacity_figures
from busplan.analysis.derivation.inputs import traced
from busplan.analysis.derivation.trace import Traced, short
from busplan.analysis.network import bus_of, model_names
from busplan.analysis.planning.cures import changeable, listed
from busplan.sections.profile import Profile

VERDICT_KEYS: Final = ("models_agree", "cheapest_change", "warnings", "text")


def verdict_figure(profile: Profile, key: str, *, model: str) -> Traced:
    """A figure of the verdict, which compares the models."""
    others = (other for other in model_names(profile) if other != model)
    result = capacity(profile, timing_models=(model, *others))
    (verdict,) = verdicts(result)
    derived = {one.timing_model: capacity_figures(profile, model=one.timing_model) for one in result.results}
    fits = tuple(figures["fits"] for figures in derived.values())
    stories = ", ".join(f"{one.timing_model}: {'fits' if one.fits else 'does not fit'}" for one in result.results)
    if key == "models_agree":
        return Traced(
            verdict.models_agree, formula="fits is the same under every timing model", numbers=stories, parts=fits
        )
    if key == "cheapest_change":
        return _change(profile, verdict, fits)
    bus = bus_of(profile)
    safety = () if bus.safety_figure is None else (bus.safety_figure.key,)
    parts = {
        "warnings": safety,
        "text": ("fits", "margin_us", "binding_term", "max_nodes", *safety),
    }[key]
    chosen = tuple(figures[part] for figures in derived.values() for part in parts)
    warned = (*(traced(profile, key) for key in bus.warning_keys), *bus.warning_constants)
    # The sentences are a reporter's; it puts them in the place of this.
    return Traced(None, formula="what is derived above, in words", parts=(*chosen, *warned))


def _change(profile: Profile, verdict: Verdict, fits: tuple[Traced, ...]) -> Traced:
    change = verdict.change
    purpose = "carries more nodes" if verdict.all_well else "makes every model fit on a bus that is set safely"
    words = f"the first of {listed(changeable(profile), 'and')} that {purpose}"
    if change is None:
        return Traced(None, formula=words, numbers="none does", parts=fits)
    settings = ", ".join(f"{key} = {value}" for key, value in change.changes.items())
    after = change.figures
    (now,) = (one for one in verdict.all_figures if one.timing_model == after.timing_model)
    numbers = (
        f"with {settings} the bus carries {after.max_nodes} nodes instead of {now.max_nodes}, and these {after.nodes} "
        f"leave {short(after.margin_us)} us instead of {short(now.margin_us)} us ({after.timing_model} model)"
    )
    return Traced(settings, formula=words, numbers=numbers, parts=fits)
