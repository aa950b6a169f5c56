"""What a sampled signal shows by itself: numpy alone.

Its files:

    independence    how many of neighbouring samples are independent
    moves           rests, moves and slips of a stem, each move from its onset to its last sample in motion
    noise           the noise of a position and its quantum; readings that stand still
"""
