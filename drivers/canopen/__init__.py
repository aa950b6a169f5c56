"""The CANopen driver: `driver` is what the daemon opens, reads and writes."""
