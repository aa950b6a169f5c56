"""The daemon's cycle in virtual time, on a device in memory; what stands round it; how runs are drawn and compared.

It knows no simulator: whoever starts it hands it a device.

    virtual_cycle       the cycle on a device in memory, and a DCS that plays a script
    flow_loop           a flow process round the valve, and the DCS's PI controller
    flow_course         the cycle in that loop, and figures of how the flow does
    flow_picture        flow and stem of several such courses
    run_picture         position, reference, pressure and state over time
    true_parameters     a, b, c, k of a valve file, to compare estimates with
"""
