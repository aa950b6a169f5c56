"""The laws: each a folder of its name, behind one boundary, found by that name (`[control] law`).

A law is shown each sample and answers with a pressure. It neither knows the controller nor the other laws: states,
limits, faults and the identification are the controller's and hold for every law. Adding one touches no other file.

    boundary        what every law does: begin, observe, command; what is held, what is learnt; the law of a name
    seed            the paper's: the pressure that balances spring and friction at the reference
    slides          none, one or two slides that land: the default
    conventional    PI on position, to compare the others with
"""
