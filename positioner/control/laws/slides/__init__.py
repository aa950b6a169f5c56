"""The law of slides: a stem that slides into rest lands where spring and friction balance, however slow the loop.

    slide_law           the law: begin, observe, command
    slide_states        its states, a type each
    transitions         which state follows which, and when: one table
    plan                one slide, or two by way of an excursion
    teaching            what a slide taught of break-away
    slide_memory        what is remembered beside the state: the move, the last slide, what excursions have cost
    slide_pressure      where a slide lands, and how break-away goes over the travel
    now                 what one step is decided from
    reference_course    does the reference rest, or take back what would be corrected
    slide_bounds        what the site sets, and the thresholds
    certificate         what can be proved of it on an identified valve

Read them in this order.
"""

from positioner.control.laws.slides.slide_law import SlideSettings as Settings

__all__ = ["Settings"]
