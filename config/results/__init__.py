"""How a result shows itself to a person in a notebook or at a prompt.

Its files:

    result     in a line, a summary, a data frame, and HTML for a notebook
    block      what a summary is made of: sentences and tables
    drawing    what figures share
"""
