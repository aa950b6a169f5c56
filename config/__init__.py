"""The ground floor: what people write and what the wire carries, declared once.

Schemas of every file a person writes (valve, simulated slave, daemon), the shipped profiles, the map of the
device, the register table of the supervisory server, and the recording format. Imports nobody.
"""
