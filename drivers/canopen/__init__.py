"""The CANopen driver (CiA 301, CiA 408): `canopen_driver` makes what the daemon opens, reads, writes and closes.

    driver, only_watch    drives a node; reads one that another drives
    sdo, pdo              what is asked and set; the cycle's frames
    wanted_settings       what a node must be told, and what of it it will refuse
    found_pdos            PDOs used as the node has them
    watcher, events       heartbeats, boot-up, emergencies; what can happen
    activation            the device states of CiA 408
    node_bus              the node's frames

Both drivers stand on all the others.
"""
