"""Recordings with an effect that nobody knows.

Its files:

    hiding          draws a valve, its hidden effect and the recordings
    input_signal    the command that makes a sticking valve show what it is
    trial           the valve's answer to it, clean or with disturbances
    sealing         the folder with the sealed answer
"""
