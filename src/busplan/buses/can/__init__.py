"""CAN 2.0 with a CANopen cycle: SYNC, feedback and command PDOs of each node or axis, and other messages."""
