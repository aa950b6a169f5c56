"""Pages in a browser. A roof beside the commands: each page is opened by one, and calls what the commands call.

Its rooms; neither page knows the other:

    parts             what they share: server, sign-in, theme, plots
    operator_page     running valves; knows them as a client does, through the observer
    workbench_page    recordings held against models; may know the workbench, the model and the ground floor
"""
