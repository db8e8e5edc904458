"""What the ring, the telegrams and the periods of SERCOS I and II forbid."""

from typing import Final

from busplan.buses.known_period import period_limit
from busplan.buses.node_time import NODE_LIMIT
from busplan.buses.parts import Limit
from busplan.buses.sercos2.constants import MOST_DRIVES, MOST_MDT_BYTES, PERIODS
from busplan.buses.sercos2.cycle import NONE, Sercos2Cycle

LIMITS: Final = (
    period_limit(PERIODS),
    NODE_LIMIT,
    Limit(
        "nodes",
        "{value:.0f} drives are over the {most:.0f} of a ring",
        lambda network: network.nodes,
        lambda _network: MOST_DRIVES,
        way_out=f"a second ring has {MOST_DRIVES:g} more",
    ),
    Limit(
        "payload",
        "the MDT has {value:.0f} bytes of data, over {most:.0f}",
        lambda network: Sercos2Cycle(network, NONE).mdt_bytes,
        lambda _network: MOST_MDT_BYTES,
        way_out="a smaller payload or a second ring would do",
        failure="payload_bytes",
    ),
)
