"""Running valves in a browser: live values and trends of daemons, in words; commands within the rights of a role.

A process of its own that reads daemons as any Modbus client does. What it says comes from `northbound.observer`, and so
does what counts as live: a page that shows a value that is not of now greys it and says why.

Its files:

    command                 `positioner page`
    page                    the page of one tab: all valves, or one in full
    overview, valve_panel   a card a valve; all of one
    status_marks            how things are stressed: grey, NE 107, a fault
    echart_options          what the charts share
    trend_plot              reference, position and pressure as they come, the states as bands
    recorded_plot           the last minutes as recorded, to zoom into
    friction_plot           friction against its baseline
    valve_controls          signing in; mode, reference, pressure, identification, acknowledgement
    signed_in               which role is in front of a tab
    alarm_card              the alarms: seen, shelved
    test_card               tests on the valve: begun with consent, broken off, reported
    moves_ahead             what a command is going to do
    question_dialog         the question before it is given
    valve_facts             what is said of a valve, a line each
"""
