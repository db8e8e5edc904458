"""What [limits] asks a plan to keep free: a share of the slice, and room for more nodes and axes."""

from math import ceil
from typing import NamedTuple

from busplan.analysis.capacity import CapacityFigures
from busplan.profile.model import Profile


class Room(NamedTuple):
    """What a profile asks for beyond fitting.

    Parameters
    ----------
    nodes
        Nodes that the period must carry [1].
    utilisation
        Largest share of the slice that its own nodes may use, 0..1 [1].
    """

    nodes: int
    utilisation: float

    def is_kept(self, figures: CapacityFigures) -> bool:
        """Tell whether a capacity leaves that room.

        Parameters
        ----------
        figures
            Of the profile, under the timing model that decides.
        """
        return figures.max_nodes >= self.nodes and figures.utilisation <= self.utilisation


def asked_room(profile: Profile) -> Room:
    """Give the room that a profile's [limits] ask for; none, where they ask for nothing.

    Parameters
    ----------
    profile
        The network.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> from busplan.profile.toml import override
    >>> asked_room(override(load("paper-1ms").profile, {"limits.min_spare_axes": 5}))
    Room(nodes=4, utilisation=1.0)
    """
    limits, nodes, axes = profile.limits, profile.bus.nodes, profile.node.axes
    by_axes = ceil((nodes * axes + (limits.min_spare_axes or 0)) / axes)
    share = 1.0 if limits.max_utilisation is None else limits.max_utilisation
    return Room(max(nodes + (limits.min_spare_nodes or 0), by_axes) if _asks_nodes(profile) else 0, share)


def _asks_nodes(profile: Profile) -> bool:
    return profile.limits.min_spare_nodes is not None or profile.limits.min_spare_axes is not None
