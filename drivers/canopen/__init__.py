"""The CANopen driver (CiA 301, CiA 408): `canopen_driver` makes what the daemon opens, reads, writes and closes.

    driver                drives a node
    watching_driver       reads a node that another drives
    sdo, pdo              what is asked and set; the cycle's frames
    node_configuration    what a node must be told, and what of it it will refuse
    pdo_mapping           PDOs used as the node has them
    watcher, events       heartbeats, boot-up, emergencies; what can happen
    device_states         the device states of CiA 408
    node_bus              the node's frames

Both drivers stand on all the others.
"""
