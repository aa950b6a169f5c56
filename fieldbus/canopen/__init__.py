"""CANopen, both ends.

Its files:

    objects      what our device's words mean, and how one sample is put into PDOs
    emergencies  what the error codes of a node's emergencies mean
    eds          its electronic data sheet, written and read
    loopback     a CAN bus between processes of one machine
    python_can   python-can, and nothing that it would load for log files
"""
