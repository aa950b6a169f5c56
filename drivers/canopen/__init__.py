"""The CANopen driver (CiA 301, CiA 408): `canopen_driver` makes what the daemon opens, reads, writes and closes.

`driver` drives a node; `only_watch` reads one that another drives. Both stand on `sdo` (what is asked and set), `pdo`
(the cycle's frames), `watcher` (heartbeats, boot-up, emergencies), `activation` (the device states of CiA 408),
`readings` (what the boundary gets of it) and `node_bus` (the node's frames). `events` names what can happen.
"""
