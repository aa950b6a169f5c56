"""The daemon's cycle in virtual time, on a device in memory, and how such a run is drawn and compared.

virtual_cycle       the cycle on a simulated device, and a DCS that plays a script
run_picture         position, reference, pressure and state over time
true_parameters     a, b, c, k of a simulated valve, to compare estimates with
"""
