"""The daemon's cycle in virtual time, on a device in memory; how runs are drawn and compared.

It knows no simulator: whoever starts it hands it a device.

    virtual_cycle       the cycle on a device in memory, and a DCS that plays a script
    run_picture         position, reference, pressure and state over time
    true_parameters     a, b, c, k of a valve file, to compare estimates with
"""
