"""The law of slides: a stem that slides into rest lands where spring and friction balance, however slow the loop.

    law                                     the law behind the boundary
    slide_law, slide_memory                 nothing, one slide or two; what is remembered of a move
    slide_balance                           where a slide lands, and how margins go over the travel
    margins_over_travel                     how far a slide must be sent to break loose: learnt here, used there
    slide_inverse                           what the law takes from an extended valve
    reference_course                        does the reference rest, or take back what would be corrected

Its settings are the site's bounds.
"""

from positioner.control.laws.slides.slide_memory import SlideSettings as Settings

__all__ = ["Settings"]
