"""Findings of rules, and the profile that rules check."""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

from busplan.analysis.capacity.cycle import available_us, cycle_of, fits_in
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.network import model_names, network_of
from busplan.analysis.planning.cures import Change, change_for_room, change_to_fit, changeable, listed
from busplan.buses.rule import Severity
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

    def __init__(self, loaded: LoadedProfile) -> None:
        self.profile = loaded.profile
        self.document = loaded.document

    @cached_property
    def deciding(self) -> CapacityFigures:
        """Capacity under the timing model that decides."""
        return figures(self.profile, model=self.profile.bus.timing_model)

    @cached_property
    def others(self) -> tuple[CapacityFigures, ...]:
        """Capacity under the other timing models."""
        return tuple(figures(self.profile, model=model) for model in self._other_models)

    @property
    def others_overrun(self) -> bool:
        """Whether the cycle does not fit under another timing model; cheaper than `others`."""
        given_us = available_us(network_of(self.profile))
        return any(
            not fits_in(cycle_of(self.profile, model=model).required_us, available_us=given_us)
            for model in self._other_models
        )

    @property
    def _other_models(self) -> tuple[str, ...]:
        return tuple(model for model in model_names(self.profile) if model != self.profile.bus.timing_model)

    def after(self, changes: Mapping[str, object]) -> CapacityFigures:
        """Capacity under the timing model that decides, with new values by dotted key."""
        return figures(override(self.profile, dict(changes)), model=self.deciding.timing_model)

    def cure(self, *models: str) -> str:
        """The cheapest change after which these timing models fit, in words."""
        return self._words(change_to_fit(self.profile, models=models))

    def room(self, nodes: int, *, utilisation: float = 1.0) -> str:
        """The cheapest change that makes room for some nodes under the model that decides, in words."""
        model = self.deciding.timing_model
        return self._words(change_for_room(self.profile, model=model, nodes=nodes, utilisation=utilisation))

    def _words(self, change: Change | None) -> str:
        if change is None:
            return f"no change of {listed(changeable(self.profile, structure=False), 'or')} alone is a cure"
        return "cheapest cure: " + ", ".join(f"{key} = {value}" for key, value in change.changes.items())
