"""The parameters that explain a record.

Its files:

    fitting             puts it together
    fit_thresholds      every number by which it decides something
    fit_problem         a record to be explained, made once
    likelihood          where the stem is, told when it moves, and what it takes to break it loose
    minimiser           lowers its cost
    ends                whether other onsets or places lead lower from where it ends
    onsets              when each move begins, as suits a valve best
    starts, guesses     where searches begin; what the positions suggest
    fit_result          what it comes to
    uncertainty         what the record determines
    parameter_estimate  a parameter with its interval, and how it is shown
    threads             searches side by side
    breaking_off        how all of them end early
"""
