"""What the pages in a browser share. Knows neither tower, nor a page.

Its files:

    listening_arguments  `--listen-host`, `--listen-port`: where a page listens
    server               listens and serves one page, everything of it from this machine
    gate                 who comes in: by the key in the address or by a password; how much at once
    sessions             who came in
    theme, plot_colours  light and dark; colours of plots
    messages             errors and sentences, shown
    page_words           what the commands say, without their options
    units, unit_choice   the units that a person reads in, and where they are chosen
    live_text            a text that changes many times a second
    number_field         where a number is typed
    drop_box             where a file is dropped
    figure_view          a plotly figure on a page, its colours those of the theme
"""
