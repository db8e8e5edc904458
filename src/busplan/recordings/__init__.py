"""Readers of recordings of a machine's bus: captures of Ethernet ports and CAN logs; and their statistics."""
