"""CANopen, both ends: the `objects` of our device, its data sheet `eds`, and `loopback`, a bus for one machine."""
