"""The parameters that explain a record.

Its files:

    fitting            puts it together
    starts, guesses    where searches begin; what the positions suggest
    objective          what they lower, and how
    fitted_parameter   a parameter with its interval, and how it is shown
    uncertainty        what the record determines
"""
