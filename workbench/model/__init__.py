"""The model held against a record: `free_run` simulates it whole, `parameters` are its coordinates in a fit."""
