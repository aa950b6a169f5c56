"""The seed's paper reproduced: its scenario, formulas as printed and corrected, claims. `python -m benchmarks.paper`.

scenario                        the run of its section 5, on the simulated valve with a noise of one's choice
formulas, findings              its formulas on such a run, and what that shows of its claims
seed_figures                    its figures 3 to 7
noise_table                     estimators against the Cramér-Rao bound, under white noise
"""
