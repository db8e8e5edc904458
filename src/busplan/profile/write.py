"""A whole profile as TOML text, for a file that is not there yet."""

import tomli_w

from busplan.sections.profile import Profile


def profile_text(profile: Profile) -> str:
    """Write a profile: what it says, and nothing that it leaves to its default.

    Parameters
    ----------
    profile
        Any profile.

    Returns
    -------
    str
        TOML that reads to the same profile. Comments are not part of a profile: to keep those of a file, edit it.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> profile_text(load("paper-4ms").profile).splitlines()[0]
    'schema_version = 1'
    """
    # TOML has no null: a key that is None is a key that is left out.
    data = profile.model_dump(exclude_unset=True, exclude_none=True)
    return tomli_w.dumps(data, multiline_strings=True)
