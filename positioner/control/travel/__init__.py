"""What lies between the DCS's reference and the law's: which opening a signal asks for, and how the stem is sent there.

    signal -> split range -> characteristic -> opening        by the signal alone, and back: `signal_path`
    opening -> low-pass -> ramp -> cut-offs -> the law        in time: `reference_ramp`, `cutoffs`

Its files:

    signal_path     from the signal to the opening, and back: split range and the four characteristics
    reference_ramp  from the reference in force to the one asked for, low-pass and ramp, without a bump
    cutoffs         beside a stop: the stem is pressed onto it
    dead_band       the error at rest that is left alone
"""
