"""Rivals told apart by experiments on the valve.

Its files:

    discrimination                                one experiment after another, until one rival is left
    rivals_by_pressure                            the rivals by the measured pressure, where there is one
    experiment_design                             the input that tells rivals apart, designed
    rival_odds                                    the rivals weighed against each other in all recordings so far
"""
