"""Which effect is missing: `diagnosis` puts it together, `extension` adds what it found.

`effect_search` refits the library step by step, `effect_candidates` judges a step, `forward_selection` is what it
shares with the balance of forces, `candidate_table` how what was tried is shown; `effect_acceptance` is the rule by
which an effect is accepted, `block_errors` its statistics, `verdict` and `verdict_sentence` what follows. `equivalence`
is what no recording can tell apart, `tangent_preview` the quick first ranking, `experiment` the input that tells rivals
apart, `residual_structure` the meter of what is unexplained.
"""
