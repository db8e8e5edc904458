"""Findings of rules, and the profile that rules check."""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

from busplan.analysis.capacity.cycle import available_us, cycle_of, fits_in
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.network import bus_of, model_names, network_of
from busplan.analysis.planning.cures import Change, change_for_room, change_to_fit, changeable, listed
from busplan.buses.rule import Severity
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.toml import LoadedProfile, override


class Finding(NamedTuple):
    """One finding at its place; lines and columns count from 1."""

    code: str
    rule: str
    severity: Severity
    message: str
    key: str
    line: int
    column: int


class Subject:
    """A profile with the figures that rules need, each computed once, at first use."""

    def __init__(self, loaded: LoadedProfile, changes: KeyChanges = NO_CHANGES) -> None:
        self.profile = loaded.profile
        self.document = loaded.document
        self.origin = f" (with {changes.words})" if changes.words else ""
        """End of the messages: the changes, which the document does not show."""

    @cached_property
    def deciding(self) -> CapacityFigures:
        """Capacity under the timing model that decides."""
        return figures(self.profile, model=bus_of(self.profile).deciding_model)

    @cached_property
    def others(self) -> tuple[CapacityFigures, ...]:
        """Capacity under the other timing models."""
        return tuple(figures(self.profile, model=model) for model in self._other_models)

    @property
    def others_fit(self) -> tuple[tuple[str, bool], ...]:
        """The other timing models, each with whether the cycle fits, which takes no figures to tell."""
        given_us = available_us(network_of(self.profile))
        return tuple(
            (model, bool(fits_in(cycle_of(self.profile, model=model).required_us, available_us=given_us)))
            for model in self._other_models
        )

    @property
    def _other_models(self) -> tuple[str, ...]:
        deciding = bus_of(self.profile).deciding_model
        return tuple(model for model in model_names(self.profile) if model != deciding)

    def after(self, changes: Mapping[str, object]) -> CapacityFigures:
        """Capacity under the timing model that decides, with new values by dotted key."""
        return figures(override(self.profile, dict(changes)), model=self.deciding.timing_model)

    def cure(self) -> str:
        """The cheapest change after which the profile is shown to fit, in words."""
        return self._words(change_to_fit(self.profile))

    def room(self, nodes: int, *, utilisation: float = 1.0) -> str:
        """The cheapest change that makes room for some nodes, in words."""
        return self._words(change_for_room(self.profile, nodes=nodes, utilisation=utilisation))

    def _words(self, change: Change | None) -> str:
        if change is None:
            return f"no change of {listed(changeable(self.profile, structure=False), 'or')} alone is a cure"
        return "cheapest cure: " + ", ".join(f"{key} = {value}" for key, value in change.changes.items())
