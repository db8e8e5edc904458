"""SERCOS III: master data and device telegrams on Ethernet at 100 Mbit/s, and the channel for other frames."""
