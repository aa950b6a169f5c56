"""Where the model fails.

Its files:

    comparison, comparison_sentences    all of it put together; the same in words
    phases, slip_matching               what the stem does when; which of its slips the model makes
    residuals                           what the error hangs together with
    friction_balance                    friction from the balance of forces
    measures                            figures of an error
"""
