"""What is published of SERCOS I and II: no figure that tests a schedule, and a gap that would make one true."""

from collections.abc import Mapping
from typing import Any

from busplan.buses.network import Network
from busplan.buses.published import Comparison, EvidenceSection
from busplan.buses.sercos2.cycle import WORST, Sercos2Cycle
from busplan.elementwise import plain


def axes_of_a_ring(
    base: Network, published: Mapping[str, Any], paper: Mapping[str, Any]
) -> "tuple[EvidenceSection, ...]":
    """Say which gap between two drives would make the published number of axes fit, at each data rate.

    Parameters
    ----------
    base
        A network of SERCOS I or II.
    published, paper
        The published figures.
    """
    given, contour = published["axes"], paper["sercos"]
    title = "SERCOS I and II: axes of a ring"
    gaps = {rate: _gap_us(base, given, rate) for rate in given["data_rates_mbit_s"]}
    return (
        EvidenceSection(
            title,
            f"{given['source']}: {given['drives']} axes every {given['period_us']:g} us, with no rate and no gap. Ours "
            f"is the gap between two drives that would leave no more room, with {given['data_bytes']} bytes each way "
            "(assumed), at the rates that leave any. The paper has a mean contour error alone, "
            f"{contour['mean_contour_error_mm']} mm ({contour['source']}), and no cycle time: it validates no "
            "schedule.",
            tuple(
                Comparison(title, f"gap at {rate} Mbit/s", "us", None, WORST, gap_us, "derived")
                for rate, gap_us in gaps.items()
                if gap_us >= 0
            ),
            "sercos2",
        ),
    )


def _gap_us(base: Network, given: Mapping[str, Any], rate_mbit_s: int) -> float:
    """The gap with which the drives fill the period; negative where they do not fit [us]."""
    changes = {"data_rate_mbit_s": rate_mbit_s, "at_gap_us": 0.0, "at_start_us": None}
    profile = base.profile.model_copy(update={"bus": base.profile.bus.model_copy(update=changes)})
    (group,) = base.groups
    size, drives = given["data_bytes"], given["drives"]
    ring = base._replace(
        profile=profile, groups=(group._replace(nodes=drives, read_bytes=size, write_bytes=size),), nonperiodic_us=0.0
    )
    left_us: float = given["period_us"] - plain(Sercos2Cycle(ring, WORST).required_us)
    gap_us: float = left_us / (drives - 1)
    return gap_us
