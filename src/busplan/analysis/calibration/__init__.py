"""From measured latencies to the execution time of a node."""
