"""SERCOS: the ring of I and II, whose drives answer in turn, and that of III, on Ethernet."""
