"""The model held against a record.

Its files:

    free_run      simulates it whole, on the command alone
    parameters    the coordinates of a fit
"""
