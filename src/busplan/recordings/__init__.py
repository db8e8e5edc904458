"""Readers of what a machine's bus recorded: captures of Ethernet ports, and logs of CAN; and their statistics."""
