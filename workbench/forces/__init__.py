"""Where a rig imposes the position there is nothing to simulate: forces are balanced, and the rest diagnosed.

Its files:

    force_balance                           the balance, and its fit
    force_diagnosis, force_diagnosis_json    which effect it lacks; the same as JSON
"""
