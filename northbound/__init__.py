"""What reads a running daemon as its client, and writes within the rights of a role. The daemon knows none of it.

    observer                     a running daemon over Modbus alone: polled, kept for minutes, never stale
    operator_page                running valves in a browser
    metrics                      running valves for Prometheus
    opcua                        running valves for OPC UA clients
    client_configurations        the register map as configurations of programs that read it
    served_valves                the valves of daemons' files, and by which certificates they are read

A room that has a command brings it: `command.py`, found by its entry point in the group `positioner.commands`.
"""
