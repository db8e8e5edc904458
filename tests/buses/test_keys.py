"""Facts about keys belong to keys that profiles of the kind have."""

import pytest
from pydantic import BaseModel

from busplan.buses import kind_named, kind_names
from busplan.profile.kinds import models_of


def has(models: list[type[BaseModel]], key: str) -> bool:
    name, _, rest = key.partition(".")
    fields = [model.model_fields[name] for model in models if name in model.model_fields]
    return bool(fields) and (not rest or has([inner for one in fields for inner in models_of(one.annotation)], rest))


@pytest.mark.parametrize("kind", kind_names())
def test_every_key_is_one_of_the_profile(kind: str) -> None:
    bus = kind_named(kind)
    assert [key for key in bus.keys if not has([bus.profile_model()], key)] == []
    roles = [key.role for key in bus.keys.values() if key.role]
    assert len(roles) == len(set(roles))
