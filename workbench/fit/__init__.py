"""The parameters that explain a record: `fitting` puts it together.

`guesses` and `starts` say where searches begin, `objective` what they lower, `uncertainty` what the record determines.
`fitted_parameter` is a parameter with its interval, and how parameters are shown.
"""
