"""Published numbers of drives beside those that the telegrams carry."""

from collections.abc import Mapping
from typing import Any, Final

from busplan.buses.network import Network
from busplan.buses.published import Comparison, EvidenceSection
from busplan.buses.sercos3.cycle import TELEGRAMS, Sercos3Cycle
from busplan.buses.sercos3.equations import DEFAULT_GAP_BYTES, LEAST_GAP_BYTES, MOST_DEVICES, MOST_TELEGRAMS
from busplan.elementwise import plain

_GAPS: Final = (int(LEAST_GAP_BYTES), int(DEFAULT_GAP_BYTES))


def performance(base: Network, published: Mapping[str, Any]) -> "tuple[EvidenceSection, ...]":
    """Compare the published table with the layout, by the least and by the default gap.

    Parameters
    ----------
    base
        A network of SERCOS III.
    published
        The published figures.
    """
    given = published["performance"]
    title = "SERCOS III: drives of a network"
    rows = zip(given["data_bytes"], given["period_us"], given["drives"], strict=True)
    return (
        EvidenceSection(
            title,
            f"{given['source']}. It names no gap and no layout: ours are the telegrams of V1.0 alone, with the "
            f"least gap and with the default of {DEFAULT_GAP_BYTES:g} bytes. Of 16 bytes four telegrams hold no more, "
            "whatever the gap.",
            tuple(
                Comparison(
                    title,
                    f"drives, {size} bytes at {period_us:g} us",
                    "1",
                    drives,
                    f"telegrams, gap {gap}",
                    most_drives(base, size, period_us=period_us, gap_bytes=gap),
                    given["grade"],
                )
                for size, period_us, drives in rows
                for gap in _GAPS
            ),
            "sercos3",
        ),
    )


def most_drives(base: Network, size_bytes: int, *, period_us: float, gap_bytes: int) -> int:
    """Most drives whose telegrams fit a period, by V1.0 and with one hot-plug field.

    Parameters
    ----------
    base
        A network of SERCOS III.
    size_bytes
        Cyclic data of a drive, in either direction [bytes].
    period_us
        Communication period [us].
    gap_bytes
        Gap between two telegrams [bytes].
    """
    changes = {"version": "V1.0", "hot_plug_field": "first", "gap_bytes": gap_bytes}
    bus = base.profile.bus.model_copy(update=changes)
    (group,) = base.groups

    def fits(drives: int) -> bool:
        one = group._replace(nodes=drives, read_bytes=size_bytes, write_bytes=size_bytes)
        profile = base.profile.model_copy(update={"bus": bus})
        cycle = Sercos3Cycle(base._replace(profile=profile, groups=(one,), nonperiodic_us=0.0), TELEGRAMS)
        telegrams = max(plain(filling.telegrams) for filling in cycle.fillings.values())
        return telegrams <= MOST_TELEGRAMS and plain(cycle.required_us) <= period_us

    return next((drives - 1 for drives in range(1, int(MOST_DEVICES) + 1) if not fits(drives)), int(MOST_DEVICES))
