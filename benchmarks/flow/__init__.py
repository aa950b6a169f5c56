"""Does the positioner stop the oscillation of a flow loop? `python -m benchmarks.flow`.

loop, course, picture       a flow process and the DCS's controller round a cycle; figures; drawn
cases                       the positioners compared
tunings, rival_laws         the same under other tunings, and published compensators
"""
