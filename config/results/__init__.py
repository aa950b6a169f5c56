"""How a result shows itself to a person: `result` in a line, a summary, a data frame, and HTML for a notebook.

`block` is what a summary is made of, sentences and tables; `drawing` what figures share.
"""
