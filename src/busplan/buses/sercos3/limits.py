"""What the telegrams and the periods of SERCOS III forbid."""

from functools import reduce
from typing import Final

from busplan.buses.known_period import period_limit
from busplan.buses.network import Network
from busplan.buses.node_time import NODE_LIMIT
from busplan.buses.parts import Limit
from busplan.buses.sercos3.constants import MOST_BYTES, MOST_DEVICES, MOST_TELEGRAMS, PERIODS
from busplan.buses.sercos3.telegrams import SORTS, data_bytes, telegrams_of
from busplan.elementwise import Number, larger


def _most_telegrams(network: Network) -> Number:
    return reduce(larger, (telegrams_of(network, kind).filling.telegrams for kind in SORTS))


def _largest_telegram(network: Network) -> Number:
    return data_bytes(network, network.largest_payload_bytes) + telegrams_of(network, "write").next_bytes


LIMITS: Final = (
    period_limit(PERIODS),
    NODE_LIMIT,
    Limit(
        "nodes",
        "{value:.0f} devices are over the {most:.0f} of a network",
        lambda network: network.nodes,
        lambda _network: MOST_DEVICES,
        way_out=f"a second network has {MOST_DEVICES:g} more",
    ),
    Limit(
        "payload",
        "a device's data make a telegram of {value:.0f} bytes, over {most:.0f}",
        _largest_telegram,
        lambda _network: MOST_BYTES,
        way_out="a smaller payload would do",
        failure="payload_bytes",
    ),
    Limit(
        "telegrams",
        "{value:.0f} telegrams in one direction are over the {most:.0f} of a cycle",
        _most_telegrams,
        lambda _network: MOST_TELEGRAMS,
        way_out="a smaller payload or a second network would do",
    ),
)
