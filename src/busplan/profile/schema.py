"""The profile's JSON Schema."""

from typing import Any, Final

from busplan.profile.model import Profile

_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def profile_schema() -> dict[str, Any]:
    """Give the JSON Schema of a profile, draft 2020-12, as pydantic derives it.

    Returns
    -------
    dict
        The schema, its dialect named first.

    Examples
    --------
    >>> profile_schema()["required"][:2]
    ['schema_version', 'name']
    """
    return {"$schema": _DIALECT, **Profile.model_json_schema(mode="validation")}
