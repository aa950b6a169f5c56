"""Which effect is missing: `diagnosis` puts it together, `extension` adds what it found.

`evidence` is the rule by which an effect is accepted, `equivalence` what no recording can tell apart, `preview` the
quick first ranking, `experiment` the input that tells rivals apart, `structure` the meter of what is unexplained.
"""
