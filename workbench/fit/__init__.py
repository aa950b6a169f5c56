"""The parameters that explain a record.

Its files:

    fitting            puts it together
    begun_fit          a fit on its way: its searches, stage by stage
    fit_result         what it comes to
    starts, guesses    where searches begin; what the positions suggest
    setpoint_starts    the same for a valve behind its positioner
    shooting           searches by multiple shooting, where those of the free run leave something to explain
    likelihood         of a record that is told when its stem moves: where slides lead to, and what breaks it loose
    onsets             when each move begins, as suits a valve best
    landings           the balance of forces where slides end in rest, from which searches begin too
    objective          what they lower
    descent            how: trust region, and a scan of the stairs
    strewing           what is left of it: places about the end, treads of static friction
    quanta             the other quanta that rests suggest, and the stairs of each
    evolution          places that evolve about an end, and from afar
    crossing           between their ends and beyond, where more than noise is left
    break_aways        what shows in break-aways alone, sought where these contradict it least
    agreement          which of them came to the same
    threads            searches side by side
    breaking_off       how all of them end early
    fitted_parameter   a parameter with its interval, and how it is shown
    uncertainty        what the record determines
    static_scatter     static friction where break-aways scatter
"""
