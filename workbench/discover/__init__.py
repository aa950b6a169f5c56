"""The form of an effect that nobody has written down: a form, not a cause.

Its files:

    discovery, discovery_json    puts it together; the same as JSON
    form_search, found_form      forms fitted and judged; one that was found
    grammar                      which forms there are: a place, a variable, a shape of one or two parameters
    form_file                    a form as an effect's file
    curve                        a form with a free shape, where its own does not suffice
    form_proposal                which forms are tried first
    added_force                  the force that a form adds, over its variable; what the landings miss
"""
