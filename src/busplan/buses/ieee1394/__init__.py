"""IEEE 1394 (FireWire) up to S400: the bus of the paper."""
