"""What the figures of a verdict rest on, which compares the timing models and looks for a change."""

from typing import Final

from busplan.analysis.capacity.figures import capacity
from busplan.analysis.capacity.verdict import verdicts
from busplan.analysis.derivation.capacity import capacity_figures
from busplan.analysis.derivation.inputs import traced
from busplan.analysis.derivation.trace import Traced, found
from busplan.analysis.network import bus_of, model_names
from busplan.analysis.planning.cures import changeable, listed
from busplan.sections.profile import Profile

_SENTENCES: Final = "sentences on what the command computes"
VERDICT_KEYS: Final = ("models_agree", "cheapest_change", "warnings", "text")


def verdict_figure(profile: Profile, key: str, *, model: str) -> Traced:
    """A figure of the verdict, which compares the models."""
    others = (other for other in model_names(profile) if other != model)
    (verdict,) = verdicts(capacity(profile, timing_models=(model, *others)))
    bus, derived = bus_of(profile), [capacity_figures(profile, model=name) for name in model_names(profile)]
    fits = tuple(figures["fits"] for figures in derived)
    safe = () if bus.safety_figure is None else tuple(figures[bus.safety_figure.key] for figures in derived)
    if key == "models_agree":
        return found(verdict.models_agree, "a comparison: fits is the same under every timing model", fits)
    # The document's change and sentences are a reporter's; it puts them in the place of these.
    if key == "cheapest_change":
        purpose = "carries more nodes" if verdict.all_well else "makes every model fit on a bus that is set safely"
        words = f"a search: the first of {listed(changeable(profile), 'and')} that {purpose}"
        return found(None, words, (*fits, *safe))
    warned = (*(traced(profile, key) for key in bus.warning_keys), *bus.warning_constants)
    return found(None, _SENTENCES, (*safe, *warned) if key == "warnings" else (*fits, *safe, *warned))
