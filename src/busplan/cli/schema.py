"""`busplan schema`."""

from busplan.cli.output import emit_document


def schema_command() -> None:
    """Print the JSON Schema of profiles (draft 2020-12), with every description and unit.

    With this file beside a profile, editors that read `#:schema ./busplan.schema.json` at its top complete and check
    it. Exits 0.

    Example: busplan schema > busplan.schema.json
    """
    from busplan.printable import to_json
    from busplan.profile.kinds import profile_schema

    emit_document(to_json(profile_schema()))
