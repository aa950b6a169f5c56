"""What somebody does about an alarm, by its cause."""

from config.codes import Ne107Cause

ADVICE = {
    Ne107Cause.FAULT: "Look at the fault in force. Remove its cause, acknowledge it, and choose the mode anew.",
    Ne107Cause.DCS_SILENT: "Look at the connection to the DCS and at its heartbeat.",
    Ne107Cause.BEYOND_LIMITS: "Look at the air supply and at [pressure]: the law needs more than it may command.",
    Ne107Cause.STUCK: "Free the stem. Look at the packing and at what may jam the plug.",
    Ne107Cause.FRICTION_HIGH: "Loosen or replace the packing at the next chance. Then set the baseline anew.",
    Ne107Cause.FRICTION_LOW: "Look for a leak at the stem. Tighten or replace the packing, then set the baseline anew.",
    Ne107Cause.STICTION: "Identify the valve. If the stem still misses moves, look at packing and air supply.",
    Ne107Cause.TRAVEL: "Plan the overhaul that the travel limit stands for. Then reset the counts.",
    Ne107Cause.REVERSALS: "Plan the overhaul that the limit stands for, and look whether the loop hunts.",
    Ne107Cause.TRAVEL_DEVIATION: "Compare reference and position. Look at air supply, stops and friction.",
    Ne107Cause.FROZEN_SENSOR: "Look at the position sensor and its linkage. Keep the valve out of automatic till then.",
    Ne107Cause.POSITION_RATE: "Look at the position sensor, its cable and its earth.",
    Ne107Cause.SATURATED: "Look at the air supply, at the zero, and for a leak between positioner and actuator.",
    Ne107Cause.OVERRUN: "Give the gateway less to do, or the loop a longer period.",
    Ne107Cause.COMMAND_RATE: "Look at who commands: an operator by hand, or a loop that is tuned too fast.",
    Ne107Cause.NOT_AT_REST: "Look whether something moves the stem: flow forces, a loose linkage, a leak.",
    Ne107Cause.PRESSURE_ELSEWHERE: "Look at the air supply, the filter, and for a leak at the actuator.",
    Ne107Cause.ONE_DIRECTION: "Have it move both ways, or identify it by a staircase of slides.",
    Ne107Cause.HIGH_HIGH: "The valve is nearly open all the way. Is it too small for the process?",
    Ne107Cause.HIGH: "The valve is far open. Look at what the process asks for.",
    Ne107Cause.LOW: "The valve is nearly shut. Look at what the process asks for.",
    Ne107Cause.LOW_LOW: "The valve is as good as shut, where a jet cuts the seat. Use a cut-off or a smaller trim.",
    Ne107Cause.TEST_OVERDUE: "Test the valve: a partial stroke, a step test or a signature.",
    Ne107Cause.MODEL_CHANGED: "Compare with the record of commissioning: spring, bench range, diaphragm, linkage.",
}
"""Of each cause that is an alarm; what the valve does on purpose (hold, manual, excited) is none."""
