"""What can happen to a node or its bus. Every reason of an error and every log line begins with one of these."""

from enum import StrEnum


class NodeEvent(StrEnum):
    """The events by name, as people read them."""

    NO_NODE = "no node answers"
    WRONG_EDS = "wrong EDS"
    NODE_ID_TAKEN = "node id taken"
    BUS_OFF = "bus off"
    SYNC_LOST = "SYNC not answered"
    HEARTBEAT_LOST = "heartbeat lost"
    PDO_TOO_SHORT = "PDO too short"
    SDO_ABORT = "SDO abort"
    SDO_TIMEOUT = "SDO not answered"
    NODE_RESTARTED = "node restarted"
    NOT_OPERATIONAL = "node not OPERATIONAL"
    NOT_ACTIVE = "node not ACTIVE"
    ACTIVE = "node ACTIVE"
    EMERGENCY = "emergency"
    COMMAND_REFUSED = "command refused"
