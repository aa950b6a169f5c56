"""Landings: what a valve says of itself where a slide of its stem ends in rest, at any period of the loop.

    p = κ x + φ_up    after a slide upward            κ = k_s/A      φ_up   = (F_c,up + F_0)/A
    p = κ x - φ_down  after a slide downward                         φ_down = (F_c,down - F_0)/A

Neither mass nor viscous friction, lag nor sampling stands in it, and a preload F_0 is no error but a parameter.

    stem_at_rest                      does the stem rest, and where; how far short a slow pressure may leave it
    landing_detector                  which rests are landings, sample by sample
    seen_time                         the time for which the stem was seen: an outage is learnt from by nobody
    pressure_delivered                is the pressure measured at a rest the one commanded
    static_law, local_balance         κ, φ_up, φ_down with their deviations; the pressure that lands at a position
    breakaway_distance                how far a slide must be sent to break the stem loose
    extended_balance                  is an extended valve the one that is there
    overshoot                         how far past its balance a stem swings and sticks there
    packing_compliance                how far the packing of a stuck stem gives way
    change_point                      the instant that parts landings best
    landing_shift                     was the sensor shifted while landings were gathered
    static_identification             all of it, sample by sample, and what it says of other estimates
    recording_landings                the same from a whole recording
"""
