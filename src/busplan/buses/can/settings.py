"""Settings of a CAN bus that a plan may change without new parts."""

from busplan.buses.can.constants import BASE_BITS, BIT_RATES, DATA_BIT_RATES, MAX_IDENTIFIER
from busplan.buses.can.streams import streams
from busplan.buses.can.traffic import traffic_of
from busplan.buses.network import Network
from busplan.buses.parts import Cost, Setting
from busplan.elementwise import plain


def settings(network: Network) -> tuple[Setting, ...]:
    """PDOs of each axis, a higher bit rate, of CAN FD a higher data bit rate, identifiers of 11 bits.

    Parameters
    ----------
    network
        The network, of plain numbers.
    """
    several = any(nodes.node.axes > 1 for nodes in network.alike)
    is_fd = network.profile.bus.data_bit_rate_kbit_s is not None
    return (
        *((_pdo_per(network),) if several else ()),
        _bit_rate(network),
        *((_data_bit_rate(network),) if is_fd else ()),
        _identifier_bits(network),
    )


def _pdo_per(network: Network) -> Setting:
    """PDOs of each axis, where a node has several: its parameters map them."""
    keys = {nodes.name: f"group.{nodes.name}.pdo_per" if nodes.name else "payload.pdo_per" for nodes in network.alike}
    several = {
        keys[nodes.name]: "axis" for nodes in network.alike if nodes.payload.pdo_per == "node" and nodes.node.axes > 1
    }
    reason = "" if several else "each axis has one already"
    values = (several,) if several else ()
    return Setting("pdo_per", "PDOs of each axis", Cost.REGISTER, tuple(keys.values()), values, reason)


def _bit_rate(network: Network) -> Setting:
    """Higher bit rates, the next higher first: the cable must be short enough."""
    key, bus = "bus.bit_rate_kbit_s", network.profile.bus
    most = BIT_RATES[-1] if bus.data_bit_rate_kbit_s is None else bus.data_bit_rate_kbit_s
    higher = tuple({key: rate} for rate in BIT_RATES if bus.bit_rate_kbit_s < rate <= most)
    return Setting("bit_rate", "bit rate", Cost.SCHEDULE, (key,), higher, "" if higher else "it is the highest")


def _data_bit_rate(network: Network) -> Setting:
    """Higher data bit rates of CAN FD, the next higher first: transceivers and cable must carry it."""
    key = "bus.data_bit_rate_kbit_s"
    higher = tuple({key: rate} for rate in DATA_BIT_RATES if rate > network.profile.bus.data_bit_rate_kbit_s)
    return Setting(
        "data_bit_rate", "data bit rate", Cost.SCHEDULE, (key,), higher, "" if higher else "it is the highest"
    )


def _identifier_bits(network: Network) -> Setting:
    """Identifiers of 11 bits, where all are small enough."""
    key, traffic = "bus.identifier_bits", traffic_of(network)
    empty = Setting("identifier_bits", "length of identifiers", Cost.SCHEDULE, (key,), ())
    if plain(traffic.identifier_bits) == BASE_BITS:
        return empty._replace(reason=f"they have {BASE_BITS} bits")
    each = streams(traffic, is_stuffed=True)
    own = [stream.last for stream in each if stream.identifier_bits == traffic.identifier_bits]
    if not own:
        return empty._replace(reason="no message has the length of the bus")
    if max(own) > MAX_IDENTIFIER[BASE_BITS]:
        return empty._replace(reason=f"some are over {MAX_IDENTIFIER[BASE_BITS]:#x}")
    return empty._replace(values=({key: BASE_BITS},))
