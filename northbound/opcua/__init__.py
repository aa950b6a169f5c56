"""Running valves for OPC UA clients: read over Modbus as any observer does, written within the rights of a role.

A process of its own (`positioner opcua`): no client ever touches a cycle's thread. `docs/opcua.md` has the nodes.

    command                         `positioner opcua`
    device_health                   NE 107 in the numbers of DI's DeviceHealth, which are others than ours
    valve_nodes                     what a valve's nodes are, and what each shows of its registers
    address_space                   the nodes, made by the types of PA-DIM; nodesets/ has those of the OPC Foundation
    valve_desk                      what clients write and call, within the rights of their roles
    guarded_session                 sessions: encrypted, of a trusted application, of a user with a password
    application_keys                this server's certificate, and those of the clients that it trusts
    told_events                     what has happened since the last look, for those who subscribe
    recorded_history                the daemon's history, for those who ask what was
    valve_server                    all of it on a port
"""
