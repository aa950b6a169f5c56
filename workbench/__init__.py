"""The workbench: hold the model against measurements, see where it fails, fit it, find what it lacks.

Its functions are names of the library, `import positioner` (docs/library.md). Its rooms, each on those before it:

    imports        files of other programs made recordings
    data           a recording made ready
    model          the model run through it
    compare        where it fails
    fit            the parameters that explain it
    select         which effect is missing: the library refitted, the rule by which one is added
    discover       the form of an effect that the library lacks
    diagnosis      what is said of it, and the valve with it
    forces         the same where a rig imposes the position, and there is nothing to simulate
    discriminate   rivals told apart by experiments
    blind          recordings with an effect that nobody knows
    report         all of it for a browser
    fleet          many valves at once
    loops          control loops without a stem signal
    bench          an open benchmark of it
    page           all of it in a browser, while it is worked
"""
