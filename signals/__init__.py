"""What a sampled signal shows by itself: numpy alone.

Its files:

    moves    rests and moves of a stem, each move from its onset to its last sample in motion
"""
