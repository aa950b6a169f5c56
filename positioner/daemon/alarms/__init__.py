"""Alarms of a valve by ISA-18.2: what holds, who has seen it, what is put aside and for how long.

What holds is said by `positioner.daemon.health` alone: an alarm is a cause of the NE 107 status that somebody must do
something about.

    alarm_states        one alarm: its states, and what leads from one to another
    alarm_list          all of a valve, looked at once a second; what is told to the journal
    alarm_registers     what the DCS reads and writes of them
"""
