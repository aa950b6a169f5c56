"""What lies between the DCS's reference and the law's: which opening a signal asks for, and how the stem is sent there.

    signal -> split range -> characteristic -> opening        by the signal alone, and back: `signal_path`
    opening -> low-pass -> ramp -> cut-offs -> the law        in time: `course`, `cutoffs`

Its files:

    signal_path                                 from the signal to the opening, and back
    split_range                                 the part of the signal that is this valve's
    characteristic                              which of the four a file asks for
    linear, equal_percentage, quick_opening     each an equation and its inverse
    polygon                                     the same through points that a person gives
    course                                      both of what follows, without a bump
    low_pass, ramp                              of the opening asked for
    cutoffs                                     beside a stop: the stem is pressed onto it
    dead_band                                   the error at rest that is left alone
"""
