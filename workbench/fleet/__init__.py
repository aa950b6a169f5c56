"""Many valves at once: which of them deserves an engineer's day, from their recordings.

A valve's recordings are looked at in the order of their times, each against the valve's last model. Most end at the
first look, some at a refit; only what neither explains is diagnosed.

Its files:

    fleet               puts it together: the ranked valves
    manifest            which recording is of which valve, and of when
    examination         one recording held against one model: looked at, refitted, diagnosed
    valve_complaints    a valve's recordings in turn, its models over time, what it complains of, its rank
    engine              examinations on many processors, by Dask
    model_changes       what changed of the valves since a time
    tables              results for other programs, as Parquet
    fleet_report        the ranking as a page
    drill_down          the diagnosis reports behind it
"""
