"""Where the model fails: `comparison` of `phases`, `residuals` and `measures`; `sentences` say it in words."""
