"""The parameters that explain a record: `fitting` puts it together.

`guesses` and `starts` say where searches begin, `objective` what they lower, `uncertainty` what the record determines.
"""
