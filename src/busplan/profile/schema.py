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
        The schema; `bus.kind` selects that of a kind of bus.

    Examples
    --------
    >>> profile_schema()["properties"]["bus"]["properties"]["kind"]["enum"][:2]
    ['ieee1394', 'can']
    """
    kinds = {kind: profile_model(kind) for kind in kind_names()}
    references, definitions = models_json_schema([(model, "validation") for model in kinds.values()])
    # With conditions, validators name the wrong key; with a union, they would say that no member matches.
    chosen = [
        {"if": _has_kind({"const": kind}), "then": references[model, "validation"]} for kind, model in kinds.items()
    ]
    known = _has_kind({"description": "Kind of bus", "enum": list(kinds)}, description="The bus")
    return {"$schema": _DIALECT, "type": "object", **known, "allOf": chosen, **definitions}


def _has_kind(allowed: dict[str, Any], **more: str) -> dict[str, Any]:
    bus = {**more, "type": "object", "properties": {"kind": allowed}, "required": ["kind"]}
    return {"properties": {"bus": bus}, "required": ["bus"]}
