"""The workbench in a browser: open a recording, see where the model fails, drag, diagnose, add what is missing.

Its files:

    page    the page of one tab
"""
