"""CAN 2.0 and CAN FD with a CANopen cycle: SYNC, feedback and command PDOs of each node or axis, and other messages."""
