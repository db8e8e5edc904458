"""The profile's JSON Schema."""

from typing import Any, Final

from pydantic.json_schema import models_json_schema

from busplan.buses import kind_names
from busplan.profile.kinds import profile_model

_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def profile_schema() -> dict[str, Any]:
    """Return the JSON Schema of a profile, draft 2020-12, made by pydantic.

    Returns
    -------
    dict
        The schema. With several kinds of bus, `bus.kind` selects one.

    Examples
    --------
    >>> profile_schema()["required"][:2]
    ['schema_version', 'name']
    """
    kinds = {kind: profile_model(kind) for kind in kind_names()}
    if len(kinds) == 1:
        (model,) = kinds.values()
        return {"$schema": _DIALECT, **model.model_json_schema(mode="validation")}
    references, definitions = models_json_schema([(model, "validation") for model in kinds.values()])
    # With conditions, validators name the wrong key; with a union, they would say that no member matches.
    chosen = [
        {"if": _has_kind({"const": kind}), "then": references[model, "validation"]} for kind, model in kinds.items()
    ]
    return {"$schema": _DIALECT, "type": "object", **_has_kind({"enum": list(kinds)}), "allOf": chosen, **definitions}


def _has_kind(allowed: dict[str, Any]) -> dict[str, Any]:
    bus = {"type": "object", "properties": {"kind": allowed}, "required": ["kind"]}
    return {"properties": {"bus": bus}, "required": ["bus"]}
