"""The workbench in a browser: open a recording, see where the model fails, drag, diagnose, add what is missing.

Its files; those up to `search` know no browser:

    command                         `positioner workbench`
    desk                            what lies on the desk of one tab
    provenance                      how each valve on it came to be
    command_lines, notebook         what does the same on a command line; and as a notebook
    recording_opening               from a file to a recording
    live_model                      the model run anew while a parameter moves
    time_figure, force_figures      what is drawn
    background, search              long work in a process of its own; what it has told so far
    page                            the page of one tab
    open_panel                      where a recording and a valve come onto the desk
    columns_panel, export_figure    which column of an export is which; what it would look like, read so
    explained_words                 words that say what they mean where they stand
    compare_panel, findings_panel   measured and simulated; what `compare` says, and where it shows
    sliders                         the parameters
    effect_panel                    an effect of one's own
    search_panel, journal_panel     which effect is missing; what was added, and what is taken home
"""
