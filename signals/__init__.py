"""What a sampled signal shows by itself: numpy alone.

Its files:

    independence    how many of neighbouring samples are independent
    moves           rests and moves of a stem, each move from its onset to its last sample in motion
"""
