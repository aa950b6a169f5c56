"""Where the model fails: `comparison` puts it together, `comparison_sentences` say it in words.

`phases` are what the stem does, `slip_matching` which of its slips the model makes, `residuals` what the error hangs
on, `friction_balance` friction from the forces, `measures` figures of an error.
"""
