"""An open benchmark: cases with truth, methods that answer, and one results file that anybody's method may write.

    cases          drawn loops, hidden effects and labelled loops, written into a folder with their truth
    drawn_loops    control loops drawn at random, by equations that are not the product's
    methods        what ours and the literature's say of a case
    scores         the results file, and how good each method is

`positioner bench` runs it.
"""
